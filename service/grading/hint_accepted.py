"""What was accepted although the assignment's description asks for something else: other words, or missing keys.

No mark depends on it; it keeps a report from saying that everything is as it was asked for.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from responders.message_format import JSON
from service.grading.hint_clues import LONGEST_TEXT, Clues
from service.grading.hint_rules import RETURNS, where_returned
from service.grading.hint_texts import Wanted, is_near, where_written
from service.grading.judging.message_parts import quoted
from submissions.submission import Part

_QUOTED = re.compile(r'"([^"]{6,60})"')
_KEY = re.compile(r'"(\w+)"\s*:')
_VARIES = re.compile(r"\d|[{}<>:]")


def accepted_differences(clues: Clues) -> tuple[str, ...]:
    """One sentence on words and one on keys that are not those of the description; none where they are."""
    task = " ".join(clues.task.split())
    return (*_other_words(task, clues), *_missing_keys(task, clues))


def _other_words(task: str, clues: Clues) -> Iterator[str]:
    texts: Sequence[tuple[Part, str, Sequence[str]]] = (
        ("program", "says", clues.spoken),
        ("program", "prints", clues.printed),
        ("responder", "answers", clues.answers),
    )
    for asked in _QUOTED.findall(task):
        begin = asked.partition("...")[0].strip()
        if len(begin.split()) < 2 or _VARIES.search(begin):
            continue
        wanted = Wanted(begin, "contains")
        if any(wanted.is_met_by(text, ignore_case=True) for _, _, found in texts for text in found):
            continue
        for part, verb, found in texts:
            near = next((text for text in found if is_near(wanted, text)), None)
            if near is not None:
                where = where_written(clues, part, near)
                yield f"{where} {verb} {quoted(near)}; the assignment asks for {quoted(begin)}"
                return


def _missing_keys(task: str, clues: Clues) -> Iterator[str]:
    asked = list(dict.fromkeys(key for form in _forms(task) for key in _KEY.findall(form)))
    answers = [text for text in clues.answers if text.startswith(JSON) and len(text) < LONGEST_TEXT]
    given = {key for text in answers for key in _KEY.findall(text)}
    missing = [key for key in asked if key not in given]
    if missing and given:
        where = where_returned(answers[0], clues, RETURNS)
        keys = " and ".join(map(quoted, missing[:3]))
        yield f"{where}: the answer is {quoted(answers[0])}, without {keys}, which the assignment asks for"


def _forms(task: str) -> Iterator[str]:
    """Each object that stands after ``JSON::``, to its last bracket."""
    for piece in task.split(JSON)[1:]:
        depth = 0
        for place, letter in enumerate(piece):
            depth += (letter == "{") - (letter == "}")
            if depth == 0:
                yield piece[: place + 1]
                break
