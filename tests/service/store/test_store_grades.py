"""A grade is stored in rows and read back complete; SQL queries can read its accuracy."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from decimal import Decimal

import numpy
import pytest
from sqlalchemy import select, text, update

import report_builders
from builders import accept_one, comparable, prepared
from responders.sandbox.meter import JobCosts, JobLimits
from service.grading.grade import Cost, Grade, VisibleFeedback, convert_texts
from service.reports.formats.json_output import build_json_document
from service.reports.formats.text import render_plain_text
from service.reports.view import build_staff_view
from service.store import artifacts
from service.store.batches.stored_requests import load_grading_request
from service.store.columns import make_storable
from service.store.engine import Store
from service.store.grades import results
from service.store.queue import jobs
from service.store.tables.courses import AssignmentVersion
from service.store.tables.grades import Artifact, CriterionResultRow
from service.store.tables.submissions import Job, SubmissionRow
from sim.errors import HostError, UsageError
from sim.recording import TimedText
from sim.sentences import Sentence, join_sentences


def _stored(store: Store, grade: Grade) -> str:
    """Store a grade and return its job's id. The rows that the grade belongs to are adapted to it."""
    accepted = accept_one(store, grade.student)
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    jobs.finish_job(store, claim, prepared(grade), datetime.now(UTC))
    with store.transaction() as session:
        version = {"assignment": grade.assignment, "title": grade.assignment_title, "version": grade.assignment_version}
        session.execute(update(AssignmentVersion).values(**version))
        session.execute(update(SubmissionRow).values(sha256=grade.submission))
    return accepted.job_id


@pytest.mark.parametrize(
    "make",
    [
        report_builders.line_follower_grade,
        report_builders.shape_grade,
        report_builders.swept_grade,
        report_builders.faulty_grade,
        report_builders.hidden_grade,
    ],
)
def test_a_grade_comes_back_as_it_was(store: Store, make: Callable[[], Grade]) -> None:
    grade = make()
    job_id = _stored(store, grade)
    with store.reading() as session:
        back, words = results.load_grade(session, job_id), results.load_grade_texts(session, job_id)
    assert comparable(back) == comparable(grade)
    assert (back.marks, back.max_marks, back.verdict) == (grade.marks, grade.max_marks, grade.verdict)
    assert build_json_document(build_staff_view(words)) == build_json_document(build_staff_view(back))
    assert render_plain_text(build_staff_view(words)) == render_plain_text(build_staff_view(back))


@pytest.mark.parametrize(
    "sentence",
    [
        Sentence("The robot ended at %(pose)s.", pose=Sentence("(%(x).1f, %(y).1f)", x=1.25, y=2)),
        join_sentences(Sentence("One of %(count)s.", count=numpy.int64(3)), "A quote.", Sentence("Two.")),
        Sentence("%(text)s was sent", text="a\x00b \ud800"),
        Sentence("%(marks)s of %(of)s", marks=Decimal("1.50"), of=numpy.float64(2.0)),
    ],
)
def test_sentences_of_a_stored_grade_can_be_translated(store: Store, sentence: str) -> None:
    first, *others = report_builders.shape_grade().criteria
    evidence = tuple(replace(each, message=sentence) for each in first.evidence)
    shown = VisibleFeedback(sentence)
    result = replace(first, message=sentence, evidence=evidence, shown=shown, unjudged=sentence, for_staff=sentence)
    grade = replace(
        report_builders.shape_grade(), criteria=(result, *others), hints=(sentence, "plain"), notes=(sentence,)
    )
    job_id = _stored(store, grade)
    with store.reading() as session:
        back = results.load_grade(session, job_id)
        in_list = results.load_marks(session, [job_id])[job_id]
    stored_sentences: list[Sentence] = []

    def collect(text: str) -> str:
        stored_sentences.extend([text] if isinstance(text, Sentence) else [])
        return text

    convert_texts(back, collect)
    assert len(stored_sentences) == len(evidence) + 6
    assert isinstance(sentence, Sentence)
    assert {each.template for each in stored_sentences} == {sentence.template}
    assert {str(each) for each in stored_sentences} == {make_storable(str(sentence))}
    assert isinstance(in_list.criteria[0].message, Sentence)
    assert back.hints[1] == "plain"


@pytest.mark.parametrize(
    ("sentence", "text"),
    [
        (Sentence("%(marks).1f marks", marks=Decimal("1.5")), "1.5 marks"),
        (Sentence("%(distance).0f mm", distance=math.nan), "nan mm"),
        (Sentence("The value was %(value)s.", value=Sentence("%(number)g", number=math.inf)), "The value was inf."),
    ],
)
def test_a_sentence_whose_format_a_stored_value_does_not_fit_is_stored_as_text(
    store: Store, sentence: str, text: str
) -> None:
    grade = replace(report_builders.shape_grade(), hints=(sentence,))
    job_id = _stored(store, grade)
    with store.reading() as session:
        (hint,) = results.load_grade(session, job_id).hints
    assert (hint, type(hint)) == (text, str)


