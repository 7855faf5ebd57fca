"""What is said of a grade in sentences: each verdict in a student's words, its accuracy, what its trials cost.

It knows no marks and no particular trial; the faults of a recording say where and when.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

from service.grading.grade import Accuracy, CriterionResult, Grade
from service.reports.readable import number, one_line, readable
from sim.recording import LossReason, Verdict

Tone = Literal["good", "notice", "bad"]
_MEGABYTE = 1 << 20


@dataclass(frozen=True, slots=True)
class VerdictWords:
    """``short`` fits a table cell; the other three are sentences. ``tone`` is how loud a report should be."""

    short: str
    happened: str
    whose: str
    next_step: str
    tone: Tone


_WORDS: Mapping[Verdict, VerdictWords] = MappingProxyType(
    {
        Verdict.FINISHED: VerdictWords(
            "finished",
            "Your program ran to its end without an error.",
            "Nothing stopped it.",
            "Compare what each criterion asked for with what your robot did.",
            "good",
        ),
        Verdict.PROGRAM_ERROR: VerdictWords(
            "error in the robot program",
            "Your robot program stopped with an error before it was done.",
            "The error is in your robot program.",
            "Go to the line named below, mend it, and run the program once in the simulator before submitting it.",
            "bad",
        ),
        Verdict.RESPONDER_ERROR: VerdictWords(
            "error in the responder",
            "Your responder raised an error, so the robot got no answer to that message.",
            "The error is in your responder, or in a function that it calls.",
            "Call the responder yourself with the message shown below and mend the line that is named.",
            "bad",
        ),
        Verdict.PROTOCOL_ERROR: VerdictWords(
            "answer could not be read",
            "Your responder answered, but not in a form that the robot can read.",
            "The answer that your responder returns is at fault.",
            "Return a string; one that starts with JSON:: must go on with valid JSON, as json.dumps makes it.",
            "bad",
        ),
        Verdict.TIME_LIMIT: VerdictWords(
            "still running at the end",
            "Your program was still running when the simulated time was up.",
            "That is no fault by itself: a line follower, for one, may run for ever.",
            "If the program was meant to end, check what its loops wait for, and whether that ever happens.",
            "notice",
        ),
        Verdict.CPU_LIMIT: VerdictWords(
            "computed for too long",
            "Your code computed for so long without waiting that it was stopped.",
            "A loop never ends, or never waits, so that the robot's world cannot move; or a calculation is too long.",
            "Check when the loop in the line below ends. In a robot program, put a sensor reading or a short "
            "time.sleep inside it; in a responder, make the calculation smaller.",
            "bad",
        ),
        Verdict.MEMORY_LIMIT: VerdictWords(
            "used too much memory",
            "Your code asked for more memory than it may use, and was stopped.",
            "Something in your code keeps growing.",
            "Look for a list or a string that grows on every turn of a loop and is never emptied.",
            "bad",
        ),
        Verdict.OUTPUT_LIMIT: VerdictWords(
            "printed too much",
            "Your code printed more than may be recorded, and was stopped.",
            "A loop in your code prints on every turn.",
            "Print only when something changes, or put a short time.sleep inside the loop.",
            "bad",
        ),
        Verdict.STALLED: VerdictWords(
            "stopped responding",
            "Your code fell silent: it neither computed nor asked the robot for anything, and was stopped.",
            "Your code waits for something that never comes.",
            "Look for a call that waits for a person, a file or another program; none of these exist here.",
            "bad",
        ),
        Verdict.SANDBOX_VIOLATION: VerdictWords(
            "did something not allowed",
            "Your code tried something that graded code may not do, and was stopped.",
            "The attempt came from your code or from a module that it imports.",
            "Use no network, no other programs, and no files outside your own folder.",
            "bad",
        ),
        Verdict.ASSIGNMENT_ERROR: VerdictWords(
            "assignment is broken",
            "The assignment itself has a mistake, so your work could not be marked fairly.",
            "This is not your fault: the instructor has to mend the assignment.",
            "You need not do anything but tell your instructor; your work can be graded again.",
            "notice",
        ),
        Verdict.HOST_ERROR: VerdictWords(
            "grading failed",
            "The machine that grades your work failed before it was done.",
            "This is not your fault, and it does not count as an attempt.",
            "You need not do anything; the grading can be run again.",
            "notice",
        ),
    }
)


_LOSSES: Mapping[LossReason, str] = MappingProxyType(
    {
        "chance": "by chance",
        "out of range": "because the robot was out of range",
        "facing away": "because it faced away",
        "blocked": "because a wall or an obstacle stood between",
    }
)


def verdict_words(verdict: Verdict) -> VerdictWords:
    """The words for ``verdict``; every verdict has some."""
    return _WORDS[verdict]


#: Where no robot was run: only functions were called and texts were read.
_NO_ROBOT = VerdictWords(
    "code checked",
    "Your functions were called and your code was read; no robot was run.",
    "What came of it is told at each criterion.",
    "Call the function yourself with the values that are named there.",
    "good",
)


#: Where there was a part to grade, and the other not.
_WITHOUT: Mapping[str, VerdictWords] = MappingProxyType(
    {
        "robot.py": VerdictWords(
            "no robot.py",
            "There is no robot.py, so only your responder was graded, by itself.",
            "The marks that need a robot program are missing for that alone.",
            "Submit robot.py beside responder.py; if it is there, check its name.",
            "bad",
        ),
        "responder.py": VerdictWords(
            "no responder.py",
            "There is no responder.py, so nothing answered your robot program, which was graded by itself.",
            "The marks that need a responder are missing for that alone.",
            "Submit responder.py beside robot.py; if it is there, check its name.",
            "bad",
        ),
    }
)

#: Where an agent of the responder's failed.
_AGENT_ERROR = VerdictWords(
    "error in an agent",
    "An agent of yours raised an error, so whoever asked it got no answer.",
    "The error is in the agent that is named below, or in a function that it calls.",
    "Call the agent's function yourself with the message that it was sent, and mend the line that is named.",
    "bad",
)


def grade_words(grade: Grade) -> VerdictWords:
    """The words for a grade's verdict, for what was not submitted, or that nothing was run; and what to do next."""
    words = _what_happened(grade)
    return replace(words, next_step=_next_step(grade, words))


