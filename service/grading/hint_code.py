"""The statements of a student's text, for hints: their lines, indentation, tokens and nesting.

Texts are split by the standard library's Python tokenizer. They are not parsed or run.
"""

from __future__ import annotations

import io
import itertools
import re
import tokenize
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

_SKIPPED_TOKENS = frozenset({tokenize.COMMENT, tokenize.NL, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER})
_NAME = re.compile(r"[^\W\d]\w*\Z")
_MAGIC = re.compile(r"^\s*[%!]")
_MAX_STATEMENTS, _MAX_TOKENS = 3000, 400
LOOPS = frozenset({"while", "for"})
_OPENING, _CLOSING = frozenset("([{"), frozenset(")]}")


@dataclass(frozen=True, slots=True)
class CallInCode:
    """One call in a statement: ``name`` is dotted, ``arguments`` has the tokens of each argument."""

    name: str
    arguments: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class Statement:
    """One logical line. ``line`` counts from 1, ``last_line`` is its last line, ``tokens`` excludes comments.

    ``number`` is its index in the code. ``parent`` is the index of the enclosing statement, or -1. ``columns`` are the
    columns where the tokens begin.
    """

    line: int
    last_line: int
    indent: int
    tokens: tuple[str, ...]
    number: int = 0
    parent: int = -1
    columns: tuple[int, ...] = ()

    @property
    def keyword(self) -> str:
        """The first token."""
        return self.tokens[0]

    @property
    def condition(self) -> tuple[str, ...]:
        """The tokens between the keyword and the last colon of a ``while`` or ``if``."""
        end = len(self.tokens) - 1 - self.tokens[::-1].index(":") if ":" in self.tokens else len(self.tokens)
        return self.tokens[1:end]

    @property
    def target(self) -> str:
        """The name in an assignment to a single name; otherwise empty."""
        return self.tokens[0] if len(self.tokens) > 2 and self.tokens[1] == "=" and is_name(self.tokens[0]) else ""

    @property
    def bound_names(self) -> frozenset[str]:
        """The names that it binds by assignment, definition, import or loop."""
        return frozenset(_collect_bound_names(self.tokens))

    @property
    def calls(self) -> tuple[CallInCode, ...]:
        """The calls in the statement, from left to right. Empty for ``def`` and ``class``."""
        return tuple(_parse_calls(self.tokens)) if self.keyword not in ("def", "class") else ()

    def has_token(self, *names: str) -> bool:
        """Return whether one of the names is among the tokens."""
        return any(name in self.tokens for name in names)


_BLOCK_KEYWORDS = frozenset({"while", "for", "if", "elif", "else", "def", "class", "with", "try", "except", "finally"})


