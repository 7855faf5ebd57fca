"""Mutants of a program: copies with one fault each, in a fixed order and number."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from service.mutation import program_operators, responder_operators  # noqa: F401 - they register their operators
from service.mutation.operators import OPERATORS
from service.mutation.source_tree import SourceTree, is_python
from submissions.submission import PART_FILES, Part

#: Far more than are graded. Longer texts give no more.
_MAX_CANDIDATES = 5000


@dataclass(frozen=True, slots=True)
class Mutant:
    """A program with one fault. ``old`` became ``new`` in this line, from 1, of ``file``; ``source`` is the result.

    ``line_text`` is the line before the change, with its indentation.
    """

    operator: str
    part: Part
    file: str
    line: int
    old: str
    new: str
    source: str
    start: int = 0  # offset of ``old`` in the original text
    line_text: str = ""


def make_mutants(text: str, part: Part, limit: int, file: str = "") -> tuple[Mutant, ...]:
    """Return at most ``limit`` mutants of a text in the order of their lines, spread over operators and lines.

    Raises:
        UsageError: The text is not Python.
    """
    mutants = choose_mutants(list(iterate_mutants(text, part, file)), limit)
    return tuple(sorted(mutants, key=lambda each: (each.start, each.operator)))


def iterate_mutants(text: str, part: Part, file: str = "") -> Iterator[Mutant]:
    """Yield all mutants of a text by operator, each text once. Raises UsageError if the text is not Python."""
    tree = SourceTree(text)
    known_sources = {text}
    # The operators of one part are more specific than the common ones.
    for operator in sorted(OPERATORS, key=lambda each: len(each.parts)):
        if part not in operator.parts:
            continue
        for edit in operator.find_edits(tree):
            source = tree.apply(edit)
            if source in known_sources or not is_python(source):
                continue
            known_sources.add(source)
            old = text[edit.start : edit.end]
            line = tree.find_line(edit.start)
            yield Mutant(
                operator.name,
                part,
                file or PART_FILES[part],
                line,
                old,
                edit.new,
                source,
                edit.start,
                tree.cut_line(line).rstrip(),
            )
            if len(known_sources) > _MAX_CANDIDATES:
                return


def choose_mutants(mutants: Sequence[Mutant], limit: int) -> list[Mutant]:
    """Return at most ``limit`` mutants: of each operator in turn, the next one on the line with the fewest so far."""
    remaining: dict[str, list[Mutant]] = {}
    for mutant in mutants:
        remaining.setdefault(mutant.operator, []).append(mutant)
    chosen: list[Mutant] = []
    line_counts: Counter[tuple[str, int]] = Counter()
    while remaining and len(chosen) < limit:
        for operator in list(remaining):
            if len(chosen) == limit:
                break
            candidates = remaining[operator]
            mutant = min(candidates, key=lambda each: line_counts[each.file, each.line])
            candidates.remove(mutant)
            if not candidates:
                del remaining[operator]
            line_counts[mutant.file, mutant.line] += 1
            chosen.append(mutant)
    return chosen
