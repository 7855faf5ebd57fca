"""The content of a report page, section by section, as plain data for a template.

Nothing is escaped or hidden here: the input is already the reader's view.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal

from service.grading.grade import CriterionResult, Evidence, Grade, TrialResult
from service.language import ENGLISH, Language, translatable
from service.reports.cause import Diagnosis, diagnose, ended, found
from service.reports.crossing import befell_in_full, note_words
from service.reports.faults import FaultGroup, fault_groups
from service.reports.plots.drawn import plots_of, same_answers
from service.reports.plots.own_diagrams import OwnDiagram, own_diagrams
from service.reports.plots.plot import Plot
from service.reports.plots.sequence import MOST_CALL_STEPS, Step, inside
from service.reports.plots.talk import talk_words, talks
from service.reports.readable import message_words, number, one_line, readable, turned
from service.reports.recognition_table import ClassLine, RecognitionTable, recognition_table
from service.reports.replay.trial import loss_moment, moment_hash
from service.reports.robots import called, messages_of, robots_of
from service.reports.verdict_sentences import (
    KINDS,
    VerdictWords,
    channel_words,
    comments_of,
    cost_words,
    grade_words,
    trial_words,
    verdict_words,
)
from service.reports.view import View, scenarios, worst_trial
from sim.recorded import printed_alone, stood_still
from sim.recording import Fault, Recording, Verdict
from submissions.diagram_cells import diagrams_in
from submissions.submission import Submission

_TIMELINE_FIRST, _TIMELINE_LAST = 40, 15
_MOST_MESSAGES = 40
_MOST_TRIALS = 250
_STOOD_STILL = translatable("the robot did not move, so its path and sensors are not drawn")
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


@dataclass(frozen=True, slots=True)
class TimelineEntry:
    """One moment of a timeline. ``t`` is empty for a line that counts omitted moments. ``what`` names the kind."""

    t: str
    kind: str
    what: str
    text: str


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
class Seen:
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
    """Details of one trial of a scenario: the one that lost most. ``where`` identifies it, if there are several."""

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
    recognition: tuple[Seen, ...]
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
    """Return the content of a report from a reader's view. ``played`` are the trials of its replay, from 1."""
    grade, language = view.grade, view.language
    plots = plots_of(grade, language)
    lines = tuple(_trial_line(trial, language) for trial in grade.trials[:_MOST_TRIALS])
    faults = fault_groups(grade, submission, language=language)
    diagnosis = diagnose(grade, submission, language)
    criteria = tuple(
        _criterion_line(grade, result, played, language, told=index in diagnosis.lost)
        for index, result in enumerate(grade.criteria)
    )
    time_alone = all(fault.verdict is Verdict.TIME_LIMIT for fault in faults)
    return Page(
        grade=grade,
        marks=number(grade.marks),
        max_marks=number(grade.max_marks),
        share=_share(float(grade.marks), float(grade.max_marks)),
        state=_state(grade.marks, grade.max_marks),
        words=grade_words(grade, language),
        ended=ended(grade, diagnosis, language),
        diagnosis=diagnosis,
        comments=comments_of(grade),
        criteria=criteria,
        lost=tuple(line for index, line in enumerate(criteria) if index in diagnosis.lost),
        others=tuple(line for index, line in enumerate(criteria) if index not in diagnosis.lost),
        faults=faults,
        faults_title=language.say("Result") if time_alone else language.say("Errors"),
        recognition=tuple(_seen(grade, alike, plots, language) for alike in same_answers(grade)),
        scenes=tuple(_scene(grade, scenario, plots, language) for scenario in scenarios(grade)),
        diagrams=() if submission is None else own_diagrams(grade, diagrams_in(submission.notebook).cells, language),
        trials=lines,
        more_trials=len(grade.trials) - len(lines),
        notes=tuple(readable(note, 400) for note in grade.notes[:20]),
        channel=channel_words(grade, language),
        cost=cost_words(grade, language),
        weak_sandbox=PROCESS_LIMITS in grade.sandbox,
        staff=view.staff,
        withheld=view.withheld,
    )


