"""Every operation on grades, appeals, submissions, test runs and assignments, through page, API and command.

Each interface goes through the same steps on a world of its own. After each step the stored rows, the log entries and
what the workers are notified of have to be those of the other interfaces, and each refuses what the others refuse.
"""

from __future__ import annotations

import io
import re
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select

import report_builders
from acting import Notices
from service.command_line import load_command
from service.commands import operating
from service.operations import appeals, assignment_uploads, assignments, grades, regrades, submissions, test_runs
from service.store.engine import Store
from service.store.ids import ALPHABET, LENGTH
from service.store.models import Audit, Base, Job
from service.store.web_tables import Appeal, Comment, OpenAssignment, Override, Tryout
from sim.errors import UsageError
from submissions.assignment.export import write_new
from web import Web, csrf, web_in
from web_world import World, make_world
from zips import zipped

CRITERION = report_builders.faulty_grade().criteria[0].id
PROGRAM, RESPONDER = "print('hello')\n", "def responder(msg):\n    return msg\n"
INTERFACES = ("page", "api", "command")
_TABLES: tuple[type[Base], ...] = (Appeal, Comment, Job, OpenAssignment, Override, Tryout)
#: Times, random ids, who did it, and what a process or a machine measured.
_UNEQUAL = frozenset(
    {"id", "actor", "packed", "process", "published_by", "grader_version", "phases", "secret_sha256", "cache_key"}
)


@dataclass(frozen=True, slots=True)
class Step:
    """One request through each interface that has it.

    ``page`` and ``api`` are the path and what is sent; ``command`` are its words, and empty where ``alone`` says why
    there is no command. ``refused`` is the HTTP status and what each interface says.
    """

    name: str
    operation: object
    page: tuple[str, dict[str, Any]]
    api: tuple[str, str, dict[str, Any] | None]
    command: tuple[str, ...] = ()
    alone: str = ""
    who: str = "grace"
    refused: tuple[int, str] | None = None
    files: dict[str, str] = field(default_factory=dict)


_GRADE = "grades/{job}"
_MARKING = f"{_GRADE}/marking"
_A_STUDENTS = "students have no commands on the machine"
_NO_COMMAND = "there is no command for one grade yet"
_ECHO = "mine/echo-responder"
_BOTH = {"robot.py": PROGRAM, "responder.py": RESPONDER}


def _set(name: str, marks: str, reason: str, seen: int, refused: tuple[int, str] | None = None) -> Step:
    return Step(
        name,
        grades.set_marks,
        (f"{_MARKING}/set", {"criterion": CRITERION, "marks": marks, "reason": reason, "seen": seen}),
        ("PUT", f"{_MARKING}/{CRITERION}", {"marks": marks, "reason": reason, "seen": seen}),
        ("mark", "set", "{job}", CRITERION, marks, "--reason", reason, "--seen", str(seen)),
        refused=refused,
    )


def _excuse(name: str, criterion: str, seen: int, refused: tuple[int, str] | None = None) -> Step:
    return Step(
        name,
        grades.set_marks,
        (f"{_MARKING}/excuse", {"criterion": criterion, "reason": "was ill", "seen": seen}),
        ("PUT", f"{_MARKING}/{criterion}", {"marks": None, "reason": "was ill", "seen": seen}),
        ("mark", "excuse", "{job}", criterion, "--reason", "was ill", "--seen", str(seen)),
        refused=refused,
    )


def _withdraw(name: str, job: str = "{job}", seen: int = 2, refused: tuple[int, str] | None = None) -> Step:
    path = _MARKING.replace("{job}", job)
    return Step(
        name,
        grades.withdraw,
        (f"{path}/withdraw", {"criterion": CRITERION, "seen": seen}),
        ("DELETE", f"{path}/{CRITERION}?seen={seen}", None),
        ("mark", "withdraw", job, CRITERION, "--seen", str(seen)),
        refused=refused,
    )


def _comment(name: str, text: str, criterion: str = "", refused: tuple[int, str] | None = None) -> Step:
    return Step(
        name,
        grades.comment,
        (f"{_MARKING}/comment", {"text": text, "criterion": criterion}),
        ("POST", f"{_GRADE}/comments", {"text": text, "criterion": criterion}),
        ("mark", "comment", "{job}", text, "--criterion", criterion),
        refused=refused,
    )


