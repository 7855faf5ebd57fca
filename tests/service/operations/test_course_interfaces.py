"""Each operation on courses, people and platforms by page, API and command: equal rows, log entries and refusals."""

from __future__ import annotations

import inspect
import shlex
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select
from starlette.testclient import TestClient

from builders import echo
from service.command_line import load_command
from service.operations import (
    assignments,
    courses,
    database,
    launches,
    people,
    platforms,
    policies,
    privacy,
    replies,
    sign_in,
    sign_in_links,
    stored_grades,
    webhooks,
)
from service.store.courses import open_assignments
from service.store.courses.versions import freeze
from service.store.models import Audit, Base, Course, Enrolment, Extension, Person, Policy
from service.store.states import CredentialKind
from service.store.web_tables import Credential, LtiPlatform, OpenAssignment
from sim.errors import UsageError
from submissions.roster import moment
from web import Web, submit, web_in

HERE, API = "/courses/1", "/api/v1/courses/1"
DUE = "2030-01-02T10:00"
PLATFORM = {"name": "Moodle", "issuer": "https://moodle.example.org", "client_id": "x"} | {
    f"{each}_url": f"https://moodle.example.org/{each}" for each in ("authorization", "token", "keys")
}
#: The tables that these operations write to.
TABLES: tuple[type[Base], ...] = (
    Course, Person, Enrolment, Policy, Extension, OpenAssignment, LtiPlatform, Credential,
)  # fmt: skip
#: Moments of the operations themselves.
PASSING = {"created_at", "opened_at", "closed_at", "signed_in_at", "used_at", "expires_at", "revoked_at"}
#: Random values.
RANDOM = {"sha256", "batch_id"}


@dataclass(frozen=True)
class Action:
    """One request by each of its interfaces; ``{ada}`` and ``{grace}`` are enrolments, ``{folder}`` has files."""

    operation: str
    page: tuple[str, dict[str, Any]] | None = None
    api: tuple[str, str, dict[str, Any] | None] | None = None
    command: str = ""
    refused: bool = False
    files: dict[str, tuple[str, bytes]] = field(default_factory=dict)


def _extension(refused: bool = False, who: str = "ada", assignment: str = "", due: str = "", more: int = 0) -> Action:
    api = {"assignment": assignment, "due_at": moment(due).isoformat() if due else None, "more_attempts": more}
    words = (f"-a {assignment} " if assignment else "") + (f"--due {due} " if due else "")
    return Action(
        "policies.extend",
        (f"{HERE}/people/{{{who}}}/extensions", {"assignment": assignment, "due": due, "more_attempts": more}),
        ("POST", f"{API}/people/{{{who}}}/extensions", api),
        f"course extend {who} {words}--more-attempts {more}",
        refused,
    )


def _policy(refused: bool = False, assignment: str = "", due: str = DUE) -> Action:
    numbers, named = {"late_days": 2, "attempts": 3}, f"-a {assignment}" if assignment else ""
    return Action(
        "policies.set_policy",
        (f"{HERE}/policy", {"assignment": assignment, "due": due, "cool_down": 10, **numbers}),
        ("PUT", f"{API}/policies", {"assignment": assignment, "due_at": moment(due).isoformat()}
         | {"cool_down_seconds": 600, **numbers}),
        f"course policy {named} --due {due} --late-days 2 --attempts 3 --cool-down 10",
        refused,
    )  # fmt: skip


def _assignment(verb: str, operation: str, path: str = "echo-responder", *, refused: bool = False) -> Action:
    drops = verb == "remove"
    return Action(
        f"assignments.{operation}",
        (f"{HERE}/assignments/{path}/{verb}", {}),
        ("DELETE" if drops else "POST", f"{API}/assignments/{path}{'' if drops else f'/{verb}'}", None),
        f"course {verb} {path}",
        refused,
    )


