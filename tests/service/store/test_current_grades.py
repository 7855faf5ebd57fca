"""One attempt is current for a student and an assignment, and every reader of grades selects the same one."""

from __future__ import annotations

import itertools
import random
from dataclasses import replace
from datetime import UTC, datetime
from decimal import Decimal
from fractions import Fraction

import pytest
from sqlalchemy import select, update

import acting
import report_builders
from builders import grading_request, prepared, release_at_once
from rows import quick_first
from service.batch_rows import describe_missing_grade
from service.lti import passback
from service.lti.services import Score
from service.operations import own_submissions
from service.store.batches import batch_table, job_lines
from service.store.batches.intake import accept_batch, accept_submission
from service.store.courses import policies
from service.store.courses.hidden_names import HiddenNames
from service.store.courses.policies import PolicyLimits
from service.store.engine import Store
from service.store.grades import current_grades, overrides
from service.store.people import lti
from service.store.people.students import ensure_course
from service.store.queue import jobs, self_tests
from service.store.queue.jobs import RetryPolicy
from service.store.states import CancelReason, CountedAttempt, JobState, ReleaseRule, Standing
from service.store.tables.courses import Course
from service.store.tables.grades import CriterionResultRow
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Job, SubmissionRow

_FIRST = report_builders.faulty_grade().criteria[0]
_SECOND = replace(_FIRST, id="second", marks=Decimal(3), max_marks=Decimal(6))
GRADE = replace(report_builders.faulty_grade(), criteria=(_FIRST, _SECOND))
NOBODY = HiddenNames(frozenset(), b"")


def _submit(store: Store, program: str, batch_id: str | None = None) -> str:
    request = grading_request("ada", f"print({program!r})\n")
    return accept_submission(store, request, max_attempts=1, batch_id=batch_id).job_id


def _end_next(store: Store, how: str = "done", worker: str = "worker") -> None:
    claim = jobs.claim_job(store, worker, 60)
    if claim is None or how == "running":
        return
    if how == "dead":
        jobs.fail_job(store, claim, "the disk is full", RetryPolicy(0.0))
    else:
        jobs.finish_job(store, claim, prepared(GRADE), datetime.now(UTC))


def _set_rule(store: Store, rule: CountedAttempt) -> None:
    with store.transaction() as session:
        ensure_course(session, "default", datetime.now(UTC))
        session.get_one(Course, 1).counted_attempt = rule
    release_at_once(store)


def _grade_with(store: Store, program: str, marks: int, batch_id: str | None = None) -> str:
    """Submit and grade an attempt of Ada whose first criterion staff give ``marks``."""
    job_id = _submit(store, program, batch_id)
    _end_next(store)
    with store.transaction() as session:
        overrides.set_marks(session, job_id, GRADE.criteria[0].id, Decimal(marks), "read again", "grace")
    return job_id


def _share(job: Job) -> Fraction:
    assert job.marks is not None
    assert job.max_marks is not None
    return Fraction(job.marks) / Fraction(job.max_marks) if job.max_marks else Fraction(-1)


def _readers(store: Store, batch_id: str | None) -> dict[str, str | None]:
    """Return the job of Ada's current attempt for each reader; None where there is none."""
    current_jobs: dict[str, str | None] = {}
    with store.reading() as session:
        enrolment_id = session.scalars(select(Enrolment.id)).one()
        of_all = own_submissions.load_own_assignments(session, 1, enrolment_id)
        current_jobs["own list"] = None if of_all[0].counting is None else of_all[0].counting.job_id
        own = own_submissions.load_own_attempts(session, enrolment_id, "echo-responder").counting
        current_jobs["own page"] = None if own is None else own.job_id
        lines = {"course": job_lines.load_course_lines(session, 1, ["echo-responder"])}
        if batch_id is not None:
            lines["batch"] = job_lines.load_job_lines(session, batch_id)
            lines["some of a batch"] = job_lines.load_job_lines_page(session, batch_id, NOBODY, 10)
            (row,) = batch_table.load_table_lines(session, batch_id, (), NOBODY)
            current_jobs["table"] = row.id if row.marks is not None and not row.staff_only else None
        for name, (line,) in lines.items():
            current_jobs[name] = line.id if line.marks is not None and not line.staff_only else None
    return current_jobs


@pytest.mark.long
@pytest.mark.parametrize("how", ["dead", "waiting", "running"])
def test_a_newer_attempt_without_a_grade_leaves_the_marks_of_the_earlier_one(store: Store, how: str) -> None:
    batch = accept_batch(store, "class", [grading_request("ada")], [], max_attempts=1)
    _end_next(store)
    acting.publish(store, batch.id, actor="grace")
    _submit(store, "newer", batch.id)
    if how != "waiting":
        _end_next(store, how)
    assert set(_readers(store, batch.id).values()) == {batch.jobs[0].job_id}
    with store.reading() as session:
        (line,) = job_lines.load_job_lines(session, batch.id)
        (row,) = batch_table.load_table_lines(session, batch.id, (), NOBODY)
    assert (line.marks, line.newer_attempt, row.newer_attempt) == (GRADE.marks, 2, 2)
    exported = acting.export_file(store, batch.id, "moodle", published=True).data.decode()
    assert f"ada,{GRADE.marks:f}," in exported
    assert "disk is full" not in exported


