"""Statements that compute a value and discard it: what they do, and the correct form."""

from __future__ import annotations

import keyword

from service.grading.hint_code import CodeStatements, Statement, is_name, join_tokens
from sim.sentences import Sentence

_STATEMENTS = frozenset(keyword.kwlist)


def describe_discarded_value(statement: Statement, code: CodeStatements) -> str:
    """Return a hint that a statement computes a value and discards it; empty if it has an effect."""
    tokens = statement.tokens
    if _has_reversed_operator(statement, code):
        return Sentence(
            "%(code)s sets %(name)s to %(value)s",
            code=f"{tokens[0]} ={tokens[2]} {tokens[3]}",
            name=tokens[0],
            value=f"{tokens[2]}{tokens[3]}",
        )
    operators = [token for token in tokens if token in ("+", "-", "*", "/", "==", "<", ">")]
    if not is_name(tokens[0]) or not operators or any(each.endswith("=") and each != "==" for each in tokens):
        return ""
    is_plain = all(is_name(each) or each in "+-*/.==<>" or each[0].isdigit() for each in tokens)
    if not is_plain or tokens[0] in _STATEMENTS:
        return ""
    return Sentence("%(code)s has no effect", code=join_tokens(tokens))


def _has_reversed_operator(statement: Statement, code: CodeStatements) -> bool:
    """Return whether this is ``count =- 1``, spaced so, in a loop, for a variable assigned earlier."""
    tokens, columns, name = statement.tokens, statement.columns, statement.target
    if len(tokens) != 4 or not name or name.isupper() or tokens[2] not in ("+", "-"):
        return False
    is_written_so = columns[2] == columns[1] + 1 and columns[3] > columns[2] + 1
    has_value = any(each.target == name for each in code.statements[: statement.number])
    return is_written_so and has_value and bool(code.list_enclosing_loops(statement))


def suggest_correct_statement(statement: Statement) -> str:
    """Return the correct form of a statement without effect."""
    tokens = statement.tokens
    if tokens[1] == "=":
        return Sentence("Write %(code)s", code=f"{tokens[0]} {tokens[2]}= {tokens[3]}")
    if tokens[1] == "==":
        return Sentence("Write one = for an assignment: %(code)s", code=f"{tokens[0]} = {join_tokens(tokens[2:])}")
    return Sentence("Write %(code)s", code=f"{tokens[0]} = {join_tokens(tokens)}")