def test_what_it_cost_is_kept_and_told_of_no_two_grades_apart(store: Store) -> None:
    cost = Cost(JobLimits(1 << 20, 240.0, 20.0), JobCosts(1 << 18, 3.25, 0.5))
    grade = replace(report_builders.shape_grade(), cost=cost)
    job_id = _stored(store, grade)
    with store.reading() as session:
        back = results.load_grade(session, job_id)
    assert back.cost == cost
    other = replace(grade, cost=Cost(cost.limits, JobCosts(1 << 18, 3.5, 0.0)))
    assert other == grade
    assert hash(other.cost) != hash(cost)


def test_hostile_texts_go_in_and_the_recordings_keep_them(store: Store) -> None:
    grade = report_builders.hostile_grade()
    first = grade.trials[0]
    poisoned = replace(
        first.recording, printed=(*first.recording.printed, TimedText(1.0, "\0\ud800'; DROP TABLE job;--"))
    )
    criteria = tuple(replace(result, message=result.message + "\0\ud800") for result in grade.criteria)
    grade = replace(grade, trials=(replace(first, recording=poisoned), *grade.trials[1:]), criteria=criteria)
    job_id = _stored(store, grade)
    with store.reading() as session:
        back = results.load_grade(session, job_id)
    assert comparable(back)[1] == comparable(grade)[1]
    assert [result.message for result in back.criteria] == [make_storable(result.message) for result in grade.criteria]


def test_accuracy_is_data(store: Store) -> None:
    grade = report_builders.shape_grade(wrong=4)
    accuracy = grade.accuracy
    assert accuracy is not None
    _stored(store, grade)
    with store.reading() as session:
        query = select(CriterionResultRow).where(CriterionResultRow.accuracy < 0.9, CriterionResultRow.accuracy_n >= 6)
        row = session.scalars(query).one()
        assert (row.accuracy, row.accuracy_low, row.accuracy_high) == (accuracy.value, accuracy.low, accuracy.high)
        counts = {(truth, answer): count for truth, answer, count in row.confusion or ()}
        assert counts == {(truth, answer): count for truth, answer, count in accuracy.confusion}
        total = session.scalar(text("SELECT SUM(CAST(marks AS NUMERIC)) FROM criterion_result"))
    assert Decimal(str(total)) == grade.marks


def test_marks_keep_their_places(store: Store) -> None:
    grade = report_builders.shape_grade()
    third = replace(grade.criteria[0], marks=Decimal("0.10"), max_marks=Decimal("3.30"))
    job_id = _stored(store, replace(grade, criteria=(third,)))
    with store.reading() as session:
        back = results.load_grade(session, job_id).criteria[0]
    assert (str(back.marks), str(back.max_marks)) == ("0.10", "3.30")


def test_a_flood_of_images_is_cut_and_the_marks_stay(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.store.grades.recordings.GRADE_BYTES", 1)
    monkeypatch.setattr("service.store.grades.recordings.MIN_RECORDING_BYTES", 1_000)
    grade = report_builders.shape_grade()
    job_id = _stored(store, grade)
    with store.reading() as session:
        back = results.load_grade(session, job_id)
    assert back.marks == grade.marks
    assert back.accuracy == grade.accuracy
    assert all("too large" in trial.recording.notes[-1] for trial in back.trials)


def test_what_a_worker_needs_is_all_in_the_database(store: Store) -> None:
    accepted = accept_one(store, "Zoë 🤖")
    with store.reading() as session:
        back = load_grading_request(session, accepted.job_id)
    assert back.submission.student == "Zoë 🤖"
    assert back.submission.program is not None
    assert "print('hello')" in back.submission.program.text
    assert back.assignment.id == "echo-responder"


def test_a_job_without_a_grade_says_so(store: Store) -> None:
    accepted = accept_one(store)
    with store.reading() as session, pytest.raises(UsageError, match="has no grade"):
        results.load_grade(session, accepted.job_id)


def test_a_file_of_the_same_name_is_replaced(store: Store) -> None:
    job_id = accept_one(store).job_id
    for data in (b"first", b"second"):
        with store.transaction() as session:
            artifacts.store_files(
                session, job_id, [artifacts.File("plot-a%.png", "image/png", data)], datetime.now(UTC)
            )
    with store.reading() as session:
        assert {name: file.data for name, file in artifacts.load_files(session, job_id).items()} == {
            "plot-a%.png": b"second"
        }
        assert artifacts.load_files(session, job_id, prefix="plot-%") == {}


def test_a_damaged_file_is_noticed(store: Store) -> None:
    job_id = _stored(store, report_builders.faulty_grade())
    with store.transaction() as session:
        session.execute(update(Artifact).values(sha256="0" * 64))
    with store.reading() as session, pytest.raises(HostError, match="damaged"):
        results.load_grade(session, job_id)


def test_a_file_over_the_cap_is_refused(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.store.artifacts.CAP_BYTES", 10)
    job_id = accept_one(store).job_id
    file = artifacts.File("large", "application/octet-stream", bytes(range(256)))
    with pytest.raises(HostError, match="too large"), store.transaction() as session:
        artifacts.store_files(session, job_id, [file], datetime.now(UTC))


def test_a_moment_without_a_zone_is_refused(store: Store) -> None:
    job_id = accept_one(store).job_id
    with pytest.raises(Exception, match="time zone"), store.transaction() as session:
        session.execute(update(Job).where(Job.id == job_id).values(due_at=datetime(2026, 1, 1)))
