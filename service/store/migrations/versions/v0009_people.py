"""Add names and e-mail addresses of people, store rejected students as persons, and allow a missing part.

Existing people have only an id, as first written, which was stored in the name column. Existing rejections keep the
name of their row.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.columns import SafeJson, SafeText
from service.store.migrate import refuse_downgrade

revision = "0009"
down_revision = "0008"

_BATCH = sa.table("batch", sa.column("id", sa.String), sa.column("refusals", SafeJson()))
_NOBODY = {"id": "", "name": "", "email": ""}


def upgrade() -> None:
    op.add_column("enrolment", sa.Column("written", SafeText(), nullable=False, server_default=""))
    op.execute("UPDATE enrolment SET written = (SELECT name FROM person WHERE person.id = enrolment.person_id)")
    op.execute("UPDATE person SET name = ''")
    op.add_column("job", sa.Column("missing", SafeText(), nullable=False, server_default=""))
    op.execute("ALTER TABLE batch RENAME COLUMN problems TO refusals")
    connection = op.get_bind()
    for batch_id, refusals in connection.execute(sa.select(_BATCH.c.id, _BATCH.c.refusals)).all():
        kept = [
            {"source": source, "reason": reason, "student": _NOBODY, "assignment": ""} for source, reason in refusals
        ]
        connection.execute(sa.update(_BATCH).where(_BATCH.c.id == batch_id).values(refusals=kept))


downgrade = refuse_downgrade
