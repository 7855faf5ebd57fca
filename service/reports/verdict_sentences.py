"""Sentences about a grade: each verdict for students, the accuracy, and the cost of the trials.

It has no marks and no single trials. The faults of a recording give place and time.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

from service.grading.grade import Accuracy, CriterionResult, Grade, TrialResult
from service.grading.verdict_labels import ENDED
from service.language import ENGLISH, Language, translatable
from service.reports.readable import number, one_line, readable
from sim.recorded import faults_of
from sim.recording import LossReason, Verdict

FULL_MARKS = translatable("Full marks.")
Tone = Literal["good", "notice", "bad"]
_MEGABYTE = 1 << 20


@dataclass(frozen=True, slots=True)
class VerdictWords:
    """The words for a verdict. ``short`` fits a table cell; the others are sentences. ``tone`` is the urgency."""

    short: str
    happened: str
    whose: str
    next_step: str
    tone: Tone


_WORDS: Mapping[Verdict, VerdictWords] = MappingProxyType(
    {
        Verdict.FINISHED: VerdictWords(
            ENDED[Verdict.FINISHED],
            translatable("Your program ran to its end without an error."),
            translatable("Nothing stopped it."),
            translatable("Compare what each criterion asked for with what your robot did."),
            "good",
        ),
        Verdict.PROGRAM_ERROR: VerdictWords(
            ENDED[Verdict.PROGRAM_ERROR],
            translatable("Your robot program stopped with an error before it was done."),
            translatable("The error is in your robot program."),
            translatable(
                "Go to the line that is named, fix it, and run the program once in the simulator before submitting it."
            ),
            "bad",
        ),
        Verdict.RESPONDER_ERROR: VerdictWords(
            ENDED[Verdict.RESPONDER_ERROR],
            translatable("The code of your responder failed, so the robot got no answer from it."),
            translatable("The error is in your responder, or in the code beside it."),
            translatable("Fix this in your responder, call it once yourself with a message, and submit it again."),
            "bad",
        ),
        Verdict.PROTOCOL_ERROR: VerdictWords(
            ENDED[Verdict.PROTOCOL_ERROR],
            translatable("Your responder answered, but not in a form that the robot can read."),
            translatable("The answer that your responder returns is at fault."),
            translatable("Return a string. After JSON:: it must contain valid JSON, as json.dumps makes it."),
            "bad",
        ),
        Verdict.TIME_LIMIT: VerdictWords(
            ENDED[Verdict.TIME_LIMIT],
            translatable("Your program was still running when the simulated time was up."),
            translatable(
                "That is no fault where a program may run for ever, as a line follower may; "
                "where it was to end, it is one."
            ),
            translatable(
                "If the program is meant to end, check what its loops wait for, and whether that ever happens."
            ),
            "notice",
        ),
        Verdict.CPU_LIMIT: VerdictWords(
            ENDED[Verdict.CPU_LIMIT],
            translatable("Your code computed for so long without waiting that it was stopped."),
            translatable(
                "A loop never ends, or never waits, so that the robot's world cannot move; "
                "or a calculation is too long."
            ),
            translatable(
                "Check when the loop in that line ends. In a robot program, put a sensor reading or a short "
                "time.sleep inside it; in a responder, make the calculation smaller."
            ),
            "bad",
        ),
        Verdict.MEMORY_LIMIT: VerdictWords(
            ENDED[Verdict.MEMORY_LIMIT],
            translatable("Your code asked for more memory than it may use, and was stopped."),
            translatable("Something in your code keeps growing."),
            translatable("Look for a list or a string that grows on every turn of a loop and is never emptied."),
            "bad",
        ),
        Verdict.OUTPUT_LIMIT: VerdictWords(
            ENDED[Verdict.OUTPUT_LIMIT],
            translatable("Your code printed more than may be recorded, and was stopped."),
            translatable("A loop in your code prints on every turn."),
            translatable("Print only when something changes, or put a short time.sleep inside the loop."),
            "bad",
        ),
        Verdict.STALLED: VerdictWords(
            ENDED[Verdict.STALLED],
            translatable(
                "Your code fell silent: it neither computed nor asked the robot for anything, and was stopped."
            ),
            translatable("Your code waits for something that never comes."),
            translatable(
                "Look for a call that waits for a person, a file or another program; none of these exist here."
            ),
            "bad",
        ),
        Verdict.SANDBOX_VIOLATION: VerdictWords(
            ENDED[Verdict.SANDBOX_VIOLATION],
            translatable("Your code tried something that graded code may not do, and was stopped."),
            translatable("The attempt came from your code or from a module that it imports."),
            translatable("Use no network, no other programs, and no files outside your own folder."),
            "bad",
        ),
        Verdict.ASSIGNMENT_ERROR: VerdictWords(
            ENDED[Verdict.ASSIGNMENT_ERROR],
            translatable("The assignment itself has a mistake, so your work could not be marked fairly."),
            translatable("This is not your fault: the instructor has to fix the assignment."),
            translatable("You need not do anything but tell your instructor; your work can be graded again."),
            "notice",
        ),
        Verdict.HOST_ERROR: VerdictWords(
            ENDED[Verdict.HOST_ERROR],
            translatable("The machine that grades your work failed before it was done."),
            translatable("This is not your fault, and it does not count as an attempt."),
            translatable("You need not do anything; the grading can be run again."),
            "notice",
        ),
    }
)


_LOSSES: Mapping[LossReason, str] = MappingProxyType(
    {
        "chance": translatable("by chance"),
        "out of range": translatable("because the robot was out of range"),
        "facing away": translatable("because it faced away"),
        "blocked": translatable("because a wall or an obstacle stood between"),
    }
)


#: The units of an accuracy.
_COUNTED: Mapping[str, str] = MappingProxyType({"images": translatable("images"), "patterns": translatable("patterns")})


def verdict_words(verdict: Verdict, language: Language = ENGLISH) -> VerdictWords:
    """Return the words for ``verdict``. Every verdict has some."""
    return _said(_WORDS[verdict], language)


def _said(words: VerdictWords, language: Language) -> VerdictWords:
    say = language.say
    return VerdictWords(say(words.short), say(words.happened), say(words.whose), say(words.next_step), words.tone)


#: No robot was run: functions were called and the source was checked.
_NO_ROBOT = VerdictWords(
    translatable("code checked"),
    translatable("Your functions were called and your code was read; no robot was run."),
    translatable("Each criterion below says what happened."),
    translatable("Call the function yourself with the values that are named there."),
    "good",
)


#: One part was graded, and the other is missing.
_WITHOUT: Mapping[str, VerdictWords] = MappingProxyType(
    {
        "robot.py": VerdictWords(
            translatable("no robot.py"),
            translatable("There is no robot.py, so only your responder was graded, by itself."),
            translatable("The marks that need a robot program are missing for that alone."),
            translatable("Submit robot.py beside responder.py; if it is there, check its name."),
            "bad",
        ),
        "responder.py": VerdictWords(
            translatable("no responder.py"),
            translatable(
                "There is no responder.py, so nothing answered your robot program, which was graded by itself."
            ),
            translatable("The marks that need a responder are missing for that alone."),
            translatable("Submit responder.py beside robot.py; if it is there, check its name."),
            "bad",
        ),
    }
)

#: An agent of the responder failed.
_AGENT_ERROR = VerdictWords(
    translatable("error in an agent"),
    translatable("An agent of yours raised an error, so whoever asked it got no answer."),
    translatable("The error is in the agent that is named below, or in a function that it calls."),
    translatable(
        "Call the agent's function yourself with the message that it was sent, and fix the line that is named."
    ),
    "bad",
)


def grade_words(grade: Grade, language: Language = ENGLISH) -> VerdictWords:
    """Return the words for a grade's verdict, or for a missing part or run, with the next step."""
    words = _what_happened(grade, language)
    return replace(words, next_step=_next_step(grade, words, language))


