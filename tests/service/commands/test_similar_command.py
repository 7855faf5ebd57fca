"""``robomark batch similar``: evidence for staff of similar code and behaviour, hidden from everybody else."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

import report_builders
from batch_command import robomark
from benchmarks.harness.disguises import DISGUISES
from builders import opened, prepared, settings_in
from responders.source_file import SourceFile
from service.commands.batch.similar import similar
from service.report_files import write_batch_reports
from service.reports.formats import FORMATS
from service.store.batches import job_lines
from service.store.batches.intake import accept_batch
from service.store.batches.similarities import find_similar_submissions
from service.store.engine import Store
from service.store.grades import results
from service.store.queue import jobs
from sim.errors import UsageError
from submissions.assignment.examples import locate_examples
from submissions.assignment.reader import find_assignment
from submissions.grading_request import GradingRequest
from submissions.submission import Submission

ASSIGNMENT = "rules-without-a-network"


def source(name: str, file: str) -> SourceFile:
    return SourceFile(file, (locate_examples(ASSIGNMENT) / name / file).read_text(encoding="utf-8"))


def submitted() -> list[Submission]:
    """Return submissions: Ada and zebedee share a responder except for formatting; the others have little in common."""
    program = source("reference", "robot.py")
    ada = Submission("ada", program, source("reference", "responder.py"))
    copy = DISGUISES["apply all"](source("reference", "responder.py").text)
    own = [
        Submission(f"s{number}", program, SourceFile("responder.py", f"def responder(text):\n    return {number}\n"))
        for number in range(8)
    ]
    return [ada, Submission("zebedee", program, SourceFile("responder.py", copy)), *own]


@pytest.fixture(scope="module")
def graded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, Store, str]]:
    """Return a home with a graded batch. The robots of ada and zebedee drove the same way, the others differently."""
    home = tmp_path_factory.mktemp("home")
    assignment = find_assignment(ASSIGNMENT)
    requests = [GradingRequest(each, assignment, f"{each.student}.zip") for each in submitted()]
    with opened(settings_in(home)) as store:
        batch = accept_batch(store, "<class>", requests, [], max_attempts=2).id
        for number, _ in enumerate(requests):
            claim = jobs.claim_job(store, "worker", 60)
            assert claim is not None
            with store.reading() as session:
                student = job_lines.load_job_line(session, claim.job_id).student
            seconds = 30 if student in ("ada", "zebedee") else 40 + number
            grade = replace(report_builders.line_follower_grade(seconds), student=student)
            jobs.finish_job(store, claim, prepared(grade), datetime.now(UTC))
        yield home, store, batch


def test_who_wrote_and_did_the_same_is_one_pair_with_all_its_evidence(graded: tuple[Path, Store, str]) -> None:
    _, store, batch = graded
    with store.reading() as session:
        lines = job_lines.load_job_lines(session, batch)
    (similar_submissions,) = find_similar_submissions(store, lines)
    (pair,) = similar_submissions.pairs
    assert pair.students == ("ada", "zebedee")
    assert [each.files for each in pair.sources] == [("responder.py", "responder.py")]
    assert {(each.trial.scenario, each.aspect) for each in pair.trials} >= {
        ("plain", "path"),
        ("with-obstacle", "path"),
    }
    assert similar_submissions.too_short == tuple(f"s{number}" for number in range(8))
    given = find_similar_submissions(store, lines, locate_examples(ASSIGNMENT) / "reference" / "responder.py")
    assert [each.sources for each in given[0].pairs] == [()]


def test_the_command_shows_a_table_and_writes_a_page(
    graded: tuple[Path, Store, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    home, _, batch = graded
    monkeypatch.setenv("ROBOMARK_HOME", str(home))
    monkeypatch.setenv("COLUMNS", "200")
    similar(batch, output=tmp_path)
    out = capsys.readouterr().out
    assert f"{ASSIGNMENT}: 1 similar pair among 10 students; 8 students have too little" in out
    assert [line.split()[:2] for line in out.splitlines() if line.startswith("ada")] == [["ada", "zebedee"]]
    page = (tmp_path / "similar.html").read_text(encoding="utf-8")
    assert "Similar submissions in &lt;class&gt;" in page
    assert "across, down = shape.sum" in page
    with pytest.raises(
        UsageError, match=r"nowhere: cannot be read \(No such file or directory\), expected Python files"
    ):
        similar(batch, given=tmp_path / "nowhere")


def test_json_is_all_that_is_printed(graded: tuple[Path, Store, str]) -> None:
    home, _, batch = graded
    document = json.loads(robomark(home, "batch", "similar", batch, "--json").out)
    assert [pair["students"] for pair in document["assignments"][0]["pairs"]] == [["ada", "zebedee"]]


def test_no_report_and_no_format_has_anything_of_it(graded: tuple[Path, Store, str], tmp_path: Path) -> None:
    _, store, batch = graded
    with store.reading() as session:
        lines = job_lines.load_job_lines(session, batch)
        grades = [results.load_grade(session, line.id) for line in lines]
    for line, grade in zip(lines, grades, strict=True):
        if line.student == "ada":
            documents = [form.document(grade) for form in FORMATS.values() if form.document is not None]
            write_batch_reports(store, "class", [line], [], tmp_path)
            documents += [path.read_text(encoding="utf-8") for path in tmp_path.iterdir()]
            assert len(documents) > 3
            assert not any("zebedee" in text for text in documents)