def test_a_batch_shows_the_attempt_that_counts_from_wherever_it_came(store: Store) -> None:
    old = accept_batch(store, "from Moodle", [grading_request("ada")], [], max_attempts=1)
    _end_next(store)
    newer = _submit(store, "newer")
    _end_next(store)
    assert set(_readers(store, old.id).values()) == {newer}
    with store.reading() as session:
        (line,) = job_lines.load_job_lines(session, old.id)
        (row,) = batch_table.load_table_lines(session, old.id, (), NOBODY)
        (own,) = job_lines.load_attempt_lines(session, old.id)
    # The system that the batch came from recognises the student by that name.
    assert (line.attempt, line.source, row.elsewhere) == (2, "ada.zip", True)
    assert (own.id, own.attempt) == (old.jobs[0].job_id, 1)


def _change_some_marks(store: Store, chance: random.Random) -> None:
    """Let staff give marks for one criterion of one grade, or excuse all of its criteria or one."""
    with store.transaction() as session:
        job_ids = session.scalars(select(Job.id).where(Job.state == JobState.DONE).order_by(Job.id)).all()
        if not job_ids:
            return
        job_id, criterion = chance.choice(job_ids), chance.choice(GRADE.criteria)
        match chance.choice(("set", "set", "excuse one", "excuse all")):
            case "set":
                marks = min(
                    chance.choice([Decimal(0), Decimal("0.1"), Decimal("0.3"), Decimal(1)]), criterion.max_marks
                )
                overrides.set_marks(session, job_id, criterion.id, marks, "read again", "grace")
            case "excuse one":
                overrides.excuse_criterion(session, job_id, criterion.id, "the task was wrong", "grace")
            case "excuse all":
                for each in GRADE.criteria:
                    overrides.excuse_criterion(session, job_id, each.id, "the task was wrong", "grace")


@pytest.mark.long
@pytest.mark.parametrize("rule", CountedAttempt)
@pytest.mark.parametrize("seed", quick_first(range(3)))
def test_all_readers_name_the_same_attempt_after_any_history(store: Store, seed: int, rule: CountedAttempt) -> None:
    chance = random.Random(seed)
    _set_rule(store, rule)
    with store.transaction() as session:
        ensure_course(session, "default", datetime.now(UTC))
        limits = PolicyLimits(attempts=chance.choice([2, None]), release=ReleaseRule.AT_ONCE)
        policies.set_policy(session, 1, "", limits)
    first = accept_batch(store, "class", [grading_request("ada")], [], max_attempts=1)
    for number in range(20):
        match chance.choice(("submit", "end", "end", "mark", "quarantine")):
            case "submit":
                _submit(store, str(number), chance.choice([None, first.id]))
            case "end":
                _end_next(store, chance.choice(["done", "done", "dead"]), f"worker-{number // 4}")
            case "mark":
                _change_some_marks(store, chance)
            case "quarantine":
                self_tests.quarantine_worker(store, f"worker-{number // 4}", "it adds wrongly")
        with store.reading() as session:
            query = (
                select(Job)
                .join(SubmissionRow)
                .where(
                    Job.standing == Standing.STANDS,
                    Job.state == JobState.DONE,
                    Job.suspect.is_(None),
                    SubmissionRow.staff_only.is_(None),
                )
                .order_by(SubmissionRow.attempt.desc())
            )
            graded = session.scalars(query).all()
            if rule is CountedAttempt.BEST:
                graded = sorted(graded, key=_share, reverse=True)
            expected = graded[0].id if graded else None
        assert set(_readers(store, first.id).values()) == {expected}


def test_predicates_and_expressions_say_the_same_of_every_outcome(store: Store) -> None:
    """For each state, standing, suspicion and limit. A table gives a reason exactly where students see no grade."""
    made = itertools.product(JobState, Standing, (None, "it adds wrongly"), (None, "attempt 3, allowed: 2"))
    pairs = {
        current_grades.is_trusted: current_grades.IS_TRUSTED,
        current_grades.is_for_students: current_grades.IS_FOR_STUDENTS,
    }
    job_id = _submit(store, "one")
    for state, standing, suspect, staff_only in made:
        lease = "a lease" if state is JobState.RUNNING else None
        with store.transaction() as session:
            session.execute(update(Job).values(state=state, standing=standing, suspect=suspect, lease=lease))
            session.execute(update(SubmissionRow).values(staff_only=staff_only))
        with store.reading() as session:
            line = job_lines.load_job_line(session, job_id)
            queries = [select(Job.id).join(SubmissionRow).where(*which) for which in pairs.values()]
            results = [session.scalar(query) is not None for query in queries]
            query = select(Job.id).join(SubmissionRow).where(*current_grades.CAN_COUNT)
            counted = session.scalar(query) is not None
        assert [is_so(line) for is_so in pairs] == results, line
        assert (describe_missing_grade(line) == "") == current_grades.is_for_students(line), line
        counts = state is JobState.DONE and standing is Standing.STANDS and suspect is None and staff_only is None
        assert counted == counts, line


