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
from service.grading.judging.message_parts import states_fault
from service.grading.verdict_labels import VERDICT_LABELS
from service.language import ENGLISH, Language, translatable
from service.reports.display_text import format_decimal, to_display_text, to_one_line
from sim.recording import LossReason, Verdict
from sim.recording_values import collect_faults

FULL_MARKS = translatable("Full marks.")
Tone = Literal["good", "notice", "bad"]
_MEGABYTE = 1 << 20


@dataclass(frozen=True, slots=True)
class VerdictWords:
    """Words for a verdict. ``short`` fits a table cell; the others are sentences. ``tone`` is the urgency.

    A completed run has no ``explanation``.
    """

    short: str
    happened: str
    explanation: str
    next_step: str
    tone: Tone


_WORDS: Mapping[Verdict, VerdictWords] = MappingProxyType(
    {
        Verdict.FINISHED: VerdictWords(
            VERDICT_LABELS[Verdict.FINISHED],
            translatable("Your program completed without errors."),
            "",
            translatable("Compare each criterion with the actions of your robot."),
            "good",
        ),
        Verdict.PROGRAM_ERROR: VerdictWords(
            VERDICT_LABELS[Verdict.PROGRAM_ERROR],
            translatable("Your robot program stopped with an error before it completed."),
            translatable("The error is in your robot program."),
            translatable(
                "Fix the line in the error message. Run the program once in the simulator, then submit again."
            ),
            "bad",
        ),
        Verdict.RESPONDER_ERROR: VerdictWords(
            VERDICT_LABELS[Verdict.RESPONDER_ERROR],
            translatable("Your responder stopped with an error, so the robot got no answer."),
            translatable("The error is in your responder or in a module that it imports."),
            translatable("Fix this in your responder. Test it by calling it with a message, then submit again."),
            "bad",
        ),
        Verdict.PROTOCOL_ERROR: VerdictWords(
            VERDICT_LABELS[Verdict.PROTOCOL_ERROR],
            translatable("Your responder answered, but the robot cannot read the answer."),
            translatable("The error is in the value that your responder returns."),
            translatable(
                "Return a string. After JSON:: the string must contain valid JSON. The function json.dumps creates it."
            ),
            "bad",
        ),
        Verdict.TIME_LIMIT: VerdictWords(
            VERDICT_LABELS[Verdict.TIME_LIMIT],
            translatable("Your program was still running at the end of the simulated time."),
            translatable(
                "This is a mistake only if the program must end by itself. A line follower, for example, may run "
                "until time is up."
            ),
            translatable("If the program must end by itself, check the conditions of its loops. Can each loop end?"),
            "notice",
        ),
        Verdict.CPU_LIMIT: VerdictWords(
            VERDICT_LABELS[Verdict.CPU_LIMIT],
            translatable("Your code was stopped because it computed for too long without waiting."),
            translatable(
                "A loop never ends or never waits, or a calculation takes too long. The robot moves only while your "
                "program waits."
            ),
            translatable(
                "Check when the loop in that line ends. In a robot program, add a sensor reading or a short "
                "time.sleep to the loop. In a responder, make the calculation shorter."
            ),
            "bad",
        ),
        Verdict.MEMORY_LIMIT: VerdictWords(
            VERDICT_LABELS[Verdict.MEMORY_LIMIT],
            translatable("Your code was stopped because it used too much memory."),
            translatable("A value in your code keeps growing."),
            translatable("Look for a list or a string that grows in every pass of a loop."),
            "bad",
        ),
        Verdict.OUTPUT_LIMIT: VerdictWords(
            VERDICT_LABELS[Verdict.OUTPUT_LIMIT],
            translatable("Your code was stopped because it printed too much."),
            translatable("A loop in your code prints in every pass."),
            translatable("Print only when a value changes, or add a short time.sleep to the loop."),
            "bad",
        ),
        Verdict.STALLED: VerdictWords(
            VERDICT_LABELS[Verdict.STALLED],
            translatable("Your code was stopped because it did nothing: it did not compute and did not use the robot."),
            translatable("Your code waits for an event that never happens."),
            translatable(
                "Look for a call that waits for a person, a file or another program. Remove it, because none of these "
                "exist here."
            ),
            "bad",
        ),
        Verdict.SANDBOX_VIOLATION: VerdictWords(
            VERDICT_LABELS[Verdict.SANDBOX_VIOLATION],
            translatable("Your code was stopped because it tried an action that is not allowed."),
            translatable("The attempt came from your code or from a module that it imports."),
            translatable("Do not use the network, other programs, or files outside your folder."),
            "bad",
        ),
        Verdict.ASSIGNMENT_ERROR: VerdictWords(
            VERDICT_LABELS[Verdict.ASSIGNMENT_ERROR],
            translatable("The assignment has an error, so your submission could not be graded fairly."),
            translatable("This is not your fault. Your instructor must fix the assignment."),
            translatable("Please tell your instructor. Your submission can then be graded again."),
            "notice",
        ),
        Verdict.HOST_ERROR: VerdictWords(
            VERDICT_LABELS[Verdict.HOST_ERROR],
            translatable("The grading computer failed before grading was complete."),
            translatable("This is not your fault, and it does not count as an attempt."),
            translatable("You don't need to do anything. The grading can be repeated."),
            "notice",
        ),
    }
)


