"""The line of a part with which one change loses nothing: a statement of the reference, a repair, a mutant, a number.

The changes are tried one after the other, the likely ones first, until the budget is used up.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from decimal import Decimal
from itertools import chain, zip_longest

from service.grading.reruns.answer_repairs import (
    ExpectedTexts,
    collect_expected_texts,
    collect_keys,
    complete_json,
    use_expected_texts,
    use_other_keys,
)
from service.grading.reruns.changed_numbers import list_number_changes
from service.grading.reruns.engine import BudgetSpent, Rerun, RerunEngine, RunTooLong
from service.grading.reruns.exchanges import ChangedLine, GivenPart, PartName, RecordedLines
from service.grading.reruns.halves import list_student_parts
from service.grading.reruns.output_repairs import list_output_repairs
from service.grading.reruns.reference_statements import list_reference_statements
from service.grading.reruns.repairs import (
    Repair,
    add_waits,
    add_waits_after_messages,
    declare_globals,
    exchange_operands,
    exchange_sides,
    move_into_and_out_of_loops,
    remove_statements,
    reread_values,
    return_values,
    set_flags,
    shift_indices,
    stop_motors,
)
from service.grading.run_plan import RunPlan
from service.mutation.mutants import choose_mutants, iterate_mutants
from service.mutation.source_tree import SourceTree, is_python
from sim.errors import UsageError
from submissions.submission import Part

#: Operators whose mutants can be what the author meant, and those whose mutants rarely are, or can be endless.
_OPERATORS = frozenset({"comparison", "condition", "label swapped", "off by one", "port", "sign"})
_LATE_OPERATORS = frozenset({"swapped statements", "while and if", "wrong unit"})
_MAX_MUTANTS = 40
#: With more differences, the two programs are not versions of each other.
_MAX_DIFFERENCES = 6


def find_changed_line(
    engine: RerunEngine,
    criterion: str,
    parts: Sequence[PartName],
    known_changes: Sequence[ChangedLine] = (),
    reference: RunPlan | None = None,
) -> Rerun | None:
    """Return the rerun with the change that loses nothing for a criterion; None if the budget shows none.

    Of several changes, the one that loses the fewest marks for all criteria counts, then the one that was tried first.

    Args:
        engine: The engine.
        criterion: The id of a criterion that lost marks.
        parts: The parts to change.
        known_changes: Changes that are tried first, if they are of these parts.
        reference: The plan of the reference, if its statements may take the place of the student's.

    Raises:
        HostError: The machine failed.
    """
    search = _LineSearch(engine, criterion, dict(_read_parts(engine, parts)), reference)
    with suppress(BudgetSpent):
        search.run([each for each in known_changes if each.part in parts])
    return search.best


def _read_parts(engine: RerunEngine, parts: Sequence[PartName]) -> Iterator[tuple[PartName, SourceTree]]:
    """Yield the parts that are Python."""
    for part in parts:
        text = engine.get_source(part)
        if text is not None:
            with suppress(UsageError):
                yield part, SourceTree(text)


class _LineSearch:
    """One search: the changes of the parts in the order in which they are tried, and the best one so far."""

    def __init__(
        self, engine: RerunEngine, criterion: str, trees: Mapping[PartName, SourceTree], reference: RunPlan | None
    ) -> None:
        self.best: Rerun | None = None
        self._engine, self._criterion, self._trees, self._reference = engine, criterion, trees, reference
        #: For each text that was tried, whether it changes a recording.
        self._effects: dict[str, bool] = {}

    def run(self, known_changes: Sequence[ChangedLine]) -> None:
        """Try the changes until one loses nothing for any criterion. Raises BudgetSpent, HostError."""
        for change in chain(known_changes, self._list_changes()):
            if change.text not in self._effects:
                self._effects[change.text] = self._try_change(change)
            if self.best is not None and not count_lost_marks(self.best):
                return

    def _try_change(self, change: ChangedLine) -> bool:
        """Run the trials with a change. Return whether it changes a recording."""
        try:
            rerun = self._engine.rerun_criterion(self._criterion, (change,))
        except RunTooLong:
            return True
        is_better = self.best is None or count_lost_marks(rerun) < count_lost_marks(self.best)
        if rerun.passes(self._criterion) and is_better:
            self.best = rerun
        return any(rerun.recordings[each].sha256 != rerun.originals[each].sha256 for each in rerun.trials)

    def _list_changes(self) -> Iterator[ChangedLine]:
        for part in self._trees:
            yield from self._list_changes_by_reference(part)
        expected = collect_expected_texts(self._engine.assignment)
        yield from self._build_all(lambda part, tree: _list_likely_repairs(part, tree, expected))
        yield from self._build_all(lambda part, tree: use_other_keys(tree, self._collect_other_keys(part)))
        mutants = chain.from_iterable(_list_mutants(part, tree, _OPERATORS) for part, tree in self._trees.items())
        shifted = self._build_all(lambda _, tree: shift_indices(tree))
        numbers = list_number_changes(self._engine, self._criterion, self._trees, self._has_effect)
        pairs = zip_longest(chain(mutants, shifted), numbers)
        yield from (each for pair in pairs for each in pair if each is not None)
        yield from self._build_all(_list_unlikely_repairs)
        for part, tree in self._trees.items():
            yield from _list_mutants(part, tree, _LATE_OPERATORS)
        yield from self._build_all(lambda _, tree: remove_statements(tree))

    def _collect_other_keys(self, part: PartName) -> list[str]:
        """Return the keys of the other parts that students write."""
        others = [each for each in list_student_parts(self._engine.assignment) if each != part]
        return [key for _, tree in _read_parts(self._engine, others) for key in collect_keys(tree)]

    def _list_changes_by_reference(self, part: PartName) -> Iterator[ChangedLine]:
        """Yield what the reference's text and output suggest for a part; nothing without a reference that has it."""
        tree, text = self._trees[part], None if self._reference is None else self._reference.get_source(part)
        if self._reference is None or text is None:
            return
        changes = list(_build_changes(part, tree, list_reference_statements(tree, SourceTree(text))))
        if len(changes) <= _MAX_DIFFERENCES:
            yield from changes
        trial = self._choose_trial()
        rerun = self._engine.rerun((trial,), (GivenPart(part, self._reference),))
        own = self._engine.results[trial].recording
        yield from _build_changes(part, tree, list_output_repairs(tree, own, rerun.recordings[trial]))

    def _build_all(self, list_repairs: Callable[[PartName, SourceTree], Iterable[Repair]]) -> Iterator[ChangedLine]:
        """Yield the repairs of all parts, without those in blocks of the program that the trial does not reach."""
        for part, tree in self._trees.items():
            lines = self._list_lines_with_calls() if part == "program" else frozenset()
            for change in _build_changes(part, tree, list_repairs(part, tree)):
                if not lines or _is_block_reached(tree, change.line, lines):
                    yield change

    def _list_lines_with_calls(self) -> frozenset[int]:
        """Return the lines from which the program calls its robot in a failed trial; empty if they are not known."""
        trial = self._choose_trial()
        recording = self._engine.rerun((trial,), (RecordedLines(),)).recordings[trial]
        return frozenset(line for each in recording.places for line in (each.line, each.outer))

    def _choose_trial(self) -> int:
        engine, criterion = self._engine, self._criterion
        return next(iter((*engine.list_failed_trials(criterion), *engine.list_trials(criterion))))

    def _has_effect(self, change: ChangedLine) -> bool:
        return self._effects[change.text]


