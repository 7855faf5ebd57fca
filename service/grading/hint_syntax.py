"""Advice on lines that Python cannot parse: missing quotes, brackets or indentation, wrong signs, copied line numbers.

Such texts are not fully split into statements, so the lines are searched.
"""

from __future__ import annotations

import io
import itertools
import keyword
import re
import tokenize
from collections.abc import Iterator

from service.grading.fault_kinds import FaultKind, is_kind, read_values
from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import Statement, is_name
from service.grading.hint_foreign_syntax import advise_on_foreign_syntax
from service.grading.hint_tables import ACTIONS
from sim.recording import Fault
from sim.sentences import Sentence

_ELSE_IF = re.compile(r"\s*(else\s+if|else?if|elsif|elf)\b")
_EMPTY_CONDITION = re.compile(r"\s*(elif|if|while)\s*:")
_ELSE_CONDITION = re.compile(r"\s*else\s+([^:#]+?)\s*:")
_SECOND_STATEMENT = re.compile(
    r"\s*[^\W\d][\w.]*\s*(?:[-+*/]?=\s*[\w.\"']+|\([^()]*\))\s+(while|def|import|print|say|return|tank_drive|tank_turn)\b"
)
_WORDS = re.compile(r"\b(say|print|speak)\(\s*([^\W\d]\w*(?:[ ]+[\w!?.]+)+)\s*(?=[,)])")
_NO_TEXT = re.compile(r"\b(?:and|or|not|if|else|for|in|is|lambda|f)\b")
_KEYWORD_ARGUMENT = re.compile(r",\s*\w+\s*=\s*\w+\s*\)*\s*$")
_INDENT_WIDTH = 4
_TEXTS = re.compile(r"""(["']).*?\1""")
#: A call of an action whose values follow without brackets.
_UNBRACKETED_CALL = re.compile(
    rf"(?P<name>say|print|speak|(?:[^\W\d]\w*\.)+(?:{'|'.join(sorted(ACTIONS))}))\s+(?P<values>[\w\"'(-][^#]*)"
)
#: Misspelt comparison signs that are no Python, with the right ones.
_SIGNS = {"=>": ">=", "=<": "<=", "=!": "!=", "<>": "!=", "> =": ">=", "< =": "<=", "! =": "!=", "= =": "=="}
_SIGNS |= {f"{sign} =": f"{sign}=" for sign in "+-*/"}
_SIGN = re.compile(r"=>|=<|=!(?!=)|<>|[<>!=] =|(?<=[\w\])] )[-+*/] =")
_NUMBER_WITH_UNIT = re.compile(
    r"\b(\d+(?:\.\d+)?)[ ]*(%|°|cm|mm|ms|s|sec|seconds?|deg|degrees?|rotations?)[ ]*(?=[,)]|$)"
)
_UNQUOTED_PREFIX = re.compile(r"\b(?:PY|IMG_DATA|JSON)::\w*")
_LINE_NUMBER = re.compile(r"\s*(\d+)[.):|]?\s+[^\W\d]")


def advise_on_syntax(fault: Fault, _: Clues, listing: Listing | None, __: Statement | None) -> str:
    """Return the fix of a line that Python cannot parse; empty if it is unclear."""
    is_unreadable = is_kind(fault, FaultKind.SYNTAX_ERROR, FaultKind.INDENTATION_ERROR)
    if listing is None or fault.line is None or not is_unreadable:
        return ""
    line = "".join(listing.lines[fault.line - 1 : fault.line])
    return (
        _advise_on_copied_signs(line)
        or _advise_on_else_if(line)
        or _advise_on_branch(line)
        or _advise_on_indentation(fault, listing, line)
        or _advise_on_unclosed_text(fault, line)
        or _advise_on_call_without_brackets(line)
        or _advise_on_comparison_sign(line)
        or advise_on_foreign_syntax(fault, listing, line)
        or _advise_on_unit(line)
        or _advise_on_unquoted_prefix(line)
        or _advise_on_unquoted_words(line, listing)
        or _advise_on_missing_plus(line)
    )


def _advise_on_copied_signs(line: str) -> str:
    """Return advice on signs that were copied with the program: Markdown fences, and line numbers."""
    if line.lstrip().startswith("```"):
        return Sentence(
            "``` marks code in a chat or a document, and is no Python. Delete each line that begins with ```."
        )
    match = _LINE_NUMBER.match(line)
    if match is None:
        return ""
    return Sentence(
        "%(number)s at the start is a line number, and no Python. Delete the numbers at the start of the lines.",
        number=match[1],
    )


def _advise_on_call_without_brackets(line: str) -> str:
    match = _UNBRACKETED_CALL.fullmatch(line.strip())
    if match is None or match["values"].startswith("("):
        return ""
    values = match["values"].rstrip()
    first_word = re.match(r"\w*", values)
    if first_word is not None and keyword.iskeyword(first_word[0]):
        return ""
    return Sentence("A call needs brackets: write %(name)s(%(values)s).", name=match["name"], values=values)