_LOSSES: Mapping[LossReason, str] = MappingProxyType(
    {
        "chance": translatable("by chance"),
        "out of range": translatable("because the robot was out of range"),
        "facing away": translatable("because the robot faced away"),
        "blocked": translatable("because of a wall or an obstacle between them"),
    }
)


#: The units of an accuracy.
_UNITS: Mapping[str, str] = MappingProxyType({"images": translatable("images"), "patterns": translatable("patterns")})


def describe_verdict(verdict: Verdict, language: Language = ENGLISH) -> VerdictWords:
    """Return the words for ``verdict``. Every verdict has some."""
    return _translate_words(_WORDS[verdict], language)


def _translate_words(verdict_words: VerdictWords, language: Language) -> VerdictWords:
    say = language.say
    return VerdictWords(
        say(verdict_words.short),
        say(verdict_words.happened),
        say(verdict_words.explanation) if verdict_words.explanation else "",
        say(verdict_words.next_step),
        verdict_words.tone,
    )


#: No robot was run: functions were called and the source was checked.
_NO_ROBOT = VerdictWords(
    translatable("code checked"),
    translatable("Your functions and your code were checked without running a robot."),
    translatable("The criteria below have the details."),
    translatable("Call the function yourself with the values from the message."),
    "good",
)


#: One part was graded, and the other is missing.
_MISSING_PART: Mapping[str, VerdictWords] = MappingProxyType(
    {
        "robot.py": VerdictWords(
            translatable("no robot.py"),
            translatable("There is no robot.py, so only your responder was graded."),
            translatable("Because of this, you lost marks only for criteria that need a robot program."),
            translatable("Submit robot.py together with responder.py. If you did, check the file name."),
            "bad",
        ),
        "responder.py": VerdictWords(
            translatable("no responder.py"),
            translatable("There is no responder.py, so your robot program was graded without answers."),
            translatable("Because of this, you lost marks only for criteria that need a responder."),
            translatable("Submit responder.py together with robot.py. If you did, check the file name."),
            "bad",
        ),
    }
)

#: An agent of the responder failed.
_AGENT_ERROR = VerdictWords(
    translatable("error in an agent"),
    translatable("One of your agents raised an error, so the sender of the message got no answer."),
    translatable("The error is in the agent named below, or in a function that it calls."),
    translatable("Fix the line in the error message. Test the agent's function by calling it with the same message."),
    "bad",
)


def describe_grade(grade: Grade, language: Language = ENGLISH) -> VerdictWords:
    """Return the words for a grade's verdict, or for a missing part or run, with the next step."""
    verdict_words = _describe_outcome(grade, language)
    return replace(verdict_words, next_step=_describe_next_step(grade, verdict_words, language))


