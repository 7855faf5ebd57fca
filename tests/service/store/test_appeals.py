"""A student has one open appeal at a time, on a visible grade. An instructor of the course answers once."""

from __future__ import annotations

import pytest
from sqlalchemy import update

import report_builders
from builders import grading_request, prepared, release_at_once
from service.store import audit
from service.store.batches.intake import accept_batch
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import freeze_assignment
from service.store.courses.hidden_names import HiddenNames, load_hidden_names
from service.store.engine import Store
from service.store.grades import appeals
from service.store.grades.appeals import MAX_TEXT_LENGTH
from service.store.queue import jobs
from service.store.tables.submissions import SubmissionRow
from sim.errors import UsageError

NONE_HIDDEN = HiddenNames(frozenset(), b"")


def _submitted(store: Store) -> None:
    accept_batch(store, "class", [grading_request("ada")], [], max_attempts=3)
    release_at_once(store)


def _graded(store: Store) -> None:
    _submitted(store)
    _grade(store)


def _grade(store: Store) -> None:
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    jobs.finish_job(store, claim, prepared(report_builders.faulty_grade()), claim.at)


def _ask(store: Store, text: str = "Why?") -> int:
    with store.transaction() as session:
        return appeals.open_appeal(session, 1, text)


def _answer(store: Store, number: int, text: str = "Because.", course: int = 1) -> None:
    with store.transaction() as session:
        appeals.answer_appeal(session, course, number, text, "grace")


def test_one_asks_is_answered_and_may_ask_again(store: Store) -> None:
    _graded(store)
    first = _ask(store, " Why?\r\nLine 3 prints it. ")
    with pytest.raises(UsageError, match="you already have an open appeal"):
        _ask(store, "And why?")
    with store.reading() as session:
        (line,) = appeals.list_open_appeals(session, 1, NONE_HIDDEN)
    assert (line.who, line.text, line.answer) == ("ada", "Why?\nLine 3 prints it.", None)
    _answer(store, first)
    with pytest.raises(UsageError, match="already has an answer"):
        _answer(store, first, "Really.")
    second = _ask(store, "And why?")
    with store.reading() as session:
        assert [each.id for each in appeals.list_open_appeals(session, 1, NONE_HIDDEN)] == [second]
        (answered,) = appeals.list_answered_appeals(session, 1, NONE_HIDDEN)
        assert [each.id for each in appeals.load_appeals(session, 1)] == [second, first]
        assert appeals.list_open_appeals(session, 2, NONE_HIDDEN) == []
        (entry,) = audit.load_entries(session, "submission", "1")
    assert (answered.answer, answered.answered_by) == ("Because.", "grace")
    assert (entry.actor, entry.action, entry.detail) == ("grace", "answer appeal", {"appeal": first})


def test_what_cannot_be_asked_or_answered_is_refused(store: Store) -> None:
    _submitted(store)
    with pytest.raises(UsageError, match="after your grade is visible"):
        _ask(store)
    _grade(store)
    for text in ("", " \n ", "x" * (MAX_TEXT_LENGTH + 1)):
        with pytest.raises(UsageError, match=f"expected 1 to {MAX_TEXT_LENGTH}"):
            _ask(store, text)
    number = _ask(store)
    with pytest.raises(UsageError, match="the answer has 0 characters"):
        _answer(store, number, "")
    for course, which in ((2, number), (1, number + 1)):
        with pytest.raises(UsageError, match=f"this course has no appeal {which}"):
            _answer(store, which, course=course)


def test_a_grade_for_staff_alone_cannot_be_asked_about(store: Store) -> None:
    _graded(store)
    with store.transaction() as session:
        session.execute(update(SubmissionRow).values(staff_only="2 days late, allowed: 0"))
    with pytest.raises(UsageError, match="after your grade is visible"):
        _ask(store)


def test_who_asks_is_not_named_while_names_are_hidden(store: Store) -> None:
    _graded(store)
    _ask(store)
    with store.transaction() as session:
        open_assignments.prepare_assignment(session, 1, freeze_assignment(grading_request("ada").assignment))
        open_assignments.hide_names(session, 1, "echo-responder", True)
    hidden = load_hidden_names(store, 1)
    with store.reading() as session:
        (line,) = appeals.list_open_appeals(session, 1, hidden)
    assert line.who == hidden.label_student("echo-responder", "ada")
    assert line.who.startswith("Participant ")
