"""The tables: created once with simultaneous starts, equal to the models, and never downgraded."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from decimal import Decimal
from pathlib import Path

import pytest
from alembic import command
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, func, insert, inspect, select, text

import acting
import report_builders
from builders import accept_one, prepared, upgraded_by_newer_release
from command import FORKING
from first_release import lay_first_release, lay_release_0_2_0
from service.settings import Settings
from service.store import artifacts
from service.store.backup import back_up, restore
from service.store.batches import batches, job_lines, stored_requests
from service.store.codec import decode
from service.store.courses import open_assignments, policies
from service.store.courses.policies import ExceededLimit
from service.store.engine import Store, open_engine, open_store
from service.store.grades import results
from service.store.migrate import apply_migrations, build_alembic_config, create_tables, is_empty_sqlite
from service.store.queue import jobs
from service.store.revision import (
    OLDEST_COMPATIBLE,
    find_newest_revision,
    load_current_revision,
    load_schema_state,
    read_revision,
)
from service.store.states import CancelReason, CompletionRule, CountedAttempt, JobState, Role, Standing
from service.store.tables import METADATA
from service.store.tables.courses import Course, OpenAssignment
from service.store.tables.grades import Artifact, CriterionResultRow, TrialRow
from service.store.tables.people import Credential, Enrolment, LtiCourse, LtiPlatform, Person
from service.store.tables.submissions import Batch, Job, SubmissionRow
from sim.errors import HostError
from submissions.student_identity import RejectedSubmission


def _open(settings: Settings) -> None:
    open_store(settings).close()


def test_the_migrations_make_what_the_models_say(service_settings: Settings) -> None:
    engine = open_engine(service_settings.database)
    with engine.begin() as connection:
        apply_migrations(connection)
    engine.dispose()
    with open_store(service_settings) as store:
        assert load_current_revision(store.engine) == find_newest_revision()
        assert set(inspect(store.engine).get_table_names()) == {*METADATA.tables, "alembic_version"}
        with store.engine.begin() as connection:
            known = build_alembic_config(connection)
            command.check(known)
            assert ScriptDirectory.from_config(known).get_current_head() == find_newest_revision()


def _describe_table(connection: Connection, table: str) -> dict[str, object]:
    """Return what a table is made of, without the order of its columns and the names of its constraints."""
    tables = inspect(connection)
    return {
        "columns": {
            each["name"]: (str(each["type"]), each["nullable"], str(each["default"]).strip("'"))
            for each in tables.get_columns(table)
        },
        "key": tables.get_pk_constraint(table)["constrained_columns"],
        "references": sorted(
            (each["constrained_columns"], each["referred_table"], each["options"])
            for each in tables.get_foreign_keys(table)
        ),
        "unique": sorted(each["column_names"] for each in tables.get_unique_constraints(table)),
        "checks": sorted(each["sqltext"] for each in tables.get_check_constraints(table)),
        "indexes": connection.execute(
            text("SELECT replace(sql, '\"', '') FROM sqlite_master WHERE type = 'index' AND tbl_name = :t ORDER BY 1"),
            {"t": table},
        ).all(),
    }


def test_a_new_database_is_what_the_migrations_make(tmp_path: Path) -> None:
    made = []
    for name, make in (("created", create_tables), ("migrated", apply_migrations)):
        engine = open_engine(f"sqlite:///{tmp_path / name}.db")
        with engine.begin() as connection:
            assert is_empty_sqlite(connection)
            make(connection)
            tables = {table: _describe_table(connection, table) for table in inspect(connection).get_table_names()}
            rows = {table.name: connection.execute(select(table)).mappings().all() for table in METADATA.sorted_tables}
            (installation,) = rows.pop("installation")
            made.append((tables, rows, len(installation["secret"]), read_revision(connection)))
            assert not is_empty_sqlite(connection)
        engine.dispose()
    assert made[0] == made[1]


def test_many_may_come_first(service_settings: Settings) -> None:
    processes = [FORKING.Process(target=_open, args=(service_settings,)) for _ in range(4)]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
        assert process.exitcode == 0
        process.close()
    engine = open_engine(service_settings.database)
    assert load_current_revision(engine) == find_newest_revision()
    engine.dispose()


def test_a_newer_database_is_refused(service_settings: Settings) -> None:
    with open_store(service_settings) as store:
        upgraded_by_newer_release(store, "9998")
    with pytest.raises(HostError, match=r"newer Robomark .*no way down"):
        open_store(service_settings)


def _back_up_and_restore(store: Store, file: Path) -> None:
    back_up(store.engine, file)
    restore(file, store.engine)


def test_a_newer_database_that_this_release_can_use_is_used(service_settings: Settings, tmp_path: Path) -> None:
    with open_store(service_settings) as store:
        job_id = accept_one(store).job_id
        upgraded_by_newer_release(store, find_newest_revision())
    with open_store(service_settings) as store:
        claim = jobs.claim_job(store, "worker", 60)
        assert claim is not None
        assert claim.job_id == job_id
        # A copy row by row would lack the columns that the newer release added.
        with pytest.raises(HostError, match=r"no way down|release that they are of"):
            _back_up_and_restore(store, tmp_path / "backup.db")


def test_the_oldest_revision_that_can_use_the_tables_is_stored(service_settings: Settings) -> None:
    engine = open_engine(service_settings.database)
    with engine.begin() as connection:
        apply_migrations(connection)
        scripts = ScriptDirectory.from_config(build_alembic_config(connection)).walk_revisions()
        assert OLDEST_COMPATIBLE in {each.revision for each in scripts}
    assert load_schema_state(engine).oldest_compatible == OLDEST_COMPATIBLE
    engine.dispose()


def test_a_database_of_the_first_release_is_upgraded_with_its_data(service_settings: Settings, tmp_path: Path) -> None:
    lay_first_release(service_settings.database, tmp_path).dispose()
    with open_store(service_settings) as store:
        with store.reading() as session:
            states = dict(session.execute(select(Job.state, func.count()).group_by(Job.state)).all())
            assert states == {JobState.DONE: 2, JobState.DEAD: 1, JobState.CANCELLED: 1, JobState.QUEUED: 1}
            counts = [
                session.scalar(select(func.count()).select_from(t)) for t in (TrialRow, CriterionResultRow, Artifact)
            ]
            assert counts == [2, 10, 3]
            (batch,) = session.scalars(select(Batch.id).where(Batch.name == "class"))
            ada, bob = sorted(job_lines.load_job_lines(session, batch), key=lambda line: line.student == "Bob 🤖")
            graded = results.load_grade(session, ada.id)
            assert (graded.student, graded.marks, ada.standing) == ("ada", Decimal("1.00"), Standing.STANDS)
            assert len(graded.trials[0].recording.ticks) > 10
            assert graded.cost is None
            assert bob.student == "Bob 🤖"
            assert (bob.name, bob.email, bob.missing) == ("", "", "")
            assert batches.load_batch(session, batch).refusals == (RejectedSubmission("odd.txt", "is odd."),)
            people = session.execute(select(Enrolment.student, Enrolment.written, Enrolment.name)).all()
            assert {(student, written) for student, written, _ in people} >= {("ada", "ada"), ("Bob 🤖", "Bob 🤖")}
            assert {name for _, _, name in people} == {""}
            assert artifacts.load_files(session, ada.id, prefix="plot-")["plot-path.png"].data.startswith(b"\x89PNG")
            assert stored_requests.load_grading_request(session, ada.id).submission.program is not None
        with store.engine.begin() as connection:
            command.check(build_alembic_config(connection))
        # The new release grades the waiting job, and new jobs get the next numbers.
        waiting = jobs.claim_job(store, "worker", 60)
        assert waiting is not None
        jobs.finish_job(store, waiting, prepared(report_builders.faulty_grade()), datetime.now(UTC))
        assert accept_one(store, "ada").attempt == 3


def test_a_database_of_release_0_2_0_is_upgraded_with_its_data(service_settings: Settings, tmp_path: Path) -> None:
    engine = lay_release_0_2_0(service_settings.database, tmp_path)
    assert load_current_revision(engine) == "0008"
    engine.dispose()
    with open_store(service_settings) as store:
        with store.engine.begin() as connection:
            command.check(build_alembic_config(connection))
        with store.reading() as session:
            state_counts = session.execute(
                select(Job.state, Job.standing, func.count()).group_by(Job.state, Job.standing)
            )
            assert {(state, standing): count for state, standing, count in state_counts} == {
                (JobState.DONE, Standing.STANDS): 2,
                (JobState.DONE, Standing.PROPOSED): 1,
                (JobState.DEAD, Standing.STANDS): 1,
                (JobState.QUEUED, Standing.STANDS): 3,
                (JobState.QUEUED, Standing.PROPOSED): 2,
            }
            assert session.scalar(select(func.count()).where(Job.published_at.is_not(None))) == 2
            assert set(session.scalars(select(Course.counted_attempt))) == {CountedAttempt.LATEST}
            assert set(session.scalars(select(Course.completion_rule))) == {CompletionRule.HIGHER}
            (batch,) = session.scalars(select(Batch.id).where(Batch.name == "class"))
            assert batches.load_batch(session, batch).refusals == (RejectedSubmission("odd.txt", "is odd."),)
            published = [line for line in job_lines.load_job_lines(session, batch) if line.marks is not None]
            assert sorted(line.marks for line in published if line.marks is not None) == [Decimal(0), Decimal(8)]
            for line in published:
                assert results.load_grade(session, line.id).marks == line.marks
            limits = policies.load_policies(session, 1)["echo-responder"]
            assert (limits.late_days, limits.attempts, limits.cool_down_seconds) == (2, 1, 60.0)
            ada = session.scalars(select(Enrolment.id).where(Enrolment.student == "ada")).one()
            assert policies.load_limits(session, ada, "echo-responder").attempts == 3
            names = session.scalars(select(Enrolment.student).order_by(Enrolment.id)).all()
            assert set(names) == {"ada", "Bob 🤖", "cyd", "dan"}
        # The new release grades, publishes and extends the old regrades.
        while claim := jobs.claim_job(store, "worker", 60):
            jobs.finish_job(store, claim, prepared(report_builders.faulty_grade()), datetime.now(UTC))
        acting.publish(store, batch, includes_held_back=True)
        assert accept_one(store, "eve").attempt == 1


def test_what_the_first_tables_called_superseded_is_cancelled(service_settings: Settings, tmp_path: Path) -> None:
    engine = lay_first_release(service_settings.database, tmp_path)
    with engine.begin() as connection:
        connection.execute(text("UPDATE job SET state = 'superseded' WHERE state = 'cancelled'"))
        connection.execute(text("UPDATE alembic_version SET version_num = '0001'"))
    engine.dispose()
    with open_store(service_settings) as store, store.reading() as session:
        reasons = session.scalars(select(Job).where(Job.state == JobState.CANCELLED)).all()
    assert [(each.error, each.cancelled_for, each.superseded_by) for each in reasons] == [
        ("superseded by a newer submission", CancelReason.SUPERSEDED, None)
    ]


@pytest.mark.long
@pytest.mark.parametrize(
    ("sentence", "exceeded", "now"),
    [
        ("attempt 3, allowed: 2", ExceededLimit("attempts", 3, 2), "attempt 3, allowed: 2"),
        ("1 day late, allowed: 0", ExceededLimit("date", 1, 0), "1 day late, allowed: 0"),
        ("12 days late, allowed: 3", ExceededLimit("date", 12, 3), "12 days late, allowed: 3"),
        (
            "submitted 0 min after the one before, asked for: 10 min",
            ExceededLimit("cool-down", 0, 10),
            "submitted 0 min after the previous submission, required: 10 min",
        ),
    ],
)
def test_sentences_of_earlier_releases_become_data(
    service_settings: Settings, tmp_path: Path, sentence: str, exceeded: ExceededLimit, now: str
) -> None:
    assert str(exceeded) == now
    engine = lay_first_release(service_settings.database, tmp_path)
    with engine.begin() as connection:
        command.upgrade(build_alembic_config(connection), "0017")
        connection.execute(text("UPDATE submission SET staff_only = :sentence"), {"sentence": sentence})
        aside = {"sentence": "over a limit: it is graded when staff ask for it"}
        connection.execute(text("UPDATE job SET state = 'cancelled', error = :sentence WHERE state = 'dead'"), aside)
        assert connection.scalar(text("SELECT count(*) FROM job WHERE error LIKE 'over a limit%'")) == 1
    engine.dispose()
    with open_store(service_settings) as store, store.reading() as session:
        stored = session.scalars(select(SubmissionRow.exceeded)).all()
        assert {decode(ExceededLimit, each) for each in stored} == {exceeded}
        (replaced,) = session.scalars(select(Job).where(Job.cancelled_for == CancelReason.SUPERSEDED))
        assert replaced.error == f"superseded by {replaced.superseded_by}"
        assert session.get(Job, replaced.superseded_by) is not None
        assert session.scalar(select(func.count()).where(Job.cancelled_for == CancelReason.OVER_LIMIT)) == 1


def test_what_was_submitted_on_the_web_before_it_had_a_batch_is_in_one(
    service_settings: Settings, tmp_path: Path
) -> None:
    engine = lay_first_release(service_settings.database, tmp_path)
    with engine.begin() as connection:
        command.upgrade(build_alembic_config(connection), "0012")
        connection.execute(text("UPDATE job SET batch_id = NULL"))
        connection.execute(text("UPDATE submission SET batch_id = NULL"))
        (name,) = set(connection.scalars(text("SELECT assignment FROM submission")))
        of_one = {"course_id": 1, "assignment_version_id": 1, "names_hidden": False}
        for assignment, opened_at in ((name, datetime(2000, 1, 1, tzinfo=UTC)), ("never", None)):
            row = of_one | {"assignment": assignment, "opened_at": opened_at}
            connection.execute(insert(OpenAssignment).values(row))
    engine.dispose()
    with open_store(service_settings) as store, store.reading() as session:
        assert open_assignments.load_course_assignment(session, 1, "never").batch_id is None
        batch_id = open_assignments.load_course_assignment(session, 1, name).batch_id
        assert batch_id is not None
        assert {line.student for line in job_lines.load_job_lines(session, batch_id)} == {"ada", "Bob 🤖", "eve"}
        assert batches.load_batch(session, batch_id).web_assignment == name
        assert session.scalar(select(func.count()).where(Job.batch_id.is_(None))) == 0


def test_of_two_jobs_that_stand_the_published_one_stays(service_settings: Settings, tmp_path: Path) -> None:
    """Quarantine and publication could leave two standing jobs for one submission, until the index prevented it."""
    engine = lay_first_release(service_settings.database, tmp_path)
    with engine.begin() as connection:
        command.upgrade(build_alembic_config(connection), "0013")
        done, dead = (
            connection.scalars(text(f"SELECT min(id) FROM job WHERE state = '{state}'")).one()
            for state in ("done", "dead")
        )
        columns = [column["name"] for column in inspect(connection).get_columns("job")]
        copied = ", ".join(
            {"id": ":id", "state": ":state", "published_at": ":at", "queued_at": ":queued"}.get(name, name)
            for name in columns
        )
        copy = text(f"INSERT INTO job ({', '.join(columns)}) SELECT {copied} FROM job WHERE id = :of")
        soon, late = "2030-01-01 00:00:00.000000+00:00", "2031-01-01 00:00:00.000000+00:00"
        for id_, state, at, queued, of in (
            ("published", "done", soon, soon, done),  # the published regrade
            ("rerun", "done", None, late, done),  # the job that repeated a suspect grade
            ("waiting", "queued", None, late, dead),
        ):
            values = {"id": id_, "state": state, "at": at, "queued": queued, "of": of}
            connection.execute(copy, values)
    engine.dispose()
    with open_store(service_settings) as store, store.reading() as session:
        standing = session.execute(select(Job.submission_id, Job.id).where(Job.standing == Standing.STANDS)).all()
        assert len(standing) == len({submission for submission, _ in standing}) == 5
        ids = {job_id for _, job_id in standing}
        assert "published" in ids
        assert {done, "rerun"} & ids == set()
        assert len({dead, "waiting"} & ids) == 1


def test_names_go_to_enrolments_and_credentials_get_their_reach(service_settings: Settings, tmp_path: Path) -> None:
    """A student of one course keeps a credential for this course. In two courses, a credential stays unchanged."""
    at = "2026-01-02 03:04:05.000000+00:00"
    engine = lay_first_release(service_settings.database, tmp_path)
    with engine.begin() as connection:
        command.upgrade(build_alembic_config(connection), "0015")

        def add(table: str, **values: object) -> None:
            names = ", ".join(values)
            bound = ", ".join(f":{name}" for name in values)
            connection.execute(text(f"INSERT INTO {table} ({names}) VALUES ({bound})"), values)

        add("course", id=50, name="two", created_at=at)
        for person, role in ((50, "student"), (51, "student"), (52, "instructor"), (53, "student"), (54, "student")):
            add("person", id=person, name=f"Name {person}", email=None, operator=person == 53, created_at=at)
            courses = (1, 50) if person == 51 else (1,)
            for course in courses:
                names = {"student": f"s{person}", "written": f"s{person}", "role": role}
                add("enrolment", id=person * 10 + course % 10, course_id=course, person_id=person, **names)
            for kind in ("link",) if person == 54 else ("link", "session", "token"):
                row = {"person_id": person, "kind": kind, "sha256": f"{kind} {person}", "name": "", "scopes": "[]"}
                add("credential", id=f"{kind}{person}"[:12], created_at=at, expires_at="2036" + at[4:], **row)
        for platform, deployments in ((50, '["1"]'), (51, '["1", "2"]')):
            urls = {"authorization_url": "", "token_url": "", "keys_url": "", "created_at": at}
            named = {"name": "p", "issuer": f"i{platform}", "client_id": "c", "deployments": deployments}
            add("lti_platform", id=platform, **named, **urls)
            add("lti_course", id=platform, platform_id=platform, context="c", course_id=1)
    engine.dispose()
    with open_store(service_settings) as store, store.reading() as session:
        rows = session.execute(select(Enrolment.person_id, Enrolment.name, Enrolment.email)).all()
        assert {(who, name, email) for who, name, email in rows if who >= 50} == {
            (person, f"Name {person}", "") for person in range(50, 55)
        }
        credential_rows = session.execute(select(Credential.person_id, Credential.course_id, Credential.role)).all()
        limited = {50: (1, Role.STUDENT), 54: (1, Role.STUDENT)}
        assert {tuple(row) for row in credential_rows} == {
            (who, *limited.get(who, (None, None))) for who in range(50, 55)
        }
        signed_in = session.scalars(select(Person.id).where(Person.signed_in_at.is_not(None))).all()
        assert sorted(signed_in) == [50, 51, 52, 53]
        launched = session.execute(select(LtiCourse.platform_id, LtiCourse.deployment)).all()
        assert {tuple(row) for row in launched} == {(50, "1"), (51, "")}
        assert session.scalars(select(LtiPlatform.service_origins)).all() == [[], []]


@pytest.mark.parametrize("revision", ["0002", "0001", "base"])
def test_there_is_no_way_down(service_settings: Settings, revision: str) -> None:
    with open_store(service_settings) as store:
        with (
            pytest.raises(HostError, match=r"cannot be taken back .* restore the backup"),
            store.engine.begin() as down,
        ):
            command.downgrade(build_alembic_config(down), revision)
        assert load_current_revision(store.engine) == find_newest_revision()
        with store.engine.begin() as connection:
            command.check(build_alembic_config(connection))


def test_a_database_that_is_away_is_named_without_its_password(service_settings: Settings) -> None:
    url = "postgresql+psycopg://someone:hush-hush@127.0.0.1:1/nowhere"
    with pytest.raises(HostError) as caught:
        open_store(replace(service_settings, database_url=url))
    assert "127.0.0.1" in str(caught.value)
    assert "hush-hush" not in str(caught.value)
