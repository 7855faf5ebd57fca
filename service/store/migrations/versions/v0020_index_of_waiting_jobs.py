"""Index the waiting jobs and the recently started ones with the columns that a claim reads."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.migrate import refuse_downgrade

revision = "0020"
down_revision = "0019"

_IS_QUEUED = sa.text("state = 'queued'")


def upgrade() -> None:
    op.create_index(
        "ix_job_waiting",
        "job",
        ["state", "lane", "batch_id", "queued_at", "id", "enrolment_id", "due_at"],
        sqlite_where=_IS_QUEUED,
        postgresql_where=_IS_QUEUED,
    )
    op.create_index(
        "ix_job_started_at_lane_batch_id_enrolment_id", "job", ["started_at", "lane", "batch_id", "enrolment_id"]
    )
    op.drop_index("ix_job_started_at", "job")


downgrade = refuse_downgrade