TABLE = b"id,name,email\nzoe,Zoe,zoe@example.org\nada,Ada Lovelace,\n"
TWO = [{"id": "zoe", "name": "Zoe", "email": "zoe@example.org"}, {"id": "ada", "name": "Ada Lovelace"}]
ACTIONS = {
    "set the policy of a course": _policy(),
    "set the policy of an assignment": _policy(assignment="echo-responder"),
    "set the policy of no assignment": _policy(True, assignment="echo-typo"),
    "set a deadline in another century": _policy(True, due="2999-01-02T10:00"),
    "drop a policy": Action(
        "policies.drop_policy",
        (f"{HERE}/assignments/echo-responder/no-policy", {}),
        ("DELETE", f"{API}/policies?assignment=echo-responder", None),
        "course policy -a echo-responder --drop",
    ),
    "extend": _extension(assignment="echo-responder", due=DUE, more=2),
    "extend for all assignments": _extension(more=1),
    "extend by nothing": _extension(True),
    "extend for no assignment": _extension(True, assignment="echo-typo", more=1),
    "extend till another century": _extension(True, due="2999-01-02T10:00"),
    "extend for an instructor": _extension(True, who="grace", more=1),
    "enrol": Action(
        "people.enrol",
        (f"{HERE}/people/table", {}),
        ("POST", f"{API}/people", {"students": TWO}),
        "course enrol {folder}/people.csv",
        files={"file": ("people.csv", TABLE)},
    ),
    "make a student's link": Action(
        "sign_in_links.make_students_link",
        (f"{HERE}/people/{{ada}}/link", {}),
        ("POST", f"{API}/people/{{ada}}/link", None),
    ),
    "make an instructor's link as a student's": Action(
        "sign_in_links.make_students_link",
        (f"{HERE}/people/{{grace}}/link", {}),
        ("POST", f"{API}/people/{{grace}}/link", None),
        refused=True,
    ),
    "make links for a course": Action(
        "sign_in_links.make_links", (f"{HERE}/people/links", {"days": 3}), ("POST", f"{API}/people/links", {"days": 3})
    ),
    "add an instructor of a new course": Action(
        "courses.add_member",
        ("/operator/courses", {"course": " TM129 ", "who": "linus", "name": "Linus"}),
        ("POST", "/api/v1/operator/courses", {"course": " TM129 ", "id": "linus", "name": "Linus"}),
        "user add linus --name Linus --course ' TM129 '",
    ),
    "add a blank instructor": Action(
        "courses.add_member",
        ("/operator/courses", {"course": "TM129", "who": " "}),
        ("POST", "/api/v1/operator/courses", {"course": "TM129", "id": " "}),
        "user add ' ' --course TM129",
        refused=True,
    ),
    "add a student as an instructor": Action(
        "courses.add_member",
        ("/operator/courses", {"course": "default", "who": "ada"}),
        ("POST", "/api/v1/operator/courses", {"course": "default", "id": "ada"}),
        "user add ada",
        refused=True,
    ),
    "sign a person out": Action(
        "people.sign_out",
        ("/operator/people/{ada}/sign-out", {}),
        ("POST", "/api/v1/operator/people/{ada}/sign-out", None),
        "user sign-out ada",
    ),
    "join two of one course": Action(
        "people.join",
        ("/operator/people/{ada}/join", {"other_id": "{grace}"}),
        ("POST", "/api/v1/operator/people/{ada}/join", {"other": "{grace}"}),
        "user join ada --same-as grace --of default",
        refused=True,
    ),
    "remove a student": Action(
        "people.remove", (f"{HERE}/people/{{ada}}/remove", {}), None, "user remove ada"
    ),
    "erase a student": Action(
        "privacy.erase_student",
        None,
        ("DELETE", f"{API}/people/{{ada}}", None),
        "course delete-student ada --for-good",
    ),
    "erase an instructor": Action(
        "privacy.erase_student",
        None,
        ("DELETE", f"{API}/people/{{grace}}", None),
        "course delete-student grace --for-good",
        refused=True,
    ),
    "prepare": Action(
        "assignments.prepare",
        (f"{HERE}/assignments", {"assignment": "json-queue"}),
        ("POST", f"{API}/assignments", {"assignment": "json-queue"}),
        "course prepare json-queue",
    ),
    "open": _assignment("open", "open_for_students"),
    "open none": _assignment("open", "open_for_students", "echo-typo", refused=True),
    "close": _assignment("close", "close"),
    "remove an assignment": _assignment("remove", "remove"),
    "hide names": Action(
        "assignments.hide_names",
        (f"{HERE}/assignments/echo-responder/names", {"hidden": "true"}),
        ("POST", f"{API}/assignments/echo-responder/names", {"names_hidden": True}),
    ),
    "register a platform": Action(
        "platforms.register",
        ("/operator/platforms", PLATFORM | {"deployments": "2, 1"}),
        ("POST", "/api/v1/operator/platforms", PLATFORM | {"deployments": ["2", "1"]}),
    ),
    "register a platform without a deployment": Action(
        "platforms.register",
        ("/operator/platforms", PLATFORM | {"deployments": " , "}),
        ("POST", "/api/v1/operator/platforms", PLATFORM | {"deployments": []}),
        refused=True,
    ),
    "register a platform at a file": Action(
        "platforms.register",
        ("/operator/platforms", PLATFORM | {"deployments": "1", "keys_url": "file:///etc/passwd"}),
        ("POST", "/api/v1/operator/platforms", PLATFORM | {"deployments": ["1"], "keys_url": "file:///etc/passwd"}),
        refused=True,
    ),
}  # fmt: skip
#: Operations with one interface, and why, or with tests of their own.
ELSEWHERE = {
    "people.enrol_new": "the page of one student; programs send a list",
    "people.issue_token": "the command; on the web everybody makes their own",
    "sign_in_links.make_members_link": "the command; on the web an instructor gets a link when they are added",
    "platforms.enrol_members": "test_lti.py, where there is a platform",
    "platforms.pass_back": "test_lti.py, where there is a platform",
    "sign_in_links.make_link": "a part of other operations",
    "sign_in_links.make_own_link": "the command that brings the service up",
    "sign_in.identify": "test_reach.py; pages and API, before anything else",
    "sign_in.note_use": "the API",
    "sign_in.sign_in": "test_sign_in.py; the page",
    "sign_in.sign_out": "test_sign_in.py; the page",
    "launches.begin": "test_lti.py; learning platforms",
    "launches.complete": "test_lti.py; learning platforms",
    "database.upgrade": "the command",
    "database.back_up": "the command",
    "database.restore": "the command",
    "database.remove_old": "the command",
    "replies.begin": "test_api.py; the API",
    "replies.keep": "test_api.py; the API",
    "replies.forget": "test_api.py; the API",
    "webhooks.create": "the API",
    "webhooks.revoke": "the API",
    "privacy.archive": "the command",
    "privacy.purge": "the command",
    "privacy.export_own": "the API",
}
#: How functions begin that change nothing.
READING = ("list_", "show_", "find", "search_", "export_student", "show", "check_", "count_", "load")
ROOMS = (
    assignments, courses, database, launches, people, platforms, policies, privacy, replies, sign_in, sign_in_links,
    stored_grades, webhooks,
)  # fmt: skip


