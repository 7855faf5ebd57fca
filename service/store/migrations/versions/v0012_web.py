"""Add the tables of the web service.

They are: sign-in, open assignments, overrides, comments, appeals, test runs, webhooks and LTI.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.columns import ExactDecimal, SafeJson, SafeText, UtcDateTime
from service.store.migrate import refuse_downgrade

revision = "0012"
down_revision = "0011"


def upgrade() -> None:
    op.create_table(
        "lti_key",
        sa.Column("id", sa.String(length=12), nullable=False),
        sa.Column("private_pem", SafeText(), nullable=False),
        sa.Column("created_at", UtcDateTime(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_lti_key")),
    )
    op.create_table(
        "lti_platform",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("name", SafeText(), nullable=False),
        sa.Column("issuer", SafeText(), nullable=False),
        sa.Column("client_id", SafeText(), nullable=False),
        sa.Column("deployments", SafeJson(), nullable=False),
        sa.Column("authorization_url", SafeText(), nullable=False),
        sa.Column("token_url", SafeText(), nullable=False),
        sa.Column("keys_url", SafeText(), nullable=False),
        sa.Column("created_at", UtcDateTime(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_lti_platform")),
    )
    with op.batch_alter_table("lti_platform", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_lti_platform_issuer_client_id"), ["issuer", "client_id"], unique=True)

    op.create_table(
        "credential",
        sa.Column("id", sa.String(length=12), nullable=False),
        sa.Column("person_id", sa.Integer(), nullable=False),
        sa.Column(
            "kind",
            sa.Enum("link", "session", "token", name="credentialkind", native_enum=False, length=16),
            nullable=False,
        ),
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.Column("name", SafeText(), nullable=False),
        sa.Column("scopes", SafeJson(), nullable=False),
        sa.Column("course_id", sa.Integer(), nullable=True),
        sa.Column("created_at", UtcDateTime(), nullable=False),
        sa.Column("expires_at", UtcDateTime(), nullable=False),
        sa.Column("used_at", UtcDateTime(), nullable=True),
        sa.Column("revoked_at", UtcDateTime(), nullable=True),
        sa.ForeignKeyConstraint(["course_id"], ["course.id"], name=op.f("fk_credential_course_id_course")),
        sa.ForeignKeyConstraint(["person_id"], ["person.id"], name=op.f("fk_credential_person_id_person")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_credential")),
        sa.UniqueConstraint("sha256", name=op.f("uq_credential_sha256")),
    )
    with op.batch_alter_table("credential", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_credential_person_id"), ["person_id"], unique=False)

    op.create_table(
        "lti_course",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("platform_id", sa.Integer(), nullable=False),
        sa.Column("context", SafeText(), nullable=False),
        sa.Column("course_id", sa.Integer(), nullable=False),
        sa.Column("members_url", SafeText(), nullable=True),
        sa.Column("lineitems_url", SafeText(), nullable=True),
        sa.ForeignKeyConstraint(["course_id"], ["course.id"], name=op.f("fk_lti_course_course_id_course")),
        sa.ForeignKeyConstraint(
            ["platform_id"], ["lti_platform.id"], name=op.f("fk_lti_course_platform_id_lti_platform")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_lti_course")),
    )
    with op.batch_alter_table("lti_course", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_lti_course_course_id"), ["course_id"], unique=False)
        batch_op.create_index(batch_op.f("ix_lti_course_platform_id_context"), ["platform_id", "context"], unique=True)

    op.create_table(
        "lti_launch",
        sa.Column("state_sha256", sa.String(length=64), nullable=False),
        sa.Column("platform_id", sa.Integer(), nullable=False),
        sa.Column("nonce", sa.String(length=64), nullable=False),
        sa.Column("target", SafeText(), nullable=False),
        sa.Column("expires_at", UtcDateTime(), nullable=False),
        sa.ForeignKeyConstraint(
            ["platform_id"], ["lti_platform.id"], name=op.f("fk_lti_launch_platform_id_lti_platform")
        ),
        sa.PrimaryKeyConstraint("state_sha256", name=op.f("pk_lti_launch")),
    )
    with op.batch_alter_table("lti_launch", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_lti_launch_expires_at"), ["expires_at"], unique=False)

    op.create_table(
        "lti_person",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("platform_id", sa.Integer(), nullable=False),
        sa.Column("subject", SafeText(), nullable=False),
        sa.Column("person_id", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(["person_id"], ["person.id"], name=op.f("fk_lti_person_person_id_person")),
        sa.ForeignKeyConstraint(
            ["platform_id"], ["lti_platform.id"], name=op.f("fk_lti_person_platform_id_lti_platform")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_lti_person")),
    )
    with op.batch_alter_table("lti_person", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_lti_person_person_id"), ["person_id"], unique=False)
        batch_op.create_index(batch_op.f("ix_lti_person_platform_id_subject"), ["platform_id", "subject"], unique=True)

    op.create_table(
        "open_assignment",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("course_id", sa.Integer(), nullable=False),
        sa.Column("assignment", SafeText(), nullable=False),
        sa.Column("assignment_version_id", sa.Integer(), nullable=False),
        sa.Column("opened_at", UtcDateTime(), nullable=True),
        sa.Column("closed_at", UtcDateTime(), nullable=True),
        sa.Column("names_hidden", sa.Boolean(), nullable=False),
        sa.ForeignKeyConstraint(
            ["assignment_version_id"],
            ["assignment_version.id"],
            name=op.f("fk_open_assignment_assignment_version_id_assignment_version"),
        ),
        sa.ForeignKeyConstraint(["course_id"], ["course.id"], name=op.f("fk_open_assignment_course_id_course")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_open_assignment")),
    )
    with op.batch_alter_table("open_assignment", schema=None) as batch_op:
        batch_op.create_index(
            batch_op.f("ix_open_assignment_course_id_assignment"), ["course_id", "assignment"], unique=True
        )

    op.create_table(
        "webhook",
        sa.Column("id", sa.String(length=12), nullable=False),
        sa.Column("course_id", sa.Integer(), nullable=False),
        sa.Column("url", SafeText(), nullable=False),
        sa.Column("secret", sa.String(length=64), nullable=False),
        sa.Column("events", SafeJson(), nullable=False),
        sa.Column("created_at", UtcDateTime(), nullable=False),
        sa.Column("revoked_at", UtcDateTime(), nullable=True),
        sa.ForeignKeyConstraint(["course_id"], ["course.id"], name=op.f("fk_webhook_course_id_course")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_webhook")),
    )
    with op.batch_alter_table("webhook", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_webhook_course_id"), ["course_id"], unique=False)

    op.create_table(
        "delivery",
        sa.Column("id", sa.String(length=12), nullable=False),
        sa.Column("webhook_id", sa.String(length=12), nullable=False),
        sa.Column("event", SafeText(), nullable=False),
        sa.Column("payload", SafeJson(), nullable=False),
        sa.Column("made_at", UtcDateTime(), nullable=False),
        sa.Column("due_at", UtcDateTime(), nullable=True),
        sa.Column("attempts", sa.Integer(), nullable=False),
        sa.Column("delivered_at", UtcDateTime(), nullable=True),
        sa.Column("error", SafeText(), nullable=True),
        sa.ForeignKeyConstraint(["webhook_id"], ["webhook.id"], name=op.f("fk_delivery_webhook_id_webhook")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_delivery")),
    )
    with op.batch_alter_table("delivery", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_delivery_delivered_at_due_at"), ["delivered_at", "due_at"], unique=False)
        batch_op.create_index(batch_op.f("ix_delivery_webhook_id"), ["webhook_id"], unique=False)

    op.create_table(
        "idempotent_reply",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("credential_id", sa.String(length=12), nullable=False),
        sa.Column("key", SafeText(), nullable=False),
        sa.Column("request_sha256", sa.String(length=64), nullable=False),
        sa.Column("status", sa.Integer(), nullable=False),
        sa.Column("body", sa.LargeBinary(), nullable=False),
        sa.Column("made_at", UtcDateTime(), nullable=False),
        sa.ForeignKeyConstraint(
            ["credential_id"], ["credential.id"], name=op.f("fk_idempotent_reply_credential_id_credential")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_idempotent_reply")),
    )
    with op.batch_alter_table("idempotent_reply", schema=None) as batch_op:
        batch_op.create_index(
            batch_op.f("ix_idempotent_reply_credential_id_key"), ["credential_id", "key"], unique=True
        )
        batch_op.create_index(batch_op.f("ix_idempotent_reply_made_at"), ["made_at"], unique=False)

    op.create_table(
        "tryout",
        sa.Column("id", sa.String(length=12), nullable=False),
        sa.Column("enrolment_id", sa.Integer(), nullable=False),
        sa.Column("assignment_version_id", sa.Integer(), nullable=False),
        sa.Column("packed", sa.LargeBinary(), nullable=False),
        sa.Column("state", sa.String(length=16), nullable=False),
        sa.Column("lease_until", UtcDateTime(), nullable=True),
        sa.Column("attempt", sa.Integer(), nullable=False),
        sa.Column("queued_at", UtcDateTime(), nullable=False),
        sa.Column("finished_at", UtcDateTime(), nullable=True),
        sa.Column("words", SafeJson(), nullable=True),
        sa.Column("replay", sa.LargeBinary(), nullable=True),
        sa.Column("error", SafeText(), nullable=True),
        sa.ForeignKeyConstraint(
            ["assignment_version_id"],
            ["assignment_version.id"],
            name=op.f("fk_tryout_assignment_version_id_assignment_version"),
        ),
        sa.ForeignKeyConstraint(["enrolment_id"], ["enrolment.id"], name=op.f("fk_tryout_enrolment_id_enrolment")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_tryout")),
    )
    with op.batch_alter_table("tryout", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_tryout_enrolment_id"), ["enrolment_id"], unique=False)
        batch_op.create_index(batch_op.f("ix_tryout_state_queued_at"), ["state", "queued_at"], unique=False)

    op.create_table(
        "appeal",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("submission_id", sa.Integer(), nullable=False),
        sa.Column("text", SafeText(), nullable=False),
        sa.Column("asked_at", UtcDateTime(), nullable=False),
        sa.Column("answer", SafeText(), nullable=True),
        sa.Column("actor", SafeText(), nullable=True),
        sa.Column("answered_at", UtcDateTime(), nullable=True),
        sa.ForeignKeyConstraint(["submission_id"], ["submission.id"], name=op.f("fk_appeal_submission_id_submission")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_appeal")),
    )
    with op.batch_alter_table("appeal", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_appeal_asked_at"), ["asked_at"], unique=False)
        batch_op.create_index(batch_op.f("ix_appeal_submission_id"), ["submission_id"], unique=False)

    op.create_table(
        "comment",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("submission_id", sa.Integer(), nullable=False),
        sa.Column("criterion", SafeText(), nullable=False),
        sa.Column("text", SafeText(), nullable=False),
        sa.Column("actor", SafeText(), nullable=False),
        sa.Column("made_at", UtcDateTime(), nullable=False),
        sa.Column("withdrawn_at", UtcDateTime(), nullable=True),
        sa.ForeignKeyConstraint(["submission_id"], ["submission.id"], name=op.f("fk_comment_submission_id_submission")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_comment")),
    )
    with op.batch_alter_table("comment", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_comment_submission_id"), ["submission_id"], unique=False)

    op.create_table(
        "override",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("submission_id", sa.Integer(), nullable=False),
        sa.Column("criterion", SafeText(), nullable=False),
        sa.Column("marks", ExactDecimal(length=32), nullable=True),
        sa.Column("excused", sa.Boolean(), nullable=False),
        sa.Column("reason", SafeText(), nullable=False),
        sa.Column("actor", SafeText(), nullable=False),
        sa.Column("made_at", UtcDateTime(), nullable=False),
        sa.Column("withdrawn_at", UtcDateTime(), nullable=True),
        sa.CheckConstraint("(marks IS NULL) = excused", name=op.f("ck_override_marks")),
        sa.ForeignKeyConstraint(
            ["submission_id"], ["submission.id"], name=op.f("fk_override_submission_id_submission")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_override")),
    )
    with op.batch_alter_table("override", schema=None) as batch_op:
        batch_op.create_index(
            batch_op.f("ix_override_submission_id_criterion"), ["submission_id", "criterion"], unique=False
        )

    op.add_column("person", sa.Column("operator", sa.Boolean(), nullable=False, server_default=sa.false()))


downgrade = refuse_downgrade
