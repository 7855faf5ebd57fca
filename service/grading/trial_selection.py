"""An assignment with only some of its trials, for experiments with changed programs. Their worlds stay the same."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields

from submissions.assignment.definition import Assignment, Trial
from submissions.criteria import AnyCriterion
from submissions.seeds import PUBLIC_SECRET, SeedSource

#: A trial by its scenario and its index in the scenario.
TrialKey = tuple[str, int]


@dataclass(frozen=True, slots=True)
class PartialAssignment(Assignment):
    """An assignment of which only the trials in ``selected`` are run. Its marks do not count."""

    selected: frozenset[TrialKey] = frozenset()

    def trials(self, secret: SeedSource = PUBLIC_SECRET) -> Iterator[Trial]:
        """Return the selected trials, as in the whole assignment."""
        # Dataclasses with slots are copies of the class, which ``super()`` does not know.
        return (each for each in Assignment.trials(self, secret) if (each.scenario.id, each.index) in self.selected)


def select_trials(assignment: Assignment, selected: Iterable[TrialKey]) -> PartialAssignment:
    """Return the assignment with only these trials."""
    values = {each.name: getattr(assignment, each.name) for each in fields(Assignment)}
    return PartialAssignment(**values, selected=frozenset(selected))


def needs_every_trial(criterion: AnyCriterion, assignment: Assignment) -> bool:
    """Return whether a criterion loses marks as soon as it fails in one trial."""
    is_tolerant = criterion.over == "median" or criterion.bands or assignment.find_pool(criterion) is not None
    return criterion.judges_each_trial and not is_tolerant
