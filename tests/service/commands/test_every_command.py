"""Properties of every command: it is listed and loads, its JSON has the same content, and a pipe gets plain lines."""

from __future__ import annotations

import json
import re
import shutil
import sqlite3
import subprocess
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select

from builders import echo, grading_request, release_at_once
from command import robomark
from paths import ROOT
from report_builders import faulty_grade, shape_grade
from service.command_line import load_command
from service.command_table import COMMANDS, Command, CommandGroup
from service.settings import Settings
from service.store.batches import publishing
from service.store.batches.intake import accept_batch
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import freeze_assignment
from service.store.engine import now, open_store
from service.store.grades import appeals, comments, overrides, results
from service.store.installation import load_secret
from service.store.people import webhooks
from service.store.people.membership import make_instructor
from service.store.queue import jobs
from service.store.statement_log import list_keys
from service.store.states import JobState
from service.store.tables.submissions import Job
from service.store.webhook_events import WebhookEvent
from submissions.assignment.examples import locate_examples
from submissions.student_identity import RejectedSubmission, Student


def _all() -> Iterator[tuple[tuple[str, ...], Command]]:
    for name, listed in COMMANDS.items():
        if isinstance(listed, CommandGroup):
            yield from (((name, below), command) for below, command in listed.commands.items())
        else:
            yield (name,), listed


ALL = dict(_all())
#: For each command with output, a line that runs here, and the keys of its document except "schema".
SHOWING = {
    "batch list": "batches",
    "batch status BATCH": "batch pace jobs changes changes_summary ranks unpublished_regrades statistics history",
    "batch submit new -a echo-responder": "batch queued known refusals",
    "batch similar BATCH": "assignments",
    "batch luck BATCH": "batch assignments",
    "batch pause BATCH": "batch changed waiting running",
    "batch resume BATCH": "batch changed waiting running",
    "batch cancel BATCH": "batch changed waiting running",
    "batch retry --all": "batch queued outdated",
    "batch regrade BATCH": "batch regraded",
    "batch publish BATCH": "batch published",
    "batch publish-one GRADE": "grade published",
    "batch publish-preview BATCH": "batch publication students completion_seconds",
    "batch regrade-one GRADE": "grade job",
    "batch grade-over-limit OVER": "grade",
    "batch overview BATCH": "batch classes missing refusals",
    "batch moderation BATCH -o sheet.html": "batch assignment output bytes",
    "assignments list": "assignments",
    "assignments show echo-responder": (
        "id title section description version marks background robot program responder given criteria scenarios"
    ),
    "assignments new task": "output",
    "assignments export echo-responder -o exported": "output files",
    "assignments autograder echo-responder -o autograder": "output",
    "models list": "models",
    "models compare digits digits-28": "models curves",
    "show GRADE": "job grade",
    "statement GRADE -o statement.json": "grade output bytes",
    "log head -o head.json": "output entries start root_sha256",
    "log check": "entries grades older_grades filed_heads findings",
    "keys list": "keys",
    "keys rotate": "key public_key",
    "keys revoke KEY": "key revoked_at",
    "mark set GRADE asks-aloud 1.5 --reason heard": "job",
    "mark excuse GRADE asks-aloud --reason ill": "job",
    "mark withdraw GRADE names-the-right-shape": "job",
    "mark comment GRADE good --criterion asks-aloud": "job",
    "mark uncomment GRADE 1": "job",
    "mark history GRADE": "grade criteria comments history",
    "appeals list": "appeals",
    "appeals answer 1 yes": "appeal",
    "course list": "courses",
    "course gradebook": "assignments students",
    "course hide-names echo-responder": "assignment names_hidden",
    "course show-names echo-responder": "assignment names_hidden",
    "course policy": "policies counted_attempt completion_rule",
    "course extend ada -a echo-responder --more-attempts 1": "student assignment due more_attempts",
    "course enrol people.csv": "students",
    "course prepare echo-responder": "assignment title open opened_at closed_at version",
    "course open echo-responder": "assignment title open opened_at closed_at version",
    "course close echo-responder": "assignment title open opened_at closed_at version",
    "course remove echo-responder": "assignment",
    "course export-student ada -o ada-all.zip": "student output bytes",
    "course delete-student cyd --for-good": "submissions grades",
    "course purge --older-than 9000": "removed archive submissions grades students",
    "user add grace --name Grace": "id path url",
    "user link ada": "id path url",
    "user links": "links",
    "user token ada --scope read": "id token scopes days",
    "user list": "people",
    "user sign-out ada": "id ended",
    "user join linus --same-as tess --of other": "id course same_as of",
    "user remove linus": "id course",
    "webhook add https://hooks.example.org/ --event batch.finished": "webhook secret",
    "webhook list": "webhooks",
    "webhook remove HOOK": "webhook",
    "webhook deliveries": "deliveries",
    (
        "platform add Moodle --issuer https://m.example.org --client x --deployment 1 --login-url https://m.example.org/l"
        " --token-url https://m.example.org/t --keys-url https://m.example.org/k"
    ): "platform",
    "platform list": "platforms",
    "db upgrade": "revision",
    "db backup copy.db": "file bytes",
    "db purge --before 2020-01-01": "removed archive submissions grades students",
}
#: The same for commands that run student code or draw.
LONG = {
    "run robot.py": "run notes",
    "assignments check echo-responder": "assignments statistics",
    "models evaluate shapes": "name measured same",
    "floors -o floors": "page floors",
    "sandbox check": (
        "kernel robot_programs responders no_bubblewrap_because no_control_group_because trials_remember_because"
    ),
    "doctor": "findings",
    "batch submit new -a echo-responder --wait": "batch queued known refusals jobs statistics report",
    "demo -o demo": "batch queued known refusals jobs statistics report",
}
#: Commands without such a row: they use the format ``json``, verify real grades, or need an empty database, a minute,
#: or a learning platform that answers.
_ELSEWHERE = {
    *{("grade",), ("batch", "export"), ("verify",), ("db", "restore"), ("models", "train")},
    *{("platform", "enrol"), ("platform", "send-marks")},
}
_CASES = [
    *(pytest.param(line, keys, id=line) for line, keys in SHOWING.items()),
    *(pytest.param(line, keys, id=line, marks=pytest.mark.long) for line, keys in LONG.items()),
]
_LONG = "very " * 40 + "long"
_BOXES_AND_ESCAPES = re.compile(r"[\u2500-\u259f\x1b]")


