"""What staff are told of a criterion beside its message."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.columns import SafeText
from service.store.migrate import refuse_downgrade

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("criterion_result", sa.Column("for_staff", SafeText(), nullable=False, server_default=""))


downgrade = refuse_downgrade
