"""Normal form of statements, independent of operand order, redundant brackets and the places of a pair.

Nothing is parsed. Text that is not Python, or nested too deeply, stays almost unchanged.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from keyword import iskeyword
from typing import TypeAlias

#: The deepest nesting of brackets; statements beyond it stay unchanged.
_MAX_NESTING = 20
_CLOSING = {"(": ")", "[": "]", "{": "}"}
#: From the weakest binding on; for each level, whether operands may be swapped.
_LEVELS: tuple[tuple[frozenset[str], bool], ...] = (
    (frozenset({"or"}), True),
    (frozenset({"and"}), True),
    (frozenset({"==", "!=", "<", ">", "<=", ">="}), False),
    (frozenset("|"), True),
    (frozenset("^"), True),
    (frozenset("&"), True),
    (frozenset({"<<", ">>"}), False),
    (frozenset("+-"), True),
    (frozenset("*/"), True),
)
_OPERATORS = frozenset().union(*(operators for operators, _ in _LEVELS))
_FLIPPED = {">": "<", ">=": "<="}
#: The implicit operator of a first operand, if its level has two operators.
_IMPLICIT_OPERATORS = {"-": "+", "/": "*"}


@dataclass(frozen=True, slots=True)
class Word:
    """One token in its compared form, and its line."""

    text: str
    line: int


@dataclass(slots=True)
class _Group:
    """The items between two brackets."""

    opening: Word
    items: list[_Item] = field(default_factory=list)
    closing: Word | None = None


_Item: TypeAlias = "Word | _Group"


def normalise_statement(statement: Sequence[Word]) -> list[Word]:
    """Return the words of a statement in normal form, each with its original line."""
    items = _group_brackets(statement)
    return list(statement) if items is None else list(_normalise_segments(items))


def _group_brackets(statement: Sequence[Word]) -> list[_Item] | None:
    """Return the items with brackets as groups; None if brackets don't match or are nested too deeply."""
    items: list[_Item] = []
    open_groups: list[_Group] = []
    for word in statement:
        inner_items = open_groups[-1].items if open_groups else items
        if word.text in _CLOSING:
            open_groups.append(_Group(word))
            inner_items.append(open_groups[-1])
        elif open_groups and word.text == _CLOSING[open_groups[-1].opening.text]:
            open_groups.pop().closing = word
        elif word.text in _CLOSING.values():
            return None
        else:
            inner_items.append(word)
        if len(open_groups) > _MAX_NESTING:
            return None
    return None if open_groups else items


def _normalise_segments(items: Sequence[_Item]) -> Iterator[Word]:
    """Yield the expressions between commas, colons, assignments and keywords, each in normal form."""
    expression: list[_Item] = []
    for item in items:
        if isinstance(item, Word) and _is_separator(item.text):
            yield from _normalise_expression(expression)
            yield item
            expression = []
        else:
            expression.append(item)
    yield from _normalise_expression(expression)


def _is_separator(text: str) -> bool:
    return text in (",", ";", ":") or (text[-1:] == "=" and text not in _OPERATORS) or _is_keyword(text)


def _is_keyword(text: str) -> bool:
    return iskeyword(text) and text not in ("and", "or", "None", "True", "False")


def _normalise_expression(items: Sequence[_Item]) -> list[Word]:
    for operators, may_swap in _LEVELS:
        operands = _split_operands(items, operators)
        if len(operands) > 1:
            return _join_operands(operands, may_swap)
    return list(_normalise_atoms(items))


def _split_operands(items: Sequence[_Item], operators: frozenset[str]) -> list[tuple[Word | None, list[_Item]]]:
    """Return the operands between these operators, each with the operator before it."""
    operands: list[tuple[Word | None, list[_Item]]] = [(None, [])]
    if "-" in operators and len(items) > 1 and isinstance(items[0], Word) and items[0].text in operators:
        operands, items = [(items[0], [])], items[1:]
    for item in items:
        # After another operator it is a sign.
        if isinstance(item, Word) and item.text in operators and _ends_operand(operands[-1][1]):
            operands.append((item, []))
        else:
            operands[-1][1].append(item)
    return operands


