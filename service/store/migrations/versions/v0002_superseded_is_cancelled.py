"""Turn jobs in state "superseded" into cancelled jobs, with that as the reason."""

from __future__ import annotations

from alembic import op

from service.store.migrate import refuse_downgrade

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    op.execute("UPDATE job SET state = 'cancelled', error = 'superseded by a newer hand-in' WHERE state = 'superseded'")


downgrade = refuse_downgrade