def timeline(recording: Recording, language: Language = ENGLISH) -> tuple[TimelineEntry, ...]:
    """Return prints, speech, touches and faults by time. If there are too many, the middle is left out."""
    moments: list[tuple[float, str, str]] = []
    for robot, own in robots_of(recording):
        whose = "" if own is recording else f"{called(robot, language)}: "
        moments += [(line.t, "printed", whose + line.text) for line in printed_alone(own)]
        moments += [(line.t, "said", whose + line.text) for line in own.spoken]
        moments += [(touch.t, "touched", whose + touch.what) for touch in own.touches]
        moments += [(fault.t, _kind(fault), whose + fault.message) for fault in own.faults]
    moments.sort(key=lambda moment: moment[0])
    omitted = len(moments) - _TIMELINE_FIRST - _TIMELINE_LAST
    entries = [_entry(t, kind, text, language) for t, kind, text in moments]
    if omitted <= 1:
        return tuple(entries)
    gap = language.say("%(count)s more entries are not shown", count=language.whole(omitted))
    return (*entries[:_TIMELINE_FIRST], TimelineEntry("", "", "", gap), *entries[-_TIMELINE_LAST:])


def _kind(fault: Fault) -> str:
    """Return the kind of a fault. A time limit alone is not a fault."""
    return "stopped" if fault.verdict is Verdict.TIME_LIMIT else "fault"


def _criterion_line(
    grade: Grade, result: CriterionResult, played: frozenset[int], language: Language, *, told: bool
) -> CriterionLine:
    full = result.marks >= result.max_marks
    missed = [item for item in result.evidence if not item.passed]
    failed = next(iter(missed), None)
    watched = next((item for item in missed if item.trial + 1 in played), None) if not full else None
    seconds = loss_moment(grade.trials[watched.trial].recording, watched.t) if watched is not None else 0.0
    return CriterionLine(
        title=one_line(result.title, 200),
        told="" if told or (full and result.set_by_hand is None) else found(grade, result, language),
        message=readable(result.message, 1000, lines=12),
        marks=number(result.marks),
        max_marks=number(result.max_marks),
        share=_share(float(result.marks), float(result.max_marks)) if result.max_marks else 100.0,
        state="excused" if result.excused else _state(result.marks, result.max_marks),
        visibility=result.visibility,
        where="" if full or failed is None else _where(grade, failed, language),
        moment="" if watched is None else moment_hash(watched.trial + 1, seconds),
        watch="" if watched is None else _watch(grade, watched.trial, seconds, language),
        for_staff=readable(result.for_staff, 1000, lines=4),
    )


def _watch(grade: Grade, trial: int, seconds: float, language: Language) -> str:
    if len(grade.trials) == 1:
        return language.say("Watch at %(seconds)s s", seconds=f"{seconds:.2f}")
    return language.say("Watch trial %(trial)s at %(seconds)s s", trial=trial + 1, seconds=f"{seconds:.2f}")


def _state(marks: Decimal, max_marks: Decimal) -> str:
    return "full" if marks >= max_marks else ("part" if marks > 0 else "none")


def _where(grade: Grade, evidence: Evidence, language: Language) -> str:
    if not 0 <= evidence.trial < len(grade.trials) or len(grade.trials) == 1:
        return ""
    return language.say("First failed in %(trial)s", trial=trial_words(grade.trials[evidence.trial], language))


def _scene(grade: Grade, scenario: str, plots: tuple[Plot, ...], language: Language) -> Scene:
    index = worst_trial(grade, scenario)
    trial = grade.trials[index]
    recording = trial.recording
    lines = tuple(_message_lines(recording, language))
    several = len(grade.trials) > 1
    return Scene(
        where=f": {trial_words(trial, language, 80)}" if several else "",
        plots=tuple(plot for plot in plots if plot.scenario == scenario),
        timeline=timeline(recording, language),
        messages=lines[:_MOST_MESSAGES],
        more_messages=max(0, len(lines) - _MOST_MESSAGES),
        talk=talk_words(talks(recording), language),
        outputs=tuple(each for each in _outputs(recording, language) if each.text),
        notes=(
            *((language.say(_STOOD_STILL),) if stood_still(recording) else ()),
            *(readable(note, 400) for note in recording.notes[:10] if note not in grade.notes),
        ),
    )


