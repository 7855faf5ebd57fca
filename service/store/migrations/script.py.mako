"""${message}."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op
from sqlalchemy import Text
from sqlalchemy.dialects import postgresql

import service.store.columns
${imports if imports else ""}

revision = ${repr(up_revision)}
down_revision = ${repr(down_revision)}
branch_labels = ${repr(branch_labels)}
depends_on = ${repr(depends_on)}
# The oldest revision whose code can use the tables after this one; the one before, where only something is added.
OLDEST_COMPATIBLE = ${repr(up_revision)}


def upgrade() -> None:
    ${upgrades if upgrades else "pass"}
