"""Hints on what stands in another's place: rows for columns, the smallest for the largest, white for black.

They apply only if visible criteria lost marks, and the outputs or answers show the exchange.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from service.grading.findings import FailedCall, MissingEntry
from service.grading.hint_answers import parse_answer
from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import Statement, join_tokens
from service.grading.hint_structure import collect_statements
from service.grading.hint_tables import OPPOSITE_SIGNS, OUTPUT_FUNCTIONS
from service.grading.judging.message_parts import quote_text
from sim.sentences import Sentence
from submissions.criteria.code import Functions
from submissions.criteria.reporting import Reports

_SIDES = (("right ", "downwards "), ("left ", "upwards "))
#: Methods that give a chance for each name.
_CHANCES = ("predict_proba", "class_predict", "decision_function")
_PIXEL_COUNTS = (14 * 14, 20 * 20)
_PREDICTION = re.compile(r"\.predict\w*\(|class_predict")
_ROWS, _COLUMNS = re.compile(r"axis\s*=\s*0"), re.compile(r"axis\s*=\s*1")
_RIGHT_ORDER = re.compile(r"\w*row\w*,\w*col\w*=.*axis=1.*axis=0|\w*col\w*,\w*row\w*=.*axis=0.*axis=1")
_SPLIT_NUMBERS = re.compile(r"\bfor (\w+) in (\w+)\.split\(")
_PIXEL_STEP = re.compile(r"reshape|::\s*4\]|,\s*4\)|\*\s*4\b|\b4\s*\*|//\s*4\b")
_PREFIX_USES = frozenset({"startswith", "removeprefix", "partition", "split", "==", "!=", "in"})
_NEAR_PREFIX = re.compile(r"(?:IMG|IMAGE)[ _-]?DATA(?:::)?\Z", re.IGNORECASE)


def hint_about_exchanged_words(clues: Clues) -> Iterator[str]:
    """Yield a hint on two branches that say each other's words, with the condition between them turned round."""
    for criterion in clues.lost:
        rows = criterion.expected if isinstance(criterion, Reports) and criterion.source != "reply" else ()
        if not isinstance(criterion, Reports) or isinstance(rows, str):
            continue
        said = set(_collect_word_pairs(criterion, clues))
        for expected, actual in sorted(said):
            if expected >= actual or (actual, expected) not in said:
                continue
            branches = [_find_branch(word, clues) for word in (expected, actual)]
            if branches[0] is None or branches[1] is None:
                continue
            (listing, first), (_, second) = sorted((each for each in branches if each), key=lambda each: each[1].line)
            head = listing.code.statements[first.parent]
            opposite = _turn_round(head)
            if opposite and listing.code.statements[second.parent].indent == head.indent:
                yield Sentence(
                    "%(place)s: lines %(first)s and %(second)s write each other's words. Write %(opposite)s in place "
                    "of %(condition)s, or exchange the two words",
                    place=listing.locate(head.line),
                    first=first.line,
                    second=second.line,
                    opposite=opposite,
                    condition=join_tokens(head.condition),
                )
                return


def _collect_word_pairs(criterion: Reports, clues: Clues) -> Iterator[tuple[str, str]]:
    """Yield the expected word and the other word that came in its place, for each trial with one of each."""
    for trial in clues.shown:
        if isinstance(criterion.expected, str):
            return
        row = criterion.expected[min(trial.place, len(criterion.expected) - 1)]
        lines = trial.recording.spoken if criterion.source == "speech" else trial.recording.printed
        text = " ".join(each.text for each in lines)
        words = [word for word in criterion.among if re.search(rf"\b{re.escape(word)}\b", text)]
        if len(row) == 1 and isinstance(row[0], str) and len(words) == 1 and words[0] != row[0]:
            yield row[0], words[0]


def _find_branch(word: str, clues: Clues) -> tuple[Listing, Statement] | None:
    """Return the only output with the word in quotes, if it is in a branch."""
    candidates = [
        (listing, each)
        for listing, each in collect_statements(clues)
        if any(call.name in OUTPUT_FUNCTIONS for call in each.calls)
        and any(token[:1] in "\"'" and re.search(rf"\b{re.escape(word)}\b", token) for token in each.tokens)
        and each.parent >= 0
    ]
    return candidates[0] if len(candidates) == 1 else None


def _turn_round(head: Statement) -> str:
    """Return the condition of a branch with its only sign turned round; empty if it has none or several."""
    signs = [token for token in head.condition if token in OPPOSITE_SIGNS]
    if head.keyword not in ("if", "elif") or len(signs) != 1:
        return ""
    return join_tokens([OPPOSITE_SIGNS.get(token, token) for token in head.condition])


