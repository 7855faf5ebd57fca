"""Add fields for staff: places to review in a criterion, the reason it is unjudged, and internal errors of a trial."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.columns import SafeText
from service.store.migrate import refuse_downgrade

revision = "0006"
down_revision = "0005"


def upgrade() -> None:
    op.add_column("criterion_result", sa.Column("for_staff", SafeText(), nullable=False, server_default=""))
    op.add_column("criterion_result", sa.Column("unjudged", SafeText(), nullable=True))
    op.add_column("trial", sa.Column("surprise", SafeText(), nullable=True))


downgrade = refuse_downgrade
