"""Add signed statements: keys, the log of statements, and the heads of the log that were written."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.columns import UtcDateTime
from service.store.migrate import refuse_downgrade

revision = "0025"
down_revision = "0024"


def upgrade() -> None:
    op.create_table(
        "statement_key",
        sa.Column("id", sa.String(16), nullable=False),
        sa.Column("public_hex", sa.String(64), nullable=False),
        sa.Column("private_hex", sa.String(64), nullable=True),
        sa.Column("created_at", UtcDateTime(), nullable=False),
        sa.Column("retired_at", UtcDateTime(), nullable=True),
        sa.Column("revoked_at", UtcDateTime(), nullable=True),
        sa.PrimaryKeyConstraint("id", name="pk_statement_key"),
    )
    op.create_table(
        "statement_entry",
        sa.Column("number", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("leaf_sha256", sa.String(64), nullable=False),
        sa.Column("made_at", UtcDateTime(), nullable=False),
        sa.Column("submission_id", sa.Integer(), nullable=True),
        sa.Column("job_id", sa.String(12), nullable=True),
        sa.Column("salt", sa.String(64), nullable=True),
        sa.Column("opening_key", sa.String(64), nullable=True),
        sa.Column("key_id", sa.String(16), nullable=True),
        sa.Column("signature", sa.String(128), nullable=True),
        sa.Column("payload", sa.LargeBinary(), nullable=True),
        sa.PrimaryKeyConstraint("number", name="pk_statement_entry"),
    )
    op.create_index("ix_statement_entry_submission_id", "statement_entry", ["submission_id"])
    op.create_table(
        "statement_head",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("size", sa.Integer(), nullable=False),
        sa.Column("root_sha256", sa.String(64), nullable=False),
        sa.Column("made_at", UtcDateTime(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_statement_head"),
    )


downgrade = refuse_downgrade
