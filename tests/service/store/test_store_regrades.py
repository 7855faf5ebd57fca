"""Batches graded again: old grades stay current until the new ones are published, and the changes are explained."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from decimal import Decimal

import pytest
from sqlalchemy import ColumnElement, select, update

import acting
import report_builders
from builders import echo, grading_request, prepared
from service.commands.batch.batch_summary import describe_unjudged
from service.grading.grade import CriterionResult, Grade
from service.operations.regrades import PublicationCounts
from service.store import audit
from service.store.batches import batches, changes, job_lines, publishing, regrade_changes
from service.store.batches.intake import accept_batch, accept_new_submissions
from service.store.courses.hidden_names import NO_HIDDEN_NAMES
from service.store.engine import Store
from service.store.grades import results
from service.store.queue import jobs
from service.store.states import JobState, Standing
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Batch, Job
from sim.errors import UsageError

GRADE = report_builders.faulty_grade()
#: A version with another table for the first criterion of the grade.
CHANGED = replace(
    echo(),
    version="changed",
    criteria=(*echo().criteria, echo().criteria[0].model_copy(update={"id": GRADE.criteria[0].id})),
)


def _better(grade: Grade) -> Grade:
    first = grade.criteria[0]
    return replace(grade, criteria=(replace(first, marks=first.max_marks), *grade.criteria[1:]))


def _other_run(grade: Grade) -> Grade:
    (trial, *rest) = grade.trials
    return replace(grade, trials=(replace(trial, recording=replace(trial.recording, sha256="0" * 64)), *rest))


def _batch(store: Store, *students: str) -> str:
    return accept_batch(store, "class", [grading_request(name) for name in students], [], max_attempts=3).id


def _grade_all(store: Store, grade: Grade = GRADE) -> None:
    while (claim := jobs.claim_job(store, "worker", 60)) is not None:
        jobs.finish_job(store, claim, prepared(grade), datetime.now(UTC))


def _regrade(store: Store, batch: str, grade: Grade = GRADE, *, changed: bool = False) -> str:
    made = acting.regrade(store, batch, CHANGED if changed else None, max_attempts=3, actor="staff")
    _grade_all(store, grade)
    return made.batch_id


def _standing(store: Store, batch: str) -> dict[str, str]:
    """Return the standing grade by student."""
    with store.reading() as session:
        return {line.student: line.id for line in job_lines.load_job_lines(session, batch)}


def _changes(store: Store, batch: str) -> list[changes.Change]:
    with store.reading() as session:
        return regrade_changes.load_changes(session, batch, NO_HIDDEN_NAMES)


def test_old_grades_stand_until_the_new_ones_are_published(store: Store) -> None:
    batch = _batch(store, "ada", "bob")
    _grade_all(store)
    before = _standing(store, batch)
    assert acting.publish(store, batch, actor="staff") == PublicationCounts(2, 0, 0, 0, 0, 0)
    again = _regrade(store, batch, _better(GRADE), changed=True)
    assert _standing(store, batch) == before
    with store.reading() as session:
        assert publishing.count_unpublished_regrades(session, batch) == 2
        assert batches.load_batch(session, again).regrade_of == batch
    assert acting.publish(store, batch, actor="staff") == PublicationCounts(2, 2, 0, 0, 0, 0)
    after = _standing(store, batch)
    assert set(after.values()).isdisjoint(before.values())
    with store.reading() as session:
        for student, job_id in before.items():
            old, new = session.get_one(Job, job_id), session.get_one(Job, after[student])
            assert (old.standing, old.marks, old.published_by) == (Standing.KEPT, GRADE.marks, "staff")
            assert (new.standing, new.batch_id, new.published_at is not None) == (Standing.STANDS, again, True)
            assert results.load_grade(session, job_id).marks == GRADE.marks
        actions = [entry.action for entry in audit.load_entries(session, "batch", batch)]
    assert actions == ["publish", "regrade", "publish"]
    assert acting.publish(store, batch, actor="staff").published == 0


def test_a_regrade_can_be_published_by_its_own_batch_too(store: Store) -> None:
    batch = _batch(store, "ada")
    _grade_all(store)
    again = _regrade(store, batch)
    acting.publish(store, again, actor="staff")
    (line,) = _standing(store, batch).values()
    with store.reading() as session:
        assert session.get_one(Job, line).batch_id == again
    assert len(_changes(store, again)) == 1


def _unjudged(grade: Grade) -> Grade:
    first = replace(grade.criteria[0], marks=Decimal(0), unjudged="it took more than 11 s of computing")
    return replace(grade, criteria=(first, *grade.criteria[1:]))


def test_what_could_not_be_judged_is_named_and_stays_back(store: Store) -> None:
    batch = _batch(store, "ada", "bob")
    for claimed in (_unjudged(GRADE), GRADE):
        claim = jobs.claim_job(store, "worker", 60)
        assert claim is not None
        jobs.finish_job(store, claim, results.prepare_grade(claimed), datetime.now(UTC))
    with store.reading() as session:
        lines = job_lines.load_job_lines(session, batch)
    (left,) = [line for line in lines if line.unjudged]
    assert describe_unjudged(lines).startswith("1 submission has criteria that could not be judged")
    assert f": {left.student};" in describe_unjudged(lines)
    assert acting.publish(store, batch, actor="staff") == PublicationCounts(1, 0, 0, 0, 0, 1)
    with store.reading() as session:
        assert session.get_one(Job, left.id).published_at is None
    assert acting.publish(store, batch, actor="staff", includes_held_back=True) == PublicationCounts(1, 0, 0, 0, 0, 0)
    with store.reading() as session:
        assert session.get_one(Job, left.id).published_at is not None
    assert acting.publish(store, batch, actor="staff") == PublicationCounts(0, 0, 0, 0, 0, 0)


def test_a_regrade_that_could_not_be_judged_takes_no_whole_grades_place(store: Store) -> None:
    batch = _batch(store, "ada")
    _grade_all(store)
    before = _standing(store, batch)
    _regrade(store, batch, _unjudged(GRADE))
    assert acting.publish(store, batch, actor="staff") == PublicationCounts(1, 0, 0, 0, 0, 1)
    assert _standing(store, batch) == before
    _regrade(store, batch, _better(GRADE))
    assert acting.publish(store, batch, actor="staff") == PublicationCounts(1, 1, 0, 0, 0, 0)
    assert len(_standing(store, batch)) == 1
    assert _standing(store, batch) != before


def test_a_whole_regrade_takes_the_place_of_what_could_not_be_judged(store: Store) -> None:
    batch = _batch(store, "ada")
    _grade_all(store, _unjudged(GRADE))
    before = _standing(store, batch)
    _regrade(store, batch)
    assert acting.publish(store, batch, actor="staff") == PublicationCounts(1, 1, 0, 0, 0, 0)
    after = _standing(store, batch)
    assert len(after) == 1
    assert after != before
    with store.reading() as session:
        assert session.get_one(Job, before["ada"]).standing is Standing.KEPT


def test_of_several_regrades_the_newest_stands(store: Store) -> None:
    batch = _batch(store, "ada")
    _grade_all(store)
    _regrade(store, batch)
    newest = _regrade(store, batch, _better(GRADE))
    acting.publish(store, batch, actor="staff")
    with store.reading() as session:
        standing = session.execute(select(Job.batch_id, Job.standing).order_by(Job.queued_at)).all()
    assert [state for _, state in standing] == [Standing.KEPT, Standing.KEPT, Standing.STANDS]
    assert standing[-1][0] == newest


@pytest.mark.parametrize(
    ("changed", "grade", "other_grader", "reason", "criteria"),
    [
        (True, _better, False, "criteria changed", 1),
        (False, _better, True, "judging changed", 1),
        (True, _better, True, "criteria changed, judging changed", 1),
        (False, lambda grade: grade, False, "nothing changed", 0),
        (False, _other_run, False, "unexplained", 0),
    ],
)
def test_what_changes_is_explained(
    store: Store, changed: bool, grade: Callable[[Grade], Grade], other_grader: bool, reason: str, criteria: int
) -> None:
    batch = _batch(store, "ada")
    _grade_all(store)
    if other_grader:
        with store.transaction() as session:
            session.execute(update(Job).values(grader_sha256="f" * 64))
    (change,) = _changes(store, _regrade(store, batch, grade(GRADE), changed=changed))
    assert change.reason.startswith(reason)
    assert (change.student, change.before) == ("ada", GRADE.marks)
    assert len(change.criteria) == criteria
    if criteria:
        first = GRADE.criteria[0]
        assert change.criteria[0].before == (first.marks, first.max_marks)
        assert change.criteria[0].after == (first.max_marks, first.max_marks)
        assert change.differs


@pytest.mark.parametrize(("pass_share", "crosses"), [("0.9", "up"), ("0", None), ("1", "up")])
def test_a_change_across_the_pass_mark_is_named(store: Store, pass_share: str, crosses: str | None) -> None:
    batch = _batch(store, "ada")
    _grade_all(store)
    again = _regrade(store, batch, replace(GRADE, criteria=tuple(map(_with_full_marks, GRADE.criteria))))
    with store.reading() as session:
        (change,) = regrade_changes.load_changes(session, again, NO_HIDDEN_NAMES, Decimal(pass_share))
    assert change.crosses == crosses
    assert all(criterion.crosses for criterion in change.criteria)


def _with_full_marks(result: CriterionResult) -> CriterionResult:
    return replace(result, marks=result.max_marks)


def test_equal_marks_are_equal_however_many_decimals_they_have(store: Store) -> None:
    """SQLite stores marks as text, and "8" is not "8.0"."""
    batch = _batch(store, "ada", "bob", "cyd")
    _grade_all(store)
    again = _regrade(store, batch)
    with store.transaction() as session:
        for student, before, after in (("ada", "8", "8.0"), ("bob", "9", "10"), ("cyd", "8.00", "8")):
            job = session.scalars(select(Job).join(Enrolment).where(Enrolment.student == student)).all()
            for row in job:
                row.marks = Decimal(before if row.regrade_of is None else after)
                row.max_marks = Decimal("10" if row.regrade_of is None else "10.00")
    with store.reading() as session:
        page = regrade_changes.load_changes_page(session, again, 1, NO_HIDDEN_NAMES)
    assert page.differing == 1
    assert [(change.student, change.differs) for change in page.changes] == [
        ("bob", True), ("ada", False), ("cyd", False),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("condition", "expected_ids"),
    [
        (Job.marks == Decimal("8"), {"8", "8.0"}),
        (Job.marks != Decimal("8.00"), {"9", "10"}),
        (Job.marks > Decimal("8.5"), {"9", "10"}),
        (Job.marks <= Decimal("9.0"), {"8", "8.0", "9"}),
        (Job.marks.is_(None), set()),
        (Job.marks.in_([Decimal("8.0"), Decimal("10.0")]), {"8", "8.0", "10"}),
    ],
)
def test_every_query_compares_marks_as_numbers(
    store: Store, condition: ColumnElement[bool], expected_ids: set[str]
) -> None:
    marks = ("8", "8.0", "9", "10")
    _batch(store, *(f"student-{number}" for number, _ in enumerate(marks)))
    with store.transaction() as session:
        for job, own in zip(session.scalars(select(Job).order_by(Job.id)), marks, strict=True):
            job.marks = Decimal(own)
    with store.reading() as session:
        assert {str(job.marks) for job in session.scalars(select(Job).where(condition))} == expected_ids


def test_criteria_that_come_and_go_are_told(store: Store) -> None:
    batch = _batch(store, "ada")
    _grade_all(store)
    (first, *rest) = GRADE.criteria
    other = replace(GRADE, criteria=(replace(first, id="new", title="A new one", marks=Decimal(1)), *rest))
    (change,) = _changes(store, _regrade(store, batch, other, changed=True))
    is_missing = {criterion.title: (criterion.before is None, criterion.after is None) for criterion in change.criteria}
    assert is_missing == {"A new one": (True, False), first.title: (False, True)}


def test_what_is_not_graded_and_other_assignments_are_left_out(store: Store) -> None:
    batch = _batch(store, "ada", "bob", "cid")
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    with pytest.raises(UsageError, match="nothing to grade again: 3 of its submissions are not graded yet"):
        acting.regrade(store, batch, None, max_attempts=3, actor="staff")
    jobs.give_up_job(store, claim, "no program")
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    jobs.finish_job(store, claim, prepared(GRADE), datetime.now(UTC))
    other = replace(echo(), id="other")
    with pytest.raises(UsageError, match="has no submission for other, only for echo-responder"):
        acting.regrade(store, batch, other, max_attempts=3, actor="staff")
    made = acting.regrade(store, batch, None, max_attempts=3, actor="staff")
    assert (made.jobs, made.other_assignment, made.unfinished) == (2, 0, 1)
    with pytest.raises(UsageError, match="There is no such"):
        acting.publish(store, "nowhere", actor="staff")


def test_what_could_not_be_graded_may_get_its_first_grade(store: Store) -> None:
    batch = _batch(store, "ada")
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    jobs.give_up_job(store, claim, "no program")
    (change,) = _changes(store, _regrade(store, batch, changed=True))
    assert (change.before, change.after) == (None, GRADE.marks)
    assert "had no grade" in change.reason
    assert acting.publish(store, batch, actor="staff") == PublicationCounts(1, 1, 0, 0, 0, 0)


def test_a_newer_submission_does_not_stop_a_regrade_of_the_one_before(store: Store) -> None:
    batch = _batch(store, "ada")
    _grade_all(store)
    made = acting.regrade(store, batch, None, max_attempts=3, actor="staff")
    accept_new_submissions(store, "late", [grading_request("ada", "print('other')\n")], [], max_attempts=3)
    with store.reading() as session:
        assert session.scalars(select(Job.state).where(Job.batch_id == made.batch_id)).all() == [JobState.QUEUED]


def test_the_same_batch_again_after_a_regrade_changes_nothing_and_points_at_a_changed_grader(store: Store) -> None:
    batch = _batch(store, "ada")
    _grade_all(store)
    _regrade(store, batch, changed=True)
    for assignment in (echo(), CHANGED):
        again = accept_new_submissions(
            store, "class", [grading_request("ada", assignment=assignment)], [], max_attempts=3
        )
        assert (again.batch, again.known[0].other_grader) == (None, False)
    with store.transaction() as session:
        session.execute(update(Job).values(grader_sha256="f" * 64))
    assert accept_new_submissions(store, "class", [grading_request("ada")], [], max_attempts=3).known[0].other_grader


def test_a_batch_of_regrades_can_be_cancelled_and_leaves_the_old_grades(store: Store) -> None:
    batch = _batch(store, "ada")
    _grade_all(store)
    before = _standing(store, batch)
    made = acting.regrade(store, batch, None, max_attempts=3, actor="staff")
    acting.cancel(store, made.batch_id, actor="staff")
    assert acting.publish(store, batch, actor="staff").replaced == 0
    assert _standing(store, batch) == before
    with store.reading() as session:
        names = session.scalars(select(Batch.name).order_by(Batch.created_at)).all()
        assert [entry.actor for entry in audit.load_entries(session, "batch", made.batch_id)] == ["staff"]
    assert names == ["class", "regrade of class"]