def _next_step(grade: Grade, words: VerdictWords) -> str:
    """The verdict's advice if something went wrong, else what would gain most marks, if any are missing."""
    if words.tone == "bad" or is_ours(grade.verdict):
        return words.next_step
    lost = max(grade.criteria, key=lambda result: result.max_marks - result.marks, default=None)
    if lost is None:
        return words.next_step
    if lost.marks >= lost.max_marks:
        return "Full marks: everything that was asked for is there."
    missing, of = number(lost.max_marks - lost.marks), number(lost.max_marks)
    most = f"Most marks are missing at “{one_line(lost.title, 100)}”: {missing} of {of}."
    return f"{most} {words.next_step}"


def _what_happened(grade: Grade) -> VerdictWords:
    if not grade.missing:
        return _ended(grade) if grade.trials else _NO_ROBOT
    words = _WITHOUT[grade.missing]
    if grade.verdict in (Verdict.FINISHED, Verdict.TIME_LIMIT):
        return words
    ended = _ended(grade)
    return replace(ended, short=f"{ended.short}; {words.short}", happened=f"{words.happened} {ended.happened}")


def _ended(grade: Grade) -> VerdictWords:
    if grade.verdict is Verdict.RESPONDER_ERROR and _is_of_an_agent(grade):
        return _AGENT_ERROR
    return verdict_words(grade.verdict)


def _is_of_an_agent(grade: Grade) -> bool:
    faults = next(trial.recording.faults for trial in grade.trials if trial.verdict is Verdict.RESPONDER_ERROR)
    return bool(faults and faults[0].agent)


