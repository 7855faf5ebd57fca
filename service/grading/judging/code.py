"""Judging of submitted code: its source, the results of its functions, and an instructor's Python checks.

Sources are read and functions called inside the sandbox. The results are data, which this module only compares.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from fractions import Fraction
from typing import Any

from responders.function_calls import CallResult, CallResults, FunctionCall, describe_missing_function
from service.grading.findings import (
    FailedCall,
    Finding,
    MissingSwitches,
    UnloadedResponder,
    WrongHiddenCalls,
    WrongReturn,
)
from service.grading.grade import CriterionResult, Measure, TrialResult
from service.grading.judging.answers import MISSING, as_text, find_at_path, parse_json_answer
from service.grading.judging.judge_declaration import Case, declare_case_judge, judge_by_trial, judge_once
from service.grading.judging.marks import round_to_steps
from service.grading.judging.message_parts import describe_fault, join_with_or, join_with_semicolons, quote_text
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from service.grading.judging.source_answers import SPEECH, SourceAnswers
from sim.errors import AssignmentError
from sim.sentences import Sentence, join_sentences
from submissions.criteria.code import ExpectedCall, Functions, PythonCheck, SourceRules, parse_flag_texts
from submissions.magics import Flags

#: The largest number of problems to report, so that the first is easy to see.
_MAX_LISTED = 4


@declare_case_judge(SourceRules)
def judge_source_rules(criterion: SourceRules, case: Case) -> CriterionResult:
    """Judge what the source must and must not contain, once for all trials."""
    program_trials = case.trials if criterion.part == "program" else ()
    answers = case.analysis.answers.get(criterion.id)
    return judge_once(criterion, judge_source(criterion, answers, case.analysis.flags, program_trials))


@declare_case_judge(Functions)
def judge_functions(criterion: Functions, case: Case) -> CriterionResult:
    """Judge the results of the responder's functions, once for all trials."""
    return judge_once(criterion, _judge_calls(criterion, case.analysis.called.get(criterion.id)))


@declare_case_judge(PythonCheck)
def judge_python_check(criterion: PythonCheck, case: Case) -> CriterionResult:
    """Judge each trial by the result of the instructor's own check."""
    return judge_by_trial(
        criterion, case, lambda index, _: _judge_check_result(criterion, case.analysis.checks[criterion.id, index])
    )


def judge_source(
    criterion: SourceRules, answers: SourceAnswers | None, flags: Flags, trials: Sequence[TrialResult] = ()
) -> Outcome:
    """Judge the source. ``trials`` are the runs of the program."""
    part = Sentence("your program") if criterion.part == "program" else Sentence("your responder")
    if answers is None:
        return fail_with(Sentence("Expected %(part)s to be submitted, but it was not.", part=part))
    if answers.error:
        return fail_with(
            Sentence("Expected %(part)s to be readable as Python, but: %(error)s.", part=part, error=answers.error)
        )
    missing_flags = _list_missing_flags(criterion, flags)
    problems = [
        *_describe_source_problems(criterion, answers, part, trials),
        *(
            Sentence("Expected the magic line of %(part)s to have %(flag)s, but it does not.", part=part, flag=flag)
            for flag in missing_flags
            if flag
        ),
    ]
    for_staff = _build_staff_note(criterion, answers)
    if not problems:
        return pass_with(Sentence("The code of %(part)s is as expected.", part=part), for_staff=for_staff)
    count = len(criterion.uses + criterion.avoids + criterion.in_loop + criterion.defines) + len(missing_flags)
    message = join_sentences(*problems[:_MAX_LISTED])
    score = Fraction(count - len(problems), count)
    letters = tuple(flag[1:] for flag in missing_flags if len(flag) == 2)
    return fail_with(message, score=score, for_staff=for_staff, findings=(MissingSwitches(letters),) if letters else ())


