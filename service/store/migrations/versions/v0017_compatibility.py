"""Store the oldest revision whose code can use the database, and each worker's reason for not claiming jobs.

The migration environment writes that revision after each migration, from its ``OLDEST_COMPATIBLE``.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.columns import SafeText
from service.store.migrate import refuse_downgrade

revision = "0017"
down_revision = "0016"


def upgrade() -> None:
    op.create_table(
        "schema_compatibility",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("oldest_compatible", sa.String(length=32), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_schema_compatibility")),
    )
    op.add_column("heartbeat", sa.Column("problem", SafeText(), nullable=True))


downgrade = refuse_downgrade
