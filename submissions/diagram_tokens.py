"""Tokens of a diagram's text, each with its line.

``diagram_text.py`` combines them to a diagram.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from sim.errors import UsageError

MAX_CHARACTERS = 20_000

_TOKEN = re.compile(
    r"""
      (?P<space>\s+)
    | (?P<comment>(?://|\#)[^\n]*|/\*(?:[^*]|\*(?!/))*\*/)
    | (?P<divider>===[^\n]*?===|\.\.\.[^\n]*?\.\.\.)
    | (?P<text>"(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*')
    | (?P<arrow><<--|<--|<<-|<->|<-|-->>|-->|->>|->|--|=>)
    | (?P<sign>[{}\[\];,=])
    | (?P<name>\w(?:[\w.]|-(?=\w))*)
    """,
    re.VERBOSE | re.DOTALL,
)
_ESCAPE = re.compile(r"\\(.)", re.DOTALL)
_ESCAPED = {"n": "\n", "\n": ""}
_UNCLOSED = {'"': "a text in quotes", "'": "a text in quotes", "/": "a comment"}


@dataclass(frozen=True, slots=True)
class DiagramToken:
    """A token: an arrow, a sign, a name, a text without its quotes, or a divider without its markers."""

    kind: str
    text: str
    line: int


def build_error(line: int, problem: str) -> UsageError:
    """Return an error for a line."""
    return UsageError(f"line {line}: {problem}")


def tokenize(text: str, first_line: int = 1) -> list[DiagramToken]:
    """Return the tokens of ``text`` without whitespace and comments.

    Raises:
        UsageError: The text contains an unknown sign. The message has the line.
    """
    if len(text) > MAX_CHARACTERS:
        raise build_error(first_line, f"the text is too long, expected at most {MAX_CHARACTERS} characters")
    tokens: list[DiagramToken] = []
    position, line = 0, first_line
    while position < len(text):
        match = _TOKEN.match(text, position)
        if match is None:
            raise build_error(line, _describe_unknown_sign(text[position:]))
        kind, piece = str(match.lastgroup), match[0]
        if kind not in ("space", "comment"):
            tokens.append(DiagramToken(kind, _extract_content(kind, piece), line))
        line += piece.count("\n")
        position = match.end()
    return tokens


def _extract_content(kind: str, piece: str) -> str:
    if kind == "text":
        return _ESCAPE.sub(lambda match: _ESCAPED.get(match[1], match[1]), piece[1:-1])
    return piece


def _describe_unknown_sign(remaining_text: str) -> str:
    if remaining_text[0] in _UNCLOSED and (remaining_text[0] != "/" or remaining_text.startswith("/*")):
        return f"{_UNCLOSED[remaining_text[0]]} never ends"
    return f"{remaining_text[0]!r} is not valid here, expected a name, an arrow such as ->, or a text in quotes"
