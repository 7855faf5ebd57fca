"""The line of a part with which one change loses nothing: a number, a sign, a comparison, a port, an order.

The changes are those that the mutation operators make of programs, and numbers that are much larger or smaller.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from decimal import Decimal

from service.grading.number_roles import describe_direction, find_direction, find_role
from service.grading.reruns.engine import BudgetSpent, Rerun, RerunEngine, RunTooLong
from service.grading.reruns.exchanges import ChangedLine, PartName, get_part_file
from service.mutation.mutants import choose_mutants, iterate_mutants
from service.mutation.operators import format_number
from service.mutation.source_tree import Edit, SourceTree
from sim.errors import UsageError
from sim.sentences import Sentence
from submissions.submission import Part

#: Operators whose mutants can be what the author meant. The others only take something away.
_OPERATORS = frozenset(
    {
        "comparison",
        "condition",
        "label swapped",
        "off by one",
        "port",
        "sign",
        "swapped statements",
        "while and if",
        "wrong unit",
    }
)
_MAX_MUTANTS = 40
_FACTORS = (1.5, 1 / 1.5, 2.0, 0.5, 1.2, 1 / 1.2, 3.0, 1 / 3)


def find_changed_line(engine: RerunEngine, criterion: str, parts: Sequence[PartName]) -> Rerun | None:
    """Return the rerun with the change that loses nothing for a criterion; None if the budget shows none.

    Of several changes, the one that gives the most marks for all criteria counts, then the one that was tried first.

    Raises:
        HostError: The machine failed.
    """
    best: Rerun | None = None
    try:
        for change in _list_changes(engine, parts):
            try:
                rerun = engine.rerun_criterion(criterion, (change,))
            except RunTooLong:
                continue
            if rerun.passes(criterion) and (best is None or _count_marks(rerun) > _count_marks(best)):
                best = rerun
                if all(each.marks >= each.max_marks for each in rerun.outcomes.values()):
                    break
    except BudgetSpent:
        pass
    return best


def _count_marks(rerun: Rerun) -> Decimal:
    return sum((each.marks for each in rerun.outcomes.values()), Decimal(0))


def _list_changes(engine: RerunEngine, parts: Sequence[PartName]) -> Iterator[ChangedLine]:
    """Yield the changes of all parts, those of the operators first."""
    texts = {part: text for part in parts if (text := engine.get_source(part)) is not None}
    trees: dict[PartName, SourceTree] = {}
    for part, text in texts.items():
        try:
            trees[part] = SourceTree(text)
        except UsageError:
            continue
        yield from _list_mutants(part, text)
    for factor in _FACTORS:
        for part, tree in trees.items():
            yield from _list_scaled_numbers(part, tree, factor)


def _list_mutants(part: PartName, text: str) -> Iterator[ChangedLine]:
    kind: Part = "program" if "program" in part else "responder"
    mutants = [each for each in iterate_mutants(text, kind) if each.operator in _OPERATORS]
    # The last ones can make loops endless, which is expensive.
    for mutant in sorted(choose_mutants(mutants, _MAX_MUTANTS), key=lambda each: each.operator == "while and if"):
        yield ChangedLine(part, mutant.line, mutant.old, mutant.new, mutant.source)


def _list_scaled_numbers(part: PartName, tree: SourceTree, factor: float) -> Iterator[ChangedLine]:
    for number in tree.numbers:
        role = find_role(tree, number)
        is_whole = isinstance(number.value, int) and role in ("index", "loop")
        value = round(number.value * factor) if is_whole else float(f"{number.value * factor:.3g}")
        if value == number.value:
            continue
        new = format_number(int(value) if float(value).is_integer() else value)
        place = Sentence("line %(line)s of %(name)s", line=number.line, name=get_part_file(part))
        yield ChangedLine(
            part,
            number.line,
            tree.text[number.start : number.end],
            new,
            tree.apply(Edit(number.start, number.end, new)),
            describe_direction(role, find_direction(number.value, value, role), place),
        )
