"""Checks a notebook against the visible scenarios of an assignment, without marks that count.

The seeds are public, so that a check depends on no secret and gives the same result on every installation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from io import BytesIO
from typing import Any

from service.grading.grade import CriterionResult, Grade
from service.grading.grader import ProgressObserver, grade
from service.grading.pools.drawing import PoolExtent
from service.grading.trial_runner import TrialRunner
from service.plotting import load_own_floors
from service.reports.diagnosis import describe_finding, diagnose
from service.reports.display_text import format_decimal, to_display_text, to_one_line
from service.reports.replay.document import build_grade_replay
from service.reports.view import build_student_view
from sim.errors import HostError, UsageError
from sim.recording import Verdict
from submissions.assignment.definition import Assignment
from submissions.bundle import build_submission
from submissions.criteria import AnyCriterion
from submissions.part_fitting import find_empty_parts
from submissions.raw_files import UploadedFile, read_uploaded, sanitise_name
from submissions.seeds import PUBLIC_SECRET
from submissions.submission import Submission

#: Size limit of the compressed replay. The worst trial of each scenario comes first.
_REPLAY_BYTES = 1_500_000
_MAX_TEXT_LENGTH, _MAX_NOTES = 1000, 40


def build_visible_assignment(assignment: Assignment) -> Assignment:
    """Return the part of an assignment that students see before publication: scenarios and criteria.

    Raises:
        UsageError: If nothing can be judged in the visible part.
    """
    scenarios = tuple(each for each in assignment.scenarios if each.visibility == "visible")
    ids = frozenset(each.id for each in scenarios)
    training = assignment.training
    criteria = {
        each.id: narrowed
        for each in assignment.criteria
        if each.visibility == "visible" and (narrowed := _narrow_criterion(each, ids)) is not None
    }
    if not criteria or (training is not None and not ids.issuperset(training.scenarios)):
        raise UsageError(
            "this assignment has no visible scenario in which a notebook can be checked; submit it instead"
        )
    kept = (each if each.needs in criteria else each.model_copy(update={"needs": None}) for each in criteria.values())
    return replace(assignment, scenarios=scenarios, criteria=tuple(kept), secret="")


def _narrow_criterion(criterion: AnyCriterion, visible_ids: frozenset[str]) -> AnyCriterion | None:
    """Return the criterion for its visible scenarios; None if it has none."""
    if not criterion.scenarios:
        return criterion if visible_ids or not criterion.judges_runs else None
    kept = tuple(each for each in criterion.scenarios if each in visible_ids)
    return criterion.model_copy(update={"scenarios": kept}) if kept else None


def read_checked_notebook(
    assignment: Assignment, name: str, notebook: bytes, files: Mapping[str, bytes], student: str
) -> Submission:
    """Return the submission of a notebook with the files beside it.

    Raises:
        UsageError: The files are not a valid submission to the assignment.
    """
    uploads = [UploadedFile(each, BytesIO(data)) for each, data in {**files, name: notebook}.items()]
    source = sanitise_name(name)
    submission = build_submission(read_uploaded(uploads, source), source, student, assignment.id, assignment.parts)
    for part in find_empty_parts(submission):
        raise UsageError("%(name)s is empty, expected a program.", name=part)
    return submission


def check_submission(
    submission: Submission, assignment: Assignment, runner: TrialRunner, observe: ProgressObserver
) -> dict[str, Any]:
    """Grade a submission in the visible part of an assignment, and return the check as data. Raises like ``grade``."""
    graded = grade(
        submission,
        build_visible_assignment(assignment),
        secret=PUBLIC_SECRET,
        runner=runner,
        observe=observe,
        extent=PoolExtent.UNTIL_DECIDED,
    )
    if graded.verdict is Verdict.HOST_ERROR:
        raise HostError("a trial ended because of a machine fault")
    view = build_student_view(graded)
    replay = build_grade_replay(view, submission, load_own_floors(assignment), _REPLAY_BYTES) if graded.trials else None
    return grade_to_check(view.grade, submission, replay)


def grade_to_check(grade: Grade, submission: Submission | None, replay: dict[str, Any] | None) -> dict[str, Any]:
    """Return what a student's view of a grade says, as data."""
    diagnosis = diagnose(grade, submission)
    return {
        "title": to_one_line(grade.assignment_title, 200),
        "happened": to_display_text(diagnosis.cause, _MAX_TEXT_LENGTH),
        "marks": format_decimal(grade.marks),
        "out_of": format_decimal(grade.max_marks),
        "criteria": [_criterion_to_json(grade, each, replay) for each in grade.criteria],
        "next_steps": [
            to_display_text(each, _MAX_TEXT_LENGTH) for each in (diagnosis.next_step, *diagnosis.further) if each
        ],
        "notes": [to_display_text(each, _MAX_TEXT_LENGTH) for each in grade.notes[:_MAX_NOTES]],
        "replay": replay,
    }


def _criterion_to_json(grade: Grade, result: CriterionResult, replay: dict[str, Any] | None) -> dict[str, Any]:
    return {
        "title": to_one_line(result.title, 200),
        "found": to_display_text(describe_finding(grade, result) or result.message, _MAX_TEXT_LENGTH),
        "marks": format_decimal(result.marks),
        "out_of": format_decimal(result.max_marks),
        "passed": result.marks >= result.max_marks,
        "moment": _find_moment(result, replay),
    }


def _find_moment(result: CriterionResult, replay: dict[str, Any] | None) -> list[float] | None:
    """Return the first failure that the replay shows: its trial in the replay, from 0, and its second."""
    places = {} if replay is None else {trial["trial"] - 1: place for place, trial in enumerate(replay["trials"])}
    return next(
        (
            [places[each.trial], each.t]
            for each in result.evidence
            if not each.passed and each.t is not None and each.trial in places
        ),
        None,
    )
