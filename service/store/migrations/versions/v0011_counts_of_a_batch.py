"""Include all counted columns in the index of a batch's jobs, so that counting reads no job row."""

from __future__ import annotations

from alembic import op

from service.store.migrate import refuse_downgrade

revision = "0011"
down_revision = "0010"


def upgrade() -> None:
    op.create_index("ix_job_batch_id_state_plots_suspect", "job", ["batch_id", "state", "plots", "suspect"])
    op.drop_index("ix_job_batch_id", "job")


downgrade = refuse_downgrade
