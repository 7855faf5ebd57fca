"""A course chooses whether lower exact marks replace published provisional ones: no, as before, or yes."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.migrate import refuse_downgrade

revision = "0024"
down_revision = "0023"


def upgrade() -> None:
    op.add_column("course", sa.Column("completion_rule", sa.String(length=16), nullable=False, server_default="higher"))


downgrade = refuse_downgrade