def _advise_on_comparison_sign(line: str) -> str:
    match = _SIGN.search(_TEXTS.sub('""', line))
    if match is None:
        return ""
    return Sentence("Python has no sign %(wrong)s. Write %(right)s.", wrong=match[0], right=_SIGNS[match[0]])


def _advise_on_unit(line: str) -> str:
    """Return advice on ``50%`` or ``2 s``, where only a number can stand."""
    match = _NUMBER_WITH_UNIT.search(_TEXTS.sub('""', line))
    if match is None:
        return ""
    return Sentence(
        "A number has no unit in Python: write %(number)s in place of %(text)s.", number=match[1], text=match[0].strip()
    )


def _advise_on_unquoted_prefix(line: str) -> str:
    match = _UNQUOTED_PREFIX.search(line)
    if match is None or _UNQUOTED_PREFIX.search(_TEXTS.sub('""', line)) is None:
        return ""
    fixed_line = f'{line[: match.start()]}"{match[0]}"{line[match.end() :]}'
    return Sentence("%(text)s is a text and needs quotes: write %(code)s.", text=match[0], code=fixed_line.strip())


def _advise_on_missing_plus(line: str) -> str:
    """Return advice on a text and a value with no sign between them."""
    tokens = list(_split_line(line))
    for (first_type, first), (second_type, second) in itertools.pairwise(tokens):
        is_after_text = first_type == tokenize.STRING and second_type in (tokenize.NAME, tokenize.NUMBER)
        is_before_text = second_type == tokenize.STRING and (is_name(first) or first in (")", "]"))
        if (is_after_text or is_before_text) and not {first, second} & set(keyword.kwlist):
            return Sentence(
                "There is no sign between %(first)s and %(second)s. To join texts, write + between them.",
                first=first,
                second=second,
            )
    return ""


def _split_line(line: str) -> Iterator[tuple[int, str]]:
    """Yield type and text of the tokens of a line, up to the first that cannot be read."""
    try:
        for token in tokenize.generate_tokens(io.StringIO(line.strip()).readline):
            yield token.type, token.string
    except (tokenize.TokenError, SyntaxError):
        return


def _advise_on_else_if(line: str) -> str:
    match = _ELSE_IF.match(line)
    if match is None:
        return ""
    return Sentence("Python has no %(wrong)s. Write elif instead of %(wrong)s.", wrong=" ".join(match[1].split()))


def _advise_on_branch(line: str) -> str:
    """Return advice on ``elif:`` without a condition, ``else`` with one, and a second statement in a line."""
    empty_match = _EMPTY_CONDITION.match(line)
    if empty_match is not None:
        if empty_match[1] == "elif":
            return Sentence("elif needs a condition before the colon. For all other cases write else:")
        return Sentence("%(keyword)s needs a condition before the colon.", keyword=empty_match[1])
    else_match = _ELSE_CONDITION.match(line)
    if else_match is not None:
        return Sentence(
            "else has no condition: write else: alone, or elif %(condition)s:", condition=else_match[1].strip()
        )
    second_match = _SECOND_STATEMENT.match(_TEXTS.sub('""', line))
    if second_match is None:
        return ""
    return Sentence("A new statement begins at %(code)s: write it in a line of its own.", code=second_match[1])


def _advise_on_indentation(fault: Fault, listing: Listing, line: str) -> str:
    """Return the fix of a line that is not indented deeper than the block's head above it."""
    values = read_values(fault, FaultKind.NO_BLOCK)
    if values is None:
        return ""
    head = int(values[0])
    width = _count_indent("".join(listing.lines[head - 1 : head])) + _INDENT_WIDTH
    if not line.strip() or fault.line == head:
        return Sentence(
            "Write the lines that belong to line %(head)s below it. Begin each with %(width)s blanks.",
            head=head,
            width=width,
        )
    return Sentence(
        "If line %(line)s belongs to line %(head)s, indent it: begin line %(line)s with %(width)s blanks.",
        line=fault.line,
        head=head,
        width=width,
    )


def _advise_on_unclosed_text(fault: Fault, line: str) -> str:
    """Return the line with its missing closing quote."""
    values = read_values(fault, FaultKind.UNCLOSED_TEXT)
    if values is None:
        return ""
    if values[0]:
        return Sentence("A text that begins with three quotes must end with three quotes.")
    opening = _find_open_quote(line)
    if opening is None:
        return ""
    quote, text = line[opening], line[opening + 1 :]
    if quote == "'" and re.search(r"\w'\w", line):
        return Sentence("The ' in the text ends it. Put \" around the text.")
    line_start = line[:opening]
    text_content, end = _split_end(text.rstrip(), line_start.count("(") - line_start.count(")"))
    other_quote = "'" if quote == '"' else '"'
    return Sentence(
        "The text has no closing %(quote)s. Write %(code)s",
        quote=quote,
        code=f"{line_start.strip()}{quote}{text_content.removesuffix(other_quote)}{quote}{end}",
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
    code = f'{match[1]}("{match[2]}"{line[match.end() :].strip()}'
    return Sentence("A text needs quotes: write %(code)s", code=code)


def _count_indent(line: str) -> int:
    return len(line) - len(line.lstrip(" "))