def hint_about_exchanged_axes(clues: Clues) -> Iterator[str]:
    """Yield a hint on sums over rows and columns that are exchanged, so right is taken for downwards."""
    accuracies = [each.accuracy for each in (*clues.results, *clues.practice) if each.accuracy is not None]
    pairs = {(truth, answer) for each in accuracies for truth, answer, _ in each.confusion if answer is not None}
    wrong_pairs = [pair for pair in pairs if pair[0] != pair[1]]
    is_exchanged = len(wrong_pairs) > 1 and all(
        (first in truth and second in answer) or (second in truth and first in answer)
        for truth, answer in wrong_pairs
        for first, second in [next((sides for sides in _SIDES if sides[0] in truth or sides[1] in truth), ("", "?"))]
    )
    for listing in clues.responders if clues.lost and is_exchanged else ():
        if listing.find_line(_PREDICTION) is not None:
            continue
        for statement in listing.code.statements:
            code = "".join(statement.tokens)
            if _ROWS.search(code) and _COLUMNS.search(code) and not _RIGHT_ORDER.match(code):
                yield Sentence(
                    "%(place)s: rows and columns are exchanged. axis=0 gives a number for each column, and axis=1 a "
                    "number for each row. Exchange 0 and 1",
                    place=listing.locate(statement.line),
                )
                return


def hint_about_smallest_chance(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``argmin`` of a network's chances, which takes the least likely class."""
    for listing in clues.responders if clues.lost else ():
        names = {each.target for each in listing.code.statements if each.has_token(*_CHANCES)} - {""}
        for statement in listing.code.statements:
            if statement.has_token("argmin") and statement.has_token(*names, *_CHANCES):
                yield Sentence(
                    "%(place)s takes the smallest chance, which is that of the least likely name. Write argmax instead "
                    "of argmin",
                    place=listing.locate(statement.line),
                )
                return


def hint_about_counted_rest(clues: Clues) -> Iterator[str]:
    """Yield a hint on a count of pixels that is the number of all other pixels."""
    for criterion in clues.lost:
        missing = clues.find_finding(criterion, MissingEntry)
        if missing is None or not missing.entry.isdigit() or len(missing.texts) != 1:
            continue
        value = _find_value(parse_answer(missing.texts[0]), missing.previous)
        if not isinstance(value, int) or value == int(missing.entry) or value + int(missing.entry) not in _PIXEL_COUNTS:
            continue
        comparisons = [
            (listing, number)
            for listing in clues.responder_process_listings
            for number, line in enumerate(listing.lines, 1)
            if re.search(r"[<>]=?\s*\d{2,3}\b", line)
        ]
        if len(comparisons) == 1:
            listing, number = comparisons[0]
            yield Sentence(
                "%(place)s: %(value)s is the number of all pixels but the %(expected)s that should count. "
                "Turn the comparison round: exchange > and <",
                place=listing.locate(number),
                value=value,
                expected=missing.entry,
            )
            return


def _find_value(answer: object, key: str) -> object:
    """Return the value of a key anywhere in the objects of an answer; None without it."""
    if not isinstance(answer, dict):
        return None
    found = (_find_value(each, key) for each in answer.values())
    return answer[key] if key in answer else next((each for each in found if each is not None), None)


def hint_about_returned_object(clues: Clues) -> Iterator[str]:
    """Yield a hint on a responder that returns an object where the text of JSON is expected."""
    for criterion in clues.lost:
        failure = clues.find_finding(criterion, FailedCall) if isinstance(criterion, Functions) else None
        if failure is None or not isinstance(failure.returned, dict):
            continue
        for listing in clues.responders:
            for statement in listing.code.statements:
                if statement.tokens[:2] == ("return", "{"):
                    yield Sentence(
                        "%(place)s returns an object, and an answer is a text. Write return "
                        '"JSON::" + json.dumps(%(code)s)',
                        place=listing.locate(statement.line),
                        code=join_tokens(statement.tokens[1:]),
                    )
                    return


def hint_about_near_prefix(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``"IMGDATA"``, with which the responder never recognises an image."""
    for listing in clues.responder_process_listings if clues.lost else ():
        for statement in listing.code.statements:
            for token in statement.tokens if statement.has_token(*_PREFIX_USES) else ():
                text = token[1:-1]
                if token[:1] in "\"'" and _NEAR_PREFIX.match(text) and not text.startswith("IMG_DATA"):
                    yield Sentence(
                        "%(place)s has %(text)s, and images begin with IMG_DATA. Write %(right)s",
                        place=listing.locate(statement.line),
                        text=quote_text(text),
                        right=quote_text("IMG_DATA::" if text.endswith("::") else "IMG_DATA"),
                    )
                    return


def hint_about_all_channels(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``csv.split(",")`` whose numbers are taken for pixels, though each pixel has four of them."""
    if not any(each.who == "responder" for each in clues.faults):
        return
    for listing in clues.responders if clues.lost else ():
        text = "\n".join(listing.lines)
        number = listing.find_line(_SPLIT_NUMBERS)
        if number is None or _PIXEL_STEP.search(text) or "Image" in text or "rgba" in text.lower():
            continue
        yield Sentence(
            "%(place)s takes all numbers of the image, and each pixel has four: red, green, blue and alpha. Write "
            "[::4] behind it for the red ones",
            place=listing.locate(number),
        )
        return