def count_lost_marks(rerun: Rerun) -> Decimal:
    """Return the marks of all criteria that still lose some."""
    return sum((each.max_marks for name, each in rerun.outcomes.items() if rerun.loses(name)), Decimal(0))


def _list_likely_repairs(part: PartName, tree: SourceTree, expected: ExpectedTexts) -> Iterator[Repair]:
    """Yield the repairs of common mistakes of which a program has few places."""
    yield from use_expected_texts(tree, expected)
    if "program" in part:
        yield from chain(stop_motors(tree), add_waits_after_messages(tree))
    else:
        yield from chain(return_values(tree), complete_json(tree, expected))
    yield from chain(declare_globals(tree), reread_values(tree), set_flags(tree))
    yield from chain(exchange_operands(tree), exchange_sides(tree))


def _list_unlikely_repairs(part: PartName, tree: SourceTree) -> Iterator[Repair]:
    yield from move_into_and_out_of_loops(tree)
    if "program" in part:
        yield from add_waits(tree)


def _list_mutants(part: PartName, tree: SourceTree, operators: frozenset[str]) -> Iterator[ChangedLine]:
    """Yield mutants that can be what the author meant."""
    kind: Part = "program" if "program" in part else "responder"
    # A loop that never begins passes whatever needs only an end.
    mutants = [
        each
        for each in iterate_mutants(tree.text, kind)
        if each.operator in operators and "while False" not in each.source
    ]
    for mutant in choose_mutants(mutants, _MAX_MUTANTS):
        yield ChangedLine(part, mutant.line, mutant.old, mutant.new, mutant.source)


def _build_changes(part: PartName, tree: SourceTree, repairs: Iterable[Repair]) -> Iterator[ChangedLine]:
    """Yield the changes of a part that leave it Python."""
    for repair in repairs:
        text = tree.apply(repair.edit)
        if text != tree.text and is_python(text):
            old = tree.text[repair.edit.start : repair.edit.end]
            yield ChangedLine(part, repair.line, old, repair.edit.new.strip(), text, repair.kind)


def _is_block_reached(tree: SourceTree, line: int, lines_with_calls: Collection[int]) -> bool:
    """Return whether the block with the statement at a line can be reached: it has such a line, or is a function's."""
    statements = [each for each in tree.nodes if isinstance(each, ast.stmt)]
    inside = [each for each in statements if each.lineno <= line <= (each.end_lineno or line)]
    if not inside:
        return True
    statement = max(inside, key=lambda each: (each.lineno, each.col_offset))
    block = next((each for each in tree.iterate_ancestors(statement) if isinstance(each, ast.stmt)), None)
    if block is None or isinstance(block, ast.FunctionDef):
        return True
    return any(block.lineno <= each <= (block.end_lineno or each) for each in lines_with_calls)