def _next_step(grade: Grade, words: VerdictWords, language: Language) -> str:
    """Return the verdict's advice if there was a problem, otherwise where most marks can be gained."""
    if words.tone == "bad" or is_ours(grade.verdict):
        return words.next_step
    lost = max(grade.criteria, key=lambda result: result.max_marks - result.marks, default=None)
    if lost is None:
        return words.next_step
    if lost.marks >= lost.max_marks:
        return language.say(FULL_MARKS)
    most = language.say(
        "Most marks are missing at “%(criterion)s”: %(missing)s of %(of)s.",
        criterion=one_line(lost.title, 100),
        missing=number(lost.max_marks - lost.marks),
        of=number(lost.max_marks),
    )
    advice = words.next_step if _costs_marks_by_time(grade) else _said(_WORDS[Verdict.FINISHED], language).next_step
    return f"{most} {advice}"


def _costs_marks_by_time(grade: Grade) -> bool:
    """Return whether the verdict's advice applies: a time limit counts only if a criterion names it."""
    if grade.missing or grade.verdict is not Verdict.TIME_LIMIT:
        return True
    told = [each.message for one in grade.criteria if one.marks < one.max_marks for each in one.evidence]
    faults = (fault for trial in grade.trials for fault in faults_of(trial.recording))
    return any(fault.verdict is Verdict.TIME_LIMIT and fault.message in each for fault in faults for each in told)


