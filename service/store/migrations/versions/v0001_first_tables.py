"""Create the first tables."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.columns import ExactDecimal, SafeJson, SafeText, UtcDateTime
from service.store.migrate import refuse_downgrade

revision = "0001"
down_revision = None


def upgrade() -> None:
    op.create_table(
        "assignment_version",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("assignment", SafeText(), nullable=False),
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.Column("version", SafeText(), nullable=False),
        sa.Column("title", SafeText(), nullable=False),
        sa.Column("max_marks", ExactDecimal(), nullable=False),
        sa.Column("content", sa.LargeBinary(), nullable=False),
        sa.Column("created_at", UtcDateTime(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_assignment_version")),
        sa.UniqueConstraint("sha256", name=op.f("uq_assignment_version_sha256")),
    )
    with op.batch_alter_table("assignment_version") as batch_op:
        batch_op.create_index(batch_op.f("ix_assignment_version_assignment"), ["assignment"], unique=False)

    op.create_table(
        "audit",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("at", UtcDateTime(), nullable=False),
        sa.Column("actor", SafeText(), nullable=False),
        sa.Column("action", SafeText(), nullable=False),
        sa.Column("subject", sa.String(length=32), nullable=False),
        sa.Column("subject_id", SafeText(), nullable=False),
        sa.Column("detail", SafeJson(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_audit")),
    )
    with op.batch_alter_table("audit") as batch_op:
        batch_op.create_index(batch_op.f("ix_audit_at"), ["at"], unique=False)
        batch_op.create_index(batch_op.f("ix_audit_subject_subject_id"), ["subject", "subject_id"], unique=False)

    op.create_table(
        "course",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("name", SafeText(), nullable=False),
        sa.Column("created_at", UtcDateTime(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_course")),
        sa.UniqueConstraint("name", name=op.f("uq_course_name")),
    )
    op.create_table(
        "person",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("name", SafeText(), nullable=False),
        sa.Column("email", SafeText(), nullable=True),
        sa.Column("created_at", UtcDateTime(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_person")),
    )
    op.create_table(
        "batch",
        sa.Column("id", sa.String(length=12), nullable=False),
        sa.Column("course_id", sa.Integer(), nullable=False),
        sa.Column("name", SafeText(), nullable=False),
        sa.Column(
            "state",
            sa.Enum("open", "paused", "cancelled", name="batchstate", native_enum=False, length=16),
            nullable=False,
        ),
        sa.Column("problems", SafeJson(), nullable=False),
        sa.Column("created_at", UtcDateTime(), nullable=False),
        sa.ForeignKeyConstraint(["course_id"], ["course.id"], name=op.f("fk_batch_course_id_course")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_batch")),
    )
    op.create_table(
        "enrolment",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("course_id", sa.Integer(), nullable=False),
        sa.Column("person_id", sa.Integer(), nullable=False),
        sa.Column("student", SafeText(), nullable=False),
        sa.Column("role", sa.Enum("student", "staff", name="role", native_enum=False, length=16), nullable=False),
        sa.ForeignKeyConstraint(["course_id"], ["course.id"], name=op.f("fk_enrolment_course_id_course")),
        sa.ForeignKeyConstraint(["person_id"], ["person.id"], name=op.f("fk_enrolment_person_id_person")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_enrolment")),
    )
    with op.batch_alter_table("enrolment") as batch_op:
        batch_op.create_index(batch_op.f("ix_enrolment_course_id_student"), ["course_id", "student"], unique=True)

    op.create_table(
        "submission",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("enrolment_id", sa.Integer(), nullable=False),
        sa.Column("assignment", SafeText(), nullable=False),
        sa.Column("batch_id", sa.String(length=12), nullable=True),
        sa.Column("attempt", sa.Integer(), nullable=False),
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.Column("source", SafeText(), nullable=False),
        sa.Column("size", sa.Integer(), nullable=False),
        sa.Column("packed", sa.LargeBinary(), nullable=False),
        sa.Column("created_at", UtcDateTime(), nullable=False),
        sa.CheckConstraint("attempt > 0", name=op.f("ck_submission_attempt")),
        sa.ForeignKeyConstraint(["batch_id"], ["batch.id"], name=op.f("fk_submission_batch_id_batch")),
        sa.ForeignKeyConstraint(["enrolment_id"], ["enrolment.id"], name=op.f("fk_submission_enrolment_id_enrolment")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_submission")),
    )
    with op.batch_alter_table("submission") as batch_op:
        batch_op.create_index(batch_op.f("ix_submission_batch_id"), ["batch_id"], unique=False)
        batch_op.create_index(
            batch_op.f("ix_submission_enrolment_id_assignment_attempt"),
            ["enrolment_id", "assignment", "attempt"],
            unique=True,
        )
        batch_op.create_index(batch_op.f("ix_submission_sha256"), ["sha256"], unique=False)

    op.create_table(
        "job",
        sa.Column("id", sa.String(length=12), nullable=False),
        sa.Column("submission_id", sa.Integer(), nullable=False),
        sa.Column("assignment_version_id", sa.Integer(), nullable=False),
        sa.Column("enrolment_id", sa.Integer(), nullable=False),
        sa.Column("batch_id", sa.String(length=12), nullable=True),
        sa.Column("lane", sa.Enum("interactive", "batch", name="lane", native_enum=False, length=16), nullable=False),
        sa.Column(
            "state",
            sa.Enum(
                "queued",
                "running",
                "done",
                "dead",
                "cancelled",
                "superseded",
                name="jobstate",
                native_enum=False,
                length=16,
            ),
            nullable=False,
        ),
        sa.Column("attempt", sa.Integer(), nullable=False),
        sa.Column("max_attempts", sa.Integer(), nullable=False),
        sa.Column("due_at", UtcDateTime(), nullable=False),
        sa.Column("lease", sa.String(length=32), nullable=True),
        sa.Column("lease_until", UtcDateTime(), nullable=True),
        sa.Column("heartbeat_at", UtcDateTime(), nullable=True),
        sa.Column("worker", SafeText(), nullable=True),
        sa.Column("progress", sa.Double(), nullable=False),
        sa.Column("error", SafeText(), nullable=True),
        sa.Column("queued_at", UtcDateTime(), nullable=False),
        sa.Column("nudged_at", UtcDateTime(), nullable=True),
        sa.Column("started_at", UtcDateTime(), nullable=True),
        sa.Column("graded_at", UtcDateTime(), nullable=True),
        sa.Column("finished_at", UtcDateTime(), nullable=True),
        sa.Column("verdict", sa.String(length=32), nullable=True),
        sa.Column("marks", ExactDecimal(), nullable=True),
        sa.Column("max_marks", ExactDecimal(), nullable=True),
        sa.Column("grader_version", SafeText(), nullable=True),
        sa.Column("walls", SafeText(), nullable=True),
        sa.Column("notes", SafeJson(), nullable=False),
        sa.Column(
            "plots",
            sa.Enum("none", "due", "done", "failed", name="plotstate", native_enum=False, length=16),
            nullable=False,
        ),
        sa.Column("plots_due_at", UtcDateTime(), nullable=True),
        sa.Column("plots_attempt", sa.Integer(), nullable=False),
        sa.Column("plotted_at", UtcDateTime(), nullable=True),
        sa.CheckConstraint("(state = 'running') = (lease IS NOT NULL)", name=op.f("ck_job_lease")),
        sa.ForeignKeyConstraint(
            ["assignment_version_id"],
            ["assignment_version.id"],
            name=op.f("fk_job_assignment_version_id_assignment_version"),
        ),
        sa.ForeignKeyConstraint(["batch_id"], ["batch.id"], name=op.f("fk_job_batch_id_batch")),
        sa.ForeignKeyConstraint(["enrolment_id"], ["enrolment.id"], name=op.f("fk_job_enrolment_id_enrolment")),
        sa.ForeignKeyConstraint(["submission_id"], ["submission.id"], name=op.f("fk_job_submission_id_submission")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_job")),
    )
    with op.batch_alter_table("job") as batch_op:
        batch_op.create_index(batch_op.f("ix_job_assignment_version_id"), ["assignment_version_id"], unique=False)
        batch_op.create_index(batch_op.f("ix_job_batch_id"), ["batch_id"], unique=False)
        batch_op.create_index(batch_op.f("ix_job_enrolment_id"), ["enrolment_id"], unique=False)
        batch_op.create_index(batch_op.f("ix_job_plots_plots_due_at"), ["plots", "plots_due_at"], unique=False)
        batch_op.create_index(batch_op.f("ix_job_started_at"), ["started_at"], unique=False)
        batch_op.create_index(batch_op.f("ix_job_state_lane_due_at"), ["state", "lane", "due_at"], unique=False)
        batch_op.create_index(batch_op.f("ix_job_state_lease_until"), ["state", "lease_until"], unique=False)
        batch_op.create_index(batch_op.f("ix_job_submission_id"), ["submission_id"], unique=False)

    op.create_table(
        "artifact",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("job_id", sa.String(length=12), nullable=False),
        sa.Column("name", SafeText(), nullable=False),
        sa.Column("media_type", SafeText(), nullable=False),
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.Column("size", sa.Integer(), nullable=False),
        sa.Column("compressed", sa.LargeBinary(), nullable=False),
        sa.Column("created_at", UtcDateTime(), nullable=False),
        sa.ForeignKeyConstraint(["job_id"], ["job.id"], name=op.f("fk_artifact_job_id_job"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_artifact")),
    )
    with op.batch_alter_table("artifact") as batch_op:
        batch_op.create_index(batch_op.f("ix_artifact_job_id_name"), ["job_id", "name"], unique=True)

    op.create_table(
        "criterion_result",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("job_id", sa.String(length=12), nullable=False),
        sa.Column("position", sa.Integer(), nullable=False),
        sa.Column("criterion", SafeText(), nullable=False),
        sa.Column("title", SafeText(), nullable=False),
        sa.Column("marks", ExactDecimal(), nullable=False),
        sa.Column("max_marks", ExactDecimal(), nullable=False),
        sa.Column("message", SafeText(), nullable=False),
        sa.Column("visibility", sa.String(length=32), nullable=False),
        sa.Column("evidence", SafeJson(), nullable=False),
        sa.Column("accuracy", sa.Double(), nullable=True),
        sa.Column("accuracy_low", sa.Double(), nullable=True),
        sa.Column("accuracy_high", sa.Double(), nullable=True),
        sa.Column("accuracy_n", sa.Integer(), nullable=True),
        sa.Column("labels", SafeJson(), nullable=True),
        sa.Column("confusion", SafeJson(), nullable=True),
        sa.Column("sights", SafeJson(), nullable=False),
        sa.ForeignKeyConstraint(
            ["job_id"], ["job.id"], name=op.f("fk_criterion_result_job_id_job"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_criterion_result")),
    )
    with op.batch_alter_table("criterion_result") as batch_op:
        batch_op.create_index(batch_op.f("ix_criterion_result_job_id_position"), ["job_id", "position"], unique=True)

    op.create_table(
        "trial",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("job_id", sa.String(length=12), nullable=False),
        sa.Column("position", sa.Integer(), nullable=False),
        sa.Column("scenario", SafeText(), nullable=False),
        sa.Column("scenario_index", sa.Integer(), nullable=False),
        sa.Column("seed", sa.BigInteger(), nullable=False),
        sa.Column("light_noise", sa.Double(), nullable=False),
        sa.Column("motor_noise", sa.Double(), nullable=False),
        sa.Column("visibility", sa.String(length=32), nullable=False),
        sa.Column("verdict", sa.String(length=32), nullable=False),
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.Column("end_t", sa.Double(), nullable=False),
        sa.ForeignKeyConstraint(["job_id"], ["job.id"], name=op.f("fk_trial_job_id_job"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_trial")),
    )
    with op.batch_alter_table("trial") as batch_op:
        batch_op.create_index(batch_op.f("ix_trial_job_id_position"), ["job_id", "position"], unique=True)


downgrade = refuse_downgrade
