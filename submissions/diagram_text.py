"""Parser of ``%%blockdiag`` and ``%%seqdiag`` cells, for the part of the language used in teaching.

The text comes from students. Its size is limited, and error messages name the line. Settings for sizes and fonts are
accepted and ignored, because reports have their own.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

from sim.errors import UsageError
from submissions.diagram import ActorGroup, ArrowHeads, Diagram, DiagramActor, DiagramArrow, DiagramKind, Divider
from submissions.diagram_tokens import (
    ACTOR_ATTRIBUTES,
    ARROW_ATTRIBUTES,
    ARROWS,
    DIAGRAM_ATTRIBUTES,
    DIRECTIONS,
    FRAGMENTS,
    GROUP_ATTRIBUTES,
    LINE_STYLES,
    SHAPES,
    DiagramToken,
    build_error,
    suggest_word,
    tokenize,
)

MAX_ACTORS = 16
MAX_STEPS = 80
MAX_GROUPS = 8
MAX_DEPTH = 8
MAX_NAME_LENGTH = 80

_COLOUR = re.compile(r"#[0-9A-Fa-f]{3}(?:[0-9A-Fa-f]{3})?|[A-Za-z]{3,30}")

Attributes = dict[str, str]


def read_diagram(kind: DiagramKind, text: str, first_line: int = 1) -> Diagram:
    """Parse ``text`` as a diagram; line numbers start from ``first_line``.

    Raises:
        UsageError: The text is not in the language or exceeds a limit. The message begins with the line.
    """
    return _DiagramParser(kind, tokenize(text, first_line), first_line).diagram()


class _DiagramParser:
    """Parser state: the position in the text, and the elements found so far."""

    def __init__(self, kind: DiagramKind, tokens: Sequence[DiagramToken], first_line: int) -> None:
        self._kind = kind
        self._tokens = tokens
        self._position = 0
        self._last_line = tokens[-1].line if tokens else first_line
        self._actors: dict[str, Attributes] = {}
        self._steps: list[DiagramArrow | Divider] = []
        self._groups: list[ActorGroup] = []
        self._classes: dict[str, Attributes] = {}
        self._settings: Attributes = {}

    def diagram(self) -> Diagram:
        """Parse the whole text, with or without a frame such as ``seqdiag { }``."""
        has_frame = self._enter_frame()
        self._parse_statements(0)
        if has_frame:
            self._expect("}")
        if self._position < len(self._tokens):
            raise self._build_unexpected_error("the end of the text")
        if not self._actors:
            raise build_error(self._last_line, "there is nothing to draw, expected lines like a -> b;")
        return Diagram(
            self._kind,
            tuple(self._build_actor(name, attributes) for name, attributes in self._actors.items()),
            self._number_steps(),
            tuple(self._groups),
            self._settings.get("orientation", "").lower() == "portrait",
        )

    def _enter_frame(self) -> bool:
        words = [token.text for token in self._tokens[:3]]
        for length in (1, 2, 3):
            has_kind = length == 1 or words[:1] in (["diagram"], [self._kind])
            if words[length - 1 : length] == ["{"] and has_kind:
                self._position = length
                return True
        return False

    # Tokens.

    def _peek_token(self) -> DiagramToken | None:
        return self._tokens[self._position] if self._position < len(self._tokens) else None

    def _is_sign(self, sign: str, lookahead: int = 0) -> bool:
        position = self._position + lookahead
        if position >= len(self._tokens):
            return False
        token = self._tokens[position]
        return token.text == sign and token.kind == "sign"

    def _accept_sign(self, sign: str) -> bool:
        is_present = self._is_sign(sign)
        self._position += is_present
        return is_present

    def _expect(self, sign: str) -> None:
        if not self._accept_sign(sign):
            raise self._build_unexpected_error(sign)

    def _take_word(self, expected: str) -> str:
        token = self._peek_token()
        if token is None or token.kind not in ("name", "text"):
            raise self._build_unexpected_error(expected)
        self._position += 1
        return token.text

    def _build_unexpected_error(self, expected: str) -> UsageError:
        token = self._peek_token()
        if token is None:
            return build_error(self._last_line, f"the text ends here, expected {expected}")
        return build_error(token.line, f"{token.text[:40]!r} stands here, expected {expected}")

    def _get_last_line(self) -> int:
        """Return the line of the last token."""
        return self._tokens[max(0, self._position - 1)].line if self._tokens else self._last_line

    # Statements.

    def _parse_statements(self, depth: int) -> None:
        self._check_depth(depth)
        while (token := self._peek_token()) is not None and not self._is_sign("}"):
            if self._accept_sign(";"):
                continue
            if token.kind == "divider":
                self._position += 1
                self._parse_divider(token)
            elif token.kind == "name" and token.text in ("class", "plugin") and not self._is_sign("=", 1):
                self._position += 1
                self._parse_class(token.text)
            elif self._is_at_group():
                self._parse_group(depth)
            elif token.text in FRAGMENTS and self._is_before_braces():
                self._parse_fragment(depth)
            elif self._is_sign("=", 1):
                self._parse_setting()
            else:
                self._parse_actors_or_arrows(depth)

    def _is_at_group(self) -> bool:
        token = self._peek_token()
        return token is not None and token.text == "group" and self._is_before_braces()

    def _is_before_braces(self) -> bool:
        """Return whether the keyword is followed by braces, with an optional name between them."""
        return self._is_sign("{", 1) or (
            self._is_sign("{", 2) and self._tokens[self._position + 1].kind in ("name", "text")
        )

    def _check_depth(self, depth: int) -> None:
        if depth > MAX_DEPTH:
            raise build_error(
                self._get_last_line(), f"braces are nested too deeply, expected at most {MAX_DEPTH} of them"
            )

    def _parse_divider(self, token: DiagramToken) -> None:
        if self._kind != "seqdiag":
            raise build_error(token.line, "a block diagram has no dividers, expected lines like a -> b;")
        self._add(Divider(token.text[3:-3].strip(), delay=token.text.startswith("...")))

    def _parse_class(self, keyword: str) -> None:
        name = self._take_word("the name of a class")
        attributes = self._parse_attributes(
            ACTOR_ATTRIBUTES | ARROW_ATTRIBUTES if keyword == "class" else None, "a class"
        )
        self._classes[name] = attributes

    def _parse_fragment(self, depth: int) -> None:
        kind = self._take_word("alt or loop")
        label = "" if self._is_sign("{") else self._take_word("a label")
        self._expect("{")
        self._add(Divider(f"{kind} {label}".strip()))
        self._parse_statements(depth + 1)
        self._expect("}")
        self._add(Divider(f"end of {kind}"))

    def _parse_setting(self) -> None:
        name, value = self._parse_assignment(DIAGRAM_ATTRIBUTES, "a diagram")
        if name == "default_shape":
            self._check_shape(value)
        self._settings[name] = value

    def _parse_group(self, depth: int) -> list[str]:
        """Parse a frame round actors, with an optional name. Actors in nested frames belong to the outer frame too."""
        self._take_word("group")
        self._check_depth(depth)
        label = "" if self._is_sign("{") else self._take_word("{")
        attributes: Attributes = {}
        members: list[str] = []
        self._expect("{")
        while not self._accept_sign("}"):
            if self._accept_sign(";"):
                continue
            if self._is_at_group():
                members += self._parse_group(depth + 1)
            elif self._is_sign("=", 1):
                name, value = self._parse_assignment(GROUP_ATTRIBUTES, "a group")
                attributes[name] = value
            else:
                members += self._parse_actors_or_arrows(depth)
        if len(self._groups) >= MAX_GROUPS:
            raise build_error(self._get_last_line(), f"there are too many groups, expected at most {MAX_GROUPS}")
        colour = _clean_colour(attributes.get("color", self._settings.get("default_group_color", "")))
        self._groups.append(ActorGroup(attributes.get("label", label), tuple(dict.fromkeys(members)), colour))
        return members

    def _parse_actors_or_arrows(self, depth: int) -> list[str]:
        """Parse ``a;`` or ``a, b [shape = box];`` or ``a -> b <- c [label = "x"];`` and return the actors named."""
        chain = [self._parse_names()]
        signs: list[DiagramToken] = []
        while (token := self._peek_token()) is not None and token.kind == "arrow":
            if token.text not in ARROWS[self._kind]:
                raise self._build_unexpected_error(f"one of {' '.join(ARROWS[self._kind])}")
            self._position += 1
            signs.append(token)
            chain.append(self._parse_names())
        if signs:
            self._parse_arrows(chain, signs, depth)
        else:
            attributes = self._parse_attributes(ACTOR_ATTRIBUTES, "an actor")
            self._check_shape(attributes.get("shape", "box"))
            for name in chain[0]:
                self._actors[name].update(attributes)
        return [name for names in chain for name in names]

    def _parse_arrows(self, chain: Sequence[Sequence[str]], signs: Sequence[DiagramToken], depth: int) -> None:
        attributes = self._parse_attributes(ARROW_ATTRIBUTES, "an arrow")
        returns: list[DiagramArrow] = []
        for sign, sources, targets in zip(signs, chain[:-1], chain[1:], strict=True):
            for source in sources:
                for target in targets:
                    arrow = self._build_arrow(source, sign.text, target, attributes)
                    self._add(arrow)
                    if sign.text == "=>" and self._kind == "seqdiag":
                        label = attributes.get("return", "")
                        returns.append(
                            replace(arrow, source=target, target=source, label=label, line="dashed", note="")
                        )
        if self._is_sign("{"):
            self._expect("{")
            self._parse_statements(depth + 1)
            self._expect("}")
        for arrow in reversed(returns):
            self._add(arrow)

    def _build_arrow(self, source: str, sign: str, target: str, attributes: Attributes) -> DiagramArrow:
        direction = attributes.get("dir", "").lower()
        sign = DIRECTIONS.get(direction, direction) if direction else sign
        is_reversed = sign.startswith("<") and sign != "<->"
        heads: ArrowHeads = "both" if sign == "<->" else "none" if sign == "--" else "target"
        is_dashed = "--" in sign and sign != "--"
        side = next((name for name in ("leftnote", "rightnote", "note") if name in attributes), "")
        return DiagramArrow(
            target if is_reversed else source,
            source if is_reversed else target,
            attributes.get("label", ""),
            LINE_STYLES.get(attributes.get("style", "").lower(), "dashed" if is_dashed else "solid"),
            heads,
            ">>" in sign or "<<" in sign or "async" in attributes,
            "failed" in attributes,
            _clean_colour(attributes.get("color", "")),
            attributes.get(side, ""),
            "left" if side == "leftnote" else "right",
        )

    # Parts of statements.

    def _parse_names(self) -> list[str]:
        """Parse one or more actors separated by commas, and add them to the diagram."""
        names = [self._parse_name()]
        while self._accept_sign(","):
            names.append(self._parse_name())
        return names

    def _parse_name(self) -> str:
        name = self._take_word("the name of an actor")
        if not name.strip() or len(name) > MAX_NAME_LENGTH:
            raise build_error(
                self._get_last_line(),
                f"an actor's name is empty or too long, expected 1 to {MAX_NAME_LENGTH} characters",
            )
        self._actors.setdefault(name, {})
        if len(self._actors) > MAX_ACTORS:
            raise build_error(self._get_last_line(), f"there are too many actors, expected at most {MAX_ACTORS}")
        return name

    def _parse_attributes(self, known_names: frozenset[str] | None, owner: str) -> Attributes:
        """Parse ``[label = "x", failed]`` any number of times, and replace a class by its attributes."""
        attributes: Attributes = {}
        while self._accept_sign("["):
            while not self._accept_sign("]"):
                if self._accept_sign(",") or self._accept_sign(";"):
                    continue
                if self._is_sign("=", 1):
                    name, value = self._parse_assignment(known_names, owner)
                else:
                    name, value = self._check_known(self._take_word("]"), known_names, owner), ""
                attributes |= self._classes.get(value, {}) if name == "class" else {name: value}
        return attributes

    def _parse_assignment(self, known_names: frozenset[str] | None, owner: str) -> tuple[str, str]:
        name = self._check_known(self._take_word("the name of an attribute"), known_names, owner)
        self._expect("=")
        return name, self._take_word(f"what {name} is")

    def _check_known(self, name: str, known_names: frozenset[str] | None, owner: str) -> str:
        if known_names is None or name in known_names:
            return name
        raise build_error(
            self._get_last_line(),
            f"{name[:40]!r} is not an attribute of {owner}{suggest_word(name, known_names, 'label or color')}",
        )

    def _check_shape(self, shape: str) -> None:
        if shape not in SHAPES:
            expected = suggest_word(shape, SHAPES, "box, ellipse or diamond")
            raise build_error(self._get_last_line(), f"there is no shape {shape[:40]!r}{expected}")

    def _add(self, step: DiagramArrow | Divider) -> None:
        if len(self._steps) >= MAX_STEPS:
            raise build_error(self._get_last_line(), f"there are too many arrows, expected at most {MAX_STEPS}")
        self._steps.append(step)

    def _build_actor(self, name: str, attributes: Attributes) -> DiagramActor:
        return DiagramActor(
            name,
            attributes.get("label", name),
            attributes.get("shape", self._settings.get("default_shape", "box")),
            _clean_colour(attributes.get("color", self._settings.get("default_node_color", ""))),
            _clean_colour(attributes.get("textcolor", "")),
            LINE_STYLES.get(attributes.get("style", "").lower(), "solid"),
        )

    def _number_steps(self) -> tuple[DiagramArrow | Divider, ...]:
        if self._settings.get("autonumber", "false").lower() == "false":
            return tuple(self._steps)
        return tuple(_add_numbers(self._steps))


def _add_numbers(steps: Iterable[DiagramArrow | Divider]) -> Iterable[DiagramArrow | Divider]:
    number = 0
    for step in steps:
        if isinstance(step, DiagramArrow):
            number += 1
            step = replace(step, label=f"{number}. {step.label}".rstrip())
        yield step


def _clean_colour(text: str) -> str:
    """Return the text if it is a valid colour, otherwise an empty text."""
    return text if _COLOUR.fullmatch(text) else ""