def _what_happened(grade: Grade, language: Language) -> VerdictWords:
    if not grade.missing:
        return _said(_ended(grade) if grade.trials else _NO_ROBOT, language)
    words = _said(_WITHOUT[grade.missing], language)
    if grade.verdict in (Verdict.FINISHED, Verdict.TIME_LIMIT):
        return words
    ended = _said(_ended(grade), language)
    return replace(ended, short=f"{ended.short}; {words.short}", happened=f"{words.happened} {ended.happened}")


def _ended(grade: Grade) -> VerdictWords:
    if grade.verdict is Verdict.RESPONDER_ERROR and _is_of_an_agent(grade):
        return _AGENT_ERROR
    return _WORDS[grade.verdict]


def _is_of_an_agent(grade: Grade) -> bool:
    faults = next(trial.recording.faults for trial in grade.trials if trial.verdict is Verdict.RESPONDER_ERROR)
    return bool(faults and faults[0].agent)


#: The kinds of events in a trial.
KINDS: Mapping[str, str] = MappingProxyType(
    {
        "printed": translatable("printed"),
        "said": translatable("said"),
        "touched": translatable("touched"),
        "stopped": translatable("stopped"),
        "fault": translatable("fault"),
    }
)


def trial_words(trial: TrialResult, language: Language = ENGLISH, longest: int = 60) -> str:
    """Return the name of a trial: its scenario and its number."""
    scenario = one_line(trial.scenario, longest)
    return language.say("%(scenario)s, trial %(number)s", scenario=scenario, number=trial.index + 1)


def hints_of(grade: Grade) -> tuple[str, ...]:
    """Return the likely causes of lost marks as sentences that are safe to show, before anything else."""
    told = (readable(hint, 600).rstrip(".") for hint in grade.hints)
    # A file name keeps its case.
    began = (hint if "." in hint.partition(" ")[0] else hint[:1].upper() + hint[1:] for hint in told)
    return tuple(hint if hint.endswith("?") else f"{hint}." for hint in began)


def is_ours(verdict: Verdict) -> bool:
    """Return whether the student has nothing to fix."""
    return verdict in (Verdict.HOST_ERROR, Verdict.ASSIGNMENT_ERROR)