def test_every_command_that_shows_something_is_tried_here() -> None:
    tried = {words for line in {**SHOWING, **LONG} for words in ALL if tuple(line.split()[: len(words)]) == words}
    assert tried | _ELSEWHERE == {words for words, command in ALL.items() if not command.serves}


def test_the_table_of_keys_for_instructors_has_every_command_and_key() -> None:
    rows = {}
    table = (ROOT / "docs" / "instructors.md").read_text(encoding="utf-8").partition("| command | keys |")[2]
    for row in table.partition("\n\n")[0].splitlines():
        names, _, keys = row.strip("|").partition("|")
        first, *more = re.findall(r"`([a-z-]+(?: [a-z-]+)?)`", names) or [""]
        for name in (first, *(f"{first.partition(' ')[0]} {each}" for each in more)):
            rows[name] = {word for code in re.findall("`([^`]*)`", keys) for word in code.split()}
    for line, keys in {**SHOWING, **LONG}.items():
        (name,) = (" ".join(words) for words in ALL if tuple(line.split()[: len(words)]) == words)
        # The demonstration's keys are in the row of ``submit``.
        if name != "demo":
            assert set(keys.split()) <= rows.get(name, set()), name


def test_every_command_that_is_listed_can_be_loaded_and_is_listed_whole() -> None:
    for words in ALL:
        assert load_command(*words).help, words
    text = robomark("--help").stdout + "".join(robomark(name, "--help").stdout for name in ("batch", "assignments"))
    output = " ".join(text.split())
    groups = (COMMANDS["batch"], COMMANDS["assignments"])
    for listed in (*COMMANDS.values(), *(each for group in groups for each in group.commands.values())):  # type: ignore[union-attr]
        assert (listed.summary in output) is not (isinstance(listed, Command) and listed.hidden)


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """Return a home with a batch of two graded submissions, one waiting and one refused, and the ids in it."""
    folder = tmp_path_factory.mktemp("home")
    refused = [RejectedSubmission("[red]odd.txt", f"is {_LONG} and no submission", Student("eve"))]
    with open_store(Settings(home=folder)) as store:
        requests = [grading_request(student, assignment=echo()) for student in ("ada", "bob", "cyd")]
        batch = accept_batch(store, "class", requests, refused, max_attempts=2)
        release_at_once(store)
        with store.transaction() as session:
            open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
            for course, who in (("default", "linus"), ("other", "tess")):
                make_instructor(session, course, Student(who))
        grades = []
        for grade in (shape_grade(wrong=2), faulty_grade()):
            claim = jobs.claim_job(store, "worker", 60)
            assert claim is not None
            with store.reading() as session:
                at = now(session)
            own = replace(grade, secret_sha256=load_secret(store).sha256)
            jobs.finish_job(store, claim, results.prepare_grade(own), at)
            grades.append(claim.job_id)
        with store.transaction() as session:
            overrides.set_marks(session, grades[0], "names-the-right-shape", Decimal(6), "seen again", "staff")
            comments.add_comment(session, grades[0], "", "Well done.", "staff")
            appeals.open_appeal(session, session.get_one(Job, grades[0]).submission_id, "Why?")
            (waiting,) = session.scalars(select(Job.id).where(Job.state == JobState.QUEUED))
            jobs.put_aside_job(session, waiting, now(session))
            publishing.publish_grade(session, grades[0], actor="staff")
            (key,) = list_keys(session)
            hook, _ = webhooks.create_webhook(session, 1, "https://hooks.example.org/", [WebhookEvent.BATCH_FINISHED])
    return folder, {"BATCH": batch.id, "GRADE": grades[0], "OVER": waiting, "HOOK": hook.id, "KEY": key.key.id}