@dataclass(frozen=True, slots=True)
class CodeStatements:
    """The statements of one text, in order."""

    statements: tuple[Statement, ...] = ()

    def find_statement(self, line: int | None) -> Statement | None:
        """Return the statement that contains the line, or None."""
        if line is None:
            return None
        return next((each for each in self.statements if each.line <= line <= each.last_line), None)

    def list_body(self, head: Statement) -> tuple[Statement, ...]:
        """Return the statements inside a loop, condition or function."""
        body = []
        for statement in self.list_following(head):
            if statement.indent <= head.indent:
                break
            body.append(statement)
        return tuple(body)

    def list_following(self, statement: Statement) -> tuple[Statement, ...]:
        """Return the statements after this one."""
        return self.statements[statement.number + 1 :]

    def find_next_outside(self, head: Statement) -> Statement | None:
        """Return the first statement after the body of ``head``, or None."""
        following = self.list_following(head)[len(self.list_body(head)) :]
        return following[0] if following else None

    def list_enclosing(self, statement: Statement) -> tuple[Statement, ...]:
        """Return the enclosing statements, the innermost first."""
        ancestors: list[Statement] = []
        parent = statement.parent
        while parent >= 0:
            ancestors.append(self.statements[parent])
            parent = ancestors[-1].parent
        return tuple(ancestors)

    def list_enclosing_loops(self, statement: Statement) -> tuple[Statement, ...]:
        """Return the enclosing loops, including itself, innermost first, then loops that call its function."""
        ancestors = self.list_enclosing(statement)
        loops = [each for each in (statement, *ancestors) if each.keyword in LOOPS]
        function = next((each.tokens[1] for each in ancestors if each.keyword == "def" and len(each.tokens) > 1), "")
        if function:
            callers = (each for each in self.statements if any(call.name == function for call in each.calls))
            loops += [outer for each in callers for outer in self.list_enclosing(each) if outer.keyword in LOOPS]
        return tuple(loops)

    def list_functions(self) -> Iterator[Statement]:
        """Return the heads of the functions."""
        return (each for each in self.statements if each.keyword == "def" and len(each.tokens) > 1)

    def number(self, tokens: Sequence[str]) -> float | None:
        """Return the number that an argument denotes, directly or by a name that is assigned once; otherwise None."""
        sign = -1.0 if tokens and tokens[0] == "-" else 1.0
        tokens = tokens[1:] if sign < 0 else tokens
        if len(tokens) > 3 and tokens[0].startswith("Speed") and tokens[1] == "(":
            return self.number(tokens[2:-1])
        if len(tokens) != 1:
            return None
        if is_name(tokens[0]):
            assignments = [each for each in self.statements if each.target == tokens[0]]
            if len(assignments) != 1 or len(assignments[0].tokens) != 3 or is_name(assignments[0].tokens[2]):
                return None
            tokens = assignments[0].tokens[2:]
        return _parse_number(tokens[0], sign)


def read_code(lines: Sequence[str]) -> CodeStatements:
    """Split a text into statements, without magic lines. Stops where the tokenizer fails."""
    text = "\n".join("#" if _MAGIC.match(line) else line for line in lines) + "\n"
    statements: list[Statement] = []
    open_blocks: list[Statement] = []
    for number, statement in enumerate(itertools.islice(_split_statements(text), _MAX_STATEMENTS)):
        while open_blocks and open_blocks[-1].indent >= statement.indent:
            open_blocks.pop()
        statements.append(replace(statement, number=number, parent=open_blocks[-1].number if open_blocks else -1))
        open_blocks.append(statements[-1])
    return CodeStatements(tuple(statements))


def guess_result_name(body: Sequence[Statement]) -> str:
    """Guess the name that a function without return should return: a fitted object, else the last assigned name."""
    fitted_names = [
        call.name.removesuffix(".fit") for each in body for call in each.calls if call.name.endswith(".fit")
    ]
    assigned_names = [each.target or each.tokens[0] for each in body if each.target or "+=" in each.tokens[1:2]]
    return next(iter((*fitted_names, *assigned_names[::-1])), "")


def is_name(token: str) -> bool:
    """Return whether a token is a name or a keyword."""
    return _NAME.match(token) is not None


def iterate_equality_tests(tokens: Sequence[str]) -> Iterator[tuple[Sequence[str], str]]:
    """Yield the tokens before each ``==`` and ``!=``, and the token after it."""
    for index, sign in enumerate(tokens[:-1]):
        if index and sign in ("==", "!="):
            yield tokens[:index], tokens[index + 1]


def join_tokens(tokens: Sequence[str]) -> str:
    """Join the tokens into readable code."""
    text = ""
    for previous, token in zip(("", *tokens), tokens, strict=False):
        is_tight = (
            token in ".,:)]}" or previous in "([{." or (token in "([" and (is_name(previous) or previous in (")", "]")))
        )
        text += token if is_tight or not previous else f" {token}"
    return text


def compute_bracket_depths(tokens: Sequence[str]) -> list[int]:
    """Return the bracket depth of each token. A bracket has the depth outside it."""
    depths, depth = [], 0
    for token in tokens:
        depth -= token in _CLOSING
        depths.append(depth)
        depth += token in _OPENING
    return depths