def _outputs(recording: Recording, language: Language) -> Iterator[TextOutput]:
    say = language.say
    yield TextOutput(say("Output of your responder"), readable(recording.responder_output, 4000))
    yield TextOutput(say("Log file of your responder (logger.txt)"), readable(recording.responder_log, 4000))
    for each in recording.agent_outputs:
        yield TextOutput(say("Output of the agent %(name)s", name=each.agent), readable(each.printed, 4000))
        yield TextOutput(say("Log file of the agent %(name)s (logger.txt)", name=each.agent), readable(each.log, 4000))


def _seen(grade: Grade, alike: tuple[int, ...], plots: tuple[Plot, ...], language: Language) -> Seen:
    results = [grade.criteria[index] for index in alike]
    tables = tuple(recognition_table(result, language) for result in results if result.accuracy is not None)
    return Seen(
        language.say(" and ").join(f"“{one_line(result.title, 80)}”" for result in results),
        tables,
        tables[0].classes if tables else (),
        tuple(plot for plot in plots if not plot.scenario and plot.subject in alike),
    )


def _message_lines(recording: Recording, language: Language) -> Iterator[MessageLine]:
    """Yield each message of the robot, followed by the calls and agent messages until its answer.

    Two robots have no agents, so a message's index in this list equals its index in the recording.
    """
    yield from (_inner_line(step, language) for step in inside(recording, -1))
    for index, (sender, message) in enumerate(messages_of(recording, language)):
        lost = message.delivered is None
        arrived = language.say("never") if message.delivered is None else f"{message.delivered:.2f} s"
        happened = befell_in_full(message, language)
        if happened:
            arrived += f" ({happened})"
        kind = "wrong" if lost or happened else ""
        yield MessageLine(f"{message.t:.2f}", sender, message_words(message.text, 240), arrived, kind, lost)
        if recording.partner is None:
            steps = itertools.islice(inside(recording, index), MOST_CALL_STEPS)
            yield from (_inner_line(step, language) for step in steps)


def _inner_line(step: Step, language: Language) -> MessageLine:
    t = "" if step.t is None else f"{step.t:.2f}"
    way = f"{called(step.source, language)} → {called(step.target, language)}"
    note = f"({note_words(step.note, language)})" if step.note else ""
    return MessageLine(t, way, step.label, note, "wrong" if step.note else "inner")


def _trial_line(trial: TrialResult, language: Language) -> TrialLine:
    start = trial.recording.start
    return TrialLine(
        scenario=one_line(trial.scenario, 60),
        index=trial.index + 1,
        start=f"{start.x:.0f}, {start.y:.0f}, {turned(start.heading)}°",
        noise=f"{trial.light_noise:g} / {trial.motor_noise:g}{_channel_words(trial, language)}",
        seed=str(trial.seed),
        seconds=f"{trial.recording.end_t:.2f}",
        words=verdict_words(trial.verdict, language),
        sha256=trial.recording.sha256[:12],
        visibility=trial.visibility,
    )


def _channel_words(trial: TrialResult, language: Language) -> str:
    """Return the swept channel settings in words. Offsets and noise have separate columns."""
    words = {"loss": language.say("loss"), "delay": language.say("delay")}
    return "".join(f"; {words[condition]} {level:g}" for condition, level in trial.sweep if condition in words)


def _entry(t: float, kind: str, text: str, language: Language) -> TimelineEntry:
    return TimelineEntry(f"{t:.2f}", kind, language.say(KINDS[kind]), readable(text, 400, lines=8))


def _share(part: float, whole: float) -> float:
    return round(100 * max(0.0, min(1.0, part / whole)), 1) if whole else 0.0