def test_an_earlier_attempt_is_not_passed_back_where_all_of_the_newest_is_excused(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[Score] = []

    def send(_store: Store, _link: object, _assignment: str, _title: str, scores: list[Score]) -> int:
        sent.extend(scores)
        return len(scores)

    monkeypatch.setattr(lti, "load_subjects", lambda *_: {"ada": "subject-1"})
    monkeypatch.setattr(passback, "send_scores", send)
    link = object.__new__(lti.CourseLink)
    object.__setattr__(link, "platform", None)
    for program in ("one", "two"):
        job_id = _submit(store, program)
        _end_next(store)
        acting.publish_one(store, job_id, actor="grace", includes_held_back=True)
    passback.send_marks(store, link, 1, "echo-responder")
    assert [score.marks for score in sent] == [GRADE.marks]
    with store.transaction() as session:
        for criterion in GRADE.criteria:
            overrides.excuse_criterion(session, job_id, criterion.id, "the task was wrong", "grace")
    sent.clear()
    passback.send_marks(store, link, 1, "echo-responder")
    assert sent == []


@pytest.mark.long
def test_the_best_attempt_counts_and_the_latest_of_several(store: Store) -> None:
    first_criterion = GRADE.criteria[0].id
    batch = accept_batch(store, "class", [grading_request("ada")], [], max_attempts=1)
    _end_next(store)
    first = batch.jobs[0].job_id
    best, worst = _grade_with(store, "best", 1), _grade_with(store, "worst", 0, batch.id)
    assert set(_readers(store, batch.id).values()) == {worst}
    _set_rule(store, CountedAttempt.BEST)
    assert set(_readers(store, batch.id).values()) == {best}
    same = _grade_with(store, "as good", 1)
    assert set(_readers(store, batch.id).values()) == {same}
    # An excused criterion is removed from the maximum: 3 of 6 is a higher share than 4 of 10.
    with store.transaction() as session:
        overrides.excuse_criterion(session, best, first_criterion, "the task was wrong", "grace")
    assert set(_readers(store, batch.id).values()) == {best}
    # A completely excused attempt has no share.
    with store.transaction() as session:
        overrides.excuse_criterion(session, best, "second", "the task was wrong", "grace")
    assert set(_readers(store, batch.id).values()) == {same}
    with store.transaction() as session:
        for job_id in (same, worst):
            overrides.set_marks(session, job_id, first_criterion, Decimal(0), "copied", "grace")
        overrides.set_marks(session, first, first_criterion, Decimal(1), "read again", "grace")
    assert set(_readers(store, batch.id).values()) == {first}
    exported = acting.export_file(store, batch.id, "moodle", published=False).data.decode()
    with store.reading() as session:
        (line,) = job_lines.load_job_lines(session, batch.id)
    assert f"ada,{line.marks:f}," in exported


def test_each_attempt_is_graded_and_counted_where_the_best_counts(store: Store) -> None:
    """With the latest attempt, a newer submission replaces the queued one, which is then no attempt."""
    for rule, cancelled, attempts in ((CountedAttempt.LATEST, 1, 0), (CountedAttempt.BEST, 1, 2)):
        _set_rule(store, rule)
        for number in range(2):
            _submit(store, f"{rule} {number}")
        with store.reading() as session:
            reasons = session.scalars(select(Job.cancelled_for).where(Job.state == JobState.CANCELLED)).all()
            assert reasons == [CancelReason.SUPERSEDED] * cancelled
            enrolment_id = session.scalars(select(Enrolment.id)).one()
            made = policies.count_attempts(session, enrolment_id, ["echo-responder"])["echo-responder"]
            assert made == attempts + (rule is CountedAttempt.BEST)  # the last of the first two is queued, too


@pytest.mark.long
@pytest.mark.parametrize("visibility", ["hidden", "after_published", "after_due_date"])
def test_students_cannot_compare_hidden_marks_by_the_attempt_that_counts(store: Store, visibility: str) -> None:
    _set_rule(store, CountedAttempt.BEST)
    better, worse = _grade_with(store, "better", 1), _grade_with(store, "worse", 0)
    assert {_readers(store, None)[name] for name in ("own list", "own page")} == {better}
    with store.transaction() as session:
        session.execute(
            update(CriterionResultRow)
            .where(CriterionResultRow.job_id == worse, CriterionResultRow.criterion == GRADE.criteria[0].id)
            .values(visibility=visibility)
        )
    assert _readers(store, None) == {"own list": None, "own page": None, "course": better}
    # The marks of one attempt are not enough for a comparison.
    acting.publish_one(store, better, actor="grace", includes_held_back=True)
    assert _readers(store, None) == {"own list": None, "own page": None, "course": better}
    if visibility == "after_due_date":
        with store.transaction() as session:
            policies.set_policy(session, 1, "", PolicyLimits(datetime(2020, 1, 1, tzinfo=UTC)))
    else:
        acting.publish_one(store, worse, actor="grace", includes_held_back=True)
    assert set(_readers(store, None).values()) == {better}
