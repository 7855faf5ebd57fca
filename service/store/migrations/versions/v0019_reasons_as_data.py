"""Store the exceeded limit of a submission and the reason of a cancellation as data beside their sentences.

The sentences remain for display. Only this migration parses them, because existing rows contain nothing else.
"""

from __future__ import annotations

import re

import sqlalchemy as sa
from alembic import op

from service.store.columns import SafeJson, SafeText
from service.store.migrate import refuse_downgrade

revision = "0019"
down_revision = "0018"

_SUBMISSION = sa.table(
    "submission", sa.column("id", sa.Integer), sa.column("staff_only", SafeText()), sa.column("exceeded", SafeJson())
)
_JOB = sa.table(
    "job",
    sa.column("id", sa.String),
    sa.column("state", sa.String),
    sa.column("error", SafeText()),
    sa.column("cancelled_for", sa.String),
    sa.column("superseded_by", sa.String),
)
_LIMITS = (
    ("attempts", re.compile(r"attempt (\d+), allowed: (\d+)")),
    ("date", re.compile(r"(\d+) days? late, allowed: (\d+)")),
    ("cool-down", re.compile(r"submitted (\d+) min after the one before, asked for: (\d+) min")),
)
_SUPERSEDED = re.compile(r"superseded by (?:([a-z0-9]{12})|.*)")
_OVER_LIMIT = "over a limit: it is graded when staff ask for it"


def upgrade() -> None:
    op.add_column("submission", sa.Column("exceeded", SafeJson(), nullable=True))
    op.add_column("job", sa.Column("cancelled_for", sa.String(length=16), nullable=True))
    op.add_column("job", sa.Column("superseded_by", sa.String(length=12), nullable=True))
    connection = op.get_bind()
    over = sa.select(_SUBMISSION.c.id, _SUBMISSION.c.staff_only).where(_SUBMISSION.c.staff_only.is_not(None))
    for submission_id, sentence in connection.execute(over).all():
        row = sa.update(_SUBMISSION).where(_SUBMISSION.c.id == submission_id)
        connection.execute(row.values(exceeded=_exceeded(sentence)))
    cancelled = sa.select(_JOB.c.id, _JOB.c.error).where(_JOB.c.state == "cancelled", _JOB.c.error.is_not(None))
    for job_id, sentence in connection.execute(cancelled).all():
        if reason := _reason(sentence):
            connection.execute(sa.update(_JOB).where(_JOB.c.id == job_id).values(**reason))


downgrade = refuse_downgrade


def _exceeded(sentence: str) -> dict[str, str | int]:
    for limit, pattern in _LIMITS:
        if found := pattern.fullmatch(sentence):
            return {"limit": limit, "actual": int(found[1]), "allowed": int(found[2])}
    # No release writes other sentences; manually entered ones were treated as date limits.
    return {"limit": "date", "actual": 0, "allowed": 0}


def _reason(sentence: str) -> dict[str, str | None]:
    if sentence == _OVER_LIMIT:
        return {"cancelled_for": "over limit"}
    found = _SUPERSEDED.fullmatch(sentence)
    return {"cancelled_for": "superseded", "superseded_by": found[1]} if found else {}