@pytest.mark.long
@pytest.mark.parametrize(("line", "keys"), _CASES)
def test_a_command_tells_the_same_in_words_and_as_a_document(
    line: str, keys: str, home: tuple[Path, dict[str, str]], tmp_path: Path
) -> None:
    database, ids = home
    words = [ids.get(word, word) for word in line.split()]
    plain, document = (_ended(tmp_path / option, database, *words, option) for option in ("--quiet", "--json"))
    assert plain.stderr == ""
    assert plain.stdout.strip()
    assert not _BOXES_AND_ESCAPES.search(plain.stdout), plain.stdout
    json_document = json.loads(document.stdout)
    assert json_document["schema"] == 1
    assert json_document.keys() == {"schema", *keys.split()}


def test_a_pipe_gets_whole_names_and_a_row_a_line(home: tuple[Path, dict[str, str]], tmp_path: Path) -> None:
    database, ids = home
    ended = _ended(tmp_path / "at work", database, "batch", "status", ids["BATCH"], COLUMNS="40", FORCE_COLOR="")
    row = next(line for line in ended.stdout.splitlines() if line.startswith("eve"))
    assert f"[red]odd.txt: is {_LONG} and no submission" in row


def test_no_command_has_another_meaning_for_the_assignments_letter_or_another_name_for_where_files_go() -> None:
    for words in ALL:
        options = {name: option.name for option in load_command(*words).params for name in option.opts}
        assert options.get("-a", "assignment") == "assignment", words
        assert not {"--out", "--into", "--folder"} & options.keys(), words
        assert "--report" not in options or words == ("grade",), words


def _ended(folder: Path, database: Path, *words: str, **environment: Any) -> subprocess.CompletedProcess[str]:
    """Run the command in a folder with the files that the lines name, on a copy of the database."""
    folder.mkdir()
    home = folder / "home"
    shutil.copytree(database, home)
    # Doctor reports jobs that have waited for minutes, and earlier tests can take minutes.
    with closing(sqlite3.connect(Settings(home=home).database.removeprefix("sqlite:///"))) as connection, connection:
        at = "strftime('%Y-%m-%d %H:%M:%f000', 'now')"
        connection.execute(f"UPDATE job SET queued_at = {at}, due_at = {at} WHERE state = 'queued'")
    shutil.copytree(locate_examples("echo-responder") / "reference", folder / "new" / "dan")
    (folder / "robot.py").write_text("print('hello')\n")
    (folder / "people.csv").write_text("id,name,email\nada,Ada Lovelace,ada@example.org\n")
    ended = robomark(*words, folder=folder, ROBOMARK_HOME=str(home), **environment)
    assert ended.returncode == 0, ended
    return ended
