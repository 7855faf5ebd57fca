"""Hints on texts and programs that repeat too often or too rarely, because of the loops they are in.

Each rule compares the loops with what the robot said, or with how early the program ended.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from service.grading.findings import OtherWord, StrayItems
from service.grading.hint_clues import Clues
from service.grading.hint_code import LOOPS, Statement, join_tokens
from service.grading.hint_slips import format_arguments
from service.grading.hint_structure import collect_statements, has_motor_call
from service.grading.hint_tables import LIMITED_MOVES, PROPERTIES
from service.grading.judging.message_parts import quote_text
from service.language import translatable
from sim.recording import Verdict
from sim.sentences import Sentence
from submissions.criteria.logs import Datalog
from submissions.criteria.motion import Encounters
from submissions.criteria.sequence import WordSequence

_OUTPUT_FUNCTIONS = frozenset({"say", "print"})
_INTEGER = re.compile(r"-?\d+")
_INCLUSIVE = {"<": "<=", ">": ">="}


def hint_about_repeated_words(clues: Clues) -> Iterator[str]:
    """Yield a hint on a text that is said in each iteration, but required once."""
    for criterion in clues.lost:
        if not isinstance(criterion, WordSequence):
            continue
        for listing, statement in collect_statements(clues):
            call = next((one for one in statement.calls if one.name in _OUTPUT_FUNCTIONS), None)
            loop = listing.code.statements[statement.parent] if statement.parent >= 0 else None
            if call is None or loop is None or loop.keyword not in LOOPS or not call.arguments:
                continue
            text = call.arguments[0][0][1:-1] if call.arguments[0][0][:1] in ("'", '"') else ""
            is_single = sum(text.casefold() in map(str.casefold, texts) for texts in criterion.words) == 1
            lines = clues.recordings[0].spoken if call.name == "say" else clues.recordings[0].printed
            count = sum(line.text == text for line in lines)
            if is_single and count > 1 and len(call.arguments[0]) == 1:
                template = (
                    translatable(
                        "%(place)s says %(text)s %(count)s times, in each pass of the loop in line %(line)s; expected "
                        "once. To run it after the loop, remove its indentation"
                    )
                    if call.name == "say"
                    else translatable(
                        "%(place)s prints %(text)s %(count)s times, in each pass of the loop in line %(line)s; "
                        "expected once. To run it after the loop, remove its indentation"
                    )
                )
                place = listing.locate(statement.line)
                yield Sentence(template, place=place, text=quote_text(text), count=count, line=loop.line)
                return


def hint_about_inner_loop(clues: Clues) -> Iterator[str]:
    """Yield a hint on a loop that repeats its output because it is nested in an unrelated loop."""
    sequences = (each for each in clues.lost if isinstance(each, WordSequence))
    repeated_words = next((found for each in sequences if (found := clues.find_finding(each, StrayItems))), None)
    if repeated_words is None:
        return
    for listing, statement in collect_statements(clues):
        outer_loop = listing.code.statements[statement.parent] if statement.parent >= 0 else None
        if statement.keyword != "for" or outer_loop is None or outer_loop.keyword != "for":
            continue
        body = listing.code.list_body(statement)
        has_output = any(call.name in _OUTPUT_FUNCTIONS for one in body for call in one.calls)
        if has_output and not any(
            one.has_token(*outer_loop.bound_names - statement.bound_names) for one in (statement, *body)
        ):
            yield Sentence(
                "%(place)s: this loop is inside the loop in line %(line)s, so it repeats its words in each pass "
                "of that loop. Words that are expected once appeared %(count)s more times. To run this loop "
                "once, after the other loop, indent it less",
                place=listing.locate(statement.line),
                line=outer_loop.line,
                count=repeated_words.count,
            )
            return


def hint_about_early_output(clues: Clues) -> Iterator[str]:
    """Yield a hint on a counter that is said or printed before it grows, so that each number is one too small."""
    for criterion in clues.lost:
        if not isinstance(criterion, WordSequence) or not criterion.words[0][0].isdecimal():
            continue
        texts = clues.spoken if criterion.source == "speech" else clues.printed
        first_number = next((int(each) for each in texts if each.isdecimal()), None)
        if first_number != int(criterion.words[0][0]) - 1:
            continue
        for listing, statement in collect_statements(clues):
            following = listing.code.list_following(statement)[:1]
            step = following[0] if following and following[0].parent == statement.parent else None
            is_output = any(call.name in ("say", "print") for call in statement.calls)
            if step is None or not is_output or not listing.code.list_enclosing_loops(statement):
                continue
            name = step.tokens[0]
            if statement.has_token(name) and step.tokens[1:] in (("+=", "1"), ("=", name, "+", "1")):
                yield Sentence(
                    "%(place)s writes %(name)s before line %(line)s adds 1 to it, and begins with "
                    "%(actual)s. Exchange the two lines, or begin with %(right)s",
                    place=listing.locate(statement.line),
                    name=name,
                    line=step.line,
                    actual=first_number,
                    right=first_number + 1,
                )
                return


def hint_about_last_number(clues: Clues) -> Iterator[str]:
    """Yield a hint on a count that ends one too early: ``< 10`` for ``<= 10``, ``range(5)`` for ``range(1, 6)``."""
    for criterion in clues.lost:
        numbers = _find_last_numbers(clues.find_finding(criterion, OtherWord))
        if numbers is None or not isinstance(criterion, WordSequence) or any(hint_about_early_output(clues)):
            continue
        last_number, missing_number = numbers
        for listing, statement in collect_statements(clues):
            condition = statement.condition if statement.keyword == "while" else ()
            if (
                len(condition) == 3
                and condition[1] in _INCLUSIVE
                and listing.code.number(condition[2:]) == missing_number
            ):
                yield Sentence(
                    "%(place)s: the loop ends before %(number)s. Write while %(condition)s",
                    place=listing.locate(statement.line),
                    number=missing_number,
                    condition=f"{condition[0]} {_INCLUSIVE[condition[1]]} {condition[2]}",
                )
                return
            call = (
                next((one for one in statement.calls if one.name == "range"), None)
                if statement.keyword == "for"
                else None
            )
            if call is None or not 1 <= len(call.arguments) <= 3:
                continue
            end = call.arguments[0] if len(call.arguments) == 1 else call.arguments[1]
            if listing.code.number(end) != missing_number:
                continue
            first_argument = ("1",) if len(call.arguments) == 1 and criterion.words[0][0] == "1" else call.arguments[0]
            start = ("0",) if len(call.arguments) == 1 and criterion.words[0][0] == "0" else first_argument
            fixed_arguments = (
                start,
                (str(missing_number + (1 if missing_number > last_number else -1)),),
                *call.arguments[2:],
            )
            yield Sentence(
                "%(place)s: range(%(arguments)s) ends before %(number)s. Write range(%(fixed)s)",
                place=listing.locate(statement.line),
                arguments=format_arguments(call.arguments),
                number=missing_number,
                fixed=format_arguments(fixed_arguments),
            )
            return


def _find_last_numbers(word: OtherWord | None) -> tuple[int, int] | None:
    """Return the last correct number and the missing one, if no other number came in its place."""
    if word is None or len(word.previous) != 1 or (word.actual and not word.actual.isalpha()):
        return None
    is_count = _INTEGER.fullmatch(word.previous[0]) and _INTEGER.fullmatch(word.expected[0])
    return (int(word.previous[0]), int(word.expected[0])) if is_count else None


def hint_about_exact_reading(clues: Clues) -> Iterator[str]:
    """Yield a hint on a loop that logs only while a reading equals one exact number."""
    if not any(isinstance(each, Datalog) for each in clues.lost) or not _has_ended_normally(clues):
        return
    for listing, statement in collect_statements(clues):
        condition = statement.condition if statement.keyword == "while" else ()
        body = listing.code.list_body(statement)
        has_output = any(call.name in _OUTPUT_FUNCTIONS for one in body for call in one.calls)
        has_reading = any(condition and (token in PROPERTIES) for one in (statement, *body) for token in one.tokens)
        if (
            "==" in condition
            and has_output
            and has_reading
            and listing.code.number(condition[condition.index("==") + 1 :]) is not None
        ):
            yield Sentence(
                "%(place)s: the loop continues only while %(condition)s is true, so it ends at the first other "
                "reading: the program ended after %(seconds).1f s. Write a condition that is true until the "
                "last required reading",
                place=listing.locate(statement.line),
                condition=join_tokens(condition),
                seconds=clues.seconds,
            )
            return


def hint_about_single_reaction(clues: Clues) -> Iterator[str]:
    """Yield a hint on a program that reacts to a sensor once, if the robot has to do so repeatedly."""
    is_repeated = any(isinstance(each, Encounters) and each.at_least > 1 for each in clues.lost)
    if not is_repeated or not _has_ended_normally(clues) or clues.seconds > clues.limit / 2:
        return
    for listing, statement in collect_statements(clues):
        is_wait = (
            statement.keyword == "while"
            and statement.parent < 0
            and any(token in PROPERTIES for token in statement.condition)
        )
        if not is_wait:
            continue
        reactions = [
            one
            for one in listing.code.list_following(statement)
            if one.parent < 0 and has_motor_call(one, LIMITED_MOVES)
        ]
        if reactions:
            yield Sentence(
                "%(place)s: the program does everything once, and ends after %(seconds).1f s of %(limit)g s. To "
                "repeat it, write while True: above this line, and indent the lines from here to line "
                "%(line)s",
                place=listing.locate(_find_first_move(listing.code.statements, statement).line),
                seconds=clues.seconds,
                limit=clues.limit,
                line=reactions[-1].last_line,
            )
            return


def _find_first_move(statements: tuple[Statement, ...], loop: Statement) -> Statement:
    """Return the first statement above a loop that switches a motor on; the loop if there is none."""
    starts = [each for each in statements[: loop.number] if has_motor_call(each, frozenset({"on"}))]
    return starts[0] if starts else loop


def _has_ended_normally(clues: Clues) -> bool:
    """Return whether the program ended by itself in every visible trial."""
    return bool(clues.recordings) and all(each.verdict is Verdict.FINISHED for each in clues.recordings)
