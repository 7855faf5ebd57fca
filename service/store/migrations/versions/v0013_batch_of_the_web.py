"""Collect the web submissions to an open assignment in one batch.

Creates the batch for assignments that were opened before, and adds their earlier submissions to it.
"""

from __future__ import annotations

import secrets

import sqlalchemy as sa
from alembic import op

from service.store.columns import SafeJson, SafeText, UtcDateTime
from service.store.ids import ALPHABET
from service.store.migrate import refuse_downgrade

revision = "0013"
down_revision = "0012"

_OPENED = sa.table(
    "open_assignment",
    sa.column("id", sa.Integer),
    sa.column("course_id", sa.Integer),
    sa.column("assignment", SafeText()),
    sa.column("assignment_version_id", sa.Integer),
    sa.column("opened_at", UtcDateTime()),
    sa.column("batch_id", sa.String),
)
_VERSION = sa.table("assignment_version", sa.column("id", sa.Integer), sa.column("title", SafeText()))
_BATCH = sa.table(
    "batch",
    sa.column("id", sa.String),
    sa.column("course_id", sa.Integer),
    sa.column("name", SafeText()),
    sa.column("state", sa.String),
    sa.column("refusals", SafeJson()),
    sa.column("created_at", UtcDateTime()),
)
_ENROLMENT = sa.table(
    "enrolment", sa.column("id", sa.Integer), sa.column("course_id", sa.Integer), sa.column("role", sa.String)
)
_SUBMISSION = sa.table(
    "submission",
    sa.column("id", sa.Integer),
    sa.column("enrolment_id", sa.Integer),
    sa.column("assignment", SafeText()),
    sa.column("batch_id", sa.String),
    sa.column("created_at", UtcDateTime()),
)
_JOB = sa.table("job", sa.column("submission_id", sa.Integer), sa.column("batch_id", sa.String))


def upgrade() -> None:
    with op.batch_alter_table("open_assignment") as batch_op:
        batch_op.add_column(sa.Column("batch_id", sa.String(length=12), nullable=True))
        batch_op.create_foreign_key("fk_open_assignment_batch_id_batch", "batch", ["batch_id"], ["id"])
        batch_op.create_index("ix_open_assignment_batch_id", ["batch_id"])
    connection = op.get_bind()
    opened = sa.select(_OPENED, _VERSION.c.title).join(_VERSION, _OPENED.c.assignment_version_id == _VERSION.c.id)
    for row in connection.execute(opened.where(_OPENED.c.opened_at.is_not(None))).all():
        batch_id = "".join(secrets.choice(ALPHABET) for _ in range(12))
        connection.execute(
            sa.insert(_BATCH).values(
                id=batch_id,
                course_id=row.course_id,
                name=f"Submitted on the web: {row.title}",
                state="open",
                refusals=[],
                created_at=row.opened_at,
            )
        )
        connection.execute(sa.update(_OPENED).where(_OPENED.c.id == row.id).values(batch_id=batch_id))
        students = sa.select(_ENROLMENT.c.id).where(
            _ENROLMENT.c.course_id == row.course_id, _ENROLMENT.c.role == "student"
        )
        theirs = (
            _SUBMISSION.c.enrolment_id.in_(students),
            _SUBMISSION.c.assignment == row.assignment,
            _SUBMISSION.c.created_at >= row.opened_at,
            _SUBMISSION.c.batch_id.is_(None),
        )
        ids = sa.select(_SUBMISSION.c.id).where(*theirs)
        without = (_JOB.c.batch_id.is_(None), _JOB.c.submission_id.in_(ids))
        connection.execute(sa.update(_JOB).where(*without).values(batch_id=batch_id))
        connection.execute(sa.update(_SUBMISSION).where(*theirs).values(batch_id=batch_id))


downgrade = refuse_downgrade
