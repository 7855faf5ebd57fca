"""Files made from a stored grade: which data of another grade they contain, and for whom."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest
from PIL import Image

import acting
import report_builders as build
from builders import grading_request, prepared
from replays import data_of, parting_grade
from service.grading.grade import Grade
from service.report_files import (
    render_each_report,
    write_batch_reports,
    write_grade_film,
    write_grade_replay,
    write_report,
)
from service.reports.view import View, build_student_view
from service.store.batches import batches, job_lines
from service.store.batches.intake import accept_batch
from service.store.batches.job_lines import JobLine
from service.store.courses import policies
from service.store.courses.policies import PolicyLimits
from service.store.engine import Store, now
from service.store.grades import results
from service.store.people.students import ensure_course
from service.store.queue import jobs
from sim.errors import UsageError


def stored(store: Store, student: str, program: int, grade: Grade) -> tuple[JobLine, str]:
    """Store the grade for a student's submission; return its job and its batch."""
    taken = accept_batch(store, "class", [grading_request(student, f"print({program})\n")], [], max_attempts=3)
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    jobs.finish_job(store, claim, prepared(grade), datetime.now(UTC))
    return line_of(store, taken.jobs[0].job_id), taken.id


def line_of(store: Store, job_id: str) -> JobLine:
    with store.reading() as session:
        return job_lines.load_job_line(session, job_id)


def replay_over(store: Store, line: JobLine, over: JobLine, folder: Path) -> dict[str, object]:
    """Return the other trial beside the first one, in the replay of one grade compared with another."""
    with store.reading() as session:
        grade = results.load_grade(session, line.id)
    write_grade_replay(store, line, grade, folder / "replay.json", over)
    return dict(json.loads((folder / "replay.json").read_text())["trials"][0]["over"])


def test_a_report_that_cannot_be_rendered_does_not_stop_those_of_other_students(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def render_for_bob(view: View, *_: object) -> str:
        if view.grade.student == "ada":
            raise OverflowError("too large")
        return "the report"

    monkeypatch.setattr("service.report_files.render_report_page", render_for_bob)
    monkeypatch.setattr("service.report_files.draw_plots", lambda *_: {})
    grade = build.line_follower_grade()
    lines = [
        stored(store, student, number, replace(grade, student=student))[0]
        for number, student in enumerate(("ada", "bob"))
    ]
    write_batch_reports(store, "class", lines, [], tmp_path)
    assert (tmp_path / "bob.html").read_text() == "the report"
    page = (tmp_path / "ada.html").read_text()
    assert "This report cannot be shown" in page
    assert f"{grade.marks:g} of {grade.max_marks:g} marks" in page
    assert [str(each.exc_info[1]) for each in caplog.records if each.exc_info] == ["too large"]
    with store.reading() as session:
        views = [(each.id, build_student_view(results.load_grade(session, each.id))) for each in lines]
        pages = [page for *_, page in render_each_report(session, sorted(views), [each.id for each in lines])]
    assert sum("This report cannot be shown" in each for each in pages) == 1


def test_a_student_watches_an_earlier_attempt_in_a_report_and_in_a_replay(store: Store, tmp_path: Path) -> None:
    before, _ = stored(store, "ada", 1, parting_grade())
    line, _ = stored(store, "ada", 2, build.line_follower_grade())
    with store.reading() as session:
        assert batches.find_previous_job(session, line.id) == before.id
        with pytest.raises(UsageError, match="comes before"):
            batches.find_previous_job(session, before.id)
        grade = results.load_grade(session, line.id)
    overlay = replay_over(store, line, before, tmp_path)
    assert (overlay["name"], overlay["parted"]) == ("attempt 1", pytest.approx(94 / 30))
    report = write_report(store, line, grade, tmp_path, "ada", before)
    assert [trial["over"]["name"] for trial in data_of(report.path.read_text())["trials"]] == ["attempt 1"] * 2
    plain = write_report(store, line, grade, tmp_path, "ada")
    assert all("over" not in trial for trial in data_of(plain.path.read_text())["trials"])


def test_the_reference_is_shown_once_the_grade_is_published_and_other_students_never(
    store: Store, tmp_path: Path
) -> None:
    reference, _ = stored(store, "reference", 1, parting_grade())
    other, _ = stored(store, "bob", 2, parting_grade())
    line, batch = stored(store, "ada", 3, build.line_follower_grade())
    with pytest.raises(UsageError, match="published"):
        replay_over(store, line, reference, tmp_path)
    acting.publish(store, batch, actor="staff")
    assert replay_over(store, line_of(store, line.id), reference, tmp_path)["name"] == "the reference"
    with pytest.raises(UsageError, match="another student's"):
        replay_over(store, line_of(store, line.id), other, tmp_path)


def test_what_is_for_staff_is_shown_over_nothing_that_a_student_reads(store: Store, tmp_path: Path) -> None:
    with store.transaction() as session:
        policies.set_policy(session, ensure_course(session, "default", now(session)), "", PolicyLimits(attempts=1))
    first, batch = stored(store, "ada", 1, build.line_follower_grade())
    proposal = acting.regrade(store, batch, None, max_attempts=1, actor="staff")
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    jobs.finish_job(store, claim, results.prepare_grade(parting_grade()), datetime.now(UTC))
    with store.reading() as session:
        (proposed,) = job_lines.load_job_lines(session, proposal.batch_id)
    with pytest.raises(UsageError, match="not published"):
        replay_over(store, first, proposed, tmp_path)
    over_the_limit = replace(first, staff_only="attempt 2, allowed: 1")
    with pytest.raises(UsageError, match="staff only"):
        replay_over(store, first, over_the_limit, tmp_path)
    assert replay_over(store, over_the_limit, proposed, tmp_path)["name"] == f"attempt 1, grade {proposed.id}"


def test_a_film_is_of_a_trial_that_may_be_shown(store: Store, tmp_path: Path) -> None:
    line, _ = stored(store, "ada", 1, build.hidden_grade())
    with store.reading() as session:
        grade = results.load_grade(session, line.id)
    write_grade_film(store, line, grade, tmp_path / "film.gif", None)
    with Image.open(tmp_path / "film.gif") as image:
        assert image.format == "GIF"
    for number in (0, 5, 6):
        with pytest.raises(UsageError, match=f"--trial {number}: expected 1 to 4"):
            write_grade_film(store, line, grade, tmp_path / "film.gif", number)