def hints_of(grade: Grade) -> tuple[str, ...]:
    """What probably cost marks, as sentences that are fit to be shown; to be said before anything else."""
    told = (readable(hint, 600).rstrip(".") for hint in grade.hints)
    # The name of a file stays as it is.
    began = (hint if "." in hint.partition(" ")[0] else hint[:1].upper() + hint[1:] for hint in told)
    return tuple(hint if hint.endswith("?") else f"{hint}." for hint in began)


def is_ours(verdict: Verdict) -> bool:
    """Whether the student has nothing to mend."""
    return verdict in (Verdict.HOST_ERROR, Verdict.ASSIGNMENT_ERROR)


def accuracy_counted(accuracy: Accuracy) -> tuple[int, str]:
    """How many were named rightly, and what is counted."""
    return round(accuracy.value * accuracy.n), accuracy.counts.of if accuracy.counts else "images"


def by_hand_words(result: CriterionResult) -> str:
    """What an instructor set in place of the grader's marks, and why; empty where nobody did."""
    said = result.set_by_hand
    if said is None:
        return ""
    reason = one_line(said.reason, 500)
    reason += "" if reason.endswith((".", "!", "?", "…")) else "."
    if said.excused:
        had = "" if said.graded is None else f" (it had {number(said.graded)} of {number(said.worth)})"
        return f"Excused, so that it does not count{had}: {reason}"
    was = "" if said.graded is None else f" from {number(said.graded)}"
    return f"Set by hand{was} to {number(result.marks)}: {reason}"


def comments_of(grade: Grade) -> tuple[str, ...]:
    """What instructors wrote, with the criterion that it is about; to be said beside the marks."""
    titles = {result.id: one_line(result.title, 200) for result in grade.criteria}
    about = ((titles.get(each.criterion, ""), readable(each.text, 2000)) for each in grade.comments)
    return tuple(f"{title}: {text}" if title else text for title, text in about)


def accuracy_words(grade: Grade) -> str:
    """One sentence with value, interval and n; empty without a classification."""
    accuracy = grade.accuracy
    if accuracy is None:
        return ""
    return (
        f"Accuracy {accuracy.value:.3f} (95 % interval {accuracy.low:.3f} to {accuracy.high:.3f}, "
        f"{accuracy.n} {accuracy_counted(accuracy)[1]})."
    )


def channel_words(grade: Grade) -> str:
    """A sentence or two on what the channel lost in all trials, and why; empty where it lost nothing."""
    messages = [message for trial in grade.trials for message in trial.recording.messages]
    lost: Counter[LossReason] = Counter(message.lost for message in messages if message.lost)
    if not lost:
        return ""
    reasons = ", ".join(f"{lost[reason]} {words}" for reason, words in _LOSSES.items() if lost[reason])
    fair = " What was lost by chance is held against nobody." if lost["chance"] else ""
    return f"The channel lost {lost.total()} of {len(messages)} messages: {reasons}.{fair}"


def cost_words(grade: Grade) -> str:
    """One sentence with what all trials cost together, or may cost where that is not told; empty if nobody knows."""
    if grade.cost is None:
        return ""
    limits, spent = grade.cost.limits, grade.cost.spent
    if spent is None:
        return (
            f"All trials together may use {limits.cpu_seconds:g} s of CPU, {limits.sleep_seconds:g} s of sleep and "
            f"{limits.kept_bytes >> 20} MB of output."
        )
    return (
        f"Used {round(spent.cpu_seconds, 1):g} of {limits.cpu_seconds:g} s of CPU, "
        f"{round(spent.sleep_seconds, 1):g} of {limits.sleep_seconds:g} s of sleep, "
        f"{round(spent.kept_bytes / _MEGABYTE, 1):g} of {limits.kept_bytes >> 20} MB of output."
    )
