"""The tables: made once whoever comes first, the same as the models say, and never taken down."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime
from decimal import Decimal
from functools import partial
from pathlib import Path

import pytest
from alembic import command
from alembic.script import ScriptDirectory
from sqlalchemy import func, insert, inspect, select, text

import report_builders
from builders import accept_one
from command import FORKING
from first_release import lay_first_release
from service.settings import Settings
from service.store import artifacts, recorded_schema
from service.store.batches import batches, intake
from service.store.courses import open_assignments
from service.store.engine import open_engine, open_store
from service.store.grades import results
from service.store.migrate import configuration, migrate
from service.store.models import Artifact, Batch, CriterionResultRow, Enrolment, Job, Person, TrialRow
from service.store.queue import jobs
from service.store.revision import current_revision, newest_revision, revision_of
from service.store.states import JobState, Standing
from service.store.web_tables import METADATA, OpenAssignment
from sim.errors import HostError
from submissions.people import Refusal


def _open(settings: Settings) -> None:
    open_store(settings).close()


def test_the_migrations_make_what_the_models_say(service_settings: Settings) -> None:
    engine = open_engine(service_settings.database)
    with engine.begin() as connection:
        migrate(connection)
    engine.dispose()
    with open_store(service_settings) as store:
        assert current_revision(store.engine) == newest_revision()
        assert set(inspect(store.engine).get_table_names()) == {*METADATA.tables, "alembic_version"}
        with store.engine.begin() as connection:
            known = configuration(connection)
            command.check(known)
            assert ScriptDirectory.from_config(known).get_current_head() == newest_revision()


def _lines_of(statement: str) -> list[str]:
    """They in one order, as Alembic has none for foreign keys, without what releases of SQLite write differently."""
    return sorted(re.sub(r'[\s",]', "", line) for line in statement.splitlines())


def test_a_new_database_is_what_the_migrations_make(tmp_path: Path) -> None:
    told = []
    for name, lay in (("laid", partial(recorded_schema.lay, revision=newest_revision())), ("migrated", migrate)):
        engine = open_engine(f"sqlite:///{tmp_path / name}.db")
        with engine.begin() as connection:
            assert recorded_schema.can_be_laid(connection)
            lay(connection)
            schema = [_lines_of(statement) for statement in recorded_schema.statements_of(connection)]
            rows = {table.name: connection.execute(select(table)).mappings().all() for table in METADATA.sorted_tables}
            (installation,) = rows.pop("installation")
            told.append((schema, rows, len(installation["secret"]), revision_of(connection)))
            assert not recorded_schema.can_be_laid(connection)
        engine.dispose()
    assert told[0] == told[1], "python -m service.store.recorded_schema writes down anew what the migrations make"


def test_many_may_come_first(service_settings: Settings) -> None:
    processes = [FORKING.Process(target=_open, args=(service_settings,)) for _ in range(4)]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
        assert process.exitcode == 0
        process.close()
    engine = open_engine(service_settings.database)
    assert current_revision(engine) == newest_revision()
    engine.dispose()


def test_a_newer_database_is_refused(service_settings: Settings) -> None:
    with open_store(service_settings) as store, store.engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    with pytest.raises(HostError, match=r"newer Robomark .*no way down"):
        open_store(service_settings)


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
            ada, bob = sorted(batches.job_lines(session, batch), key=lambda line: line.student == "Bob 🤖")
            graded = results.load(session, ada.id)
            assert (graded.student, graded.marks, ada.standing) == ("ada", Decimal("1.00"), Standing.STANDS)
            assert len(graded.trials[0].recording.ticks) > 10
            assert graded.cost is None
            assert bob.student == "Bob 🤖"
            assert (bob.name, bob.email, bob.missing) == ("", "", "")
            assert batches.batch(session, batch).refusals == (Refusal("odd.txt", "is odd."),)
            people = session.execute(select(Enrolment.student, Enrolment.written, Person.name).join(Person)).all()
            assert {(student, written) for student, written, _ in people} >= {("ada", "ada"), ("Bob 🤖", "Bob 🤖")}
            assert {name for _, _, name in people} == {""}
            assert artifacts.get(session, ada.id, prefix="plot-")["plot-path.png"].data.startswith(b"\x89PNG")
            assert intake.load_grading_request(session, ada.id).submission.program is not None
        with store.engine.begin() as connection:
            command.check(configuration(connection))
        # What waited is graded by the new release, and what comes in is numbered on.
        waiting = jobs.claim(store, "worker", 60)
        assert waiting is not None
        jobs.finish(store, waiting, results.prepare(report_builders.faulty_grade()), datetime.now(UTC))
        assert accept_one(store, "ada").attempt == 3


def test_what_the_first_tables_called_superseded_is_cancelled(service_settings: Settings, tmp_path: Path) -> None:
    engine = lay_first_release(service_settings.database, tmp_path)
    with engine.begin() as connection:
        connection.execute(text("UPDATE job SET state = 'superseded' WHERE state = 'cancelled'"))
        connection.execute(text("UPDATE alembic_version SET version_num = '0001'"))
    engine.dispose()
    with open_store(service_settings) as store, store.reading() as session:
        reasons = session.scalars(select(Job.error).where(Job.state == JobState.CANCELLED)).all()
    assert reasons == ["superseded by a newer submission"]


def test_what_was_submitted_on_the_web_before_it_had_a_batch_is_in_one(
    service_settings: Settings, tmp_path: Path
) -> None:
    engine = lay_first_release(service_settings.database, tmp_path)
    with engine.begin() as connection:
        command.upgrade(configuration(connection), "0012")
        connection.execute(text("UPDATE job SET batch_id = NULL"))
        connection.execute(text("UPDATE submission SET batch_id = NULL"))
        (name,) = set(connection.scalars(text("SELECT assignment FROM submission")))
        of_one = {"course_id": 1, "assignment_version_id": 1, "names_hidden": False}
        for assignment, opened_at in ((name, datetime(2000, 1, 1, tzinfo=UTC)), ("never", None)):
            row = of_one | {"assignment": assignment, "opened_at": opened_at}
            connection.execute(insert(OpenAssignment).values(row))
    engine.dispose()
    with open_store(service_settings) as store, store.reading() as session:
        assert open_assignments.find(session, 1, "never").batch_id is None
        batch_id = open_assignments.find(session, 1, name).batch_id
        assert batch_id is not None
        assert {line.student for line in batches.job_lines(session, batch_id)} == {"ada", "Bob 🤖", "eve"}
        assert batches.batch(session, batch_id).web_assignment == name
        assert session.scalar(select(func.count()).where(Job.batch_id.is_(None))) == 0


@pytest.mark.parametrize("revision", ["0002", "0001", "base"])
def test_there_is_no_way_down(service_settings: Settings, revision: str) -> None:
    with open_store(service_settings) as store:
        with (
            pytest.raises(HostError, match=r"cannot be taken back .* restore the backup"),
            store.engine.begin() as down,
        ):
            command.downgrade(configuration(down), revision)
        assert current_revision(store.engine) == newest_revision()
        with store.engine.begin() as connection:
            command.check(configuration(connection))


def test_a_database_that_is_away_is_named_without_its_password(service_settings: Settings) -> None:
    url = "postgresql+psycopg://someone:hush@127.0.0.1:1/nowhere"
    with pytest.raises(HostError) as caught:
        open_store(replace(service_settings, database_url=url))
    assert "127.0.0.1" in str(caught.value)
    assert "hush" not in str(caught.value)
