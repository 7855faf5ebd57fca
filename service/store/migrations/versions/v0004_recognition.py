"""Add outcomes of sent images, confidence, and accuracy curves of swept values."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.columns import SafeJson
from service.store.migrate import refuse_downgrade

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    op.add_column("criterion_result", sa.Column("counts", SafeJson(), nullable=True))
    op.add_column("criterion_result", sa.Column("confidence", SafeJson(), nullable=True))
    op.add_column("criterion_result", sa.Column("curves", SafeJson(), nullable=False, server_default="[]"))
    op.add_column("trial", sa.Column("sweep", SafeJson(), nullable=False, server_default="[]"))


downgrade = refuse_downgrade
