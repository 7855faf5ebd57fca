"""Repeat a stored grading on this machine and compare the recordings' hashes and the marks."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from collections.abc import Set as AbstractSet

from service.commands.installation import open_installation
from service.commands.output import create_table, print_json, print_line, print_note, print_renderables
from service.grading.grade import Grade, TrialResult
from service.grading.grader import grade as grade_submission
from service.grading.pools.drawing import PoolExtent
from service.grading.trial_runner import TrialRunner
from service.operations import stored_grades
from service.operations.stored_grades import StoredGrading
from service.version import GRADER_VERSION, hash_grader
from sim.errors import HostError
from sim.recording import Recording, Verdict
from submissions.criteria import Criterion
from submissions.grading_request import GradingRequest
from submissions.seeds import PUBLIC_SECRET, Secret, choose_secret, format_secret_name

#: A stored trial and its repetition.
TrialPair = tuple[TrialResult, TrialResult]

#: Explanation of a difference, by cause.
_REASONS = {
    "program": (
        "three gradings in fresh processes differ from each other, so the program depends on outside values, such as "
        "object addresses or the processor's clock"
    ),
    "grader": (
        "three gradings in fresh processes are the same, so this is a fault in Robomark; please report it with both "
        "versions"
    ),
}
_LIMIT_REASON = (
    "a limit stops the program in some gradings in fresh processes and not in others, so the program is close to this "
    "limit or depends on outside values"
)
#: The machine and its load decide when such a trial ends, so its hash can differ.
_LIMIT_VERDICTS = frozenset({Verdict.CPU_LIMIT, Verdict.MEMORY_LIMIT, Verdict.STALLED, Verdict.HOST_ERROR})


def verify_grade(grade: str) -> None:
    """Repeat the grading with this id. Raises HostError for an unexpected difference."""
    with open_installation() as (service, actor):
        grading = stored_grades.load_grading(service, actor, grade)
    stored_grade, grading_request, secret = grading.grade, grading.request, _check_secret(grading)
    extent = PoolExtent.UNTIL_DECIDED if stored_grade.is_provisional else PoolExtent.WHOLE
    regrade = _grade_again(grading_request, secret, extent)
    rows = list(zip(stored_grade.trials, regrade.trials, strict=False))
    marks = _compare_marks(stored_grade, regrade, rows, grading_request.assignment.criteria)
    cause = _find_cause(rows, marks, regrade, lambda earlier: _grade_again(grading_request, secret, extent, earlier))
    has_differences = len(stored_grade.trials) != len(regrade.trials) or "differs" in (
        *marks,
        *itertools.starmap(_compare_trials, rows),
    )
    is_same = not has_differences and cause is None
    print_json(**_comparison_to_json(grading.job_id, stored_grade, regrade, rows), same=is_same, cause=cause)
    table = create_table("scenario", "trial", "stored", "again", "")
    for stored_trial, new_trial in rows:
        hashes = (stored_trial.recording.sha256[:16], new_trial.recording.sha256[:16])
        table.add_row(stored_trial.scenario, str(stored_trial.index), *hashes, _compare_trials(stored_trial, new_trial))
    print_renderables(table)
    print_line(f"marks: {stored_grade.marks} stored, {regrade.marks} regraded")
    if grading.grader_sha256 != hash_grader():
        print_note(
            f"graded by Robomark {stored_grade.grader_version}, regraded by {GRADER_VERSION}; their code or "
            "libraries differ"
        )
    for result, comparison in zip(stored_grade.criteria, marks, strict=False):
        if comparison != "same":
            print_note(f"the marks of {result.title} differ ({comparison})")
    if not is_same:
        reason = "" if cause is None else f": {_REASONS[cause] if has_differences else _LIMIT_REASON}"
        raise HostError(f"grade {grading.job_id} does not match its regrade{reason}")
    print_line(f"grade {grading.job_id} matches its regrade")


def _grade_again(request: GradingRequest, secret: Secret, extent: PoolExtent, earlier_runs: int = 0) -> Grade:
    """Grade every trial of the submission in fresh processes, after grading it ``earlier_runs`` times.

    In a new process namespace, process ids start again at 1. Only earlier processes make the ids differ.
    """
    with TrialRunner(spares=False) as runner:
        *_, last_grade = (
            grade_submission(request.submission, request.assignment, secret=secret, runner=runner, extent=extent)
            for _ in range(earlier_runs + 1)
        )
        return last_grade


def _find_cause(
    rows: Sequence[TrialPair], marks: Sequence[str], regrade: Grade, grade_again: Callable[[int], Grade]
) -> str | None:
    """Return the cause of the differences, ``program`` or ``grader``, or None if nothing differs.

    Grades the submission twice more, each time in fresh processes, after 0 and 1 other gradings. If these gradings also
    differ, the program uses its own randomness. Robomark itself is deterministic. Marks that differ where a limit cut a
    trial have no cause if these gradings agree: the machine was slow once.
    """
    trials = [number for number, row in enumerate(rows) if _compare_trials(*row) == "differs"]
    criteria = [number for number, compared in enumerate(marks) if compared != "same"]
    if not trials and not criteria:
        return None
    repeated_grades = (grade_again(0), grade_again(1))
    has_differences = any(
        any(_compare_trials(regrade.trials[number], grade.trials[number]) == "differs" for number in trials)
        or any(regrade.criteria[number].marks != grade.criteria[number].marks for number in criteria)
        for grade in repeated_grades
    )
    if has_differences:
        return "program"
    return "grader" if trials or "differs" in marks else None


def _comparison_to_json(
    job_id: str, stored_grade: Grade, regrade: Grade, rows: Sequence[TrialPair]
) -> dict[str, object]:
    """Return the JSON value for the comparison."""
    return {
        "grade": job_id,
        "marks": stored_grade.marks,
        "marks_again": regrade.marks,
        "trials": [
            {
                "scenario": before.scenario,
                "index": before.index,
                "sha256": before.recording.sha256,
                "sha256_again": after.recording.sha256,
                "compared": _compare_trials(before, after),
            }
            for before, after in rows
        ],
    }


def _check_secret(grading: StoredGrading) -> Secret:
    """Return the secret that the grading used. Raises HostError if this installation has another secret."""
    own_secret, needed_hash = grading.own_secret, grading.grade.secret_sha256
    secret = choose_secret(needed_hash, own_secret)
    if secret is None:
        raise HostError(
            f"grade {grading.job_id} cannot be verified with this secret: it was graded with "
            f"{format_secret_name(needed_hash)}, and "
            f"the secret here is {own_secret.name}; set ROBOMARK_SECRET to the original secret"
        )
    if secret == PUBLIC_SECRET:
        print_note("graded before this installation had a secret: regraded in the same worlds")
    else:
        print_note(f"secret: {secret.name}")
    return secret


def _compare_marks(
    stored_grade: Grade, regrade: Grade, rows: Sequence[TrialPair], criteria: Sequence[Criterion]
) -> list[str]:
    """Return ``same``, ``cut by a limit`` or ``differs`` for each criterion.

    Marks may only differ if the criterion uses a trial that a limit cut short.
    """
    by_id = {criterion.id: criterion for criterion in criteria}
    cut_scenarios = {before.scenario for before, after in rows if _compare_trials(before, after) == "cut by a limit"}
    return [
        "same"
        if before.marks == after.marks
        else "cut by a limit"
        if before.id in by_id and _is_affected(by_id[before.id], cut_scenarios)
        else "differs"
        for before, after in zip(stored_grade.criteria, regrade.criteria, strict=True)
    ]


def _is_affected(criterion: Criterion, scenarios: AbstractSet[str]) -> bool:
    return criterion.judges_runs and bool(scenarios & set(criterion.scenarios or scenarios))


def _compare_trials(stored_trial: TrialResult, new_trial: TrialResult) -> str:
    if stored_trial.recording.sha256 == new_trial.recording.sha256:
        return "same"
    is_cut = stored_trial.verdict in _LIMIT_VERDICTS or new_trial.verdict in _LIMIT_VERDICTS
    return (
        "cut by a limit" if is_cut and _has_same_beginning(stored_trial.recording, new_trial.recording) else "differs"
    )


def _has_same_beginning(stored_recording: Recording, new_recording: Recording) -> bool:
    """Return whether the output of one recording is a prefix of the other's output."""
    pairs = (
        *zip(stored_recording.spoken, new_recording.spoken, strict=False),
        *zip(stored_recording.printed, new_recording.printed, strict=False),
    )
    messages = zip(stored_recording.messages, new_recording.messages, strict=False)
    return all(one == other for one, other in pairs) and all(
        (one.t, one.sender, one.text) == (other.t, other.sender, other.text) for one, other in messages
    )
