"""Statements by command: a grade is verified from a file alone, and a simulator that moves differently is named."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import pytest
from sqlalchemy import select, update

import acting
from builders import opened, settings_in
from command import robomark
from service.commands import statement_rerun
from service.commands.statement_verification import VerificationOptions, verify_file
from service.grading.grader import grade
from service.operations import statements
from service.statements.facts import Fact, FactKind, commit_to_facts, open_fact
from service.statements.keys import dump_keys, generate_signing_key
from service.statements.statement import PredicateType, sign_statement
from service.statements.statement_file import LogPlace, StatementFile, parse_statement_file
from service.store.batches.intake import accept_batch
from service.store.grades import results
from service.store.installation import load_secret
from service.store.queue import jobs
from service.store.tables.submissions import Job
from sim.drive import Drive
from sim.errors import HostError, UsageError
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission
from submissions.grading_request import GradingRequest

ASSIGNMENT = "forwards-for-two-seconds"
PROGRAM = "tank_drive.on_for_seconds(SpeedPercent(30), SpeedPercent(30), 2)\n"


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a home, a submission, the statement on its published grade, and the keys."""
    folder = tmp_path_factory.mktemp("statements")
    (folder / "ada").mkdir()
    (folder / "ada" / "robot.py").write_text(PROGRAM, encoding="utf-8")
    assignment = find_assignment(ASSIGNMENT)
    submission = read_submission(folder / "ada", required_parts=assignment.parts)
    with opened(settings_in(folder / "home")) as store:
        accept_batch(store, "class", [GradingRequest(submission, assignment, "ada")], [], max_attempts=3)
        claim = jobs.claim_job(store, "worker", 60)
        assert claim is not None
        own_grade = grade(submission, assignment, secret=load_secret(store))
        jobs.finish_job(store, claim, results.prepare_grade(own_grade), datetime.now(UTC))
        acting.publish_one(store, claim.job_id)
        service, actor = acting.service_on(store), acting.machine()
        (folder / "keys.json").write_bytes(dump_keys(statements.list_keys(service)))
        (folder / "statement.json").write_bytes(statements.show_statement(service, actor, 1, claim.job_id).data)
    return folder


def _options(home: Path) -> VerificationOptions:
    return VerificationOptions(home / "keys.json", home / "ada", ASSIGNMENT)


