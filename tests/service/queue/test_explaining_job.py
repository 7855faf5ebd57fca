"""Causes of lost marks in stored grades: searched once, when nothing else waits, and shown with the grade."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy.orm import Session

from builders import opened, settings_in
from processes import until
from responders.source_file import SourceFile
from service.grading.grade import ShownCause
from service.grading.trial_runner import TrialRunner
from service.queue.broker import build_broker_url
from service.queue.celery_app import make_celery
from service.queue.embedded_services import EmbeddedServices
from service.queue.explaining_job import explain_next_grade, is_student_waiting
from service.queue.grading_job import GradingOutcome, grade_next_job
from service.queue.notifier import Notifier
from service.reports.view import build_staff_view, build_student_view
from service.settings import Settings
from service.store.batches.intake import accept_submission
from service.store.engine import Store
from service.store.grades import causes, results
from service.store.grades.causes import StoredCauses
from service.store.states import JobQueue, JobState
from service.store.tables.submissions import Job
from submissions.assignment.examples import read_example
from submissions.assignment.reader import find_assignment, read_assignment
from submissions.grading_request import GradingRequest

HIDDEN = """
id = "hidden-noise"
title = "Hidden noise"
[reruns]
reveals = 1
[parts]
responder = "none"
[[scenario]]
id = "calm"
poses = [[300, 700, 0]]
seconds = 5
visibility = "hidden"
motor_noise = 200
[[criterion]]
title = "Keeps its heading"
marks = 2
check = "pose"
heading = 0
heading_tolerance = 0.001
"""
STRAIGHT = "tank_drive.on_for_rotations(20, 20, 200 / 176)\n"


def submit(store: Store, settings: Settings, runner: TrialRunner, request: GradingRequest) -> str:
    accepted = accept_submission(store, request, lane=JobQueue.INTERACTIVE, max_attempts=3)
    if accepted.copied_from is None:
        assert grade_next_job(store, settings, runner, "worker") is GradingOutcome.GRADED
    return accepted.job_id


def wrong_echo(student: str) -> GradingRequest:
    reference = read_example("echo-responder", "reference")
    assert reference.responder is not None
    text = reference.responder.text.replace("Python saw >>", "Python saw >")
    submission = replace(reference, student=student, responder=SourceFile("responder.py", text))
    return GradingRequest(submission, find_assignment("echo-responder"), f"{student}.zip")


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return settings_in(tmp_path)


def test_causes_are_searched_once_and_loaded_with_the_grade(settings: Settings, runner: TrialRunner) -> None:
    with opened(settings) as store:
        job_id = submit(store, settings, runner, wrong_echo("ada"))
        with store.reading() as session:
            assert results.load_grade(session, job_id).causes == ()
        assert causes.count_unexplained_grades(store) == 1
        assert explain_next_grade(store, settings, runner) == job_id
        assert causes.count_unexplained_grades(store) == 0
        assert explain_next_grade(store, settings, runner) is None
        with store.reading() as session:
            grade = results.load_grade(session, job_id)
        (cause,) = grade.causes
        assert (cause.criterion, cause.files) == ("replies", ("responder.py",))
        assert cause.text.startswith("With the reference's responder in place of yours, the same program gets all 4")
        assert cause.staff_note.startswith("For staff: in line 14")
        assert build_student_view(grade).grade.causes == (replace(cause, staff_note=""),)


def test_full_marks_need_no_causes(settings: Settings, runner: TrialRunner) -> None:
    with opened(settings) as store:
        reference = read_example("echo-responder", "reference")
        submit(store, settings, runner, GradingRequest(reference, find_assignment("echo-responder"), "ada.zip"))
        assert explain_next_grade(store, settings, runner) is None


@pytest.mark.parametrize(("search_causes", "expected"), [(True, [1]), (False, [])])
def test_workers_are_notified_of_searches_unless_they_are_off(
    settings: Settings, runner: TrialRunner, monkeypatch: pytest.MonkeyPatch, search_causes: bool, expected: list[int]
) -> None:
    notices: list[int] = []
    monkeypatch.setattr(Notifier, "_count_missing", lambda _, queue, due: due)
    monkeypatch.setattr(Notifier, "explain", lambda _, count: notices.append(count))
    monkeypatch.setattr(Notifier, "plot", lambda _, count: None)
    with opened(settings) as store:
        submit(store, settings, runner, wrong_echo("ada"))
        own_settings = replace(settings, search_causes=search_causes).with_broker(build_broker_url(settings))
        Notifier(make_celery(own_settings), store, own_settings).catch_up()
    assert notices == expected


@pytest.mark.long
def test_a_worker_without_other_work_searches(tmp_path: Path) -> None:
    settings = settings_in(tmp_path, concurrency=1, search_causes=True)
    with opened(settings) as store, EmbeddedServices(settings, store) as services:
        job_id = accept_submission(store, wrong_echo("ada"), lane=JobQueue.INTERACTIVE, max_attempts=3).job_id
        Notifier(make_celery(services.settings), store, services.settings).grade(JobQueue.INTERACTIVE, 1)

        def list_causes() -> tuple[ShownCause, ...]:
            services.ensure()
            with store.reading() as session:
                return results.load_grade(session, job_id).causes if _is_done(session, job_id) else ()

        (cause,) = until(list_causes)
        assert cause.criterion == "replies"


def _is_done(session: Session, job_id: str) -> bool:
    return session.get_one(Job, job_id).state is JobState.DONE


def test_failed_search_leaves_the_grade_without_causes(
    settings: Settings, runner: TrialRunner, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise RuntimeError("broken")

    with opened(settings) as store:
        job_id = submit(store, settings, runner, wrong_echo("ada"))
        monkeypatch.setattr("service.queue.explaining_job.add_causes", fail)
        assert explain_next_grade(store, settings, runner) == job_id
        assert explain_next_grade(store, settings, runner) is None
        with store.reading() as session:
            assert results.load_grade(session, job_id).causes == ()


def test_a_student_who_waits_interrupts_a_search_which_is_done_later(
    settings: Settings, runner: TrialRunner, monkeypatch: pytest.MonkeyPatch
) -> None:
    with opened(settings) as store:
        submit(store, settings, runner, wrong_echo("ada"))
        assert not is_student_waiting(store)
        other = GradingRequest(read_example("say-tm129", "reference"), find_assignment("say-tm129"), "ben.zip")
        accept_submission(store, other, lane=JobQueue.INTERACTIVE, max_attempts=3)
        assert is_student_waiting(store)
        monkeypatch.setattr("service.queue.explaining_job._LOOK_SECONDS", 0.0)
        assert explain_next_grade(store, settings, runner) is not None
        assert causes.count_unexplained_grades(store) == 1
        assert grade_next_job(store, settings, runner, "worker") is GradingOutcome.GRADED
        assert explain_next_grade(store, settings, runner) is not None
        assert causes.count_unexplained_grades(store) == 0


def test_hidden_causes_are_counted_for_each_student(settings: Settings, runner: TrialRunner, tmp_path: Path) -> None:
    folder = tmp_path / "hidden-noise"
    folder.mkdir()
    (folder / "assignment.toml").write_text(HIDDEN)
    assignment = read_assignment(folder)
    reference = read_example("echo-responder", "reference")
    with opened(settings) as store:
        grades = []
        for extra in ("", "# again\n"):
            submission = replace(reference, responder=None, program=SourceFile("robot.py", STRAIGHT + extra))
            job_id = submit(store, settings, runner, GradingRequest(submission, assignment, "ada.zip"))
            explain_next_grade(store, settings, runner)
            with store.reading() as session:
                grades.append(results.load_grade(session, job_id))
                assert causes.count_revealed_causes(session, job_id) == len(grades) - 1
        first, second = grades
        assert [each.for_staff for each in (*first.causes, *second.causes)] == [False, True]
        (shown,) = build_student_view(first).grade.causes
        assert shown.text.startswith("In a hidden trial: With the motor noise off, the same submission gets all 2")
        assert shown.staff_note == ""
        assert build_student_view(second).grade.causes == ()
        assert [each.staff_note for each in build_staff_view(second).grade.causes] == [
            "Only staff see this: the student has seen 1 of 1 causes in hidden trials."
        ]


def test_copied_grades_are_explained_for_their_own_student(settings: Settings, runner: TrialRunner) -> None:
    with opened(settings) as store:
        first = submit(store, settings, runner, wrong_echo("ada"))
        causes.store_causes(store, first, StoredCauses((), revealed=1))
        second = submit(store, settings, runner, wrong_echo("ben"))
        with store.reading() as session:
            assert list(causes.load_causes(session, [first, second])) == [first]
        assert explain_next_grade(store, settings, runner) == second
        with store.reading() as session:
            assert [each.criterion for each in results.load_grade(session, second).causes] == ["replies"]