def _describe_source_problems(
    criterion: SourceRules, answers: SourceAnswers, part: str, trials: Sequence[TrialResult]
) -> Iterator[str]:
    """Yield a sentence for each rule that the source violates."""
    for rule, position in zip(criterion.uses, answers.uses, strict=True):
        if position is None:
            yield Sentence(
                "Expected %(part)s to use %(rule)s, but it does not, or only in code that is not run.",
                part=part,
                rule=_describe_rule(rule),
            )
    for rule, position in zip(criterion.avoids, answers.avoids, strict=True):
        finding = (
            Sentence("%(place)s uses it", place=position.describe())
            if position is not None
            else _describe_unseen_speech(rule, answers, trials) or answers.unread
        )
        if finding:
            yield Sentence(
                "Expected %(part)s not to use %(rule)s, but %(finding)s.",
                part=part,
                rule=_describe_rule(rule),
                finding=finding,
            )
    for rule, position in zip(criterion.in_loop, answers.in_loop, strict=True):
        if position is None:
            yield Sentence(
                "Expected %(part)s to call %(rule)s inside a loop, but it does not, or only in code that is not run.",
                part=part,
                rule=rule,
            )
    for rule, position in zip(criterion.defines, answers.defines, strict=True):
        if position is None:
            yield Sentence(
                "Expected %(part)s to define a function %(rule)s, but it does not.",
                part=part,
                rule=rule,
            )


def _describe_unseen_speech(rule: str, answers: SourceAnswers, trials: Sequence[TrialResult]) -> str:
    """Return a note that the robot spoke although the source shows no call for it; empty if it did not.

    A rule may name only one of the speech functions.
    """
    matches = [fnmatchcase(call, rule) for call in SPEECH]
    is_shown = any(place is not None for place in answers.speech)
    if not rule.endswith("()") or not any(matches) or is_shown:
        return ""
    has_spoken = any(trial.recording.spoken for trial in trials if trial.visibility == "visible")
    return Sentence("the robot spoke during the run") if has_spoken else ""


def _build_staff_note(criterion: SourceRules, answers: SourceAnswers) -> str:
    """Return what staff should check for avoided constructs, because the source does not show all it can do."""
    if not criterion.avoids or not answers.doubts:
        return ""
    return Sentence("The code may do more than it shows: %(doubts)s.", doubts=join_with_semicolons(answers.doubts))


def _list_missing_flags(criterion: SourceRules, flags: Flags) -> list[str]:
    """Return one entry per required flag: the flag if it is missing, otherwise empty."""
    if not criterion.flags:
        return []
    required_flags = parse_flag_texts(criterion.flags)
    values = [
        "" if flags.values.get(short) == value else f"-{short} {value}"
        for short, value in sorted(required_flags.values.items())
    ]
    return values + ["" if short in flags.switches else f"-{short}" for short in sorted(required_flags.switches)]


def _describe_rule(rule: str) -> str:
    return Sentence("a %(keyword)s loop", keyword=rule) if rule in ("for", "while") else rule


_MAX_MESSAGE_LENGTH = 500
_MAX_MEASURES = 20


def list_calls(criterion: Functions) -> tuple[FunctionCall, ...]:
    """Return the calls that the criterion needs."""
    return tuple(
        FunctionCall(call.function or criterion.function, call.arguments, call.named, call.hidden)
        for call in criterion.calls
    )


def _judge_calls(criterion: Functions, results: CallResults | None) -> Outcome:
    if results is None:
        return fail_with(Sentence("Expected a responder to be submitted, but it was not."))
    if results.fault is not None:
        return fail_with(
            Sentence("Expected the responder to be loaded, but: %(fault)s.", fault=describe_fault(results.fault)),
            findings=(UnloadedResponder(results.fault),),
        )
    scores: list[Fraction] = []
    first_problem = for_staff = ""
    findings: tuple[Finding, ...] = ()
    min_score = Fraction(str(criterion.at_least)) if criterion.each else Fraction(1)
    for call, call_result in zip(criterion.calls, results.returned, strict=True):
        score, description, value = _compare_call(criterion, call, call_result)
        scores.append(score)
        if score < min_score:
            problem = Sentence(
                "Expected %(call)s to return %(value)s, but %(actual)s",
                call=_format_call(criterion, call),
                value=_format_expected(call),
                actual=description,
            )
            if call.hidden:
                for_staff = for_staff or Sentence(
                    "The first hidden call with a wrong result: %(problem)s.", problem=problem
                )
            elif not first_problem:
                name, first_problem = call.function or criterion.function, problem
                expected = None if call.one_of else call.returns
                is_failed = value is MISSING
                findings = (
                    FailedCall(name, call_result.fault, call_result.value)
                    if is_failed
                    else WrongReturn(name, expected, value),
                )
    if not first_problem and any(score < min_score for score in scores):
        first_problem, findings = _describe_hidden_failures(criterion, results, scores, min_score)
    return _combine_call_scores(criterion, scores, first_problem, for_staff, findings)


