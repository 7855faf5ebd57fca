"""Hints on objects in the responder's answers: wrong key, swapped values, None, a text instead of a number.

They compare the answers with the criteria that lost marks.
"""

from __future__ import annotations

import contextlib
import difflib
import re
from collections.abc import Iterator

from responders.message_format import JSON
from service.grading.fault_kinds import FaultKind, read_values
from service.grading.findings import MissingEntry, OtherAnswer
from service.grading.hint_clues import Clues, find_finding
from service.grading.hint_code import join_tokens
from service.grading.hint_differences import advise_on_difference
from service.grading.hint_formats import RETURN_LINE, describe_return_line
from service.grading.judging.message_parts import quote_text
from service.language import translatable
from sim.readers.json_text import read_json
from sim.readers.reader_errors import UnreadableDataError
from sim.sentences import Sentence, join_with_and
from submissions.criteria.logs import ImageLog
from submissions.criteria.replies import Replies
from submissions.criteria.reporting import Reports
from submissions.criteria.unreliable_channel import FreshAnswers, Resends
from submissions.raw_files import sanitise_name

_KEY = re.compile(r"""["'](\w{2,40})["']\s*:""")
_NONE_VALUE = re.compile(r"\bNone\b|\bnull\b")
_TEXT_NUMBER = re.compile(r'"(\w+)"\s*:\s*"(-?\d+(?:\.\d+)?)"')
_IMAGE_LOG = re.compile(r"image_data (?:left|right|both)\Z")
_MIN_SIMILARITY = 0.6
#: A key with an object or a list as its value.
_OBJECT_VALUE = re.compile(r"""['"](\w+)['"]: ([\[{])""")
_PAIR = re.compile(r"\w+(?: , \w+)+\Z")
#: The number of answers that show a constant shift.
_MIN_SHIFTED_ANSWERS = 2
_MAX_NAMED_KEYS = 3


def hint_about_other_keys(clues: Clues) -> Iterator[str]:
    """Yield a hint on a key missing from all answers, if they have a similar key or other keys in its place."""
    for criterion in clues.lost:
        path = (criterion.path or "") if isinstance(criterion, Replies) else ""
        expected_key = path.rpartition(".")[2]
        for answer in clues.answers if path else ():
            sibling_keys = _list_sibling_keys(answer, path)
            if sibling_keys and not any(expected_key in _list_sibling_keys(each, path) for each in clues.answers):
                line = describe_key_line(sibling_keys, clues) or describe_return_line(answer, clues, RETURN_LINE)
                yield Sentence(
                    "%(place)s: the answer has %(keys)s; expected the key %(expected)s",
                    place=line,
                    keys=join_with_and([quote_text(key) for key in sibling_keys[:3]]),
                    expected=quote_text(expected_key),
                )
                return
    yield from _hint_about_near_keys(clues)


def hint_about_missing_key(clues: Clues) -> Iterator[str]:
    """Yield a hint on a key that the assignment asks for and the robot reads, but no answer has."""
    program_faults = (fault for fault in clues.faults if fault.who == "program")
    key = next((values[0] for fault in program_faults if (values := read_values(fault, FaultKind.NO_KEY))), "")
    if not key or f'"{key}"' not in clues.task or clues.missing == "responder":
        return
    answer_keys = list(dict.fromkeys(each for answer in clues.answers for each in _KEY.findall(answer)))
    similar_keys = difflib.get_close_matches(
        key.casefold(), [each.casefold() for each in answer_keys], 1, _MIN_SIMILARITY
    )
    similar_key = next(
        (each for each in answer_keys if each.casefold() in similar_keys and f'"{each}"' not in clues.task), ""
    )
    line = describe_key_line([similar_key], clues) if similar_key and key not in answer_keys else ""
    if line:
        yield Sentence(
            "%(place)s answers the key %(key)s; the assignment requires %(required)s. Write %(required)s",
            place=line,
            key=quote_text(similar_key),
            required=quote_text(key),
        )


