"""Overrides count wherever marks are shown, in every grade of the submission, until they are withdrawn."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from decimal import Decimal
from functools import partial
from xml.etree import ElementTree

import pytest
from sqlalchemy.orm import Session

import acting
import report_builders
from builders import accept_one, grading_request, prepared
from service.batch_rows import build_rows
from service.grading.class_statistics import to_marked_submission
from service.grading.grade import Grade, StaffAdjustment, VisibleFeedback
from service.report_files import render_report_body
from service.reports.formats import FORMATS
from service.reports.formats.json_output import build_json_document
from service.reports.view import build_gradebook_view, build_staff_view, build_student_view
from service.store import audit
from service.store.batches import batch_table, class_overview, job_lines, regrade_changes
from service.store.batches.intake import accept_batch, accept_submission
from service.store.courses.hidden_names import NO_HIDDEN_NAMES, HiddenNames
from service.store.engine import Store
from service.store.grades import comments, marking_history, overrides, results
from service.store.grades.statistics_marks import load_marked_submissions
from service.store.installation import load_secret
from service.store.queue import jobs
from service.store.tables.submissions import Job
from sim.errors import UsageError

#: 5 of 6 for the first criterion, 2 of 2 for the second.
GRADE = replace(report_builders.shape_grade(), sandbox="Landlock 7, seccomp, process limits, policy 0", hints=())
SHAPE, ALOUD = (result.id for result in GRADE.criteria)
Change = Callable[[Session, str], object]


def _set(criterion: str, marks: str) -> Change:
    return lambda session, job: overrides.set_marks(session, job, criterion, Decimal(marks), "seen again", "staff")


def _excuse(criterion: str) -> Change:
    return lambda session, job: overrides.excuse_criterion(session, job, criterion, "was ill", "staff")


def _withdraw(criterion: str) -> Change:
    return lambda session, job: overrides.withdraw_override(session, job, criterion, "staff")


def _grade_all(store: Store, grade: Grade = GRADE) -> None:
    while (claim := jobs.claim_job(store, "worker", 60)) is not None:
        jobs.finish_job(store, claim, prepared(grade), datetime.now(UTC))


def _graded(store: Store, grade: Grade = GRADE) -> tuple[str, str]:
    """Return a batch with one graded submission, and its job."""
    batch = accept_batch(store, "class", [grading_request("ada")], [], max_attempts=3)
    _grade_all(store, grade)
    return batch.id, batch.jobs[0].job_id


def _change(store: Store, job_id: str, *changes: Change) -> None:
    for change in changes:
        with store.transaction() as session:
            change(session, job_id)


def _totals(store: Store, batch: str) -> dict[str, tuple[float, float]]:
    """Return marks and maximum marks from each reader of them."""
    with store.reading() as session:
        (line,) = job_lines.load_job_lines(session, batch)
        job = session.get_one(Job, line.id)
        grade = results.load_grade(session, line.id)
        counted = load_marked_submissions(session, [line])
    # In statistics, as in a gradebook, the other criteria replace an excused one. Fully excused students are left out.
    assert [(each.marks, each.max_marks) for each in counted] == [
        (marks, grade.worth) for marks in [build_gradebook_view(grade).marks] if marks is not None
    ]
    if counted:
        assert counted == [to_marked_submission(replace(grade, assignment=line.assignment, student="ada"))]
    rows = build_rows(store, [line])
    wide, *_ = _csv(FORMATS["csv"].table, rows)
    long = _csv(FORMATS["csv-long"].table, rows)
    (document,) = json.loads(_written(FORMATS["json"].table, rows))
    properties = {
        each.get("name"): each.get("value") or ""
        for each in ElementTree.fromstring(_written(FORMATS["junit"].table, rows)).iter("property")
    }
    body = str(render_report_body(store, line.id, line.plots, build_student_view(grade)).body)
    score = re.search(r"<b>([\d.]+)</b><span>of ([\d.]+) marks", body)
    assert score is not None
    assert line.marks is not None
    return {
        "list": (float(line.marks), float(line.max_marks)),
        "row": (float(job.marks or 0), float(job.max_marks or 0)),
        "grade": (float(grade.marks), float(grade.max_marks)),
        "csv": (float(wide["marks"]), float(wide["max_marks"])),
        "csv-long": (sum(float(row["marks"] or 0) for row in long), sum(float(row["max_marks"] or 0) for row in long)),
        "json": (document["marks"], document["max_marks"]),
        "junit": (float(properties["marks"]), float(properties["max_marks"])),
        "report": (float(score[1]), float(score[2])),
    }


def _written(table: object, rows: object) -> str:
    assert callable(table)
    text = table(rows)
    assert isinstance(text, str)
    return text


def _csv(table: object, rows: object) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(_written(table, rows))))


@pytest.mark.long
@pytest.mark.parametrize(
    ("changes", "marks", "most", "of_all"),
    [
        ([], 7, 8, 7),
        ([_set(SHAPE, "6")], 8, 8, 8),
        ([_set(SHAPE, "0.25")], 2.25, 8, 2.25),
        ([_set(SHAPE, "0"), _set(SHAPE, "4.5")], 6.5, 8, 6.5),
        ([_set(SHAPE, "6"), _withdraw(SHAPE)], 7, 8, 7),
        ([_excuse(ALOUD)], 5, 6, 6.67),
        ([_excuse(SHAPE)], 2, 2, 8),
        ([_set(SHAPE, "3"), _excuse(ALOUD)], 3, 6, 4),
        ([_excuse(ALOUD), _set(ALOUD, "1")], 6, 8, 6),
        ([_excuse(ALOUD), _excuse(SHAPE)], 0, 0, None),
    ],
    ids=["as graded", "full", "a quarter", "set twice", "withdrawn", "one excused", "the other", "both ways",
         "excused, then set", "all excused"],
)  # fmt: skip
def test_every_place_that_tells_marks_tells_the_same(
    store: Store, changes: list[Change], marks: float, most: float, of_all: float | None
) -> None:
    batch, job_id = _graded(store)
    _change(store, job_id, *changes)
    assert set(_totals(store, batch).values()) == {(marks, most)}
    with store.reading() as session:
        rows = build_rows(store, job_lines.load_job_lines(session, batch))
        assert results.load_original_grade(session, job_id).criteria == GRADE.criteria
    # A gradebook has one maximum per assignment, so the other criteria replace the excused one.
    moodle = _csv(FORMATS["moodle"].table, rows)[0]["Grade"]
    assert moodle == ("" if of_all is None else f"{of_all:g}")
    (gradescope,) = json.loads(_written(FORMATS["gradescope"].table, rows))
    assert gradescope["score"] == (of_all or 0)


def test_a_regrade_counts_what_was_set_and_changes_the_rest(store: Store) -> None:
    batch, job_id = _graded(store)
    _change(store, job_id, _set(SHAPE, "6"))
    acting.regrade(store, batch, None, max_attempts=3, actor="staff")
    shape, aloud = GRADE.criteria
    worse = (replace(shape, marks=Decimal(1)), replace(aloud, marks=Decimal("1.5")))
    _grade_all(store, replace(GRADE, criteria=worse))
    with store.reading() as session:
        again = session.query(Job).filter(Job.regrade_of == job_id).one()
        (change,) = regrade_changes.load_changes(session, again.batch_id or "", NO_HIDDEN_NAMES)
    assert (change.before, change.after) == (8, Decimal("7.5"))
    assert [(each.title, each.by_hand) for each in change.criteria] == [(aloud.title, False)]
    acting.publish(store, batch, actor="staff")
    assert set(_totals(store, batch).values()) == {(7.5, 8)}
    # An override applies to the earlier and the later grade, whichever it was made in.
    _change(store, job_id, _withdraw(SHAPE))
    assert set(_totals(store, batch).values()) == {(2.5, 8)}


def test_marks_set_for_more_than_a_changed_criterion_gives_are_all_that_it_gives(store: Store) -> None:
    batch, job_id = _graded(store)
    _change(store, job_id, _set(SHAPE, "6"))
    acting.regrade(store, batch, None, max_attempts=3, actor="staff")
    shape, aloud = GRADE.criteria
    _grade_all(store, replace(GRADE, criteria=(replace(shape, marks=Decimal(1), max_marks=Decimal(4)), aloud)))
    with store.reading() as session:
        again = session.query(Job).filter(Job.regrade_of == job_id).one()
        (change,) = regrade_changes.load_changes(session, again.batch_id or "", NO_HIDDEN_NAMES)
    (criterion,) = change.criteria
    assert (criterion.title, criterion.before, criterion.after) == (shape.title, (6, 6), (4, 4))
    assert criterion.by_hand
    acting.publish(store, batch, actor="staff")
    assert set(_totals(store, batch).values()) == {(6, 6)}


def test_a_copy_of_a_grade_has_the_graders_marks_and_not_what_was_set_for_another(store: Store) -> None:
    request = grading_request("ada")
    theirs = [replace(request, submission=replace(request.submission, student=name)) for name in ("ada", "bob", "eve")]
    secret = load_secret(store).sha256
    first = accept_submission(store, theirs[0], max_attempts=3)
    waits = accept_submission(store, theirs[1], max_attempts=3)
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    jobs.finish_job(store, claim, results.prepare_grade(replace(GRADE, secret_sha256=secret)), datetime.now(UTC))
    _change(store, first.job_id, _set(SHAPE, "0"))
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    assert jobs.finish_job_from_cache(store, claim)
    copied = accept_submission(store, theirs[2], max_attempts=3)
    with store.reading() as session:
        marks = {
            job: job_lines.load_job_line(session, job).marks for job in (first.job_id, waits.job_id, copied.job_id)
        }
        assert job_lines.load_job_line(session, copied.job_id).copied_from == first.job_id
    assert list(marks.values()) == [2, 7, 7]
    # An override of a submission also applies to a copied grade.
    _change(store, copied.job_id, _excuse(SHAPE))
    with store.reading() as session:
        assert job_lines.load_job_line(session, copied.job_id).marks == 2
        assert job_lines.load_job_line(session, first.job_id).max_marks == 8


def test_what_could_not_be_judged_gets_its_marks_and_is_published(store: Store) -> None:
    shape, aloud = GRADE.criteria
    unjudged = replace(shape, marks=Decimal(0), unjudged="too long", message="This could not be judged; staff look.")
    batch, job_id = _graded(store, replace(GRADE, criteria=(unjudged, aloud)))
    assert acting.publish(store, batch, actor="staff").unjudged == 1
    _change(store, job_id, _set(SHAPE, "5"))
    assert set(_totals(store, batch).values()) == {(7, 8)}
    with store.reading() as session:
        (line,) = job_lines.load_job_lines(session, batch)
        view = build_staff_view(results.load_grade(session, job_id)).grade.criteria[0]
    assert (line.unjudged, line.set_by_hand) == (0, 1)
    assert view.message == "Adjusted by staff to 5: seen again."
    assert acting.publish(store, batch, actor="staff").published == 1
    _change(store, job_id, _withdraw(SHAPE))
    with store.reading() as session:
        assert job_lines.load_job_line(session, job_id).unjudged == 1
        (step, *_) = marking_history.load_history(session, session.get_one(Job, job_id).submission_id)
    assert (step.before, step.after, step.text) == ("not judged", "5", "seen again")


REFUSED: list[tuple[Change, str]] = [
    (_set(SHAPE, "6.01"), "are 6.01, expected 0 to 6 with at most four decimal places"),
    (_set(SHAPE, "-1"), "are -1, expected 0 to 6"),
    (_set(SHAPE, "NaN"), "are NaN, expected 0 to 6"),
    (_set(SHAPE, "1E-7"), "are 1E-7, expected 0 to 6"),
    (_set("names-the-right-shap", "1"), "has no criterion 'names-the-right-shap'; did you mean"),
    (_withdraw(SHAPE), "are not adjusted"),
    (lambda session, _: overrides.excuse_criterion(session, "nowhere", SHAPE, "why", "staff"), "nowhere has no grade"),
    (
        lambda session, job: overrides.excuse_criterion(session, job, SHAPE, "  ", "staff"),
        "the reason has 0 characters",
    ),
    (lambda session, job: overrides.excuse_criterion(session, job, SHAPE, "x" * 501, "staff"), "the reason has 501"),
    (lambda session, job: comments.add_comment(session, job, "", " ", "staff"), "the comment has 0 characters"),
    (lambda session, job: comments.add_comment(session, job, "other", "x", "staff"), "has no criterion 'other'"),
    (lambda session, job: comments.withdraw_comment(session, job, 1, "staff"), "has no comment 1"),
]


def test_what_cannot_be_is_refused_and_changes_nothing(store: Store) -> None:
    batch, job_id = _graded(store)
    for change, sentence in REFUSED:
        with pytest.raises(UsageError, match=re.escape(sentence)):
            _change(store, job_id, change)
    assert set(_totals(store, batch).values()) == {(7, 8)}


@pytest.mark.parametrize(
    ("text", "marks"), [("2.5", "2.5"), (" 2,5 ", "2.5"), ("3", "3"), ("3.", "3"), (",5", "0.5"), ("-0", "0")]
)
def test_marks_are_read_as_people_write_them(text: str, marks: str) -> None:
    assert overrides.parse_marks(text) == Decimal(marks)


@pytest.mark.parametrize("text", ["1_0", "1e1", "0x1", "nan", "Infinity", "1.5.0", "1 0", ".", "-", "", "1" * 50 + "_"])
def test_marks_are_refused_as_only_programs_write_them(text: str) -> None:
    with pytest.raises(UsageError, match="expected a number such as"):
        overrides.parse_marks(text)


@pytest.mark.parametrize(
    ("written", "stored"),
    [("0E-400000000", "0"), ("2." + "0" * 9000, "2"), ("2.5000", "2.5"), ("-0", "0"), ("1e0", "1")],
)
def test_marks_are_stored_without_padding(store: Store, written: str, stored: str) -> None:
    _, job_id = _graded(store)
    _change(store, job_id, _set(SHAPE, written))
    with store.reading() as session:
        override = overrides.load_overrides(session, [job_id])[job_id][SHAPE]
    assert str(override.marks) == stored


def test_a_grade_that_waits_has_no_marks_to_be_set(store: Store) -> None:
    job_id = accept_one(store).job_id
    with pytest.raises(UsageError, match="has no grade"):
        _change(store, job_id, _set(SHAPE, "1"))


def test_the_trail_says_who_changed_what_and_keeps_no_reason(store: Store) -> None:
    _, job_id = _graded(store)
    _change(store, job_id, _set(SHAPE, "5.50"), _excuse(SHAPE), _withdraw(SHAPE))
    _change(store, job_id, lambda session, job: comments.add_comment(session, job, SHAPE, "Look at line 3.", "staff"))
    with store.reading() as session:
        subject = session.get_one(Job, job_id).submission_id
        entries = [
            (step.action, step.before, step.after, step.text) for step in marking_history.load_history(session, subject)
        ]
        kept = audit.load_entries(session, "submission", str(subject))
    assert entries == [
        ("set marks", "5", "5.5", "seen again"),
        ("excuse", "5.5", "excused", "was ill"),
        ("withdraw", "excused", "as graded", "was ill"),
        ("comment", "", "", "Look at line 3."),
    ]
    assert {entry.actor for entry in kept} == {"staff"}
    assert "ill" not in json.dumps([entry.detail for entry in kept])


def test_a_report_says_what_was_set_why_and_what_was_written(store: Store) -> None:
    _, job_id = _graded(store)
    _change(store, job_id, _set(SHAPE, "6"), _excuse(ALOUD))
    for criterion, text in (("", "Well <b>done</b>."), (SHAPE, "Line 3 was right.")):
        _change(store, job_id, partial(comments.add_comment, criterion=criterion, text=text, actor="staff"))
    with store.reading() as session:
        grade = results.load_grade(session, job_id)
        line = job_lines.load_job_line(session, job_id)
    json_document = build_json_document(build_staff_view(grade))
    first, second = json_document["criteria"]
    assert first["message"].startswith("Adjusted by staff from 5 to 6: seen again. 5 of 6 images")
    assert first["set_by_hand"] == {"from": 5, "of": 6, "excused": False, "reason": "seen again"}
    assert second["message"].startswith("Excused, does not count (before: 2 of 2): was ill. It asked")
    assert json_document["comments"] == [
        {"criterion": "", "text": "Well <b>done</b>."}, {"criterion": SHAPE, "text": "Line 3 was right."},
    ]  # fmt: skip
    body = str(render_report_body(store, line.id, line.plots, build_student_view(grade)).body)
    assert "Well &lt;b&gt;done" in body
    rows = build_rows(store, [line])
    assert _csv(FORMATS["csv"].table, rows)[0][f"marks: {ALOUD}"] == ""
    for form in ("csv", "junit", "moodle", "gradescope", "json"):
        assert "Line 3 was right." in _written(FORMATS[form].table, rows), form
    for form in ("text", "gradescope", "json"):
        assert "Line 3 was right." in _written(FORMATS[form].document, grade), form
    # Notes on a criterion that a student does not see are hidden as well.
    hidden = replace(grade, criteria=(replace(grade.criteria[0], visibility="hidden"), grade.criteria[1]))
    assert [each.criterion for each in build_student_view(hidden).grade.comments] == [""]
    _change(store, job_id, lambda session, job: comments.withdraw_comment(session, job, 1, "staff"))
    with store.reading() as session:
        assert [each.criterion for each in results.load_grade(session, job_id).comments] == [SHAPE]


def test_what_was_set_is_told_where_the_message_is_of_visible_trials_alone() -> None:
    shape = GRADE.criteria[0]
    by_hand = StaffAdjustment(Decimal(5), Decimal(6), "seen again", excused=False)
    adjusted_result = replace(shape, set_by_hand=by_hand, marks=Decimal(6))
    trials = tuple(replace(trial, visibility="hidden") for trial in GRADE.trials)
    view = build_student_view(replace(GRADE, criteria=(adjusted_result,), trials=trials)).grade.criteria[0].message
    assert view.startswith("Adjusted by staff from 5 to 6: seen again.")
    assert "5 of 6 images" not in view


def test_statistics_know_which_criteria_have_hidden_trials(store: Store) -> None:
    feedback = VisibleFeedback("seen")
    criteria = (replace(GRADE.criteria[0], shown=feedback), GRADE.criteria[1])
    batch, _ = _graded(store, replace(GRADE, criteria=criteria))
    with store.reading() as session:
        (marked,) = load_marked_submissions(session, job_lines.load_job_lines(session, batch))
    assert [each.has_hidden_trials for each in marked.criteria] == [True, False]
    assert marked.criteria == to_marked_submission(replace(GRADE, criteria=criteria)).criteria


def test_who_is_excused_is_out_of_every_statistic(store: Store) -> None:
    """Ada is excused from the second criterion, Bob from both: mean, bars and shares count the other criteria only."""
    students = ("ada", "bob", "cid")
    batch = accept_batch(store, "class", [grading_request(name) for name in students], [], max_attempts=3)
    _grade_all(store)
    ada, bob, _ = (job.job_id for job in batch.jobs)
    _change(store, ada, _set(SHAPE, "3"), _excuse(ALOUD))
    _change(store, bob, _excuse(SHAPE), _excuse(ALOUD))
    with store.reading() as session:
        lines = batch_table.load_table_lines(session, batch.id, (), HiddenNames(frozenset(), b""))
        (overviews,) = class_overview.compute_overviews(session, 1, lines, Decimal("0.6"), NO_HIDDEN_NAMES)
        accuracies = {line.student: line.accuracy for line in job_lines.load_job_lines(session, batch.id)}
    # Ada has 3 of 6, so 4 of 8; Cid 7 of 8.
    statistics = overviews.statistics
    assert (statistics.n, statistics.mean, statistics.max_marks) == (2, 5.5, 8)
    assert (statistics.lowest, statistics.highest) == (4, 7)
    assert {bin_.low: bin_.count for bin_ in overviews.distribution if bin_.count} == {4: 1, 7: 1}
    assert overviews.passed == 1
    assert {each.id: each.n for each in statistics.criteria} == {SHAPE: 2, ALOUD: 1}
    assert bob not in {each.id for each in overviews.outliers}
    assert {student: accuracy is None for student, accuracy in accuracies.items()} == {
        "ada": False,
        "bob": True,
        "cid": False,
    }
