"""Why a criterion could not be judged, for staff."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.columns import SafeText
from service.store.migrate import refuse_downgrade

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("criterion_result", sa.Column("unjudged", SafeText(), nullable=True))


downgrade = refuse_downgrade