def hint_about_none_answers(clues: Clues) -> Iterator[str]:
    """Yield a hint on an answer that contains None, if exactly one line returns None."""
    answer = next((each for each in clues.answers if _NONE_VALUE.search(each)), None)
    if answer is None or not any(isinstance(each, Replies) for each in clues.lost):
        return
    returns = [
        (listing, each)
        for listing in clues.responder_process_listings
        for each in listing.code.statements
        if each.tokens in (("return", "None"), ("return",))
    ]
    if len(returns) != 1:
        return
    listing, statement = returns[0]
    condition = next((one for one in listing.code.list_enclosing(statement) if one.keyword in ("if", "elif")), None)
    if condition is not None:
        yield Sentence(
            "%(place)s returns None, and the answer was %(answer)s. Check the condition in line %(line)s: %(code)s",
            place=listing.locate(statement.line),
            answer=quote_text(answer),
            line=condition.line,
            code=join_tokens(condition.condition),
        )


def hint_about_answer_values(clues: Clues) -> Iterator[str]:
    """Yield the line that makes a wrong value of an answer, with how it differs from the expected one."""
    for criterion in clues.costliest_criteria[:1]:
        path = (criterion.path or "") if isinstance(criterion, Replies) else ""
        difference = _describe_value_difference(criterion, clues) if isinstance(criterion, Replies) and path else ""
        if difference:
            yield difference
            return
        answer = clues.find_finding(criterion, OtherAnswer) if path else None
        location = ""
        if answer is not None:
            location = _describe_words_line(answer.text, clues) or describe_key_line([path.rpartition(".")[2]], clues)
        if answer is None or not location or not isinstance(criterion, Replies):
            continue
        expected = next((each for each in criterion.expect.values() if str(each).endswith(answer.text)), "")
        advice = advise_on_difference(expected, answer.text) if expected and isinstance(expected, str) else ""
        if answer.text.startswith("["):
            advice = Sentence("It is a list or an array: take its first value with [0]")
        if advice:
            yield Sentence(
                "%(place)s answers %(answer)s at %(path)s. %(advice)s",
                place=location,
                answer=quote_text(answer.text),
                path=path,
                advice=advice,
            )
            return


def _describe_value_difference(criterion: Replies, clues: Clues) -> str:
    """Return how the first wrong answer to a known question differs from the expected one, with its line."""
    path = criterion.path or ""
    for recording in clues.recordings:
        for message in recording.messages if not criterion.agents else ():
            question = recording.messages[message.reply_to].text if message.reply_to is not None else ""
            expected, value = criterion.expect.get(question), parse_answer(message.text)
            for key in path.split("."):
                value = value.get(key) if isinstance(value, dict) else None
            if not isinstance(value, str) or expected is None or value == expected:
                continue
            advice = advise_on_difference(expected, value)
            location = _describe_words_line(value, clues) or describe_key_line([path.rpartition(".")[2]], clues)
            if not advice or not location:
                return ""
            answer = quote_text(value)
            return Sentence("%(place)s answers %(answer)s. %(advice)s", place=location, answer=answer, advice=advice)
    return ""


def hint_about_shifted_numbers(clues: Clues) -> Iterator[str]:
    """Yield a hint on a number of the answers that is too large or too small by the same amount in every trial."""
    reports = {each.id for each in clues.lost if isinstance(each, Reports) and each.source == "reply"}
    for result in clues.results:
        failure_count = sum(not each.passed for each in result.evidence) if result.id in reports else 0
        entries = (each for findings in result.findings.values() for each in findings if isinstance(each, MissingEntry))
        pairs = {found for each in entries if (found := _compute_shift(each)) is not None}
        if failure_count < _MIN_SHIFTED_ANSWERS or len(pairs) != 1:
            continue
        key, shift = pairs.pop()
        location = describe_key_line([key], clues)
        if location and shift:
            template = (
                translatable(
                    "%(place)s: %(key)s is %(amount)s too small in every answer. Correct how it is counted: add "
                    "%(amount)s"
                )
                if shift > 0
                else translatable(
                    "%(place)s: %(key)s is %(amount)s too large in every answer. Correct how it is counted: subtract "
                    "%(amount)s"
                )
            )
            yield Sentence(template, place=location, key=quote_text(key), amount=abs(shift))
            return


def _compute_shift(missing: MissingEntry) -> tuple[str, int] | None:
    """Return the key and expected minus actual value of an answer; None if they are not whole numbers."""
    value = _unwrap_object(missing.texts[0]).get(missing.previous) if len(missing.texts) == 1 else None
    if not isinstance(value, int) or not missing.entry.isdigit():
        return None
    return missing.previous, int(missing.entry) - value


