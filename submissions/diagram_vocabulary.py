"""Vocabulary of diagram texts: attributes of actors, arrows, groups and diagrams, shapes, and arrow types.

Most attributes set sizes or fonts and have no effect. They are listed so that misspelt names can be reported.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from types import MappingProxyType

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