def test_a_statement_is_verified_with_the_files_only(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    verify_file(home / "statement.json", _options(home))
    output = capsys.readouterr().out
    assert "run again, have the same recordings and give the same marks" in output
    assert "FAILED" not in output
    assert "student: ada" in output


def test_the_first_tick_and_field_that_differ_are_named(
    home: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    original_tick = Drive.tick

    def tick_aside(drive: Drive, clock: int) -> None:
        original_tick(drive, clock)
        drive.y += 0.5

    monkeypatch.setattr(Drive, "tick", tick_aside)
    with pytest.raises(HostError, match="checks failed"):
        verify_file(home / "statement.json", _options(home))
    output = capsys.readouterr().out
    assert "trial 1 " in output
    assert "differs first at tick 0 (0.033 s) in y: " in output


def test_another_submission_or_version_is_named(home: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "robot.py").write_text(PROGRAM + "say('hello')\n", encoding="utf-8")
    with pytest.raises(HostError):
        verify_file(home / "statement.json", replace(_options(home), submission=tmp_path))
    assert "FAILED the submission is another one" in capsys.readouterr().out
    with pytest.raises(HostError):
        verify_file(home / "statement.json", replace(_options(home), assignment="turn-through-a-right-angle"))
    assert "FAILED the assignment is another version" in capsys.readouterr().out


def test_other_marks_are_named(home: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def grade_worse(*args: object, **kwargs: object) -> object:
        original = grade(*args, **kwargs)  # type: ignore[arg-type]
        first, *others = original.criteria
        return replace(original, criteria=(replace(first, marks=first.marks / 2), *others))

    monkeypatch.setattr(statement_rerun, "grade_submission", grade_worse)
    with pytest.raises(HostError):
        verify_file(home / "statement.json", _options(home))
    assert "marks stated, " in capsys.readouterr().out


def test_marks_that_the_file_leaves_out_are_named(
    home: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = parse_statement_file((home / "statement.json").read_bytes())
    trials = tuple(each for each in file.facts if each.fact.kind is FactKind.TRIAL)
    (tmp_path / "statement.json").write_bytes(replace(file, facts=trials).to_bytes())
    with pytest.raises(HostError):
        verify_file(tmp_path / "statement.json", _options(home))
    assert ": no marks stated, " in capsys.readouterr().out


def test_values_of_a_file_are_printed_without_control_characters(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    key, marks = generate_signing_key(), "9\x1b[2K\nok     forged"
    fact = open_fact(Fact(FactKind.CRITERION, 1, {"id": ["a"], "title": "A", "marks": marks}), bytes(32))
    predicate = {"entry": 0, "commitments": commit_to_facts([fact])}
    envelope = sign_statement(key, PredicateType.GRADE, {"submission": "ab" * 32}, predicate)
    root = {"log": envelope.hash_as_leaf(bytes(32)).hex()}
    place = LogPlace("00" * 32, (), sign_statement(key, PredicateType.LOG_HEAD, root, {"size": 1}))
    (tmp_path / "own.json").write_bytes(StatementFile(envelope, (key.public_key,), place, (fact,)).to_bytes())
    verify_file(tmp_path / "own.json", VerificationOptions(None, None, None))
    assert "A: 9?[2K?ok     forged of None\n" in capsys.readouterr().out


def test_the_wrong_files_are_refused(home: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="needs --submission"):
        verify_file(home / "statement.json", VerificationOptions(None, None, ASSIGNMENT))
    with pytest.raises(UsageError, match=r"keys\.json: the file is no statement"):
        verify_file(home / "keys.json", VerificationOptions(None, None, None))
    with pytest.raises(UsageError, match=r"statement\.json: the file has no keys"):
        verify_file(home / "statement.json", VerificationOptions(home / "statement.json", None, None))
    with pytest.raises(UsageError, match="is not a file"):
        verify_file(tmp_path, VerificationOptions(None, None, None))


def test_a_copy_without_seeds_is_checked_but_not_repeated(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = replace(parse_statement_file((home / "statement.json").read_bytes()), seeds=None, columns={})
    (home / "own.json").write_bytes(file.to_bytes())
    verify_file(home / "own.json", replace(_options(home), assignment=None))
    with pytest.raises(HostError):
        verify_file(home / "own.json", _options(home))
    assert "FAILED the file has no seeds; ask staff for their copy" in capsys.readouterr().out


def test_the_log_is_filed_and_checked(home: Path, tmp_path: Path) -> None:
    run = partial(robomark, ROBOMARK_HOME=str(home / "home"))
    assert run("log", "head", "-o", tmp_path / "head.json").returncode == 0
    second = run("log", "head", "-o", tmp_path / "head.json")
    assert (second.returncode, "name a new file" in second.stderr) == (2, True)
    checked = run("log", "check", tmp_path / "head.json")
    assert (checked.returncode, checked.stderr) == (0, "")
    assert "1 entries, 1 published grades, 1 filed heads" in checked.stdout
    assert run("keys", "rotate").returncode == 0
    keys = json.loads(run("keys", "list", "--json").stdout)["keys"]
    assert [key["retired_at"] is None for key in keys] == [False, True]
    with opened(settings_in(home / "home")) as store, store.transaction() as session:
        marks = session.scalar(select(Job.marks))
        session.execute(update(Job).values(marks=99))
    found = run("log", "check", tmp_path / "head.json", "--json")
    assert found.returncode == 3
    (finding,) = json.loads(found.stdout)["findings"]
    assert "was changed: its total is not that of entry 0" in finding["sentence"]
    with opened(settings_in(home / "home")) as store, store.transaction() as session:
        session.execute(update(Job).values(marks=marks))
