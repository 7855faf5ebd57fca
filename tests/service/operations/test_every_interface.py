"""Each operation by page, API and command: equal rows, activity log entries, notifications to workers, and errors."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from decimal import Decimal
from typing import Any

import pytest
from _pytest.mark.structures import ParameterSet
from sqlalchemy import select, update

import acting
import report_builders
from builders import grading_request
from interfaces import INTERFACES, Installation, Row, installation_in
from operation_table import batches, courses, grades
from service import operations
from service.operations.courses import find
from service.operations.policies import PolicyLimits
from service.store.batches import intake
from service.store.courses import open_assignments, policies
from service.store.courses.assignment_versions import freeze_assignment
from service.store.engine import now
from service.store.grades import appeals, comments, overrides
from service.store.people import webhooks
from service.store.queue import jobs, test_runs
from service.store.states import JobState
from service.store.tables.grades import CriterionResultRow
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Job
from submissions.assignment.reader import find_assignment
from submissions.stored_submission import pack_submission
from web import COURSE, Web, grade_all
from web_world import make_world

_CRITERION = report_builders.faulty_grade().criteria[0].id
TABLE: dict[str, Row] = batches.ROWS | grades.ROWS | courses.ROWS
#: Operations without a row in the table, and the reason.
ELSEWHERE = {
    "assignments.prepare": "a part of prepare_from_catalogue and upload",
    "batches.resolve_course": "reads",
    "courses.list_own": "reads",
    "credentials.make_token": "the page of one's own account; test_credential_rights.py",
    "credentials.end_credential": "the page of one's own account; test_credential_rights.py",
    "credentials.end_other_credentials": "the page of one's own account; test_credential_rights.py",
    "gradebook.download_table": "reads; test_gradebook.py",
    "notebook_runs.start_run": "the API, for notebooks; test_notebook_runs.py",
    "notebook_runs.start_check": "the API, for notebooks; test_notebook_runs.py",
    "people.enrol_new": "the page of one student; programs send a list",
    "people.issue_token": "the command; on the web everybody makes their own",
    "privacy.archive": "the command",
    "privacy.purge": "the command",
    "sign_in_links.make_members_link": "the command; on the web an instructor gets a link when they are added",
    "sign_in_links.make_own_link": "the command that brings the service up",
    "sign_in.identify": "test_credential_rights.py; pages and API, before anything else",
    "sign_in.record_use": "the API; test_credential_rights.py",
    "sign_in.sign_in": "the page; test_sign_in.py",
    "sign_in.sign_out": "the page; test_sign_in.py",
    "launches.begin": "learning platforms; test_lti.py",
    "launches.complete": "learning platforms; test_lti.py",
    "statements.rotate_key": "the command; test_statement_commands.py",
    "statements.revoke_key": "the command; test_statement_commands.py",
    "statement_log.write_head": "the command; test_statement_commands.py",
    "statements.sign_head": "a part of write_head and of statements",
    "database.upgrade": "the command",
    "database.back_up": "the command",
    "database.restore": "the command",
    "database.remove_old_submissions": "the command",
    "replies.reserve_key": "the API; test_api.py",
    "replies.store_reply": "the API; test_api.py",
    "replies.release_key": "the API; test_api.py",
}
#: Name prefixes of functions that change nothing. Functions in the table have a row even so.
READING = (
    "list_",
    "show",
    "find",
    "search_",
    "export",
    "check_",
    "preview_submissions",
    "poll_",
    "load",
    "count_",
    "is_",
)


def _members(web: Web) -> dict[str, Any]:
    """Create one object of every kind, an unopened assignment, and a person who operates the installation."""
    world = make_world(web)
    with web.store.transaction() as session:
        open_assignments.prepare_assignment(session, 1, freeze_assignment(find_assignment("json-queue")))
    people = {"grace": world.grace, "ada": world.ada, "root": web.operator()}
    ids = {name: str(each.enrolment_id) for name, each in people.items()}
    return world.values | ids | {"leaver": world.values["student_id"], "people": people}


def _batch(web: Web) -> dict[str, str]:
    requests = [grading_request(who, f"print({who!r})\n") for who in ("cat", "dan")]
    batch = intake.accept_batch(web.store, "week two", requests, (), course=COURSE, max_attempts=3)
    return {"batch_id": batch.id, "job_id": batch.jobs[0].job_id}


def _graded(web: Web) -> dict[str, str]:
    made = _batch(web)
    grade_all(web, report_builders.faulty_grade())
    return made


def _regraded(web: Web) -> dict[str, str]:
    made = _graded(web)
    acting.publish(web.store, made["batch_id"], includes_held_back=True)
    acting.regrade(web.store, made["batch_id"])
    grade_all(web, report_builders.faulty_grade())
    return made


def _paused(web: Web) -> dict[str, str]:
    made = _batch(web)
    acting.pause(web.store, made["batch_id"])
    return made


def _cancelled(web: Web) -> dict[str, str]:
    made = _batch(web)
    acting.cancel(web.store, made["batch_id"])
    return made


def _dead(web: Web) -> dict[str, str]:
    made = _batch(web)
    with web.store.transaction() as session:
        of_batch = update(Job).where(Job.batch_id == made["batch_id"])
        session.execute(of_batch.values(state=JobState.DEAD, error="the worker ended"))
    return made


def _over_a_limit(web: Web) -> dict[str, str]:
    made = _batch(web)
    with web.store.transaction() as session:
        jobs.put_aside_job(session, made["job_id"], now(session))
    return made


def _marked(web: Web) -> dict[str, str]:
    with web.store.transaction() as session:
        (job_id,) = session.scalars(select(Job.id).where(Job.submission_id == 1))
        overrides.set_marks(session, job_id, _CRITERION, Decimal(1), "seen again", "staff")
        comments.add_comment(session, job_id, "", "Well done.", "staff")
    return {}


def _answered(web: Web) -> dict[str, str]:
    with web.store.transaction() as session:
        appeals.answer_appeal(session, 1, 1, "It is right.", "staff")
    return {}


def _provisional(web: Web) -> dict[str, str]:
    pool = {"size": 200, "drawn": 4, "least": 0.1, "most": 0.9, "is_decided": False}
    with web.store.transaction() as session:
        (job_id,) = session.scalars(select(Job.id).where(Job.submission_id == 1))
        session.execute(update(Job).where(Job.id == job_id).values(provisional=True))
        session.execute(update(CriterionResultRow).where(CriterionResultRow.job_id == job_id).values(pool=pool))
    return {}


def _running_a_test(web: Web) -> dict[str, str]:
    with web.store.transaction() as session:
        version_id = open_assignments.load_course_assignment(session, 1, "echo-responder").version_id
        ada = session.scalars(select(Enrolment.id).where(Enrolment.student == "ada")).one()
        test_runs.queue_test_run(session, ada, version_id, pack_submission(grading_request("ada").submission))
    return {}


def _closed(web: Web) -> dict[str, str]:
    with web.store.transaction() as session:
        open_assignments.close_assignment(session, 1, "echo-responder")
    return {}


def _with_a_policy(web: Web) -> dict[str, str]:
    with web.store.transaction() as session:
        policies.set_policy(session, 1, "echo-responder", PolicyLimits(attempts=3))
    return {}


def _with_many_webhooks(web: Web) -> dict[str, str]:
    with web.store.transaction() as session:
        for number in range(webhooks.MAX_WEBHOOKS - 1):
            webhooks.create_webhook(session, 1, f"https://hooks.example.org/{number}", ["grade.finished"])
    return {}


STATES = {
    "queued": _batch,
    "graded": _graded,
    "regraded": _regraded,
    "paused": _paused,
    "cancelled": _cancelled,
    "dead": _dead,
    "over a limit": _over_a_limit,
    "marked": _marked,
    "answered": _answered,
    "provisional": _provisional,
    "running a test": _running_a_test,
    "closed": _closed,
    "with a policy": _with_a_policy,
    "many webhooks": _with_many_webhooks,
}


@pytest.fixture(scope="module")
def installation(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Installation]:
    folder = tmp_path_factory.mktemp("installation")
    (folder / "people.csv").write_bytes(courses.TABLE)
    for name, files in batches.FOLDERS.items():
        for path, text in files.items():
            (folder / name / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / name / path).write_text(text)
    with installation_in(folder, _members, STATES) as made:
        yield made


def _name(operation: Any) -> str:
    return f"{operation.__module__.rpartition('.')[2]}.{operation.__name__}"


def _list_rows() -> list[ParameterSet]:
    """Return the rows. All but the first refusal of an operation are long tests."""
    rows, refusing = [], set()
    for name, row in TABLE.items():
        operation = _name(row.operation)
        is_long = row.refused is not None and operation in refusing
        rows.append(pytest.param(name, marks=[pytest.mark.long] * is_long))
        if row.refused is not None:
            refusing.add(operation)
    return rows


@pytest.mark.parametrize("name", _list_rows())
def test_an_operation_is_the_same_by_every_interface(installation: Installation, name: str) -> None:
    row = TABLE[name]
    done = {interface: installation.run(row, interface) for interface in row.interfaces}
    answers = {interface: answer for interface, (answer, _) in done.items()}
    first = next(iter(done.values()))[1]
    for interface, (answer, left) in done.items():
        assert left == first, interface
        if row.refused is None:
            assert answer.is_accepted, answers
            assert all(word in answer.text for word in row.says), answers
        else:
            status, sentence = row.refused
            assert answer.status == (2 if interface == "command" else status), answers
            assert sentence.casefold() in answer.text.casefold(), answers
    changes = bool(first.rows or first.notices)
    assert changes is (row.refused is None and not row.says and name not in batches.UNCHANGED), first


def test_every_operation_has_a_row_and_every_missing_interface_a_reason() -> None:
    operation_names = {
        each
        for room in pkgutil.iter_modules(operations.__path__)
        for each in vars(importlib.import_module(f"service.operations.{room.name}")).values()
        if inspect.isfunction(each)
        and each.__module__ == f"service.operations.{room.name}"
        and [*inspect.signature(each).parameters][:2] == ["service", "actor"]
        and not each.__name__.startswith(("_", *READING))
    }
    tested_operations = {_name(row.operation) for row in TABLE.values()}
    assert {_name(each) for each in operation_names} <= tested_operations | set(ELSEWHERE)
    assert not tested_operations & set(ELSEWHERE)
    for name, row in TABLE.items():
        assert bool(row.alone) == (row.interfaces != INTERFACES), name


@pytest.mark.parametrize(
    "line",
    [
        "course policy",
        "course policy --attempts 1",
        "course policy --drop",
        "course extend ada --more-attempts 1",
        "course enrol {folder}/people.csv",
        "course prepare echo-responder",
        "course open echo-responder",
        "course close echo-responder",
        "course remove echo-responder",
        "course hide-names echo-responder",
        "user add zoe --student",
        "user list",
        "user links",
        "webhook list",
        "webhook add https://hooks.example.org/ --event batch.finished",
        "platform enrol",
    ],
)
def test_no_command_creates_a_course_from_a_mistyped_name(installation: Installation, line: str) -> None:
    row = Row(find, command=f"{line} --course typo", alone="commands name courses")
    answer, left = installation.run(row, "command")
    assert (answer.status, left.rows) == (2, ())
    assert "there is no course called 'typo'" in answer.text


def test_an_export_is_the_same_by_every_interface(installation: Installation) -> None:
    page_text = {interface: installation.run(TABLE["export"], interface)[0].text for interface in INTERFACES}
    texts = {interface: text.removeprefix("\ufeff").replace("\r\n", "\n") for interface, text in page_text.items()}
    assert texts["page"] == texts["api"] == texts["command"]