def _uncomment(name: str, number: int, refused: tuple[int, str] | None = None) -> Step:
    return Step(
        name,
        grades.withdraw_comment,
        (f"{_MARKING}/uncomment", {"comment_id": number}),
        ("DELETE", f"{_GRADE}/comments/{number}", None),
        ("mark", "uncomment", "{job}", str(number)),
        refused=refused,
    )


def _answer(name: str, number: int, refused: tuple[int, str] | None = None) -> Step:
    return Step(
        name,
        appeals.answer,
        (f"appeals/{number}/answer", {"text": "It is right."}),
        ("POST", f"appeals/{number}/answer", {"text": "It is right."}),
        ("appeals", "answer", str(number), "It is right."),
        refused=refused,
    )


def _ask(name: str, text: str, refused: tuple[int, str] | None = None) -> Step:
    return Step(
        name,
        appeals.ask,
        ("mine/submissions/1/appeal", {"text": text}),
        ("POST", "mine/submissions/1/appeals", {"text": text}),
        alone=_A_STUDENTS,
        who="ada",
        refused=refused,
    )


def _send(name: str, operation: object, files: dict[str, str], refused: tuple[int, str] | None = None) -> Step:
    is_submit = operation is submissions.submit
    path = "mine/submissions" if is_submit else "mine/tryouts"
    return Step(
        name,
        operation,
        (_ECHO if is_submit else f"{_ECHO}/try", {}),
        ("POST", f"{path}?assignment=echo-responder", None),
        alone=_A_STUDENTS,
        who="ada",
        files=files,
        refused=refused,
    )


def _course(name: str, operation: object, action: str, refused: tuple[int, str] | None = None) -> Step:
    method, path = ("DELETE", "") if action == "remove" else ("POST", f"/{action}")
    return Step(
        name,
        operation,
        (f"assignments/shape-recognition/{action}", {}),
        (method, f"assignments/shape-recognition{path}", None),
        ("course", action, "shape-recognition"),
        refused=refused,
    )


STEPS = (
    _set("set marks", "1", "seen again", 0),
    _set("set marks that have changed", "2", "seen again", 0, (409, "Somebody else changed the marks")),
    _set("set too many marks", "1000", "seen again", 1, (422, "expected 0 to")),
    _set("set marks without a reason", "2", "  ", 1, (422, "the reason has 0 characters")),
    _excuse("excuse", CRITERION, 1),
    _excuse("excuse what there is not", "other", 0, (422, "has no criterion")),
    _withdraw("withdraw what has changed", seen=1, refused=(409, "Somebody else changed the marks")),
    _withdraw("withdraw"),
    _withdraw("withdraw nothing", refused=(422, "is set by hand")),
    _comment("comment", "Well done."),
    _comment("comment on a criterion", "Look there.", CRITERION),
    _comment("comment on what there is not", "Look there.", "other", (422, "has no criterion")),
    _comment("comment without text", "  ", refused=(422, "the comment has 0 characters")),
    _uncomment("withdraw a comment", 1),
    _uncomment("withdraw a comment again", 1, (422, "has no comment 1")),
    _answer("answer an appeal", 1),
    _answer("answer an appeal again", 1, (422, "is answered already")),
    _answer("answer no appeal", 7, (422, "there is no appeal 7")),
    _ask("appeal", "And now?"),
    _ask("appeal twice", "And now?", (422, "you have asked already")),
    Step(
        "publish",
        regrades.publish_one,
        (f"{_GRADE}/publish", {"anyway": "true"}),
        ("POST", f"{_GRADE}/publish", {"anyway": True}),
        alone=_NO_COMMAND,
    ),
    Step(
        "regrade",
        regrades.regrade_one,
        (f"{_GRADE}/regrade", {}),
        ("POST", f"{_GRADE}/regrades", {}),
        alone=_NO_COMMAND,
    ),
    Step(
        "regrade for another assignment",
        regrades.regrade_one,
        (f"{_GRADE}/regrade", {"assignment": "shape-recognition"}),
        ("POST", f"{_GRADE}/regrades", {"assignment": "shape-recognition"}),
        alone=_NO_COMMAND,
        refused=(422, "this submission is for"),
    ),
    Step(
        "grade what is over no limit",
        regrades.grade_over_limit,
        (f"{_GRADE}/grade-over-limit", {}),
        ("POST", f"{_GRADE}/over-limit", None),
        alone=_NO_COMMAND,
        refused=(409, "does not wait for staff"),
    ),
    _send("submit", submissions.submit, _BOTH),
    _send("submit nothing", submissions.submit, {}, (422, "nothing was sent")),
    _send("submit an empty program", submissions.submit, _BOTH | {"robot.py": " "}, (422, "is empty")),
    _withdraw("withdraw before there is a grade", "{queued}", refused=(409, "has no grade")),
    _send("start a test run", test_runs.start, _BOTH),
    _send("start two test runs", test_runs.start, _BOTH, (422, "is not through yet")),
    Step(
        "prepare",
        assignment_uploads.prepare_from_catalogue,
        ("assignments", {"assignment": "shape-recognition"}),
        ("POST", "assignments", {"assignment": "shape-recognition"}),
        ("course", "prepare", "shape-recognition"),
    ),
    _course("open", assignments.open_for_students, "open"),
    _course("remove what students have been shown", assignments.remove, "remove", (422, "have been shown it")),
    _course("close", assignments.close, "close"),
    Step(
        "hide names",
        assignments.hide_names,
        ("assignments/shape-recognition/names", {"hidden": "true"}),
        ("POST", "assignments/shape-recognition/names", {"names_hidden": True}),
        alone="commands show every name, and have no use for it",
    ),
    Step(
        "preview",
        assignment_uploads.preview,
        ("assignments/shape-recognition/preview", {}),
        ("POST", "assignments/shape-recognition/preview", None),
        alone="a preview is a submission of an instructor's own, and commands have no person",
    ),
    Step(
        "upload",
        assignment_uploads.upload,
        ("assignments/uploads", {}),
        ("POST", "assignments/uploads", None),
        alone="commands prepare folders",
        files={"mine.zip": ""},
    ),
)