def _combine_call_scores(
    criterion: Functions, scores: Sequence[Fraction], problem: str, for_staff: str, findings: tuple[Finding, ...]
) -> Outcome:
    """Return the outcome of the calls. ``problem`` describes the first problem, if any."""
    share = sum(scores, Fraction(0)) / len(scores)
    measures = (Measure(Sentence("right"), float(share)),)
    if not problem or (criterion.table and share >= Fraction(str(criterion.at_least))):
        return pass_with(_describe_right_calls(criterion, scores, share), measures=measures, for_staff=for_staff)
    right_count = sum(score == 1 for score in scores)
    score = round_to_steps(share) if criterion.table else share
    message = (
        Sentence(
            "%(problem)s (%(right)s of %(count)s calls correct).", problem=problem, right=right_count, count=len(scores)
        )
        if len(scores) > 1 and not criterion.table
        else Sentence("%(problem)s.", problem=problem)
    )
    return fail_with(message, score=score, measures=measures, for_staff=for_staff, findings=findings)


def _describe_right_calls(criterion: Functions, scores: Sequence[Fraction], share: Fraction) -> str:
    """Return the sentence on calls that passed. ``share`` is the mean of the scores."""
    if criterion.table:
        return Sentence(
            "The functions returned the expected values: at least %(percent).0f%% of %(count)s calls correct.",
            percent=100 * criterion.at_least,
            count=len(scores),
        )
    if criterion.each:
        return Sentence(
            "The functions returned the expected values: %(percent).0f%% correct.", percent=100 * float(share)
        )
    return Sentence(
        "The functions returned the expected values: %(count)s of %(count)s calls correct.", count=len(scores)
    )


def _describe_hidden_failures(
    criterion: Functions, results: CallResults, scores: Sequence[Fraction], min_score: Fraction
) -> tuple[str, tuple[Finding, ...]]:
    """Return the message if only hidden calls failed, without values or errors, which a program can choose."""
    calls = criterion.calls
    faults = [gave.fault for gave in results.returned if gave.fault is not None]
    if [fault.message for fault in faults] == [
        describe_missing_function(call.function or criterion.function) for call in calls
    ]:
        problem = Sentence("Expected all functions to exist, but %(fault)s", fault=faults[0].message)
        return problem, (UnloadedResponder(faults[0]),)
    hidden_scores = [score for call, score in zip(calls, scores, strict=True) if call.hidden]
    if criterion.table:
        share = round_to_steps(sum(scores, Fraction(0)) / len(scores))
        problem = Sentence(
            "Expected %(function)s to be correct in %(least).0f%% of %(count)s calls, but it was correct in about "
            "%(percent).0f%%",
            function=criterion.function,
            least=100 * criterion.at_least,
            count=len(scores),
            percent=100 * float(share),
        )
        return problem, ()
    problem = Sentence(
        "Expected the right values in all %(count)s hidden calls as well, but %(right)s of them were right",
        count=len(hidden_scores),
        right=sum(score >= min_score for score in hidden_scores),
    )
    return problem, (WrongHiddenCalls(),)


def _judge_check_result(criterion: PythonCheck, call_result: CallResult) -> Outcome:
    """Return the outcome from an instructor's check.

    Raises:
        AssignmentError: The check failed or returned an invalid value.
    """
    if call_result.fault is not None:
        raise AssignmentError(
            f"The assignment's own check fails: {criterion.file}: {describe_fault(call_result.fault)}."
        )
    result = {"passed": call_result.value} if isinstance(call_result.value, bool) else call_result.value
    description = f"{criterion.file}: check returned {quote_text(as_text(call_result.value))}"
    problem = f"The assignment's own check fails: {description}, expected True, False or a dict"
    if not isinstance(result, dict) or not isinstance(result.get("passed"), bool):
        raise AssignmentError(f'{problem} with "passed".')
    score, measures = result.get("score", 0), result.get("measures", {})
    message = result.get("message") or ""
    numbers = [score, *measures.values()] if isinstance(measures, dict) else [None]
    if not isinstance(message, str) or not all(map(_is_number, numbers)):
        raise AssignmentError(f"{problem}: message is a text, score a number, measures maps names to numbers.")
    message = " ".join(message.split())[:_MAX_MESSAGE_LENGTH] if message else _describe_result(result["passed"])
    kept_measures = tuple(
        Measure(str(name)[:60], float(value)) for name, value in list(measures.items())[:_MAX_MEASURES]
    )
    if result["passed"]:
        return pass_with(message, measures=kept_measures)
    return fail_with(message, score=Fraction(str(score)), measures=kept_measures)