def _describe_next_step(grade: Grade, verdict_words: VerdictWords, language: Language) -> str:
    """Return the verdict's advice if there was a problem, otherwise where most marks can be gained."""
    if verdict_words.tone == "bad" or is_not_students_fault(grade.verdict):
        return verdict_words.next_step
    costliest_criterion = max(grade.criteria, key=lambda result: result.max_marks - result.marks, default=None)
    if costliest_criterion is None:
        return verdict_words.next_step
    if costliest_criterion.marks >= costliest_criterion.max_marks:
        return language.say(FULL_MARKS)
    suggestion = language.say(
        "The most marks are available for “%(criterion)s”: %(missing)s of %(of)s.",
        criterion=to_one_line(costliest_criterion.title, 100),
        missing=format_decimal(costliest_criterion.max_marks - costliest_criterion.marks),
        of=format_decimal(costliest_criterion.max_marks),
    )
    advice = (
        verdict_words.next_step
        if _is_verdict_advice_relevant(grade)
        else _translate_words(_WORDS[Verdict.FINISHED], language).next_step
    )
    return f"{suggestion} {advice}"


def _is_verdict_advice_relevant(grade: Grade) -> bool:
    """Return whether the verdict's advice applies: a time limit counts only if a criterion names it."""
    if grade.missing or grade.verdict is not Verdict.TIME_LIMIT:
        return True
    failure_messages = [each.message for one in grade.criteria if one.marks < one.max_marks for each in one.evidence]
    faults = (fault for trial in grade.trials for fault in collect_faults(trial.recording))
    return any(
        fault.verdict is Verdict.TIME_LIMIT and states_fault(each, fault)
        for fault in faults
        for each in failure_messages
    )


def _describe_outcome(grade: Grade, language: Language) -> VerdictWords:
    if not grade.missing:
        return _translate_words(_select_verdict_words(grade) if grade.trials else _NO_ROBOT, language)
    missing_words = _translate_words(_MISSING_PART[grade.missing], language)
    if grade.verdict in (Verdict.FINISHED, Verdict.TIME_LIMIT):
        return missing_words
    ending_words = _translate_words(_select_verdict_words(grade), language)
    return replace(
        ending_words,
        short=f"{ending_words.short}; {missing_words.short}",
        happened=f"{missing_words.happened} {ending_words.happened}",
    )


def _select_verdict_words(grade: Grade) -> VerdictWords:
    if grade.verdict is Verdict.RESPONDER_ERROR and _is_agent_error(grade):
        return _AGENT_ERROR
    return _WORDS[grade.verdict]


def _is_agent_error(grade: Grade) -> bool:
    faults = next(trial.recording.faults for trial in grade.trials if trial.verdict is Verdict.RESPONDER_ERROR)
    return bool(faults and faults[0].agent)


#: The kinds of events in a trial.
EVENT_KINDS: Mapping[str, str] = MappingProxyType(
    {
        "printed": translatable("printed"),
        "said": translatable("said"),
        "touched": translatable("touched"),
        "stopped": translatable("stopped"),
        "fault": translatable("fault"),
    }
)


def format_trial_name(trial: TrialResult, language: Language = ENGLISH, max_length: int = 60) -> str:
    """Return the name of a trial: its scenario and its number."""
    scenario = to_one_line(trial.scenario, max_length)
    return language.say("%(scenario)s, trial %(number)s", scenario=scenario, number=trial.index + 1)


def format_hints(grade: Grade, language: Language = ENGLISH) -> tuple[str, ...]:
    """Return the likely causes of lost marks as sentences that are safe to show, before anything else."""
    hint_texts = (to_display_text(language.translate_sentence(hint), 600).rstrip(".") for hint in grade.hints)
    # A file name keeps its case.
    capitalised_hints = (hint if "." in hint.partition(" ")[0] else hint[:1].upper() + hint[1:] for hint in hint_texts)
    return tuple(hint if hint.endswith("?") else f"{hint}." for hint in capitalised_hints)


def is_not_students_fault(verdict: Verdict) -> bool:
    """Return whether the student has nothing to fix."""
    return verdict in (Verdict.HOST_ERROR, Verdict.ASSIGNMENT_ERROR)