@dataclass(frozen=True, slots=True)
class Seen:
    """What one step left behind, and how it was refused."""

    rows: list[str]
    log: list[Any]
    notices: list[tuple[str, int]]
    status: int  # of HTTP; 0 for commands that did what they should
    said: str


@dataclass(frozen=True, slots=True)
class Driver:
    """One interface to a world of its own."""

    web: Web
    world: World
    notices: Notices
    folder: Path

    def page(self, step: Step) -> tuple[int, str]:
        browser = self.web.browser(self.world.grace if step.who == "grace" else self.world.ada)
        path, data = step.page
        word = {"csrf": csrf(browser.get("/account"))}
        answer = browser.post(self._here(path), data=data | word, files=self._parts(step, "file") or None)
        return answer.status_code, answer.text

    def api(self, step: Step) -> tuple[int, str]:
        member = self.world.grace if step.who == "grace" else self.world.ada
        method, path, sent = step.api
        options: dict[str, Any] = {"headers": self.web.token(member, "read", "submit", "mark", "manage")}
        if "mine.zip" in step.files:
            options["content"] = self._own_assignment()
            options["headers"] |= {"content-type": "application/zip"}
        elif path.startswith("mine/") and sent is None:
            options["files"] = self._parts(step, "file") or [("nothing", (None, ""))]
        else:
            options["json"] = sent
        answer = self.web.browser().request(method, f"/api/v1{self._here(path)}", **options)
        return answer.status_code, answer.text

    def command(self, step: Step) -> tuple[int, str]:
        words = [self._filled(word) for word in step.command]
        try:
            load_command(*words[:2]).main(words[2:], standalone_mode=False)
        except UsageError as error:
            return 2, str(error)
        return 0, ""

    def seen(self, status: int, said: str, logged: int) -> Seen:
        with self.web.store.reading() as session:
            rows = [
                f"{table.__tablename__} {_plain(row)}" for table in _TABLES for row in session.scalars(select(table))
            ]
            entries = session.scalars(select(Audit).where(Audit.id > logged).order_by(Audit.id)).all()
            log = [_same([each.action, each.subject, each.subject_id, each.detail]) for each in entries]
        notices = list(self.notices.sent)
        self.notices.sent.clear()
        return Seen(sorted(rows), log, notices, status, said)

    def _here(self, path: str) -> str:
        return f"/courses/1/{self._filled(path)}"

    def _filled(self, text: str) -> str:
        if "{queued}" in text:
            with self.web.store.reading() as session:
                queued = session.scalars(select(Job.id).where(Job.submission_id == 2)).one()
            text = text.replace("{queued}", queued)
        return text.replace("{job}", self.world.values["job_id"])

    def _parts(self, step: Step, single: str) -> list[tuple[str, tuple[str, io.BytesIO]]]:
        if "mine.zip" in step.files:
            return [(single, ("mine.zip", io.BytesIO(self._own_assignment())))]
        return [("files", (name, io.BytesIO(text.encode()))) for name, text in step.files.items()]

    def _own_assignment(self) -> bytes:
        folder = self.folder / "mine"
        if not folder.exists():
            write_new(folder)
        return zipped({f"mine/{each.name}": each.read_bytes() for each in folder.iterdir() if each.is_file()})


