"""Add to policies when students see grades. Students of existing courses see them when they are graded, as before."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.columns import UtcDateTime
from service.store.migrate import refuse_downgrade

revision = "0026"
down_revision = "0025"

_AT_ONCE = "at-once"
_COURSE = sa.table("course", sa.column("id", sa.Integer))
_POLICY = sa.table(
    "policy",
    sa.column("course_id", sa.Integer),
    sa.column("assignment", sa.String),
    sa.column("late_days", sa.Integer),
    sa.column("cool_down_seconds", sa.Float),
    sa.column("release", sa.String),
)


def upgrade() -> None:
    column = sa.Column("release", sa.String(length=16), nullable=False, server_default="own-at-once")
    op.add_column("policy", column)
    op.add_column("policy", sa.Column("released_at", UtcDateTime(), nullable=True))
    connection = op.get_bind()
    connection.execute(sa.update(_POLICY).values(release=_AT_ONCE))
    with_default = sa.select(_POLICY.c.course_id).where(_POLICY.c.assignment == "")
    defaults = sa.select(
        _COURSE.c.id, sa.literal(""), sa.literal(0), sa.literal(0.0), sa.literal(_AT_ONCE)
    ).where(_COURSE.c.id.not_in(with_default))  # fmt: skip
    columns = ["course_id", "assignment", "late_days", "cool_down_seconds", "release"]
    connection.execute(sa.insert(_POLICY).from_select(columns, defaults))


downgrade = refuse_downgrade