def accuracy_counted(accuracy: Accuracy, language: Language = ENGLISH) -> tuple[int, str]:
    """Return how many were identified correctly, and the unit."""
    of = accuracy.counts.of if accuracy.counts else "images"
    return round(accuracy.value * accuracy.n), language.say(_COUNTED.get(of, "%(of)s"), of=of)


def by_hand_words(result: CriterionResult, language: Language = ENGLISH) -> str:
    """Return a sentence on a staff adjustment and its reason; empty if there is none."""
    said = result.set_by_hand
    if said is None:
        return ""
    reason = one_line(said.reason, 500)
    reason += "" if reason.endswith((".", "!", "?", "…")) else "."
    marks = number(result.marks)
    if said.excused and said.graded is None:
        return language.say("Excused, so that it does not count: %(reason)s", reason=reason)
    if said.graded is None:
        return language.say("Set by hand to %(marks)s: %(reason)s", marks=marks, reason=reason)
    had = number(said.graded)
    if said.excused:
        return language.say(
            "Excused, so that it does not count (it had %(had)s of %(worth)s): %(reason)s",
            had=had,
            worth=number(said.worth),
            reason=reason,
        )
    return language.say("Set by hand from %(had)s to %(marks)s: %(reason)s", had=had, marks=marks, reason=reason)


def comments_of(grade: Grade) -> tuple[str, ...]:
    """Return the instructors' comments with their criterion, for display beside the marks."""
    titles = {result.id: one_line(result.title, 200) for result in grade.criteria}
    about = ((titles.get(each.criterion, ""), readable(each.text, 2000)) for each in grade.comments)
    return tuple(f"{title}: {text}" if title else text for title, text in about)


def accuracy_words(grade: Grade) -> str:
    """Return a sentence with value, interval and n, and whether it is unmarked; empty without a classification."""
    result, accuracy = grade.recognition, grade.accuracy
    if result is None or accuracy is None:
        return ""
    practice = "" if result.worth else " in practice, which is not marked:"
    return (
        f"Accuracy{practice} {accuracy.value:.3f} (95 % interval {accuracy.low:.3f} to {accuracy.high:.3f}, "
        f"{accuracy.n} {accuracy_counted(accuracy)[1]})."
    )


def channel_words(grade: Grade, language: Language = ENGLISH) -> str:
    """Return one or two sentences on the channel's losses in all trials, and the reasons; empty without losses."""
    messages = [message for trial in grade.trials for message in trial.recording.messages]
    lost: Counter[LossReason] = Counter(message.lost for message in messages if message.lost)
    if not lost:
        return ""
    reasons = ", ".join(f"{lost[reason]} {language.say(words)}" for reason, words in _LOSSES.items() if lost[reason])
    told = language.say(
        "The channel lost %(lost)s of %(sent)s messages: %(reasons)s.",
        lost=lost.total(),
        sent=len(messages),
        reasons=reasons,
    )
    fair = language.say("What was lost by chance is held against nobody.")
    return f"{told} {fair}" if lost["chance"] else told


def cost_words(grade: Grade, language: Language = ENGLISH) -> str:
    """Return one sentence with what all trials cost together; empty if that is not shown."""
    if grade.cost is None or grade.cost.spent is None:
        return ""
    limits, spent = grade.cost.limits, grade.cost.spent
    most = {
        "most_cpu": f"{limits.cpu_seconds:g}",
        "most_sleep": f"{limits.sleep_seconds:g}",
        "most_output": limits.kept_bytes >> 20,
    }
    return language.say(
        "Used %(cpu)s of %(most_cpu)s s of CPU, %(sleep)s of %(most_sleep)s s of sleep, "
        "%(output)s of %(most_output)s MB of output.",
        cpu=f"{round(spent.cpu_seconds, 1):g}",
        sleep=f"{round(spent.sleep_seconds, 1):g}",
        output=f"{round(spent.kept_bytes / _MEGABYTE, 1):g}",
        **most,
    )
