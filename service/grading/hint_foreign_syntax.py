"""Advice on words and signs of other languages in a line that Python cannot parse, and on branches without their head.

The advice is on one line, so a rule needs signs that Python has nowhere else.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Mapping
from types import MappingProxyType

from service.grading.fault_kinds import FaultKind, is_kind
from service.grading.hint_clues import Listing
from sim.recording import Fault
from sim.sentences import Sentence

_TEXTS = re.compile(r"""(["']).*?\1""")
_FIRST_WORD = re.compile(r"\s*([^\W\d_]+)\b(?!\s*(?:[.,\[]|=(?!=)))")
_OPERATOR_WORD = re.compile(r"(?<=[\w)\]\"'] )(And|AND|Or|OR|In|IN|Is|IS)(?= )|(?<= )(Not|NOT)(?= )")
_COUNTING_LOOP = re.compile(r"\s*for\s+([^\W\d]\w*)\s*(?:=|in|from)\s*([\w.]+)\s*(?:to|until|\.{2,3})\s*([\w.]+)")
_FOR_EACH = re.compile(r"\s*for\s*each\s+(?P<name>[^\W\d]\w*)\s+in\s+(?P<values>[^:]+?)\s*:?\s*$")
_UNTIL = re.compile(r"\s*(?P<word>(?:repeat|loop|do|wait)\s+until|until|unless)\b\s*(?P<condition>[^:]+?)\s*:?\s*$")
_REPEAT = re.compile(r"\s*(?P<word>repeat|loop|do)\s*(?:\(\s*)?(?P<count>\w+)\s*\)?\s*(?:times\s*)?:\s*$")
_FOREVER = re.compile(r"\s*(?P<word>forever|repeat|loop)\s*:\s*$")
_FUNCTION = re.compile(r"\s*(?P<word>function|func|fun|define|sub|void)\s+(?P<head>[^\W\d]\w*\s*\([^()]*\))")
_DICTIONARY_EQUALS = re.compile(r"""[{,]\s*(?P<key>(["'])[^"']*\2)\s*=(?!=)""")
_OPEN_BRACE = re.compile(r"""\{(?P<value>[^{}"']+)(?=["'])""")
_BRANCH = re.compile(r"(\s*)(else|elif|except|finally)\b")
#: The heads that each kind of branch belongs to.
_HEADS: Mapping[str, re.Pattern[str]] = MappingProxyType(
    {
        "else": re.compile(r"(if|elif|for|while|except)\b"),
        "elif": re.compile(r"(if|elif)\b"),
        "except": re.compile(r"(try|except)\b"),
        "finally": re.compile(r"(try|except|else)\b"),
    }
)


def advise_on_foreign_syntax(fault: Fault, listing: Listing, line: str) -> str:
    """Return the Python for a line in another language's words; empty if there is none in it."""
    code = _TEXTS.sub(lambda match: f"{match[1]}{' ' * (len(match[0]) - 2)}{match[1]}", line)
    return (
        _advise_on_capital_keyword(line, code)
        or _advise_on_loop_words(line)
        or _advise_on_semicolon(line, code)
        or _advise_on_dictionary(line)
        or _advise_on_brace(fault, line)
        or _advise_on_branch_position(fault, listing, line)
    )


def _advise_on_capital_keyword(line: str, code: str) -> str:
    """Return advice on ``While x:`` and ``if a And b:``."""
    match = _FIRST_WORD.match(code)
    word = match[1] if match is not None else ""
    is_head = word.lower() in keyword.kwlist and word not in keyword.kwlist
    if not is_head or word.lower() in ("and", "or", "in", "is"):
        operator = _OPERATOR_WORD.search(code)
        word = (operator[1] or operator[2]) if operator is not None else ""
    if not word:
        return ""
    return Sentence(
        "Python has no %(wrong)s: its words have small letters. Write %(right)s.", wrong=word, right=word.lower()
    )


def _advise_on_loop_words(line: str) -> str:
    """Return advice on loops and functions as other languages write them."""
    match = _COUNTING_LOOP.match(line)
    if match is not None:
        end = str(int(match[3]) + 1) if match[3].isdecimal() else f"{match[3]} + 1"
        code = _write_loop(match[1], f"range({match[2]}, {end})")
        return Sentence("To count, write %(code)s The second number of range is not reached.", code=code)
    match = _FOR_EACH.match(line)
    if match is not None:
        return Sentence("Write %(code)s", code=_write_loop(match["name"], match["values"]))
    match = _UNTIL.match(line)
    if match is not None:
        word = match["word"]
        code = f"{'if' if word == 'unless' else 'while'} not ({match['condition']}):"
        return Sentence("Python has no %(wrong)s. Write %(code)s", wrong=" ".join(word.split()), code=code)
    match = _FOREVER.match(line)
    if match is not None:
        return Sentence("Python has no %(wrong)s. Write %(code)s", wrong=match["word"], code="while True:")
    match = _REPEAT.match(line)
    if match is not None:
        code = _write_loop("_", f"range({match['count']})")
        return Sentence("Python has no %(wrong)s. Write %(code)s", wrong=match["word"], code=code)
    match = _FUNCTION.match(line)
    if match is not None:
        return Sentence("Python has no %(wrong)s. Write %(code)s", wrong=match["word"], code=f"def {match['head']}:")
    return ""


def _write_loop(name: str, values: str) -> str:
    return f"for {name} in {values}:"


def _advise_on_semicolon(line: str, code: str) -> str:
    """Return advice on ``range(10; 101; 10)``."""
    depth, places = 0, []
    for index, sign in enumerate(code.partition("#")[0]):
        depth += (sign in "([{") - (sign in ")]}")
        if sign == ";" and depth > 0:
            places.append(index)
    if not places:
        return ""
    fixed = "".join("," if index in places else sign for index, sign in enumerate(line))
    return Sentence("Values in brackets have commas between them. Write %(code)s", code=fixed.strip())


def _advise_on_dictionary(line: str) -> str:
    """Return advice on ``{"key" = value}``."""
    match = _DICTIONARY_EQUALS.search(line)
    if match is None:
        return ""
    return Sentence(
        "In curly brackets a colon stands between a key and its value. Write %(key)s: in place of %(key)s =.",
        key=match["key"],
    )


def _advise_on_brace(fault: Fault, line: str) -> str:
    """Return advice on a brace that an f-string opens and does not close."""
    match = _OPEN_BRACE.search(line)
    if match is None or not is_kind(fault, FaultKind.OPEN_BRACE):
        return ""
    code = f"{line[: match.end()]}}}{line[match.end() :]}"
    return Sentence("A curly bracket is not closed. Write %(code)s", code=code.strip())


def _advise_on_branch_position(fault: Fault, listing: Listing, line: str) -> str:
    """Return advice on ``else`` that is not below its ``if``, or is separated from it."""
    branch = _BRANCH.match(line)
    if branch is None or fault.line is None:
        return ""
    indent, heads = len(branch[1]), _HEADS[branch[2]]
    previous: tuple[int, int, str] | None = None
    for number in range(fault.line - 1, 0, -1):
        text = listing.lines[number - 1]
        content, width = text.strip(), len(text) - len(text.lstrip())
        if not content or content.startswith("#") or width > indent:
            continue
        if previous is None and width == indent and heads.match(content):
            return ""
        head = heads.match(content)
        if previous is not None and head is not None and width == indent:
            return Sentence(
                "Line %(line)s stands between %(head)s in line %(number)s and this %(branch)s, and ends it. Indent "
                "line %(line)s, or move it.",
                line=previous[0],
                head=head[1],
                number=number,
                branch=branch[2],
            )
        if head is not None and width < indent:
            return Sentence(
                "This %(branch)s belongs to %(head)s in line %(number)s. Begin both lines with %(width)s blanks.",
                branch=branch[2],
                head=head[1],
                number=number,
                width=width,
            )
        if width < indent:
            return ""
        previous = previous or (number, width, content)
    return ""