def count_correct(accuracy: Accuracy, language: Language = ENGLISH) -> tuple[int, str]:
    """Return how many were identified correctly, and the unit."""
    unit = accuracy.counts.of if accuracy.counts else "images"
    return round(accuracy.value * accuracy.n), language.say(_UNITS.get(unit, "%(of)s"), of=unit)


def describe_adjustment(result: CriterionResult, language: Language = ENGLISH) -> str:
    """Return a sentence on a staff adjustment and its reason; empty if there is none."""
    adjustment = result.set_by_hand
    if adjustment is None:
        return ""
    reason = to_one_line(adjustment.reason, 500)
    reason += "" if reason.endswith((".", "!", "?", "…")) else "."
    marks = format_decimal(result.marks)
    if adjustment.excused and adjustment.graded is None:
        return language.say("Excused, does not count: %(reason)s", reason=reason)
    if adjustment.graded is None:
        return language.say("Adjusted by staff to %(marks)s: %(reason)s", marks=marks, reason=reason)
    graded_marks = format_decimal(adjustment.graded)
    if adjustment.excused:
        return language.say(
            "Excused, does not count (before: %(had)s of %(worth)s): %(reason)s",
            had=graded_marks,
            worth=format_decimal(adjustment.worth),
            reason=reason,
        )
    return language.say(
        "Adjusted by staff from %(had)s to %(marks)s: %(reason)s", had=graded_marks, marks=marks, reason=reason
    )


def format_comments(grade: Grade) -> tuple[str, ...]:
    """Return the instructors' comments with their criterion, for display beside the marks."""
    titles = {result.id: to_one_line(result.title, 200) for result in grade.criteria}
    titled_comments = ((titles.get(each.criterion, ""), to_display_text(each.text, 2000)) for each in grade.comments)
    return tuple(f"{title}: {text}" if title else text for title, text in titled_comments)


def describe_accuracy(grade: Grade) -> str:
    """Return a sentence with value, interval and n, and whether it is unmarked; empty without a classification."""
    result, accuracy = grade.recognition, grade.accuracy
    if result is None or accuracy is None:
        return ""
    practice = "" if result.worth else " for practice (not marked):"
    return (
        f"Accuracy{practice} {accuracy.value:.3f} (95 % interval {accuracy.low:.3f} to {accuracy.high:.3f}, "
        f"{accuracy.n} {count_correct(accuracy)[1]})."
    )


def describe_channel_losses(grade: Grade, language: Language = ENGLISH) -> str:
    """Return one or two sentences on the channel's losses in all trials, and the reasons; empty without losses."""
    messages = [message for trial in grade.trials for message in trial.recording.messages]
    loss_counts: Counter[LossReason] = Counter(message.lost for message in messages if message.lost)
    if not loss_counts:
        return ""
    reasons = ", ".join(
        f"{loss_counts[reason]} {language.say(words)}" for reason, words in _LOSSES.items() if loss_counts[reason]
    )
    summary = language.say(
        "The channel lost %(lost)s of %(sent)s messages: %(reasons)s.",
        lost=loss_counts.total(),
        sent=len(messages),
        reasons=reasons,
    )
    fairness_note = language.say("Messages lost by chance do not cost marks.")
    return f"{summary} {fairness_note}" if loss_counts["chance"] else summary


def describe_cost(grade: Grade, language: Language = ENGLISH) -> str:
    """Return one sentence with what all trials cost together; empty if that is not shown."""
    if grade.cost is None or grade.cost.spent is None:
        return ""
    limits, spent = grade.cost.limits, grade.cost.spent
    limit_texts = {
        "most_cpu": f"{limits.cpu_seconds:g}",
        "most_sleep": f"{limits.sleep_seconds:g}",
        "most_output": limits.kept_bytes >> 20,
    }
    return language.say(
        "CPU time: %(cpu)s of %(most_cpu)s s. Sleep: %(sleep)s of %(most_sleep)s s. Output: %(output)s of "
        "%(most_output)s MB.",
        cpu=f"{round(spent.cpu_seconds, 1):g}",
        sleep=f"{round(spent.sleep_seconds, 1):g}",
        output=f"{round(spent.kept_bytes / _MEGABYTE, 1):g}",
        **limit_texts,
    )