def _plain(row: Base) -> str:
    """A row without what differs from one world to the next: times, random ids, and who did it."""
    columns = {column.key: getattr(row, column.key) for column in row.__table__.columns}
    return str({key: _same(value) for key, value in columns.items() if key not in _UNEQUAL})


def _same(value: Any) -> Any:
    if isinstance(value, datetime):
        return "a time"
    if isinstance(value, dict):
        return {key: _same(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_same(each) for each in value]
    if isinstance(value, str) and re.fullmatch(f"[{ALPHABET}]{{{LENGTH}}}", value):
        return "an id"
    return "bytes" if isinstance(value, bytes) else value


def _last_entry(store: Store) -> int:
    with store.reading() as session:
        return session.scalar(select(Audit.id).order_by(Audit.id.desc()).limit(1)) or 0


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], Seen]:
    """What each step left behind, by interface and step."""
    found: dict[tuple[str, str], Seen] = {}
    with pytest.MonkeyPatch.context() as patch:
        for interface in INTERFACES:
            home = tmp_path_factory.mktemp(interface)
            with web_in(home) as web:
                notices = Notices()
                context = web.app.state.context
                web.app.state.context = replace(context, service=replace(context.service, notifier=notices))
                patch.setenv("ROBOMARK_HOME", str(home))
                patch.setattr(operating, "_LateNotifier", lambda _settings, _store, to=notices: to)
                driver = Driver(web, make_world(web), notices, home / "made")
                for step in STEPS:
                    logged = _last_entry(web.store)
                    # What has no command is done by the page, so that the worlds stay the same.
                    how = "page" if interface == "command" and step.alone else interface
                    status, said = getattr(driver, how)(step)
                    found[interface, step.name] = driver.seen(status, said, logged)
    return found


@pytest.mark.parametrize("step", STEPS, ids=lambda step: step.name)
def test_page_api_and_command_do_and_refuse_the_same(seen: dict[tuple[str, str], Seen], step: Step) -> None:
    page, api, command = (seen[interface, step.name] for interface in INTERFACES)
    if step.refused is None:
        assert page.status == 303, page.said
        assert api.status in (200, 201, 204), api.said
        assert command.status in (0, 303), command.said
    else:
        status, sentence = step.refused
        assert (page.status, api.status) == (status, status), (page.said, api.said)
        assert command.status in (2, status)
        for each in (page, api, command):
            assert sentence.casefold() in each.said.casefold()
            assert (each.log, each.notices) == ([], [])
    assert page.rows == api.rows == command.rows
    assert page.log == api.log == command.log
    assert page.notices == api.notices == command.notices


def test_steps_that_change_something_leave_a_row_an_entry_or_a_notice(seen: dict[tuple[str, str], Seen]) -> None:
    before: list[str] = []
    for step in STEPS:
        left = seen["api", step.name]
        if step.refused is None:
            assert left.rows != before or left.log or left.notices, step.name
        before = left.rows


def test_every_operation_has_a_step_and_every_step_without_a_command_says_why() -> None:
    modules = (appeals, assignment_uploads, assignments, grades, submissions, test_runs)
    reading = re.compile("show|list|find|load|sending|reference_of|prepare$")
    operations = {
        each
        for module in modules
        for name, each in vars(module).items()
        if getattr(each, "__module__", "") == module.__name__
        and callable(each)
        and name[0].islower()
        and not reading.match(name)
    }
    of_one_grade = {regrades.publish_one, regrades.regrade_one, regrades.grade_over_limit}
    assert operations | of_one_grade == {step.operation for step in STEPS}
    assert all(bool(step.command) != bool(step.alone) for step in STEPS)
