"""The content of a report page, section by section, as plain data for a template.

Nothing is escaped or hidden here: the input is already the reader's view.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal

from service.grading.grade import CriterionResult, Evidence, Grade, TrialResult
from service.language import Language, translatable
from service.reports.diagnosis import (
    Diagnosis,
    describe_finding,
    describe_outcome,
    describe_withheld_marks,
    diagnose,
    list_further_proofs,
)
from service.reports.display_text import (
    abbreviate_message,
    format_decimal,
    format_heading,
    to_display_text,
    to_one_line,
)
from service.reports.faults import FaultGroup, group_faults
from service.reports.messages import collect_messages, describe_loss_fully, describe_note, format_party_name
from service.reports.plots.grade_plots import group_same_answers, list_plots
from service.reports.plots.message_counts import count_messages, describe_message_counts
from service.reports.plots.own_diagrams import OwnDiagram, list_own_diagrams
from service.reports.plots.plot import Plot
from service.reports.plots.sequence import MAX_CALL_STEPS, Step, iterate_inner_steps
from service.reports.recognition_table import ClassLine, RecognitionTable, build_recognition_table
from service.reports.replay.trial import compute_loss_time, format_moment_link
from service.reports.timeline import TimelineEntry, build_timeline
from service.reports.verdict_sentences import (
    VerdictWords,
    describe_channel_losses,
    describe_cost,
    describe_grade,
    describe_verdict,
    format_comments,
    format_trial_name,
)
from service.reports.view import View, find_worst_trial, list_scenarios
from sim.recording import Recording, Verdict
from sim.recording_values import is_stationary
from submissions.diagram_cells import read_diagrams
from submissions.submission import Submission

_MAX_MESSAGES = 40
_MAX_TRIALS = 250
_NO_MOVEMENT = translatable("the robot did not move, so its path and sensors are not drawn")
PROCESS_LIMITS = "process limits only"


@dataclass(frozen=True, slots=True)
class CriterionLine:
    """One row of the criteria table. ``share`` is a percentage, ``where`` is the place of the first failure.

    ``message`` has the full findings. ``told`` has a short form, which is empty if they are already shown or nothing
    was lost.
    """

    title: str
    told: str
    message: str
    marks: str
    max_marks: str
    share: float
    state: str  # full, part, none, excused
    visibility: str
    where: str
    moment: str  # a link to the moment in the replay, with its text; empty if there is none
    watch: str
    for_staff: str
    proof: str  # what reruns showed, if the diagnosis does not say it
    pool: str  # whether the marks are exact or provisional, if they are defined over a pool


@dataclass(frozen=True, slots=True)
class MessageLine:
    """One row of the messages table. ``kind`` is ``wrong``, or ``inner`` for a responder's own requests.

    ``lost`` marks messages that never arrived.
    """

    t: str
    sender: str
    text: str
    arrived: str
    kind: str
    lost: bool = False


@dataclass(frozen=True, slots=True)
class TrialLine:
    """One row of the table of all trials."""

    scenario: str
    index: int
    start: str
    noise: str
    seed: str
    seconds: str
    words: VerdictWords
    sha256: str
    visibility: str


@dataclass(frozen=True, slots=True)
class RecognitionSection:
    """Recognition results, shown once for all criteria that judge the same answers."""

    title: str
    tables: tuple[RecognitionTable, ...]
    classes: tuple[ClassLine, ...]
    plots: tuple[Plot, ...]


@dataclass(frozen=True, slots=True)
class TextOutput:
    """The printed or logged text of a process, with its title."""

    title: str
    text: str


@dataclass(frozen=True, slots=True)
class Scene:
    """Details of a scenario's trial with the most lost marks. ``where`` names the trial if the scenario has several."""

    where: str
    plots: tuple[Plot, ...]
    timeline: tuple[TimelineEntry, ...]
    messages: tuple[MessageLine, ...]
    more_messages: int
    talk: str
    outputs: tuple[TextOutput, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Page:
    """All data for the template."""

    grade: Grade
    marks: str
    max_marks: str
    share: float
    state: str  # as for a criterion; gives the colour of the bar
    words: VerdictWords
    ended: str
    diagnosis: Diagnosis
    comments: tuple[str, ...]
    criteria: tuple[CriterionLine, ...]
    lost: tuple[CriterionLine, ...]  # criteria lost by the cause, which is shown first
    others: tuple[CriterionLine, ...]
    faults: tuple[FaultGroup, ...]
    faults_title: str
    recognition: tuple[RecognitionSection, ...]
    scenes: tuple[Scene, ...]
    diagrams: tuple[OwnDiagram, ...]
    trials: tuple[TrialLine, ...]
    more_trials: int
    notes: tuple[str, ...]
    channel: str
    cost: str
    weak_sandbox: bool
    staff: bool
    withheld: bool


def build_page(view: View, submission: Submission | None = None, replayed_trials: frozenset[int] = frozenset()) -> Page:
    """Return the content of a report from a reader's view. ``replayed_trials`` are the trials of its replay, from 1."""
    grade, language = view.grade, view.language
    plots = list_plots(grade, language)
    trial_lines = tuple(_build_trial_line(trial, language) for trial in grade.trials[:_MAX_TRIALS])
    faults = group_faults(grade, submission, language=language)
    diagnosis = diagnose(grade, submission, language)
    proofs = list_further_proofs(grade, diagnosis)
    criteria = tuple(
        _build_criterion_line(
            grade,
            result,
            replayed_trials,
            language,
            proof=proofs.get(index, ""),
            is_in_diagnosis=index in diagnosis.lost,
        )
        for index, result in enumerate(grade.criteria)
    )
    is_time_limit_only = all(fault.verdict is Verdict.TIME_LIMIT for fault in faults)
    return Page(
        grade=grade,
        marks=format_decimal(grade.marks),
        max_marks=format_decimal(grade.max_marks),
        share=_compute_share(float(grade.marks), float(grade.max_marks)),
        state=_classify_marks(grade.marks, grade.max_marks),
        words=describe_grade(grade, language),
        ended=describe_outcome(grade, diagnosis, language),
        diagnosis=diagnosis,
        comments=format_comments(grade),
        criteria=criteria,
        lost=tuple(line for index, line in enumerate(criteria) if index in diagnosis.lost),
        others=tuple(line for index, line in enumerate(criteria) if index not in diagnosis.lost),
        faults=faults,
        faults_title=language.say("Result") if is_time_limit_only else language.say("Errors"),
        recognition=tuple(
            _build_recognition_section(grade, alike, plots, language) for alike in group_same_answers(grade)
        ),
        scenes=tuple(_build_scene(grade, scenario, plots, language) for scenario in list_scenarios(grade)),
        diagrams=()
        if submission is None or submission.notebook is None
        else list_own_diagrams(grade, read_diagrams(submission.notebook).cells, language),
        trials=trial_lines,
        more_trials=len(grade.trials) - len(trial_lines),
        notes=tuple(to_display_text(note, 400) for note in grade.notes[:20]),
        channel=describe_channel_losses(grade, language),
        cost=describe_cost(grade, language),
        weak_sandbox=PROCESS_LIMITS in grade.sandbox,
        staff=view.staff,
        withheld=view.withheld,
    )


def _build_criterion_line(
    grade: Grade,
    result: CriterionResult,
    replayed_trials: frozenset[int],
    language: Language,
    *,
    proof: str,
    is_in_diagnosis: bool,
) -> CriterionLine:
    has_full_marks = result.marks >= result.max_marks
    failures = [item for item in result.evidence if not item.passed]
    first_failure = next(iter(failures), None)
    watched_failure = (
        next((item for item in failures if item.trial + 1 in replayed_trials), None) if not has_full_marks else None
    )
    seconds = (
        compute_loss_time(grade.trials[watched_failure.trial].recording, watched_failure.t)
        if watched_failure is not None
        else 0.0
    )
    if is_in_diagnosis:
        told = describe_withheld_marks(result, language)
    elif has_full_marks and result.set_by_hand is None:
        told = ""
    else:
        told = describe_finding(grade, result, language)
    return CriterionLine(
        title=to_one_line(result.title, 200),
        told=told,
        message=to_display_text(result.message, 1000, lines=12),
        marks=format_decimal(result.marks),
        max_marks=format_decimal(result.max_marks),
        share=_compute_share(float(result.marks), float(result.max_marks)) if result.max_marks else 100.0,
        state="excused" if result.excused else _classify_marks(result.marks, result.max_marks),
        visibility=result.visibility,
        where=""
        if has_full_marks or first_failure is None
        else _describe_first_failure(grade, first_failure, language),
        moment="" if watched_failure is None else format_moment_link(watched_failure.trial + 1, seconds),
        watch="" if watched_failure is None else _format_watch_label(grade, watched_failure.trial, seconds, language),
        for_staff=to_display_text(result.for_staff, 1000, lines=4),
        proof=proof,
        pool=result.pool.note if result.pool is not None else "",
    )


def _format_watch_label(grade: Grade, trial: int, seconds: float, language: Language) -> str:
    if len(grade.trials) == 1:
        return language.say("Watch at %(seconds)s s", seconds=f"{seconds:.2f}")
    return language.say("Watch trial %(trial)s at %(seconds)s s", trial=trial + 1, seconds=f"{seconds:.2f}")


def _classify_marks(marks: Decimal, max_marks: Decimal) -> str:
    return "full" if marks >= max_marks else ("part" if marks > 0 else "none")


def _describe_first_failure(grade: Grade, evidence: Evidence, language: Language) -> str:
    if not 0 <= evidence.trial < len(grade.trials) or len(grade.trials) == 1:
        return ""
    return language.say("First failed in %(trial)s", trial=format_trial_name(grade.trials[evidence.trial], language))


def _build_scene(grade: Grade, scenario: str, plots: tuple[Plot, ...], language: Language) -> Scene:
    index = find_worst_trial(grade, scenario)
    trial = grade.trials[index]
    recording = trial.recording
    # A trial can have a hundred thousand messages, of which few are shown.
    lines = tuple(itertools.islice(_build_message_lines(recording, language), _MAX_MESSAGES))
    has_several_trials = len(grade.trials) > 1
    return Scene(
        where=f": {format_trial_name(trial, language, 80)}" if has_several_trials else "",
        plots=tuple(plot for plot in plots if plot.scenario == scenario),
        timeline=build_timeline(recording, language),
        messages=lines,
        more_messages=_count_message_lines(recording) - len(lines),
        talk=describe_message_counts(count_messages(recording), language),
        outputs=tuple(each for each in _collect_outputs(recording, language) if each.text),
        notes=(
            *((language.say(_NO_MOVEMENT),) if is_stationary(recording) else ()),
            *(to_display_text(note, 400) for note in recording.notes[:10] if note not in grade.notes),
        ),
    )


def _collect_outputs(recording: Recording, language: Language) -> Iterator[TextOutput]:
    say = language.say
    yield TextOutput(say("Output of your responder"), to_display_text(recording.responder_output, 4000))
    yield TextOutput(say("Log file of your responder (logger.txt)"), to_display_text(recording.responder_log, 4000))
    for output in recording.agent_outputs:
        yield TextOutput(say("Output of the agent %(name)s", name=output.agent), to_display_text(output.printed, 4000))
        yield TextOutput(
            say("Log file of the agent %(name)s (logger.txt)", name=output.agent), to_display_text(output.log, 4000)
        )


def _build_recognition_section(
    grade: Grade, criterion_indices: tuple[int, ...], plots: tuple[Plot, ...], language: Language
) -> RecognitionSection:
    results = [grade.criteria[index] for index in criterion_indices]
    tables = tuple(build_recognition_table(result, language) for result in results if result.accuracy is not None)
    return RecognitionSection(
        language.say(" and ").join(f"“{to_one_line(result.title, 80)}”" for result in results),
        tables,
        tables[0].classes if tables else (),
        tuple(plot for plot in plots if not plot.scenario and plot.subject in criterion_indices),
    )


def _build_message_lines(recording: Recording, language: Language) -> Iterator[MessageLine]:
    """Yield each message of the robot, followed by the calls and agent messages until its answer.

    Two robots have no agents, so a message's index in this list equals its index in the recording.
    """
    yield from (_build_inner_line(step, language) for step in iterate_inner_steps(recording, -1))
    for index, (sender, message) in enumerate(collect_messages(recording, language)):
        is_lost = message.delivered is None
        arrived = language.say("never") if message.delivered is None else f"{message.delivered:.2f} s"
        loss_text = describe_loss_fully(message, language)
        if loss_text:
            arrived += f" ({loss_text})"
        kind = "wrong" if is_lost or loss_text else ""
        yield MessageLine(f"{message.t:.2f}", sender, abbreviate_message(message.text, 240), arrived, kind, is_lost)
        if recording.partner is None:
            steps = itertools.islice(iterate_inner_steps(recording, index), MAX_CALL_STEPS)
            yield from (_build_inner_line(step, language) for step in steps)


def _count_message_lines(recording: Recording) -> int:
    """Return the number of lines that ``_build_message_lines`` yields, without building them."""
    inner_counts = Counter({-1: 0})
    for call in recording.calls:
        inner_counts[call.message] += 1 + (call.result != "None")  # a logger returns nothing
    inner_counts.update(agent_message.message for agent_message in recording.agent_messages)
    count = len(collect_messages(recording)) + inner_counts.pop(-1)
    if recording.partner is None:
        count += sum(min(inner_count, MAX_CALL_STEPS) for inner_count in inner_counts.values())
    return count


def _build_inner_line(step: Step, language: Language) -> MessageLine:
    t = "" if step.t is None else f"{step.t:.2f}"
    direction = f"{format_party_name(step.source, language)} → {format_party_name(step.target, language)}"
    note = f"({describe_note(step.note, language)})" if step.note else ""
    return MessageLine(t, direction, step.label, note, "wrong" if step.note else "inner")


def _build_trial_line(trial: TrialResult, language: Language) -> TrialLine:
    start = trial.recording.start
    return TrialLine(
        scenario=to_one_line(trial.scenario, 60),
        index=trial.index + 1,
        start=f"{start.x:.0f}, {start.y:.0f}, {format_heading(start.heading)}°",
        noise=f"{trial.light_noise:g} / {trial.motor_noise:g}{_describe_channel_settings(trial, language)}",
        seed=str(trial.seed),
        seconds=f"{trial.recording.end_t:.2f}",
        words=describe_verdict(trial.verdict, language),
        sha256=trial.recording.sha256[:12],
        visibility=trial.visibility,
    )


def _describe_channel_settings(trial: TrialResult, language: Language) -> str:
    """Return the swept channel settings in words. Offsets and noise have separate columns."""
    condition_names = {"loss": language.say("loss"), "delay": language.say("delay")}
    return "".join(
        f"; {condition_names[condition]} {level:g}" for condition, level in trial.sweep if condition in condition_names
    )


def _compute_share(amount: float, total: float) -> float:
    return round(100 * max(0.0, min(1.0, amount / total)), 1) if total else 0.0
