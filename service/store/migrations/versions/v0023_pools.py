"""Add pools: the extent of a grading, whether its marks are provisional, and the value of a criterion over its pool."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.columns import SafeJson
from service.store.migrate import refuse_downgrade

revision = "0023"
down_revision = "0022"


def upgrade() -> None:
    for name in ("whole_pools", "provisional"):
        op.add_column("job", sa.Column(name, sa.Boolean(), nullable=False, server_default=sa.false()))
    op.add_column("criterion_result", sa.Column("pool", SafeJson(), nullable=True))


downgrade = refuse_downgrade