@dataclass(frozen=True)
class Installation:
    """A course with Grace, its instructor, Ada and an assignment, which every action begins with."""

    web: Web
    tables: bytes
    values: dict[str, Any]
    browsers: dict[str, TestClient]
    tokens: dict[str, dict[str, str]]

    def restore(self) -> None:
        """Undo what the action before has changed."""
        self.web.store.engine.dispose()
        _database(self.web).write_bytes(self.tables)


@pytest.fixture(scope="module")
def installation(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Installation]:
    folder = tmp_path_factory.mktemp("courses")
    (folder / "people.csv").write_bytes(TABLE)
    with web_in(folder / "home") as web:
        members = {"grace": web.instructor(), "ada": web.student(), "root": web.operator()}
        with web.store.transaction() as session:
            open_assignments.prepare(session, 1, freeze(echo()))
        staff = {name: members[name] for name in ("grace", "root")}
        browsers = {name: web.browser(each) for name, each in staff.items()}
        tokens = {name: web.token(each, "read", "submit", "mark", "manage") for name, each in staff.items()}
        web.link(members["ada"])
        web.store.engine.dispose()
        values = {name: each.enrolment_id for name, each in members.items()} | {"folder": folder}
        yield Installation(web, _database(web).read_bytes(), values, browsers, tokens)


