"""Texts as searches and sorted columns compare them: without case and accents, so that ``jurgen`` finds ``Jürgen``.

Names that stay the same letter for letter are found as before.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping
from types import MappingProxyType

#: Letters of Latin alphabets that Unicode does not decompose into a plain letter and an accent.
_PLAIN_LETTERS: Mapping[int, str] = MappingProxyType(
    str.maketrans({"ø": "o", "ł": "l", "đ": "d", "ð": "d", "þ": "th", "æ": "ae", "œ": "oe", "ı": "i", "ħ": "h"})
)


def fold_text(text: str) -> str:
    """Return a text in lower case, without accents."""
    # Decomposed first, because some signs are decomposed into capital letters.
    letters = unicodedata.normalize("NFKD", unicodedata.normalize("NFKD", text).casefold())
    return "".join(each for each in letters if not unicodedata.combining(each)).translate(_PLAIN_LETTERS)
