"""Python source as tokens without the details that are changed first in a copy: names, numbers, texts, layout.

Nothing is parsed and nothing can fail: text that is not Python also has tokens. The time is linear in its length.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from keyword import iskeyword

import numpy as np
from numpy.typing import NDArray

from service.similarity.normal_form import Word, normalise_statement

#: The number of tokens read per file. A program of a thousand lines has about 10 000.
MAX_TOKENS = 20_000

#: Every branch matches or fails without backtracking. An unclosed text ends with its line or the file.
_TOKEN = re.compile(
    r"""(?P<blank>[ \t\f\r\\]++|\#[^\n]*+)
    |(?P<newline>\n)
    |(?P<text>[rbfuRBFU]{0,2}(?:'''(?:[^\\']|\\.|'(?!''))*+(?:'''|\\?\Z)|\"""(?:[^\\"]|\\.|"(?!""))*+(?:\"""|\\?\Z)
        |'(?:[^\\'\n]|\\.)*+'?|"(?:[^\\"\n]|\\.)*+"?))
    |(?P<number>\.?[0-9](?:[eE][-+][0-9]|[\w.])*+)
    |(?P<name>[^\W\d]\w*+)
    |(?P<operator>[*]{2}=?|//=?|<<=?|>>=?|->|[-+*/%@&|^<>=!:]=|.)""",
    re.VERBOSE | re.DOTALL,
)
_ASSIGNING = frozenset({"=", ":=", *(f"{operator}=" for operator in "+-*/%@&|^"), "**=", "//=", "<<=", ">>="})
_OPENING, _CLOSING = frozenset("([{"), frozenset(")]}")
#: The names after these words, up to the mark, are the author's own.
_BINDING = {"def": ":", "class": ":", "for": "in", "lambda": ":", "as": ":"}


@dataclass(frozen=True, slots=True)
class Tokens:
    """The tokens of one file: a number for each, equal for equal tokens, and its line, from 1."""

    numbers: NDArray[np.uint64]
    lines: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.numbers)


@dataclass(frozen=True, slots=True)
class _RawToken:
    kind: str
    text: str
    line: int


def tokenise_source(source: str) -> Tokens:
    """Return the tokens of a Python file, without comments, layout, imports and unused texts.

    Operands that may be swapped are in a fixed order, so line numbers need not ascend within a statement.
    """
    statements = [_filter_statement(statement) for statement in _split_statements(source)]
    own_names = _collect_own_names([piece for statement in statements for piece in statement])
    words = [
        word
        for statement in statements
        for word in normalise_statement([Word(_normalise_text(piece, own_names), piece.line) for piece in statement])
    ]
    return Tokens(
        np.array([zlib.crc32(word.text.encode("utf-8", "surrogatepass")) for word in words], np.uint64),
        np.array([word.line for word in words], np.int64),
    )


def _split_statements(source: str) -> Iterator[list[_RawToken]]:
    """Yield the statements: lines, joined while a bracket is open."""
    statement: list[_RawToken] = []
    line, depth, count = 1, 0, 0
    for match in _TOKEN.finditer(source):
        kind, text = str(match.lastgroup), match[0]
        if kind == "newline" and depth == 0:
            yield statement
            statement = []
        elif kind not in ("blank", "newline"):
            statement.append(_RawToken(kind, text, line))
            depth = max(0, depth + (text in _OPENING) - (text in _CLOSING))
            count += 1
        line += text.count("\n")
        if count >= MAX_TOKENS:
            break
    yield statement


def _filter_statement(statement: list[_RawToken]) -> list[_RawToken]:
    if not statement or statement[0].text in ("import", "from"):
        return []
    return [] if all(piece.kind == "text" for piece in statement) else statement


def _collect_own_names(pieces: Sequence[_RawToken]) -> frozenset[str]:
    """Return the names that the author chose, as their places show: assigned, defined, looped over."""
    own_names: set[str] = set()
    closing_text = ""
    targets: list[str] = []
    line = 0
    for number, piece in enumerate(pieces):
        is_after_dot = number > 0 and pieces[number - 1].text == "."
        if piece.line != line:
            line, targets = piece.line, []
        if piece.text in _ASSIGNING:
            own_names.update(targets)
            targets = []
        if piece.text == closing_text:
            closing_text = ""
        elif piece.text in _BINDING:
            closing_text = _BINDING[piece.text]
        elif piece.kind == "name" and not is_after_dot and not iskeyword(piece.text):
            targets.append(piece.text)
            if closing_text:
                own_names.add(piece.text)
    return frozenset(own_names)


def _normalise_text(piece: _RawToken, own_names: frozenset[str]) -> str:
    if piece.kind in ("text", "number"):
        return piece.kind
    return "name" if piece.text in own_names else piece.text