def _database(web: Web) -> Path:
    return web.settings.home / "robomark.db"


def test_every_operation_has_a_row() -> None:
    found = {
        f"{room.__name__.rpartition('.')[2]}.{name}"
        for room in ROOMS
        for name, each in vars(room).items()
        if inspect.isfunction(each) and each.__module__ == room.__name__ and not name.startswith(("_", *READING))
    }
    assert found == {each.operation for each in ACTIONS.values()} | set(ELSEWHERE)


@dataclass(frozen=True)
class Outcome:
    """What an operation leaves behind, and whether it was accepted."""

    accepted: bool
    added: list[Any]
    removed: list[Any]
    log: list[Any]


@pytest.mark.parametrize("name", ACTIONS)
def test_an_operation_is_the_same_by_every_interface(
    installation: Installation, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    action = ACTIONS[name]
    monkeypatch.setenv("ROBOMARK_HOME", str(installation.web.settings.home))
    outcomes = {
        interface: _outcome(installation, action, interface)
        for interface in ("page", "api", "command")
        if getattr(action, interface)
    }
    first = next(iter(outcomes.values()))
    assert outcomes == dict.fromkeys(outcomes, first)
    assert first.accepted is not action.refused
    assert bool(first.added or first.removed or first.log) is not action.refused


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
        "user add zoe --student",
        "user list",
    ],
)
def test_no_command_creates_a_course_from_a_mistyped_name(
    installation: Installation, monkeypatch: pytest.MonkeyPatch, line: str
) -> None:
    monkeypatch.setenv("ROBOMARK_HOME", str(installation.web.settings.home))
    installation.restore()
    before = _rows(installation.web)
    with pytest.raises(UsageError, match="there is no course called 'typo'"):
        _run(f"{line} --course typo", **installation.values)
    assert _rows(installation.web) == before


def _outcome(installation: Installation, action: Action, interface: str) -> Outcome:
    installation.restore()
    web, values = installation.web, installation.values
    who = "root" if "operator" in str(action.page or action.api) else "grace"
    before = _rows(web)
    if interface == "page":
        path, form = _filled(action.page, values)
        answer = submit(installation.browsers[who], path, form, files=action.files or None)
        accepted = answer.status_code in (200, 303)
    elif interface == "api":
        method, path, sent = _filled(action.api, values)
        answer = installation.browsers[who].request(method, path, json=sent, headers=installation.tokens[who])
        accepted = answer.is_success
    else:
        accepted = _is_accepted(action.command, values)
    after = _rows(web)
    with web.store.reading() as session:
        log = [(each.action, each.subject, each.subject_id, each.detail) for each in session.scalars(select(Audit))]
    added, removed = ([each for each in one if each not in other] for one, other in ((after, before), (before, after)))
    return Outcome(accepted, added, removed, log)


def _filled(request: Any, values: dict[str, Any]) -> Any:
    """The request with its placeholders replaced."""
    if isinstance(request, str) and "{" in request:
        return request.format(**values)
    if isinstance(request, tuple):
        return tuple(_filled(each, values) for each in request)
    return {name: _filled(each, values) for name, each in request.items()} if isinstance(request, dict) else request


def _is_accepted(line: str, values: dict[str, Any]) -> bool:
    try:
        _run(line, **values)
    except UsageError:
        return False
    return True


def _run(line: str, **values: Any) -> None:
    group, name, *rest = shlex.split(line.format(**values))
    load_command(group, name).main(rest, standalone_mode=False)


def _rows(web: Web) -> list[Any]:
    with web.store.reading() as session:
        return [
            (table.__name__, dict(_columns(row)))
            for table in TABLES
            for row in session.scalars(select(table))
            # Those of who asks change with every request.
            if not (isinstance(row, Credential) and row.kind is not CredentialKind.LINK)
        ]


def _columns(row: Base) -> Iterator[tuple[str, Any]]:
    """The values of a row; of moments that pass only whether there is one."""
    for column in row.__table__.columns:
        value = getattr(row, column.name)
        if column.name in PASSING:
            yield f"has {column.name}", value is not None
        elif column.name not in RANDOM and not (isinstance(row, Credential) and column.name == "id"):
            yield column.name, value
