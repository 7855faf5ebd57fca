"""A course chooses the attempt that counts: the latest, as before, or the best."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.migrate import refuse_downgrade

revision = "0022"
down_revision = "0021"


def upgrade() -> None:
    op.add_column("course", sa.Column("counted_attempt", sa.String(length=16), nullable=False, server_default="latest"))


downgrade = refuse_downgrade
