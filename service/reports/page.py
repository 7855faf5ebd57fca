"""What a report page tells of a grade, section by section, as plain data that a template lays out.

Nothing is escaped here, and nothing is hidden: what comes in is the reader's view already.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

from service.grading.grade import CriterionResult, Evidence, Grade, TrialResult
from service.reports.crossing import befell_in_full
from service.reports.faults import FaultGroup, fault_groups
from service.reports.plots.drawn import plots_of
from service.reports.plots.own_diagrams import OwnDiagram, own_diagrams
from service.reports.plots.plot import Plot
from service.reports.readable import message_words, number, one_line, readable
from service.reports.recognition_table import RecognitionTable, recognition_tables
from service.reports.replay.trial import loss_moment, moment_hash
from service.reports.robots import messages_of, robots_of
from service.reports.view import View, scenarios, worst_trial
from service.reports.words import (
    VerdictWords,
    channel_words,
    comments_of,
    cost_words,
    grade_words,
    hints_of,
    verdict_words,
)
from sim.recorded import stood_still
from sim.recording import AgentMessage, AgentOutput, Fault, Recording, Verdict
from submissions.diagram_cells import diagrams_in
from submissions.submission import Submission

_TIMELINE_FIRST, _TIMELINE_LAST = 40, 15
_MOST_MESSAGES = 40
_MOST_TRIALS = 250
_STOOD_STILL = "the robot stood still, so neither its path nor its sensors are drawn"
PROCESS_LIMITS = "process limits only"


@dataclass(frozen=True, slots=True)
class CriterionLine:
    """One row of the criteria table; ``share`` is per cent, ``where`` points at the first failure."""

    title: str
    message: str
    marks: str
    max_marks: str
    share: float
    state: str  # full, part, none
    visibility: str
    where: str
    moment: str  # a link to where the replay shows it, and what it says; empty if it does not
    watch: str
    for_staff: str


@dataclass(frozen=True, slots=True)
class TimelineEntry:
    """One moment of a timeline; ``t`` is empty for a line that says how many were left out."""

    t: str
    kind: str
    text: str


@dataclass(frozen=True, slots=True)
class MessageLine:
    """One row of the messages table."""

    t: str
    sender: str
    text: str
    arrived: str
    wrong: bool


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
class Scene:
    """A closer look at one trial of a scenario: the one that lost most."""

    scenario: str
    which: str
    words: VerdictWords
    plots: tuple[Plot, ...]
    timeline: tuple[TimelineEntry, ...]
    messages: tuple[MessageLine, ...]
    more_messages: int
    responder_output: str
    responder_log: str
    agents: tuple[AgentOutput, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Page:
    """All that the template needs."""

    grade: Grade
    marks: str
    max_marks: str
    share: float
    words: VerdictWords
    hints: tuple[str, ...]
    comments: tuple[str, ...]
    criteria: tuple[CriterionLine, ...]
    faults: tuple[FaultGroup, ...]
    faults_title: str
    classification: tuple[Plot, ...]
    recognition: tuple[RecognitionTable, ...]
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


def page_of(view: View, submission: Submission | None = None, played: frozenset[int] = frozenset()) -> Page:
    """Everything a report says of what the reader may see; ``played`` are the trials of its replay, from 1."""
    grade = view.grade
    plots = plots_of(grade)
    lines = tuple(_trial_line(trial) for trial in grade.trials[:_MOST_TRIALS])
    faults = fault_groups(grade, submission)
    time_alone = all(fault.verdict is Verdict.TIME_LIMIT for fault in faults)
    return Page(
        grade=grade,
        marks=number(grade.marks),
        max_marks=number(grade.max_marks),
        share=_share(float(grade.marks), float(grade.max_marks)),
        words=grade_words(grade),
        hints=hints_of(grade),
        comments=comments_of(grade),
        criteria=tuple(_criterion_line(grade, result, played) for result in grade.criteria),
        faults=faults,
        faults_title="How it ended" if time_alone else "What went wrong",
        classification=tuple(plot for plot in plots if not plot.scenario),
        recognition=recognition_tables(grade),
        scenes=tuple(_scene(grade, scenario, plots) for scenario in scenarios(grade)),
        diagrams=own_diagrams(grade, diagrams_in(submission.notebook).cells) if submission is not None else (),
        trials=lines,
        more_trials=len(grade.trials) - len(lines),
        notes=tuple(readable(note, 400) for note in grade.notes[:20]),
        channel=channel_words(grade),
        cost=cost_words(grade),
        weak_sandbox=PROCESS_LIMITS in grade.sandbox,
        staff=view.staff,
        withheld=view.withheld,
    )


def timeline(recording: Recording) -> tuple[TimelineEntry, ...]:
    """What was printed, said, touched and went wrong, by time; the middle is left out where there is too much."""
    moments: list[tuple[float, str, str]] = []
    for robot, own in robots_of(recording):
        whose = "" if own is recording else f"{robot}: "
        moments += [(line.t, "printed", whose + line.text) for line in own.printed]
        moments += [(line.t, "said", whose + line.text) for line in own.spoken]
        moments += [(touch.t, "touched", whose + touch.what) for touch in own.touches]
        moments += [(fault.t, _kind(fault), whose + fault.message) for fault in own.faults]
    moments.sort(key=lambda moment: moment[0])
    omitted = len(moments) - _TIMELINE_FIRST - _TIMELINE_LAST
    if omitted <= 1:
        return tuple(_entry(*moment) for moment in moments)
    first, last = moments[:_TIMELINE_FIRST], moments[-_TIMELINE_LAST:]
    gap = TimelineEntry("", "", f"{omitted:,} more entries are not shown")
    return (*(_entry(*moment) for moment in first), gap, *(_entry(*moment) for moment in last))


def _kind(fault: Fault) -> str:
    """Time that is up is no fault by itself."""
    return "stopped" if fault.verdict is Verdict.TIME_LIMIT else "fault"


def _criterion_line(grade: Grade, result: CriterionResult, played: frozenset[int]) -> CriterionLine:
    full = result.marks >= result.max_marks
    missed = [item for item in result.evidence if not item.passed]
    failed = next(iter(missed), None)
    watched = next((item for item in missed if item.trial + 1 in played), None) if not full else None
    seconds = loss_moment(grade.trials[watched.trial].recording, watched.t) if watched is not None else 0.0
    return CriterionLine(
        title=one_line(result.title, 200),
        message=readable(result.message, 1000, lines=12),
        marks=number(result.marks),
        max_marks=number(result.max_marks),
        share=_share(float(result.marks), float(result.max_marks)) if result.max_marks else 100.0,
        state="full" if full else ("part" if result.marks > 0 else "none"),
        visibility=result.visibility,
        where="" if full or failed is None else _where(grade, failed),
        moment="" if watched is None else moment_hash(watched.trial + 1, seconds),
        watch=f"Watch it at {seconds:.2f} s",
        for_staff=readable(result.for_staff, 1000, lines=4),
    )


def _where(grade: Grade, evidence: Evidence) -> str:
    if not 0 <= evidence.trial < len(grade.trials) or len(grade.trials) == 1:
        return ""
    trial = grade.trials[evidence.trial]
    return f"First missed in {one_line(trial.scenario, 60)}, trial {trial.index + 1}"


def _scene(grade: Grade, scenario: str, plots: tuple[Plot, ...]) -> Scene:
    index = worst_trial(grade, scenario)
    trial = grade.trials[index]
    recording = trial.recording
    messages = messages_of(recording)
    of = sum(other.scenario == scenario for other in grade.trials)
    which = "the only trial" if of == 1 else f"trial {trial.index + 1} of {of}, the one that lost most"
    if of > 1 and all(item.passed for result in grade.criteria for item in result.evidence):
        which = f"trial {trial.index + 1} of {of}"
    return Scene(
        scenario=one_line(scenario, 80),
        which=which,
        words=verdict_words(trial.verdict),
        plots=tuple(plot for plot in plots if plot.scenario == scenario),
        timeline=timeline(recording),
        messages=tuple(itertools.islice(_message_lines(recording), _MOST_MESSAGES)),
        more_messages=max(0, len(messages) + len(recording.agent_messages) - _MOST_MESSAGES),
        responder_output=readable(recording.responder_output, 4000),
        responder_log=readable(recording.responder_log, 4000),
        agents=tuple(
            AgentOutput(each.agent, readable(each.printed, 4000), readable(each.log, 4000))
            for each in recording.agent_outputs
        ),
        notes=(
            *((_STOOD_STILL,) if stood_still(recording) else ()),
            *(readable(note, 400) for note in recording.notes[:10] if note not in grade.notes),
        ),
    )


def _message_lines(recording: Recording) -> Iterator[MessageLine]:
    """Each message of the robot's is followed by what the agents said until it was answered.

    Two robots have no agents, so the index of a message among those told is its index in the recording.
    """
    inner: dict[int, list[AgentMessage]] = {}
    for each in recording.agent_messages:
        inner.setdefault(each.message, []).append(each)
    yield from map(_agent_line, inner.get(-1, ()))
    for index, (sender, message) in enumerate(messages_of(recording)):
        arrived = "never" if message.delivered is None else f"{message.delivered:.2f} s"
        happened = befell_in_full(message)
        if happened:
            arrived += f" ({happened})"
        wrong = message.delivered is None or bool(happened)
        yield MessageLine(f"{message.t:.2f}", sender, message_words(message.text, 240), arrived, wrong)
        yield from map(_agent_line, inner.get(index, ()))


def _agent_line(each: AgentMessage) -> MessageLine:
    arrived = f"({each.note})" if each.note else f"{each.t:.2f} s"
    sender = f"{each.sender} → {each.receiver}"
    return MessageLine(f"{each.t:.2f}", sender, message_words(each.text, 240), arrived, bool(each.note))


def _trial_line(trial: TrialResult) -> TrialLine:
    start = trial.recording.start
    return TrialLine(
        scenario=one_line(trial.scenario, 60),
        index=trial.index + 1,
        start=f"{start.x:.0f}, {start.y:.0f}, {start.heading:.0f}°",
        noise=f"{trial.light_noise:g} / {trial.motor_noise:g}{_channel_words(trial)}",
        seed=str(trial.seed),
        seconds=f"{trial.recording.end_t:.2f}",
        words=verdict_words(trial.verdict),
        sha256=trial.recording.sha256[:12],
        visibility=trial.visibility,
    )


def _channel_words(trial: TrialResult) -> str:
    """What the channel was swept to; offsets and noise have columns of their own."""
    return "".join(f"; {condition} {level:g}" for condition, level in trial.sweep if condition in ("loss", "delay"))


def _entry(t: float, kind: str, text: str) -> TimelineEntry:
    return TimelineEntry(f"{t:.2f}", kind, readable(text, 400, lines=8))


def _share(part: float, whole: float) -> float:
    return round(100 * max(0.0, min(1.0, part / whole)), 1) if whole else 0.0
