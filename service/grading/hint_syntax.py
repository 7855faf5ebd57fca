"""Advice on lines that Python cannot parse: ``else if``, missing or unclosed quotes, missing indentation.

Such texts are not fully split into statements, so the lines are searched.
"""

from __future__ import annotations

import re

from service.grading.fault_kinds import FaultKind, is_kind, read_values
from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import Statement
from sim.recording import Fault

_ELSE_IF = re.compile(r"\s*(else\s+if|else?if|elsif|elf)\b")
_WORDS = re.compile(r"\b(say|print|speak)\(\s*([^\W\d]\w*(?:[ ]+[\w!?.]+)+)\s*(?=[,)])")
_NO_TEXT = re.compile(r"\b(?:and|or|not|if|else|for|in|is|lambda|f)\b")
_KEYWORD_ARGUMENT = re.compile(r",\s*\w+\s*=\s*\w+\s*\)*\s*$")
_INDENT_WIDTH = 4


def advise_on_syntax(fault: Fault, _: Clues, listing: Listing | None, __: Statement | None) -> str:
    """Return the fix of a line that Python cannot parse; empty if it is unclear."""
    is_unreadable = is_kind(fault, FaultKind.SYNTAX_ERROR, FaultKind.INDENTATION_ERROR)
    if listing is None or fault.line is None or not is_unreadable:
        return ""
    line = "".join(listing.lines[fault.line - 1 : fault.line])
    return (
        _advise_on_else_if(line)
        or _advise_on_indentation(fault, listing, line)
        or _advise_on_unclosed_text(fault, line)
        or _advise_on_unquoted_words(line, listing)
    )


def _advise_on_else_if(line: str) -> str:
    match = _ELSE_IF.match(line)
    if match is None:
        return ""
    keyword = " ".join(match[1].split())
    return f"Python has no {keyword}. Write elif in place of {keyword}."


def _advise_on_indentation(fault: Fault, listing: Listing, line: str) -> str:
    """Return the fix of a line that is not indented deeper than the block's head above it."""
    values = read_values(fault, FaultKind.NO_BLOCK)
    if values is None:
        return ""
    head = int(values[0])
    width = _count_indent("".join(listing.lines[head - 1 : head])) + _INDENT_WIDTH
    if not line.strip() or fault.line == head:
        return f"Write the lines that belong to line {head} below it. Begin each with {width} blanks."
    return f"If line {fault.line} belongs to line {head}, indent it: begin line {fault.line} with {width} blanks."


def _advise_on_unclosed_text(fault: Fault, line: str) -> str:
    """Return the line with its missing closing quote."""
    values = read_values(fault, FaultKind.UNCLOSED_TEXT)
    if values is None:
        return ""
    if values[0]:
        return "A text that begins with three quotes must end with three quotes."
    opening = _find_open_quote(line)
    if opening is None:
        return ""
    quote, text = line[opening], line[opening + 1 :]
    if quote == "'" and re.search(r"\w'\w", line):
        return "The ' in the text ends it. Put \" around the text."
    line_start = line[:opening]
    text_content, end = _split_end(text.rstrip(), line_start.count("(") - line_start.count(")"))
    other_quote = "'" if quote == '"' else '"'
    return (
        f"The text has no closing {quote}. Write "
        f"{line_start.strip()}{quote}{text_content.removesuffix(other_quote)}{quote}{end}"
    )


def _split_end(text: str, brackets: int) -> tuple[str, str]:
    """Split a text into its words and the code after them: closing brackets, or a named argument."""
    argument_match = _KEYWORD_ARGUMENT.search(text) if brackets > 0 else None
    if argument_match is not None:
        return text[: argument_match.start()], text[argument_match.start() :]
    end = ""
    while text.endswith(")") and len(end) < brackets:
        text, end = text[:-1], f"{end})"
    return text, end


def _find_open_quote(line: str) -> int | None:
    """Return the position of an opening quote that is never closed; None if there is none."""
    opening: int | None = None
    is_escaped = False
    for index, letter in enumerate(line):
        if is_escaped:
            is_escaped = False
        elif opening is None and letter == "#":
            return None
        elif letter == "\\":
            is_escaped = True
        elif opening is None and letter in "\"'":
            opening = index
        elif opening is not None and letter == line[opening]:
            opening = None
    return opening


def _advise_on_unquoted_words(line: str, listing: Listing) -> str:
    """Return advice on unquoted words in the brackets of a call."""
    match = _WORDS.search(line)
    if match is None or _NO_TEXT.search(match[2]):
        return ""
    bound_names = {name for each in listing.code.statements for name in each.bound_names}
    if set(match[2].split()) <= bound_names:
        return ""
    return f'A text needs quotes: write {match[1]}("{match[2]}"{line[match.end() :].strip()}'


def _count_indent(line: str) -> int:
    return len(line) - len(line.lstrip(" "))