def hint_about_swapped_values(clues: Clues) -> Iterator[str]:
    """Yield a hint on a number that belongs to another key of the answer."""
    reports = {each.id for each in clues.lost if isinstance(each, Reports) and each.source == "reply"}
    for result in clues.results:
        missing = find_finding(result, MissingEntry) if result.id in reports else None
        number, key = (missing.entry, missing.previous) if missing else ("", "")
        for answer in clues.answers if key else ():
            values = _unwrap_object(answer)
            other_key = next((each for each, value in values.items() if each != key and str(value) == number), None)
            if any(True for _ in hint_about_shifted_numbers(clues)):
                return
            if other_key is None or key not in values or str(values[key]) == number:
                continue
            location = describe_key_line([key], clues)
            if location:
                yield Sentence(
                    "%(place)s: %(key)s is %(value)s; expected %(expected)s, which %(other_key)s has. Check the values "
                    "of %(key)s and %(other_key)s: they may be swapped",
                    place=location,
                    key=quote_text(key),
                    value=str(values[key]),
                    expected=number,
                    other_key=quote_text(other_key),
                )
                return


def hint_about_text_numbers(clues: Clues) -> Iterator[str]:
    """Yield a hint on a number sent as a text that the program compares with a number."""
    if not any(isinstance(each, Resends | FreshAnswers | Replies) for each in clues.lost):
        return
    for answer in clues.answers:
        match = _TEXT_NUMBER.search(answer) if answer.startswith(JSON) else None
        if match is None:
            continue
        key = match[1]
        pattern = re.compile(rf"""\[["']{key}["']\]\s*(?:==|!=|<|>)(?!\s*["'])""")
        listing = next((each for each in clues.programs if each.find_line(pattern)), None)
        if listing is not None:
            yield Sentence(
                "%(place)s sends %(key)s as the text %(text)s, and %(program_place)s compares it with a number. Write "
                "int(...) around the text",
                place=describe_key_line([key], clues) or "responder.py",
                key=quote_text(key),
                text=quote_text(match[2]),
                program_place=listing.locate(listing.find_line(pattern)),
            )
            return


def hint_about_image_command(clues: Clues) -> Iterator[str]:
    """Yield a hint on a printed text that is close to ``image_data left``."""
    if not any(isinstance(each, ImageLog) for each in clues.lost):
        return
    for text in clues.printed:
        similarity = difflib.SequenceMatcher(None, text.casefold(), "image_data left").ratio()
        if similarity >= 0.75 and not _IMAGE_LOG.match(text) and "logged..." not in text:
            location = clues.describe_matching_line("program", re.compile(re.escape(text)))
            side = next((each for each in ("right", "both") if each in text), "left")
            yield Sentence(
                '%(place)s prints %(text)s, which logs no image; expected "image_data %(side)s"',
                place=location,
                text=quote_text(text),
                side=side,
            )
            return


def hint_about_quoted_object(clues: Clues) -> Iterator[str]:
    """Yield a hint on a key whose value is the text of an object, where the object is expected."""
    for criterion in clues.lost:
        for text in criterion.contains if isinstance(criterion, Replies) else ():
            match = _OBJECT_VALUE.match(text)
            quoted = re.compile(rf"""['"]{match[1]}['"]: ['"]\{match[2]}""") if match is not None else None
            if match is None or quoted is None or not any(quoted.search(each) for each in clues.answers):
                continue
            location = describe_key_line([match[1]], clues)
            if location:
                yield Sentence(
                    "%(place)s: the value of %(key)s is a text, and not the object in it. Make the object with "
                    "ast.literal_eval(...) first",
                    place=location,
                    key=quote_text(match[1]),
                )
                return


