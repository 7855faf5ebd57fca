"""Repeat a stored grading on this machine and compare the recordings' hashes and the marks."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from collections.abc import Set as AbstractSet

from service.commands.installation import open_installation
from service.commands.output import create_table, print_json, print_line, print_note, print_renderables
from service.grading.grade import Grade, TrialResult
from service.grading.grader import grade as grade_submission
from service.grading.trial_runner import TrialRunner
from service.operations import stored_grades
from service.operations.stored_grades import StoredGrading
from service.version import GRADER_VERSION, hash_grader
from sim.errors import HostError
from sim.recording import Recording, Verdict
from submissions.criteria import Criterion
from submissions.grading_request import GradingRequest
from submissions.seeds import PUBLIC_SECRET, Secret, format_secret_name

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
    stored, grading_request, secret = grading.grade, grading.request, _check_secret(grading)
    again = _grade_again(grading_request, secret)
    rows = list(zip(stored.trials, again.trials, strict=False))
    marks = _compare_marks(stored, again, rows, grading_request.assignment.criteria)
    cause = _find_cause(rows, marks, again, grading_request, secret)
    differs = len(stored.trials) != len(again.trials) or "differs" in (
        *marks,
        *itertools.starmap(_compare_trials, rows),
    )
    same = not differs and cause is None
    print_json(**_comparison_to_json(grading.job_id, stored, again, rows), same=same, cause=cause)
    compared = create_table("scenario", "trial", "stored", "again", "")
    for before, after in rows:
        hashes = (before.recording.sha256[:16], after.recording.sha256[:16])
        compared.add_row(before.scenario, str(before.index), *hashes, _compare_trials(before, after))
    print_renderables(compared)
    print_line(f"marks: {stored.marks} stored, {again.marks} regraded")
    if grading.grader_sha256 != hash_grader():
        print_note(
            f"graded by Robomark {stored.grader_version}, regraded by {GRADER_VERSION}; their code or libraries differ"
        )
    for result, compared_marks in zip(stored.criteria, marks, strict=False):
        if compared_marks != "same":
            print_note(f"the marks of {result.title} differ ({compared_marks})")
    if not same:
        reason = "" if cause is None else f": {_REASONS[cause] if differs else _LIMIT_REASON}"
        raise HostError(f"grade {grading.job_id} does not match its regrade{reason}")
    print_line(f"grade {grading.job_id} matches its regrade")


def _grade_again(request: GradingRequest, secret: Secret, earlier: int = 0) -> Grade:
    """Grade every trial of the submission in fresh processes, after grading it ``earlier`` times.

    In a new process namespace, process ids start again at 1. Only earlier processes make the ids differ.
    """
    with TrialRunner(spares=False) as runner:
        for _ in range(earlier):
            grade_submission(request.submission, request.assignment, secret=secret, runner=runner)
        return grade_submission(request.submission, request.assignment, secret=secret, runner=runner)


def _find_cause(
    rows: Sequence[TrialPair], marks: Sequence[str], again: Grade, request: GradingRequest, secret: Secret
) -> str | None:
    """Return the cause of the differences, ``program`` or ``grader``, or None if nothing differs.

    Grades the submission twice more, each time in fresh processes. If these gradings also differ, the program uses its
    own randomness. Robomark itself is deterministic. Marks that differ where a limit cut a trial have no cause if these
    gradings agree: the machine was slow once.
    """
    trials = [number for number, row in enumerate(rows) if _compare_trials(*row) == "differs"]
    criteria = [number for number, compared in enumerate(marks) if compared != "same"]
    if not trials and not criteria:
        return None
    repeated = (_grade_again(request, secret), _grade_again(request, secret, earlier=1))
    differs = any(
        any(_compare_trials(again.trials[number], grade.trials[number]) == "differs" for number in trials)
        or any(again.criteria[number].marks != grade.criteria[number].marks for number in criteria)
        for grade in repeated
    )
    if differs:
        return "program"
    return "grader" if trials or "differs" in marks else None


def _comparison_to_json(job_id: str, stored: Grade, again: Grade, rows: Sequence[TrialPair]) -> dict[str, object]:
    """Return the JSON value for the comparison."""
    return {
        "grade": job_id,
        "marks": stored.marks,
        "marks_again": again.marks,
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
    own, needed = grading.own_secret, grading.secret_sha256
    if needed is None:
        print_note("graded before this installation had a secret: regraded in the same worlds")
        return PUBLIC_SECRET
    if needed != own.sha256:
        raise HostError(
            f"grade {grading.job_id} cannot be verified with this secret: it was graded with "
            f"{format_secret_name(needed)}, and "
            f"the secret here is {own.name}; set ROBOMARK_SECRET to the original secret"
        )
    print_note(f"secret: {own.name}")
    return own


def _compare_marks(stored: Grade, again: Grade, rows: Sequence[TrialPair], criteria: Sequence[Criterion]) -> list[str]:
    """Return ``same``, ``cut by a limit`` or ``differs`` for each criterion.

    Marks may only differ if the criterion uses a trial that a limit cut short.
    """
    by_id = {criterion.id: criterion for criterion in criteria}
    cut = {before.scenario for before, after in rows if _compare_trials(before, after) == "cut by a limit"}
    return [
        "same"
        if before.marks == after.marks
        else "cut by a limit"
        if before.id in by_id and _is_affected(by_id[before.id], cut)
        else "differs"
        for before, after in zip(stored.criteria, again.criteria, strict=True)
    ]


def _is_affected(criterion: Criterion, scenarios: AbstractSet[str]) -> bool:
    return criterion.judges_runs and bool(scenarios & set(criterion.scenarios or scenarios))


def _compare_trials(before: TrialResult, after: TrialResult) -> str:
    if before.recording.sha256 == after.recording.sha256:
        return "same"
    cut = before.verdict in _LIMIT_VERDICTS or after.verdict in _LIMIT_VERDICTS
    return "cut by a limit" if cut and _has_same_beginning(before.recording, after.recording) else "differs"


def _has_same_beginning(before: Recording, after: Recording) -> bool:
    """Return whether the output of one recording is a prefix of the other's output."""
    pairs = (*zip(before.spoken, after.spoken, strict=False), *zip(before.printed, after.printed, strict=False))
    messages = zip(before.messages, after.messages, strict=False)
    return all(one == other for one, other in pairs) and all(
        (one.t, one.sender, one.text) == (other.t, other.sender, other.text) for one, other in messages
    )
