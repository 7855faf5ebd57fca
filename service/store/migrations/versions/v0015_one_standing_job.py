"""Allow one standing job per submission, enforced by an index, and store the time zone of a policy.

If several jobs stand, the one that students saw is kept: graded, published and newest. A job that is still to be graded
takes precedence over a failed or cancelled one.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.columns import UtcDateTime
from service.store.migrate import refuse_downgrade

revision = "0015"
down_revision = "0013"

_JOB = sa.table(
    "job",
    sa.column("id", sa.String),
    sa.column("submission_id", sa.Integer),
    sa.column("standing", sa.String),
    sa.column("state", sa.String),
    sa.column("suspect", sa.String),
    sa.column("queued_at", UtcDateTime()),
    sa.column("published_at", UtcDateTime()),
)
_STANDS = sa.text("standing = 'stands'")


def upgrade() -> None:
    graded = sa.and_(_JOB.c.state == "done", _JOB.c.suspect.is_(None))
    preferred = (
        sa.case((graded, 0), (_JOB.c.state.in_(("queued", "running")), 1), else_=2),
        sa.case((_JOB.c.published_at.is_not(None), 0), else_=1),
        _JOB.c.published_at.desc(),
        _JOB.c.queued_at.desc(),
        _JOB.c.id,
    )
    place = sa.func.row_number().over(partition_by=_JOB.c.submission_id, order_by=preferred).label("place")
    standing = sa.select(_JOB.c.id, place).where(_JOB.c.standing == "stands").subquery()
    double = sa.select(standing.c.id).where(standing.c.place > 1)
    op.get_bind().execute(sa.update(_JOB).where(_JOB.c.id.in_(double)).values(standing="kept"))
    op.create_index(
        "uq_job_standing", "job", ["submission_id"], unique=True, sqlite_where=_STANDS, postgresql_where=_STANDS
    )
    op.add_column("policy", sa.Column("zone", sa.String(length=64), nullable=False, server_default=""))


downgrade = refuse_downgrade
