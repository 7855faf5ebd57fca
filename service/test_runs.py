"""Test runs: a program runs once, unmarked, in the first visible scenario with a public seed.

Uses the sandbox and simulator of grading; ``store.queue.test_runs`` stores owners and results.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from service.grading.grade import Grade
from service.grading.grader import ProgressObserver, grade
from service.grading.trial_runner import TrialRunner
from service.plotting import load_own_floors
from service.reports.display_text import to_display_text, to_one_line
from service.reports.faults import group_faults
from service.reports.replay.document import build_grade_replay, compress_replay
from service.reports.replay.trial import format_moment_link
from service.reports.transcript import build_transcript
from service.reports.verdict_sentences import describe_grade
from service.reports.view import build_student_view
from sim.recording import Verdict
from sim.recording_values import collect_faults
from submissions.assignment.definition import Assignment
from submissions.assignment.scenario import NO_SWEEP
from submissions.criteria.code import SourceRules
from submissions.part_notes import build_missing_part_note
from submissions.seeds import PUBLIC_SECRET
from submissions.submission import PART_FILES, Submission

#: Simulated seconds; less if the assignment's own limit is shorter.
MAX_SECONDS = 30.0
_PROGRAM_CPU, _RESPONDER_CPU, _ALL_CPU, _ALL_SLEEP, _ALL_OUTPUT_MB = 3.0, 5.0, 10.0, 10.0, 8
_MAX_LINES = 400
_MAX_LINE_LENGTH = 400


@dataclass(frozen=True, slots=True)
class RunResult:
    """The result of a test run: plain data for display, and the compressed replay."""

    verdict: Verdict
    words: dict[str, Any]
    replay: bytes | None


def build_single_trial_assignment(assignment: Assignment) -> Assignment | None:
    """Return an assignment with the single trial of test runs; None without a visible scenario.

    It depends on no secret, has no marks, and allows no more than the original assignment.
    """
    visible_scenario = next((each for each in assignment.scenarios if each.visibility == "visible"), None)
    if visible_scenario is None or assignment.training is not None:
        return None
    limits = assignment.limits
    single_trial = replace(
        visible_scenario,
        poses=visible_scenario.poses[:1],
        second_poses=visible_scenario.second_poses[:1],
        choose="each",
        trials=1,
        seconds=min(visible_scenario.seconds, MAX_SECONDS),
        light_noise=visible_scenario.light_noise[:1],
        motor_noise=visible_scenario.motor_noise[:1],
        sweep=NO_SWEEP,
    )
    return replace(
        assignment,
        scenarios=(single_trial,),
        # The same imports are forbidden as in the assignment.
        criteria=tuple(each for each in assignment.criteria if isinstance(each, SourceRules)),
        limits=replace(
            limits,
            program_cpu=min(limits.program_cpu, _PROGRAM_CPU),
            responder_cpu=min(limits.responder_cpu, _RESPONDER_CPU),
            all_cpu=min(limits.all_cpu or _ALL_CPU, _ALL_CPU),
            all_sleep=min(limits.all_sleep, _ALL_SLEEP),
            all_output_mb=min(limits.all_output_mb, _ALL_OUTPUT_MB),
        ),
        secret="",
    )


def execute_test_run(
    submission: Submission, assignment: Assignment, runner: TrialRunner, observe: ProgressObserver
) -> RunResult:
    """Run a submission in the trial of a ``build_single_trial_assignment``. Raises like ``grade``."""
    full_grade = grade(submission, assignment, secret=PUBLIC_SECRET, runner=runner, observe=observe)
    run = replace(full_grade, criteria=(), hints=(), missing="", notes=_rephrase_notes(full_grade, submission))
    replay = (
        build_grade_replay(build_student_view(run), submission, load_own_floors(assignment)) if run.trials else None
    )
    return RunResult(run.verdict, _build_result(run, submission), compress_replay(replay) if replay else None)


def _rephrase_notes(full_grade: Grade, submission: Submission) -> tuple[str, ...]:
    """Return the notes, with the note about a missing part rephrased for a run without marks."""
    if not full_grade.missing:
        return full_grade.notes
    mark_notes = {build_missing_part_note(part, submission.files) for part in PART_FILES}
    other_notes = tuple(note for note in full_grade.notes if note not in mark_notes)
    return (*other_notes, f"There is no {full_grade.missing}, so only the other part was run.")


def _build_result(run: Grade, submission: Submission) -> dict[str, Any]:
    outcome = describe_grade(run)
    notes = (*run.notes, *(note for trial in run.trials for note in trial.recording.notes))
    faults = [fault for trial in run.trials for fault in collect_faults(trial.recording)]
    lines = [line for trial in run.trials for line in build_transcript(trial.recording)]
    return {
        "tone": outcome.tone,
        "happened": outcome.happened,
        "whose": outcome.explanation,
        "seconds": run.trials[0].recording.end_t if run.trials else 0.0,
        "lines": [[round(t, 2), to_display_text(text, _MAX_LINE_LENGTH)] for t, text in lines[:_MAX_LINES]],
        "more_lines": max(0, len(lines) - _MAX_LINES),
        "faults": [
            {
                "where": fault.where,
                "file": to_one_line(fault.file, 60),
                "line": fault.line,
                "message": fault.message,
                "hint": fault.hint,
            }
            for fault in group_faults(run, submission)
        ],
        "failed": format_moment_link(1, faults[0].t) if faults else "",
        "notes": [to_display_text(text, _MAX_LINE_LENGTH) for text in notes],
    }
