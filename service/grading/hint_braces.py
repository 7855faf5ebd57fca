"""Hints on texts that were output with their braces, because the f before the quotes is missing.

Evidence: a printed, spoken, sent or answered text with a name in braces that the submission defines.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from service.grading.hint_clues import Clues
from sim.sentences import Sentence

_BRACES = re.compile(r"\{([A-Za-z_]\w*)[^{}\"']{0,40}\}")
_PLAIN_TEXT = re.compile(r"""[bru]?["']""", re.IGNORECASE)
_MAX_TOKEN_LENGTH = 60


def hint_about_braces(clues: Clues) -> Iterator[str]:
    """Yield a hint with the line of the text that was meant as an f-string."""
    if not clues.lost:
        return
    texts = (*clues.printed, *clues.spoken, *clues.sent, *clues.answers)
    names_by_braces = {each[0]: each[1] for text in texts for each in _BRACES.finditer(text)}
    names = {
        name
        for listing in clues.texts
        for each in listing.code.statements
        for name in (*each.bound_names, *each.tokens)
    }
    for listing in clues.texts:
        for statement in listing.code.statements:
            for token in statement.tokens:
                braces = next((each for each, name in names_by_braces.items() if each in token and name in names), None)
                if braces is None or not _PLAIN_TEXT.match(token) or "format" in statement.tokens:
                    continue
                is_short = len(token) <= _MAX_TOKEN_LENGTH
                yield Sentence(
                    "%(place)s: the f before the quotes is missing, so %(braces)s stays as it is and is not replaced "
                    "by its value. Write %(code)s",
                    place=listing.locate(statement.line),
                    braces=braces,
                    code=f"f{token}" if is_short else Sentence("f before the first quote"),
                )
                return
