"""Add regrades and standing, copies of identical grades, submission policies, known answers and quarantine."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.columns import SafeJson, SafeText, UtcDateTime
from service.store.migrate import refuse_downgrade

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    op.create_table(
        "policy",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("course_id", sa.Integer(), nullable=False),
        sa.Column("assignment", SafeText(), nullable=False),
        sa.Column("due_at", UtcDateTime(), nullable=True),
        sa.Column("late_days", sa.Integer(), nullable=False),
        sa.Column("attempts", sa.Integer(), nullable=True),
        sa.Column("cool_down_seconds", sa.Double(), nullable=False),
        sa.ForeignKeyConstraint(["course_id"], ["course.id"], name=op.f("fk_policy_course_id_course")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_policy")),
    )
    op.create_index(op.f("ix_policy_course_id_assignment"), "policy", ["course_id", "assignment"], unique=True)

    op.create_table(
        "extension",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("enrolment_id", sa.Integer(), nullable=False),
        sa.Column("assignment", SafeText(), nullable=False),
        sa.Column("due_at", UtcDateTime(), nullable=True),
        sa.Column("more_attempts", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(["enrolment_id"], ["enrolment.id"], name=op.f("fk_extension_enrolment_id_enrolment")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_extension")),
    )
    op.create_index(
        op.f("ix_extension_enrolment_id_assignment"), "extension", ["enrolment_id", "assignment"], unique=True
    )

    op.create_table(
        "worker",
        sa.Column("name", SafeText(), nullable=False),
        sa.Column("grader_version", SafeText(), nullable=False),
        sa.Column("grader_sha256", sa.String(length=64), nullable=False),
        sa.Column("first_at", UtcDateTime(), nullable=False),
        sa.Column("canary_at", UtcDateTime(), nullable=False),
        sa.Column("quarantined_at", UtcDateTime(), nullable=True),
        sa.Column("reason", SafeText(), nullable=True),
        sa.PrimaryKeyConstraint("name", name=op.f("pk_worker")),
    )

    op.create_table(
        "canary",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("worker", SafeText(), nullable=False),
        sa.Column("process", sa.Integer(), nullable=False),
        sa.Column("right_at", UtcDateTime(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_canary")),
    )
    op.create_index(op.f("ix_canary_worker_process"), "canary", ["worker", "process"], unique=True)

    op.create_table(
        "presence",
        sa.Column("worker", SafeText(), nullable=False),
        sa.Column("host", SafeText(), nullable=False),
        sa.Column("concurrency", sa.Integer(), nullable=False),
        sa.Column("grader_version", SafeText(), nullable=False),
        sa.Column("walls", SafeText(), nullable=False),
        sa.Column("started_at", UtcDateTime(), nullable=False),
        sa.Column("seen_at", UtcDateTime(), nullable=False),
        sa.PrimaryKeyConstraint("worker", name=op.f("pk_presence")),
    )
    op.create_index(op.f("ix_presence_seen_at"), "presence", ["seen_at"])

    # Never rebuilds a table: SQLite would empty the tables that refer to a dropped one, by cascade.
    _add_reference("batch", "regrade_of", "batch")
    op.add_column("submission", sa.Column("handed_in_at", UtcDateTime(), nullable=True))
    op.add_column("submission", sa.Column("days_late", sa.Integer(), nullable=False, server_default="0"))
    op.add_column("submission", sa.Column("staff_only", SafeText(), nullable=True))

    op.add_column("job", sa.Column("process", sa.Integer(), nullable=True))
    op.add_column("job", sa.Column("phases", SafeJson(), nullable=False, server_default="{}"))
    op.add_column("job", sa.Column("grader_sha256", sa.String(length=64), nullable=True))
    op.add_column("job", sa.Column("cache_key", sa.String(length=64), nullable=True))
    op.add_column("job", sa.Column("fresh", sa.Boolean(), nullable=False, server_default=sa.false()))
    _add_reference("job", "copied_from", "job")
    _add_reference("job", "regrade_of", "job")
    op.add_column("job", sa.Column("standing", sa.String(length=16), nullable=False, server_default="stands"))
    op.add_column("job", sa.Column("suspect", SafeText(), nullable=True))
    op.add_column("job", sa.Column("published_at", UtcDateTime(), nullable=True))
    op.add_column("job", sa.Column("published_by", SafeText(), nullable=True))
    op.create_index(op.f("ix_job_cache_key"), "job", ["cache_key"])
    op.create_index(op.f("ix_job_copied_from"), "job", ["copied_from"])
    op.create_index(op.f("ix_job_regrade_of"), "job", ["regrade_of"])
    op.create_index(op.f("ix_job_worker_finished_at"), "job", ["worker", "finished_at"])


def _add_reference(table: str, column: str, to: str) -> None:
    """Add a column and its foreign key in one statement, which SQLite can do without rebuilding the table."""
    op.execute(
        f"ALTER TABLE {table} ADD COLUMN {column} VARCHAR(12) CONSTRAINT fk_{table}_{column}_{to} REFERENCES {to} (id)"
    )


downgrade = refuse_downgrade