def _ends_operand(items: Sequence[_Item]) -> bool:
    return bool(items) and not (isinstance(items[-1], Word) and items[-1].text in _OPERATORS)


def _join_operands(operands: Sequence[tuple[Word | None, list[_Item]]], may_swap: bool) -> list[Word]:
    normalised_operands = [(operator, _normalise_expression(items)) for operator, items in operands]
    first_operator = next(operator for operator, _ in normalised_operands if operator is not None)
    # The order of concatenated texts matters.
    if not may_swap or any(words and words[0].text == "text" for _, words in normalised_operands):
        return (
            _normalise_comparison(normalised_operands)
            if len(normalised_operands) == 2
            else [word for each in normalised_operands for word in _prepend_operator(*each)]
        )
    implicit_operator = Word(_IMPLICIT_OPERATORS.get(first_operator.text, first_operator.text), first_operator.line)
    pairs = [(operator or implicit_operator, words) for operator, words in normalised_operands]
    pairs.sort(key=lambda pair: (pair[0].text, [word.text for word in pair[1]]))
    (operator, words), *other_pairs = pairs
    sign = [operator] if operator.text == "-" else []
    return [*sign, *words, *(word for each in other_pairs for word in _prepend_operator(*each))]


def _normalise_comparison(operands: Sequence[tuple[Word | None, list[Word]]]) -> list[Word]:
    (_, first_words), (operator, second_words) = operands
    assert operator is not None
    is_swapped = operator.text in _FLIPPED or (
        operator.text in ("==", "!=") and [word.text for word in second_words] < [word.text for word in first_words]
    )
    operator = Word(_FLIPPED.get(operator.text, operator.text), operator.line)
    return [*second_words, operator, *first_words] if is_swapped else [*first_words, operator, *second_words]


def _prepend_operator(operator: Word | None, words: Sequence[Word]) -> list[Word]:
    return [*words] if operator is None else [operator, *words]


def _normalise_atoms(items: Sequence[_Item]) -> Iterator[Word]:
    """Yield names, calls, subscripts and brackets, without brackets that only group."""
    last_item: _Item | None = None
    for index, item in enumerate(items):
        if isinstance(item, Word):
            if not (item.text == "sum" and _extract_summands(items[index + 1 : index + 2])):
                yield item
        elif isinstance(last_item, Word) and last_item.text == "sum" and (summands := _extract_summands([item])):
            yield from _normalise_expression(summands)
        elif item.opening.text == "(" and item.items and not _is_callee(last_item):
            yield from _normalise_segments(item.items)
        elif not (_is_callee(last_item) and _is_pair_index(item)):
            yield item.opening
            yield from _normalise_segments(item.items)
            if item.closing is not None:
                yield item.closing
        last_item = item


def _is_callee(item: _Item | None) -> bool:
    """Return whether brackets after this item are those of a call or a subscript."""
    return isinstance(item, _Group) or (item is not None and item.text.isidentifier())


def _is_pair_index(group: _Group) -> bool:
    """Return whether it is ``[0]``: a place of a pair counts like a variable."""
    inner_texts = [item.text for item in group.items if isinstance(item, Word)]
    return group.opening.text == "[" and len(group.items) == 1 and inner_texts == ["number"]


def _extract_summands(items: Sequence[_Item]) -> list[_Item]:
    """Return the ``a + b`` of the brackets in ``sum([a, b])``; empty for other brackets."""
    match items:
        case [_Group(items=[_Group(items=list() as inside, opening=Word("[" | "("))])]:
            return [Word("+", item.line) if isinstance(item, Word) and item.text == "," else item for item in inside]
        case _:
            return []
