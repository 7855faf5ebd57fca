"""No code reads texts that are meant for people. It uses values, codes and exception classes."""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

import pytest

from paths import TESTS

_ROOT = TESTS.parent
_PACKAGES = ("models", "responders", "robomark", "service", "sim", "submissions")
#: Programs of students and of the course, and migrations, which read the data of earlier releases.
_LEFT_OUT = ("catalogue", "examples", "known_answer", "library", "template", "versions")
_FIELDS = {"cause", "error", "finding", "hint", "happened", "message", "next_step", "reason", "sentence", "staff_only"}
_NAMES = _FIELDS | {"note"}
_PARTS = {"endswith", "find", "partition", "removeprefix", "removesuffix", "rpartition", "startswith"}
_PATTERNS = {"findall", "finditer", "fullmatch", "match", "search"}

_OF_PYTHON = "reads, for all hints, the sentences of Python, which has no codes for mistakes"
#: For each file, the number of such places and the reason.
_ALLOWED: dict[str, tuple[int, str]] = {
    "responders/faults.py": (1, "reads, in one place, the sentence of a stored fault that it makes itself"),
    "responders/notebook_executor.py": (1, "a fault names the function that is missing in its sentence alone"),
    "responders/sandbox/inside/name_suggestions.py": (2, "ImportError of Python's has no code for what is missing"),
    "service/commands/grading.py": (1, "leaves out of a row's reason the file's name, which the row has"),
    "service/grading/fault_kinds.py": (1, _OF_PYTHON),
    "sim/readers/json_text.py": (1, "Python's ValueError for a long number has no class of its own"),
    "submissions/assignment/reader.py": (1, "the TOML reader of Python 3.11 tells the line in its sentence alone"),
}


def _text(node: ast.expr) -> bool:
    """Return whether an expression is, by its name, a text for people."""
    match node:
        case ast.Name(id=name):
            return name in _NAMES
        case ast.Attribute(attr=name):
            return name in _FIELDS
        case ast.Call(func=ast.Name(id="str"), args=[ast.Name(id=name)]):
            return name in {"error", "problem", "exception"}
        case ast.Call(func=ast.Attribute(value=inner, attr="casefold" | "lower" | "strip")):
            return _text(inner)
    return False


def _words(node: ast.expr) -> bool:
    """Return whether an expression is recognisably a text with letters."""
    match node:
        case ast.Constant(value=str(text)):
            return any(map(str.isalpha, text))
        case ast.Constant():
            return False
        case ast.Tuple(elts=elements):
            return any(map(_words, elements))
    return True


def _constant(node: ast.expr) -> bool:
    match node:
        case ast.Constant() | ast.JoinedStr():
            return _words(node)
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name.isupper()
    return False


def _reads_text(node: ast.AST) -> bool:
    match node:
        case ast.Call(func=ast.Attribute(value=value, attr=method), args=arguments):
            if method in _PARTS:
                return _text(value) and any(map(_words, arguments))
            return method in _PATTERNS and any(map(_text, arguments))
        case ast.Compare(left=left, ops=[ast.In() | ast.NotIn()], comparators=[right]):
            return _text(right) and _words(left)
        case ast.Compare(left=left, ops=[ast.Eq() | ast.NotEq()], comparators=[right]):
            return (_text(left) and _constant(right)) or (_text(right) and _constant(left))
    return False


def _places(source: str) -> list[int]:
    return [node.lineno for node in ast.walk(ast.parse(source)) if isinstance(node, ast.expr) and _reads_text(node)]


def _product_files() -> list[Path]:
    files = (file for package in _PACKAGES for file in sorted((_ROOT / package).rglob("*.py")))
    return [file for file in files if not set(file.relative_to(_ROOT).parts) & set(_LEFT_OUT)]


def test_no_code_reads_texts_for_people() -> None:
    uses = Counter[str]()
    lines: dict[str, list[int]] = {}
    for file in _product_files():
        if places := _places(file.read_text(encoding="utf-8")):
            name = file.relative_to(_ROOT).as_posix()
            uses[name], lines[name] = len(places), places
    allowed = {name: count for name, (count, _) in _ALLOWED.items()}
    differing = {name: lines.get(name, []) for name in uses | allowed if uses[name] != allowed.get(name, 0)}
    assert not differing, "give the error, fault or row a code or a value; or correct the count in the table"


@pytest.mark.parametrize(
    ("source", "is_found"),
    [
        ('"over" in str(error)', True),
        ('str(error) == "over a limit"', True),
        ("job.error == OVER_A_LIMIT", True),
        ('job.error.startswith("superseded by ")', True),
        ("re.match(PATTERN, change.reason)", True),
        ("PATTERN.search(fault.message)", True),
        ('note.removeprefix("ignored: ")', True),
        ('job.error == ""', False),
        ("job.error is None", False),
        ('reason.endswith((".", "!"))', False),
        ("job.cancelled_for == CancelReason.OVER_LIMIT", False),
        ('message.note == "lost"', False),
    ],
)
def test_what_reads_a_text_is_found(source: str, is_found: bool) -> None:
    assert bool(_places(source)) is is_found
