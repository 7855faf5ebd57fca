"""Move names to enrolments, limit credentials to courses, and assign LTI contexts to deployments.

Each enrolment gets the name and address of its person. Credentials of students in one course are limited to that course
and role. The contexts of a platform with one deployment are assigned to it; otherwise the deployment remains empty
until an instructor of the course launches it.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.columns import SafeJson, SafeText, UtcDateTime
from service.store.migrate import refuse_downgrade

revision = "0016"
down_revision = "0015"

_PERSON = sa.table(
    "person",
    sa.column("id", sa.Integer),
    sa.column("operator", sa.Boolean),
    sa.column("name", SafeText()),
    sa.column("email", SafeText()),
    sa.column("signed_in_at", UtcDateTime()),
)
_ENROLMENT = sa.table(
    "enrolment",
    sa.column("id", sa.Integer),
    sa.column("course_id", sa.Integer),
    sa.column("person_id", sa.Integer),
    sa.column("role", sa.String),
    sa.column("name", SafeText()),
    sa.column("email", SafeText()),
)
_CREDENTIAL = sa.table(
    "credential",
    sa.column("person_id", sa.Integer),
    sa.column("kind", sa.String),
    sa.column("course_id", sa.Integer),
    sa.column("role", sa.String),
    sa.column("created_at", UtcDateTime()),
)
_PLATFORM = sa.table("lti_platform", sa.column("id", sa.Integer), sa.column("deployments", SafeJson()))
_COURSE = sa.table("lti_course", sa.column("platform_id", sa.Integer), sa.column("deployment", SafeText()))


def upgrade() -> None:
    for column in ("name", "email"):
        op.add_column("enrolment", sa.Column(column, SafeText(), nullable=False, server_default=""))
    op.add_column("person", sa.Column("signed_in_at", UtcDateTime(), nullable=True))
    op.add_column("credential", sa.Column("role", sa.String(length=16), nullable=True))
    # One statement, which SQLite can run without rebuilding the table.
    op.execute(
        "ALTER TABLE credential ADD COLUMN platform_id INTEGER "
        "CONSTRAINT fk_credential_platform_id_lti_platform REFERENCES lti_platform (id)"
    )
    op.add_column("lti_platform", sa.Column("service_origins", SafeJson(), nullable=False, server_default="[]"))
    op.add_column("lti_course", sa.Column("deployment", SafeText(), nullable=False, server_default=""))
    op.drop_index("ix_lti_course_platform_id_context", "lti_course")
    names = ["platform_id", "deployment", "context"]
    op.create_index("ix_lti_course_platform_id_deployment_context", "lti_course", names, unique=True)
    _give_names_to_enrolments()
    _limit_credentials_of_students()
    _name_deployments()
    for column in ("name", "email"):
        op.drop_column("person", column)


def _give_names_to_enrolments() -> None:
    of_person = _PERSON.c.id == _ENROLMENT.c.person_id
    name = sa.select(_PERSON.c.name).where(of_person).scalar_subquery()
    email = sa.select(sa.func.coalesce(_PERSON.c.email, "")).where(of_person).scalar_subquery()
    op.get_bind().execute(sa.update(_ENROLMENT).values(name=name, email=email))


def _limit_credentials_of_students() -> None:
    connection = op.get_bind()
    owned = (_CREDENTIAL.c.person_id == _PERSON.c.id, _CREDENTIAL.c.kind.in_(["session", "token"]))
    first = sa.select(sa.func.min(_CREDENTIAL.c.created_at)).where(*owned).scalar_subquery()
    connection.execute(sa.update(_PERSON).values(signed_in_at=first))
    only_course = (
        sa.select(_ENROLMENT.c.person_id, sa.func.min(_ENROLMENT.c.course_id).label("course_id"))
        .join(_PERSON, _PERSON.c.id == _ENROLMENT.c.person_id)
        .where(_PERSON.c.operator.is_(False))
        .group_by(_ENROLMENT.c.person_id)
        .having(sa.func.count() == 1, sa.func.min(_ENROLMENT.c.role) == "student")
        .subquery()
    )
    course_id = sa.select(only_course.c.course_id).where(only_course.c.person_id == _CREDENTIAL.c.person_id)
    of_student = _CREDENTIAL.c.person_id.in_(sa.select(only_course.c.person_id))
    connection.execute(
        sa.update(_CREDENTIAL).where(of_student).values(course_id=course_id.scalar_subquery(), role="student")
    )


def _name_deployments() -> None:
    connection = op.get_bind()
    for platform_id, deployments in connection.execute(sa.select(_PLATFORM.c.id, _PLATFORM.c.deployments)).all():
        if len(deployments) == 1:
            theirs = _COURSE.c.platform_id == platform_id
            connection.execute(sa.update(_COURSE).where(theirs).values(deployment=deployments[0]))


downgrade = refuse_downgrade
