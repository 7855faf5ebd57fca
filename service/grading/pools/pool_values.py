"""Values of criteria over a pool: the bounds on them after the trials that were drawn, and the marks they decide.

``pass_bounds`` and ``mean_bounds`` contain the statistics. A value is provisional until every trial of its pool was
run; it may be decided before, if all values within its bounds give the same marks.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from service.grading.grade import PoolValue
from service.grading.judging.marks import Over, combine_outcomes
from service.grading.judging.outcome import Outcome
from service.grading.pools.mean_bounds import bound_mean
from service.grading.pools.pass_bounds import bound_passes
from submissions.criteria import Criterion

#: The declared probability that any mark of a grade is decided wrongly, shared by its criteria.
ERROR_OF_GRADE = Fraction(1, 20)


def compute_pool_share(
    criterion: Criterion, outcomes: Sequence[Outcome], size: int, error: Fraction
) -> tuple[Fraction, PoolValue]:
    """Return the fraction of a criterion's marks, and its value over the pool.

    Args:
        criterion: The criterion, with the rule that combines trials and the bands of its marks.
        outcomes: The outcomes of the drawn trials, in the order of drawing.
        size: The number of trials of the pool.
        error: The probability that the bounds are ever wrong.
    """
    least, most = bound_value(outcomes, criterion.over, size, error)
    least_share, most_share = _find_band(criterion, least), _find_band(criterion, most)
    is_decided = least_share == most_share
    estimate = min(max(combine_outcomes(outcomes, criterion.over), least), most)
    share = least_share if is_decided else _find_band(criterion, estimate)
    return share, PoolValue(size, len(outcomes), float(least), float(most), is_decided)


def bound_value(outcomes: Sequence[Outcome], rule: Over, size: int, error: Fraction) -> tuple[Fraction, Fraction]:
    """Return the least and the greatest value that the whole pool can have, from 0 to 1. Equal for a whole pool.

    A value over all trials, and the worst one, are bounded by what is known for certain: one failure decides the
    first, and only the whole pool the other. So is the median.
    """
    if len(outcomes) == size:
        value = combine_outcomes(outcomes, rule)
        return value, value
    if rule == "share":
        passes = bound_passes(size, [outcome.passed for outcome in outcomes], error)
        return Fraction(passes.least, size), Fraction(passes.most, size)
    if rule == "mean":
        mean = bound_mean(size, [float(outcome.score) for outcome in outcomes], float(error))
        return Fraction(mean.least), Fraction(mean.most)
    missing_count = size - len(outcomes)
    failure, success = Outcome(False, Fraction(0), ""), Outcome(True, Fraction(1), "")
    return (
        combine_outcomes([*outcomes, *[failure] * missing_count], rule),
        combine_outcomes([*outcomes, *[success] * missing_count], rule),
    )


def _find_band(criterion: Criterion, value: Fraction) -> Fraction:
    """Return the fraction of the marks for this value: the value itself, if the criterion has no bands."""
    if not criterion.bands or not criterion.marks:
        return value
    # The decimals that the instructor wrote, not their nearest binary fractions.
    reached_marks = [marks for start, marks in criterion.bands if value >= Fraction(str(start))]
    return Fraction(str(reached_marks[-1])) / Fraction(criterion.marks) if reached_marks else Fraction(0)
