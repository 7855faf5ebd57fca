"""People have a name and an address beside their id; whoever was refused is kept as a person; a part may be missing.

Of earlier people only the id is known, as it was first written, which stood where the name is; of those refused, what
their row was called.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.columns import SafeJson, SafeText
from service.store.migrate import refuse_downgrade

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None

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
