"""Judging what the text of a hand-in has: its constructs, calls, names and flags, from facts found inside the walls.

Text is compared with rules and nothing else; what the code does when it runs is judged elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from fractions import Fraction
from types import MappingProxyType
from typing import Any

from service.grading.judging.outcome import Outcome, failed, passed
from submissions.criteria.code import CONSTRUCTS, SourceRules, flags_in
from submissions.magics import Flags

_GROUPS = ("constructs", "calls", "looped", "handed_on", "names", "functions", "imports")
#: What can do more than its text shows: no reader can tell what it comes to.
_VEILED = ("exec", "eval", "compile", "getattr", "__import__", "globals", "locals", "vars", "__builtins__", "importlib")
_IMPORT = "import "
#: More that is wrong would bury the first.
_MOST_TOLD = 4


@dataclass(frozen=True, slots=True)
class SourceFacts:
    """What stands in one file: for each kind, names and the first line of each.

    ``error``: it is no Python. ``cut``: there is more in it than is told here.
    """

    found: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    error: str = ""
    cut: bool = False

    @classmethod
    def read(cls, told: Any) -> SourceFacts:
        """From what the reader inside the walls returned, which is not believed to have any form."""
        if not isinstance(told, dict):
            return cls(error="it cannot be read")
        error = told.get("error")
        if isinstance(error, dict):
            line = f" (line {error['line']})" if isinstance(error.get("line"), int) else ""
            # With a line it is no Python, and cannot be imported either; else it is too large to be read.
            return cls(error=f"{str(error.get('text', ''))[:200]}{line}", cut=not line)
        return cls({group: _lines(told.get(group)) for group in _GROUPS}, cut=told.get("cut") is not False)


_NO_MODULES: Mapping[str, SourceFacts] = MappingProxyType({})


def judge_source(
    criterion: SourceRules, facts: SourceFacts | None, flags: Flags, modules: Mapping[str, SourceFacts] = _NO_MODULES
) -> Outcome:
    """``modules`` are the other Python files of the hand-in, by name, which the part may import."""
    whose = "your program" if criterion.part == "program" else "your responder"
    if facts is None:
        return failed(f"Expected {whose} to be handed in, but it was not.")
    if facts.error:
        return failed(f"Expected {whose} to be readable as Python, but: {facts.error}.")
    everywhere = {"": facts, **modules}
    wrong: list[str] = []
    count = 0
    for rule in criterion.uses:
        count += 1
        if all(_line(each, rule) is None for each in everywhere.values()):
            wrong.append(f"Expected {whose} to use {_words(rule)}, but it does not")
    for rule in criterion.avoids:
        count += 1
        but = next((but for name, each in everywhere.items() if (but := _has(each, rule, name))), "")
        if but:
            wrong.append(f"Expected {whose} to do without {_words(rule)}, but {but}")
    for rule in criterion.in_loop:
        count += 1
        if all(_called(each, "looped", rule) is None for each in everywhere.values()):
            wrong.append(f"Expected {whose} to call {rule} inside a loop, but it does not")
    for name in criterion.defines:
        count += 1
        if not any(name in each.found["functions"] for each in everywhere.values() if not each.error):
            wrong.append(f"Expected {whose} to define a function {name}, but it does not")
    for told in _missing_flags(criterion, flags):
        count += 1
        if told:
            wrong.append(f"Expected the magic line of {whose} to have {told}, but it does not")
    if not wrong:
        veiled = _veiled(everywhere) if criterion.avoids else ""
        return passed(f"The text of {whose} is as expected.{veiled}")
    return failed(f"{'. '.join(wrong[:_MOST_TOLD])}.", score=Fraction(count - len(wrong), count))


def _missing_flags(criterion: SourceRules, flags: Flags) -> list[str]:
    """For each flag that is asked for the flag if it is missing, else nothing."""
    if not criterion.flags:
        return []
    wanted = flags_in(criterion.flags)
    values = [
        "" if flags.values.get(short) == value else f"-{short} {value}"
        for short, value in sorted(wanted.values.items())
    ]
    return values + ["" if short in flags.switches else f"-{short}" for short in sorted(wanted.switches)]


def _has(facts: SourceFacts, rule: str, file: str) -> str:
    """Where the file has what ``rule`` means, called or taken to be called by another name; nothing if it has not."""
    line = _line(facts, rule)
    if line is None and rule.endswith("()"):
        line = _called(facts, "handed_on", rule)
    where = f" of {file}" if file else ""
    if line is not None:
        return f"line {line}{where} has it"
    return f"{file or 'it'} has too many names to be sure" if facts.cut else ""


def _veiled(files: Mapping[str, SourceFacts]) -> str:
    """A hint for whoever wants to look: what is avoided could hide there."""
    for file, facts in files.items():
        for name in _VEILED:
            line = _line(facts, name) or _line(facts, f"import {name}")
            if line is not None:
                where = f" of {file}" if file else ""
                return f" Line {line}{where} has {name}, which can do more than its text shows."
    return ""


def _line(facts: SourceFacts, rule: str) -> int | None:
    """The first line that has what a rule names."""
    if facts.error:
        return None
    if rule.endswith("()"):
        return _called(facts, "calls", rule)
    if rule in CONSTRUCTS:
        return facts.found["constructs"].get(rule)
    if rule.startswith(_IMPORT):
        module = rule.removeprefix(_IMPORT).strip()
        lines = [line for name, line in facts.found["imports"].items() if f"{name}.".startswith(f"{module}.")]
        return min(lines, default=None)
    lines = [line for name, line in facts.found["names"].items() if f".{rule}." in f".{name}."]
    return min(lines, default=None)


def _called(facts: SourceFacts, group: str, rule: str) -> int | None:
    if facts.error:
        return None
    pattern = rule.removesuffix("()")
    lines = [
        line
        for name, line in facts.found[group].items()
        if fnmatchcase(name, pattern) or fnmatchcase(name, f"*.{pattern}")
    ]
    return min(lines, default=None)


def _words(rule: str) -> str:
    if rule not in CONSTRUCTS:
        return rule
    return f"a {rule} loop" if rule in ("for", "while") else rule


def _lines(told: Any) -> dict[str, int]:
    if not isinstance(told, list):
        return {}
    pairs = [pair for pair in told if isinstance(pair, list) and len(pair) == 2]
    return {str(name): line for name, line in pairs if isinstance(line, int)}