def _split_statements(text: str) -> Iterator[Statement]:
    tokens: list[tokenize.TokenInfo] = []
    try:
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type == tokenize.NEWLINE:
                if tokens:
                    yield from _split_logical_line(tokens)
                tokens = []
            elif token.type not in _SKIPPED_TOKENS:
                tokens.append(token)
    except (tokenize.TokenError, SyntaxError):
        return


def _split_logical_line(tokens: list[tokenize.TokenInfo]) -> Iterator[Statement]:
    """Yield the statements of one logical line, split at semicolons and before a body on the same line."""
    tokens = tokens[:_MAX_TOKENS]
    first_token, strings = tokens[0], [token.string for token in tokens]
    indent, depth, start = first_token.start[1], 0, 0
    for index, string in enumerate(strings):
        depth += (string in _OPENING) - (string in _CLOSING)
        is_end = string == ";" or (string == ":" and strings[start] in _BLOCK_KEYWORDS and index + 1 < len(strings))
        if depth or not is_end or strings[start] == "lambda":
            continue
        yield _build_statement(tokens[start : index + (string == ":")], indent)
        indent, start = indent + (string == ":"), index + 1
    if start < len(strings):
        yield _build_statement(tokens[start:], indent)


def _build_statement(tokens: list[tokenize.TokenInfo], indent: int) -> Statement:
    strings, columns = (token.string for token in tokens), (token.start[1] for token in tokens)
    return Statement(tokens[0].start[0], tokens[-1].end[0], indent, tuple(strings), columns=tuple(columns))


def _collect_bound_names(tokens: tuple[str, ...]) -> Iterator[str]:
    match tokens:
        case ("def" | "class" | "global", name, *_):
            yield name
        case ("import" | "from", *rest):
            names = rest[rest.index("import") + 1 :] if tokens[0] == "from" and "import" in rest else rest
            for index, name in enumerate(names):
                is_renamed = index + 1 < len(names) and names[index + 1] == "as"
                if is_name(name) and name != "as" and not is_renamed:
                    yield name
        case ("for", *rest):
            yield from filter(is_name, rest[: rest.index("in")] if "in" in rest else rest)
    depth = 0
    for index, token in enumerate(tokens):
        depth += (token in _OPENING) - (token in _CLOSING)
        if token == ":=" and index:
            yield tokens[index - 1]
        if depth == 0 and token.endswith("=") and token not in ("==", "!=", "<=", ">=", ":="):
            yield from _collect_targets(tokens[:index])


def _collect_targets(tokens: Sequence[str]) -> Iterator[str]:
    if all(is_name(token) or token in ".,()=[]" or token[0].isdigit() or token[0] in "\"'" for token in tokens):
        yield from (
            token for place, token in enumerate(tokens) if is_name(token) and tokens[place - 1 : place] != (".",)
        )


def _parse_calls(tokens: Sequence[str]) -> Iterator[CallInCode]:
    for index, token in enumerate(tokens[:-1]):
        if tokens[index + 1] != "(" or not is_name(token) or token in ("and", "or", "not", "in", "if", "while"):
            continue
        start = index
        while start >= 2 and tokens[start - 1] == "." and is_name(tokens[start - 2]):
            start -= 2
        yield CallInCode("".join(tokens[start : index + 1]), tuple(_split_arguments(tokens[index + 2 :])))


def _split_arguments(tokens: Sequence[str]) -> Iterator[tuple[str, ...]]:
    depth, start = 0, 0
    for index, token in enumerate(tokens):
        if token in _CLOSING and depth == 0:
            if index > start:
                yield tuple(tokens[start:index])
            return
        depth += (token in _OPENING) - (token in _CLOSING)
        if token == "," and depth == 0:
            yield tuple(tokens[start:index])
            start = index + 1


def _parse_number(token: str, sign: float) -> float | None:
    try:
        return sign * float(token)
    except ValueError:
        return None
