"""A change by a regrade, and the summary of the changes of a batch."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from typing import Literal

from service.grading.class_statistics import PASS_SHARE
from service.store.states import ChangeStage, JobState, Standing


@dataclass(frozen=True, slots=True)
class CriterionChange:
    """A criterion whose marks differ, as (marks, maximum); None if that version of the assignment does not have it.

    ``by_hand`` is true if marks set by staff replace those of the new grade; their maximum may differ. ``crosses`` is
    true if the marks were full and no longer are, or the reverse, or if they are in another band.
    """

    title: str
    before: tuple[Decimal, Decimal] | None
    after: tuple[Decimal, Decimal] | None
    by_hand: bool
    stages: tuple[ChangeStage, ...] = ()
    crosses: bool = False


@dataclass(frozen=True, slots=True)
class Change:
    """A regrade and the grade that it may replace. Marks are None without a grade.

    ``stages`` are those of its criteria. ``changed_parts`` names the parts of the assignment that differ, except
    criteria, if the new version changed marks. ``crosses`` tells whether the share of all marks is now on the other
    side of the pass mark.
    """

    student: str
    job_id: str
    before_id: str
    state: JobState
    standing: Standing
    before: Decimal | None
    after: Decimal | None
    before_max: Decimal | None
    after_max: Decimal | None
    criteria: tuple[CriterionChange, ...]
    reason: str
    stages: tuple[ChangeStage, ...] = ()
    changed_parts: tuple[str, ...] = ()
    crosses: Literal["up", "down"] | None = None
    is_unexplained: bool = False

    @property
    def differs(self) -> bool:
        """Return whether the regrade is done and its marks or maximum differ."""
        return self.state is JobState.DONE and (self.before, self.before_max) != (self.after, self.after_max)

    @property
    def is_open_or_differs(self) -> bool:
        """Return whether the marks or their maximum differ, or are not available yet."""
        return self.after is None or (self.before, self.before_max) != (self.after, self.after_max)

    @property
    def direction(self) -> int:
        """Return 1 if the share of the marks is higher than before, -1 if it is lower, otherwise 0."""
        if self.before is None or self.after is None:
            return 0
        shares = compute_share(self.before, self.before_max), compute_share(self.after, self.after_max)
        return (shares[1] > shares[0]) - (shares[1] < shares[0])


@dataclass(frozen=True, slots=True)
class ChangesSummary:
    """Numbers of regrades: by change of marks, by stage, and by boundary.

    A regrade with several stages counts for each. ``higher``, ``lower``, ``same``, ``first_grades`` and ``ungraded``
    add up to ``regrades``. ``crossing_criteria`` is the number of regrades with a criterion that crosses a boundary.
    """

    regrades: int
    higher: int
    lower: int
    same: int
    first_grades: int
    ungraded: int
    stages: Mapping[ChangeStage, int]
    crossing_up: int
    crossing_down: int
    crossing_criteria: int
    pass_share: Decimal


def summarise_changes(changes: Sequence[Change], pass_share: Decimal = PASS_SHARE) -> ChangesSummary:
    """Return the numbers of these changes. ``pass_share`` is the boundary that they were loaded with."""
    compared = [change for change in changes if change.state is JobState.DONE and change.before is not None]
    first_grades = sum(change.state is JobState.DONE and change.before is None for change in changes)
    counts = Counter(stage for change in changes for stage in change.stages)
    directions = Counter(change.direction for change in compared)
    crossings = Counter(change.crosses for change in changes)
    return ChangesSummary(
        regrades=len(changes),
        higher=directions[1],
        lower=directions[-1],
        same=directions[0],
        first_grades=first_grades,
        ungraded=len(changes) - len(compared) - first_grades,
        stages={stage: counts[stage] for stage in ChangeStage if counts[stage]},
        crossing_up=crossings["up"],
        crossing_down=crossings["down"],
        crossing_criteria=sum(any(each.crosses for each in change.criteria) for change in changes),
        pass_share=pass_share,
    )


def compute_share(marks: Decimal, max_marks: Decimal | None) -> Fraction:
    """Return the share of the maximum, 0 without a maximum."""
    return Fraction(marks) / Fraction(max_marks) if max_marks else Fraction(0)
