"""Add the translatable sentences of a grade. Texts of earlier grades stay in English."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.columns import SafeJson
from service.store.migrate import refuse_downgrade

revision = "0021"
down_revision = "0020"


def upgrade() -> None:
    op.add_column("job", sa.Column("sentences", SafeJson(), nullable=False, server_default="[]"))


downgrade = refuse_downgrade