def _describe_result(passed: bool) -> str:
    return Sentence("As expected.") if passed else Sentence("Not as expected.")


def _compare_call(criterion: Functions, call: ExpectedCall, call_result: CallResult) -> tuple[Fraction, str, Any]:
    """Return the correct fraction of a call, a description of what happened, and the compared value or MISSING."""
    if call_result.fault is not None:
        description = Sentence("it did not: %(fault)s", fault=describe_fault(call_result.fault))
        return Fraction(0), description, MISSING
    value = call_result.value
    if criterion.path is not None:
        value = find_at_path(parse_json_answer(value), criterion.path) if isinstance(value, str) else MISSING
        if value is MISSING and not isinstance(call_result.value, str):
            description = Sentence("it returned %(value)s, not a text of JSON", value=_format_value(call_result.value))
            return Fraction(0), description, MISSING
        if value is MISSING:
            answer_text = quote_text(as_text(call_result.value))
            description = Sentence(
                "there is nothing at %(path)s in %(answer)s", path=criterion.path, answer=answer_text
            )
            return Fraction(0), description, MISSING
    description = Sentence("it returned %(value)s", value=_format_value(value))
    if criterion.each:
        return _compute_correct_share(criterion, call.returns, value), description, value
    allowed_values = call.one_of or (call.returns,)
    return Fraction(any(_is_close_value(criterion, value, each) for each in allowed_values)), description, value


def _compute_correct_share(criterion: Functions, expected_values: Sequence[Any], value: Any) -> Fraction:
    if not isinstance(value, list):
        return Fraction(0)
    right_count = sum(_is_close_value(criterion, got, each) for got, each in zip(value, expected_values, strict=False))
    return Fraction(right_count, max(len(expected_values), len(value)))


def _is_close_value(criterion: Functions, actual: Any, expected: Any) -> bool:
    """Return whether values are equal as JSON, numbers within the tolerance, texts apart from repeated spaces."""
    if isinstance(actual, bool) or isinstance(expected, bool):
        return actual is expected
    if _is_number(actual) and _is_number(expected):
        return abs(float(actual) - float(expected)) <= criterion.tolerance + 1e-12
    if isinstance(actual, str) and isinstance(expected, str):
        actual_text, expected_text = " ".join(actual.split()), " ".join(expected.split())
        return (
            actual_text.casefold() == expected_text.casefold()
            if criterion.ignore_case
            else actual_text == expected_text
        )
    if isinstance(actual, list) and isinstance(expected, list | tuple):
        return len(actual) == len(expected) and all(
            _is_close_value(criterion, got, each) for got, each in zip(actual, expected, strict=True)
        )
    if isinstance(actual, dict) and isinstance(expected, dict):
        return actual.keys() == expected.keys() and all(
            _is_close_value(criterion, actual[key], expected[key]) for key in expected
        )
    return actual is None and expected is None


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def _format_call(criterion: Functions, call: ExpectedCall) -> str:
    arguments = [repr(value) for value in call.arguments]
    arguments += [f"{name}={value!r}" for name, value in call.named.items()]
    text = ", ".join(arguments)
    return f"{call.function or criterion.function}({text if len(text) <= 80 else text[:77] + '...'})"


def _format_expected(call: ExpectedCall) -> str:
    return join_with_or([_format_value(value) for value in call.one_of or (call.returns,)])


def _format_value(value: Any) -> str:
    """Return the value for a message: texts in quotes, others as they are, shortened."""
    text = quote_text(as_text(value))
    return text if isinstance(value, str) else text[1:-1]
