"""Add the installation's secret, the secret's hash of each grade, and the part of a grade visible to students."""

from __future__ import annotations

import secrets
from datetime import UTC, datetime

import sqlalchemy as sa
from alembic import op

from service.store.columns import SafeJson, UtcDateTime
from service.store.migrate import refuse_downgrade

revision = "0005"
down_revision = "0004"


def upgrade() -> None:
    installation = op.create_table(
        "installation",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("secret", sa.String(length=64), nullable=False),
        sa.Column("made_at", UtcDateTime(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_installation")),
    )
    # The first process creates it under the lock of the migration; all others read it.
    made = {"id": 1, "secret": secrets.token_hex(32), "made_at": datetime.now(UTC)}
    op.bulk_insert(installation, [made])

    op.add_column("job", sa.Column("secret_sha256", sa.String(length=64), nullable=True))
    op.add_column("trial", sa.Column("place", sa.Integer(), nullable=False, server_default="0"))
    op.add_column("criterion_result", sa.Column("shown", SafeJson(), nullable=True))


downgrade = refuse_downgrade
