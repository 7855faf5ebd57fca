"""Add the total cost of a job's trials, with its limits; unknown for earlier grades."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.columns import SafeJson
from service.store.migrate import refuse_downgrade

revision = "0007"
down_revision = "0006"


def upgrade() -> None:
    op.add_column("job", sa.Column("cost", SafeJson(), nullable=True))


downgrade = refuse_downgrade
