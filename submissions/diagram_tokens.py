"""Tokens of a diagram's text, each with its line, and the words that attributes, shapes and arrows may have.

``diagram_text.py`` combines them to a diagram.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from sim.errors import UsageError
from submissions.diagram import LineStyle


def _split_words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_FONT = _split_words("class fontfamily fontsize fontstyle href")
ACTOR_ATTRIBUTES = _FONT | _split_words(
    "label shape color textcolor style linecolor width height colwidth colheight numbered icon background description "
    "rotate stacked"
)
ARROW_ATTRIBUTES = _FONT | _split_words(
    "label color textcolor style dir hstyle folded nofolded thick async diagonal failed return activate noactivate "
    "note leftnote rightnote"
)
GROUP_ATTRIBUTES = _FONT | _split_words("label color textcolor shape thick style orientation width height icon")
DIAGRAM_ATTRIBUTES = _split_words(
    "activation autonumber orientation edge_height edge_length edge_layout page_padding node_width node_height "
    "span_width span_height default_fontsize default_fontfamily default_fontstyle default_shape default_node_color "
    "default_node_style default_group_color default_linecolor default_textcolor default_note_color shape_namespace "
    "width height"
)
SHAPES = _split_words(
    "box square roundedbox circle ellipse diamond minidiamond note mail cloud actor dots beginpoint endpoint textbox "
    "none flowchart.condition flowchart.database flowchart.input flowchart.loopin flowchart.loopout "
    "flowchart.terminator"
)
LINE_STYLES: Mapping[str, LineStyle] = MappingProxyType(
    {"solid": "solid", "dashed": "dashed", "dotted": "dotted", "none": "solid"}
)
#: The arrow for each value of an arrow's ``dir``.
DIRECTIONS = MappingProxyType({"forward": "->", "back": "<-", "both": "<->", "none": "--"})
ARROWS = MappingProxyType(
    {
        "blockdiag": ("->", "<-", "<->", "--", "=>"),
        "seqdiag": ("->", "<-", "-->", "<--", "->>", "<<-", "-->>", "<<--", "=>", "<->"),
    }
)
FRAGMENTS = ("alt", "loop")


def suggest_word(word: str, known_words: frozenset[str], example: str) -> str:
    """Return the end of a message about an unknown word: the probable meaning, or the expected words."""
    matches = difflib.get_close_matches(word[:40], sorted(known_words), 1)
    return f"; did you mean {matches[0]}?" if matches else f", expected one such as {example}"


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