def hint_about_returned_pair(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``return kind, thing`` where the answer should have an object with as many keys."""
    for criterion in clues.lost:
        texts = criterion.contains if isinstance(criterion, Replies) else ()
        keys = list(dict.fromkeys(found[1] for text in texts if (found := _KEY.match(text))))
        if not keys or any(key in _KEY.findall(answer) for answer in clues.answers for key in keys[:1]):
            continue
        for listing in clues.responder_process_listings:
            for statement in listing.code.statements:
                if statement.keyword == "return" and _PAIR.match(" ".join(statement.tokens[1:])):
                    names = ", ".join(f'"{key}": ...' for key in keys)
                    yield Sentence(
                        "%(place)s returns several values, without keys. Write an object with the keys that are asked "
                        "for: return {%(entries)s}",
                        place=listing.locate(statement.line),
                        entries=names,
                    )
                    return


def _hint_about_near_keys(clues: Clues) -> Iterator[str]:
    """Yield a hint on a key required within a text, as in ``"'typ': 'PY'"``."""
    for criterion in clues.lost:
        texts = criterion.contains if isinstance(criterion, Replies) else ()
        expected_keys = {key for text in texts for key in _KEY.findall(text)}
        answer_keys = {key for answer in clues.answers for key in _KEY.findall(answer)}
        for key in sorted(expected_keys - answer_keys):
            similar_keys = difflib.get_close_matches(key, sorted(answer_keys - expected_keys), 1, _MIN_SIMILARITY)
            line = describe_key_line(similar_keys, clues) if similar_keys else ""
            if line:
                yield Sentence(
                    "%(place)s writes the key %(key)s; expected %(expected)s",
                    place=line,
                    key=quote_text(similar_keys[0]),
                    expected=quote_text(key),
                    criterion=criterion.id,
                )
                return


def _list_sibling_keys(answer: str, path: str) -> list[str]:
    """Return the keys of an answer at the level of the path's last key."""
    value = parse_answer(answer)
    for key in path.split(".")[:-1]:
        value = value.get(key) if isinstance(value, dict) else None
    return [str(key) for key in value] if isinstance(value, dict) else []


def _unwrap_object(answer: str) -> dict[str, object]:
    """Return the innermost object of an answer that is wrapped in objects of one key; {} if it is not an object."""
    value = parse_answer(answer)
    while isinstance(value, dict) and len(value) == 1:
        value = next(iter(value.values()))
    return {str(key): each for key, each in value.items()} if isinstance(value, dict) else {}


def parse_answer(answer: str) -> object:
    """Return the object in a JSON answer; None for any other text."""
    with contextlib.suppress(ValueError, UnreadableDataError):
        return read_json(answer.removeprefix(JSON)) if answer.startswith(JSON) else None
    return None


def describe_key_line(keys: list[str], clues: Clues) -> str:
    """Return the line of a responder that writes one of the keys; empty if none does."""
    for listing in clues.responder_process_listings:
        for key in keys:
            line = listing.find_line(re.compile(rf"""["']{re.escape(key)}["']\s*:"""))
            if line is not None:
                return listing.locate(line)
    return ""


def _describe_words_line(text: str, clues: Clues) -> str:
    """Return the only line of the responder or an agent that has the first words of a text in quotes."""
    opening = text.rpartition(" ")[0]
    pattern = re.compile(rf"""["']{re.escape(opening)}""")
    lines = [
        listing.locate(number)
        for listing in clues.responder_process_listings
        for number, line in enumerate(listing.lines, 1)
        if opening and pattern.search(line)
    ]
    return lines[0] if len(lines) == 1 else ""


def advise_on_key_place(key: str, answer: str, clues: Clues) -> str:
    """Return where a key is that the robot does not find in an answer, or the line of the answer that lacks it."""
    value = parse_answer(answer)
    keys = [str(each) for each in value] if isinstance(value, dict) else []
    outer_key = next((each for each in keys if isinstance(value, dict) and _has_key(value[each], key)), "")
    if outer_key:
        return Sentence(
            'It is inside "%(outer)s": write ["%(outer)s"]["%(key)s"].', outer=outer_key, key=sanitise_name(key)
        )
    line = describe_key_line(keys, clues)
    if not line:
        return ""
    return Sentence(
        'The answer has only %(keys)s: add "%(key)s" to it in %(line)s, or read one of these keys.',
        keys=", ".join(quote_text(each) for each in keys[:_MAX_NAMED_KEYS]),
        key=sanitise_name(key),
        line=line,
    )


def _has_key(value: object, key: str) -> bool:
    return isinstance(value, dict) and key in value
