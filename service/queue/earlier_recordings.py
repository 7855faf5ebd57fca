"""Judging of a regrade's earlier recordings again, which tells a change of judging from a change of the simulation.

It explains changes and affects no marks, so it never fails a grading. No student code runs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import structlog
from sqlalchemy import select

from service.grading.grade import CriterionResult, Grade
from service.grading.judging.judge_declaration import StaticAnalysis
from service.grading.judging.limited_judging import compute_judging_limits, judge_within_limits
from service.store.artifacts import File
from service.store.batches import stored_requests
from service.store.engine import Store
from service.store.grades import results
from service.store.grades.judged_again import CriterionWorth, JudgedAgain, RejudgedMarks, build_file
from service.store.grades.recordings import is_whole
from service.store.states import JobState
from service.store.tables.submissions import Job
from service.version import hash_grader
from sim.errors import Cancelled
from submissions.assignment.definition import Assignment
from submissions.criteria import Criterion
from submissions.criteria.code import Functions, PythonCheck, SourceRules

_log = structlog.get_logger(__name__)
#: Criteria whose judges need more than recordings.
_ANALYSED = (Functions, PythonCheck, SourceRules)


def judge_earlier_recordings(
    store: Store, job_id: str, new_grade: Grade, assignment: Assignment, heartbeat: Callable[[], None]
) -> list[File]:
    """Return the marks of the earlier recordings, judged by the old and the new criteria, as a file to store.

    Empty unless the job is a regrade with other marks and at least two possible causes. Raises whatever ``heartbeat``
    raises if it is Cancelled.
    """
    try:
        judged_again = _judge_again(store, job_id, new_grade, assignment, heartbeat)
    except Cancelled:
        raise
    except Exception:
        _log.exception("regrade.not_compared")
        return []
    return [] if judged_again is None else [build_file(judged_again)]


def _judge_again(
    store: Store, job_id: str, new_grade: Grade, assignment: Assignment, heartbeat: Callable[[], None]
) -> JudgedAgain | None:
    with store.reading() as session:
        query = select(Job.regrade_of).where(Job.id == job_id, ~Job.whole_pools)
        earlier = session.get(Job, session.scalar(query) or "")
        if earlier is None or earlier.state is not JobState.DONE or earlier.missing or new_grade.missing:
            return None
        old_assignment = stored_requests.load_assignment(session, earlier.id)
        has_other_code = earlier.grader_sha256 != hash_grader()
        has_other_criteria = old_assignment.criteria != assignment.criteria
        if not has_other_code and not has_other_criteria:
            return None
        old_grade = results.load_original_grade(session, earlier.id)
    has_equal_marks = _list_worth(old_grade) == _list_worth(new_grade)
    # With equal recordings and one cause, that cause is certain.
    is_certain = _list_recordings(old_grade) == _list_recordings(new_grade) and has_other_code != has_other_criteria
    if has_equal_marks or is_certain or not all(is_whole(trial.recording) for trial in old_grade.trials):
        return None

    def judge(judged_assignment: Assignment) -> dict[str, CriterionResult]:
        criteria = tuple(filter(_needs_only_recordings, judged_assignment.criteria))
        limits = compute_judging_limits(old_grade.trials)
        judged = judge_within_limits(
            limits, replace(judged_assignment, criteria=criteria), old_grade.trials, StaticAnalysis(), heartbeat
        )
        return {result.id: result for result in judged if not result.unjudged}

    by_new_criteria = judge(assignment)
    by_old_criteria = judge(old_assignment) if has_other_criteria else by_new_criteria
    names = by_old_criteria.keys() & by_new_criteria.keys()
    return JudgedAgain(
        earlier.id,
        {name: RejudgedMarks(_get_worth(by_old_criteria[name]), _get_worth(by_new_criteria[name])) for name in names},
    )


def _needs_only_recordings(criterion: Criterion) -> bool:
    return not isinstance(criterion, _ANALYSED) and criterion.result_needed is None


def _get_worth(result: CriterionResult) -> CriterionWorth:
    return result.marks, result.max_marks


def _list_worth(grade: Grade) -> list[tuple[object, ...]]:
    return [(result.id, *_get_worth(result)) for result in grade.criteria]


def _list_recordings(grade: Grade) -> list[tuple[object, ...]]:
    return [(trial.scenario, trial.index, trial.recording.sha256, trial.verdict) for trial in grade.trials]
