"""How well an assignment measures: facility, discrimination and weight of its criteria, from the marks of a batch.

A pure function of existing marks, with bootstrap intervals of 95 %. The same marks give the same figures, in any order.
The figures follow https://docs.moodle.org/dev/Quiz_statistics_calculations, except that the discrimination is that of
classical test theory: the correlation of a criterion with the total of the *other* criteria.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from service.grading.class_statistics import MarkedCriterion, MarkedSubmission
from sim.sentences import Sentence, join_sentences, join_with_and

#: The smallest batch with figures.
MIN_SUBMISSIONS = 10
_RESAMPLES, _SEED = 1000, 29
_PERCENTILES = (2.5, 97.5)
#: Below it, an item is marginal or poor (Ebel, R. L. (1965), Measuring Educational Achievement, Prentice-Hall).
_GOOD_DISCRIMINATION = 0.3
#: A criterion that nearly all submissions pass cannot reach it, so half of the highest possible value is enough.
_GOOD_EFFICIENCY = 0.5
#: An effective weight differs from the intended one if its whole interval differs by more than this factor.
_WEIGHT_FACTOR = 2.0
#: Criteria agree by chance if nearly all submissions get the same, so this many have to lose marks, and not to.
_MIN_ON_EACH_SIDE = 3
_MIN_OVERFITTED, _MIN_OVERFITTED_SHARE, _OVERFITTED_HIDDEN_SHARE = 3, 0.1, 0.5
#: Differences due to floating-point numbers. Shares are 0 to 1, and a variance of marks is at least about 1e-8.
_TINY = 1e-9

_Floats = NDArray[np.float64]


class Interval(NamedTuple):
    """The bootstrap interval of a figure."""

    low: float
    high: float


@dataclass(frozen=True, slots=True)
class CriterionQuality:
    """The figures of one criterion. Each interval is None where its figure is None.

    ``discrimination`` is None without variance, and if there are no other criteria. ``effective_weight`` is None if the
    marks and the total have a negative covariance, and without variance of the total.
    """

    id: str
    title: str
    facility: float  # the mean share of its marks, 0 to 1
    facility_interval: Interval
    discrimination: float | None  # -1 to 1
    discrimination_interval: Interval | None
    intended_weight: float  # its share of all marks, 0 to 1
    effective_weight: float | None  # its share of the spread of the total, 0 to 1
    effective_weight_interval: Interval | None


@dataclass(frozen=True, slots=True)
class QualityFinding:
    """A reason to look at the assignment again; ``criteria`` contains the ids of the affected criteria."""

    kind: Literal["all-full", "all-lost", "discrimination", "agreement", "weight", "overfit"]
    criteria: tuple[str, ...]
    sentence: str


@dataclass(frozen=True, slots=True)
class HiddenShares:
    """Mean shares of marks in criteria that students see completely, and in criteria with hidden trials."""

    visible: float
    hidden: float
    overfitted: int  # submissions with all marks of the visible criteria, and less than half of the hidden ones


@dataclass(frozen=True, slots=True)
class TaskQuality:
    """The figures of one assignment from ``n`` submissions. If there are too few, only ``note`` says so."""

    n: int
    criteria: tuple[CriterionQuality, ...]
    findings: tuple[QualityFinding, ...]
    hidden_shares: HiddenShares | None  # None if all trials are visible, or none is
    note: str = ""


@dataclass(frozen=True, slots=True)
class _Marks:
    """The marks of a batch: a row for each submission, a column for each criterion."""

    criteria: tuple[MarkedCriterion, ...]
    shares: _Floats  # an excused criterion has the share of the others, which make up for it
    has_marks: NDArray[np.bool_]
    max_marks: _Floats  # of each criterion


def assess_task(submissions: Sequence[MarkedSubmission]) -> TaskQuality:
    """Return the figures and findings of an assignment from its submissions in one batch.

    Criteria that are worth no marks are left out.
    """
    n = len(submissions)
    if n < MIN_SUBMISSIONS:
        note = Sentence(
            "Figures on the task need at least %(least)s graded submissions; there are %(count)s.",
            least=MIN_SUBMISSIONS,
            count=n,
        )
        return TaskQuality(n, (), (), None, note)
    marks = _collect_marks(submissions)
    if not marks.criteria:
        return TaskQuality(n, (), (), None)
    qualities = _assess_criteria(marks)
    hidden_shares = _compare_hidden(marks)
    findings = (
        *_find_constant(marks, qualities),
        *_find_agreeing(marks),
        *_find_undiscriminating(marks, qualities),
        *_find_misweighted(marks, qualities),
        *_find_overfit(marks, hidden_shares),
    )
    return TaskQuality(n, qualities, findings, hidden_shares)


def _collect_marks(submissions: Sequence[MarkedSubmission]) -> _Marks:
    """Return the marks as matrices."""
    criteria: dict[str, MarkedCriterion] = {}
    for submission in submissions:
        for criterion in submission.criteria:
            if criterion.max_marks:
                criteria.setdefault(criterion.id, criterion)
    columns = {criterion: column for column, criterion in enumerate(criteria)}
    shares = np.full((len(submissions), len(columns)), np.nan)
    for row, submission in enumerate(submissions):
        for criterion in submission.criteria:
            if criterion.max_marks:
                shares[row, columns[criterion.id]] = criterion.marks / criterion.max_marks
    has_marks = ~np.isnan(shares)
    max_marks = np.array([float(each.max_marks) for each in criteria.values()])
    totals = np.where(has_marks, shares, 0.0) @ max_marks
    mean_shares = totals / np.maximum(has_marks @ max_marks, _TINY)
    filled_shares = np.where(has_marks, shares, mean_shares[:, np.newaxis]).round(9)
    return _Marks(tuple(criteria.values()), filled_shares, has_marks, max_marks)


def _assess_criteria(marks: _Marks) -> tuple[CriterionQuality, ...]:
    """Return the figures of each criterion with their intervals."""
    kinds, counts = np.unique(np.hstack([marks.shares, marks.has_marks]), axis=0, return_counts=True)
    shares, has_marks = np.hsplit(kinds, 2)
    n = int(counts.sum())
    # Equal rows are resampled together: many submissions have the same marks. The kinds of rows are sorted, so that the
    # order of the submissions, which depends on the reader if names are hidden, does not change the figures.
    resamples = np.random.default_rng(_SEED).multinomial(n, counts / n, size=_RESAMPLES)
    weights = np.vstack([counts, resamples]).astype(np.float64)
    facilities, discriminations, effective_weights = _compute_figures(weights, shares, has_marks, marks.max_marks)
    intended_weights = marks.max_marks / marks.max_marks.sum()
    qualities = []
    for column, criterion in enumerate(marks.criteria):
        facility, discrimination, effective_weight = (
            figures[:, column] for figures in (facilities, discriminations, effective_weights)
        )
        qualities.append(
            CriterionQuality(
                criterion.id,
                criterion.title,
                float(facility[0]),
                _compute_interval(facility[1:]),
                *_estimate(discrimination),
                float(intended_weights[column]),
                *_estimate(effective_weight, if_undefined=0.0),
            )
        )
    return tuple(qualities)


def _compute_figures(
    weights: _Floats, shares: _Floats, has_marks: _Floats, max_marks: _Floats
) -> tuple[_Floats, _Floats, _Floats]:
    """Return facilities, discriminations and effective weights, with a row for each row of ``weights``.

    NaN stands for undefined figures.
    """
    own_marks = shares * max_marks
    other_marks = own_marks.sum(axis=1, keepdims=True) - own_marks
    counts = weights @ has_marks
    with np.errstate(divide="ignore", invalid="ignore"):
        own_means, other_means = (weights @ (has_marks * each) / counts for each in (own_marks, other_marks))
        own_variances, other_variances = (
            _drop_noise(weights @ (has_marks * each**2) / counts - means**2)
            for each, means in ((own_marks, own_means), (other_marks, other_means))
        )
        covariances = weights @ (has_marks * own_marks * other_marks) / counts - own_means * other_means
        discriminations = np.clip(covariances / np.sqrt(own_variances * other_variances), -1.0, 1.0)
        covariances_with_total = covariances + own_variances
        # Moodle leaves negative covariances out of the sum.
        roots = np.sqrt(np.where(covariances_with_total > _TINY, covariances_with_total, 0.0))
        effective_weights = roots / roots.sum(axis=1, keepdims=True)
    discriminations[~np.isfinite(discriminations)] = np.nan
    effective_weights[covariances_with_total < -_TINY] = np.nan
    return own_means / max_marks, discriminations, effective_weights


def _drop_noise(variances: _Floats) -> _Floats:
    return np.where(variances > _TINY, variances, 0.0)


def _estimate(figures: _Floats, if_undefined: float = np.nan) -> tuple[float | None, Interval | None]:
    """Return a figure and its interval, from its value for the batch and for each resample.

    A resample without a value counts as ``if_undefined``, or not at all.
    """
    if np.isnan(figures[0]):
        return None, None
    return float(figures[0]), _compute_interval(np.nan_to_num(figures[1:], nan=if_undefined))


def _compute_interval(figures: _Floats) -> Interval:
    defined_figures = figures[~np.isnan(figures)]
    if not len(defined_figures):
        return Interval(np.nan, np.nan)
    low, high = np.percentile(defined_figures, _PERCENTILES)
    return Interval(float(low), float(high))


def _find_constant(marks: _Marks, qualities: Sequence[CriterionQuality]) -> Iterator[QualityFinding]:
    for column, quality in enumerate(qualities):
        count = int(marks.has_marks[:, column].sum())
        if count < MIN_SUBMISSIONS:
            continue
        if quality.facility > 1 - _TINY:
            sentence = Sentence(
                "%(title)s: all %(count)s submissions have full marks, so it does not influence their order.",
                title=quality.title,
                count=count,
            )
            yield QualityFinding("all-full", (quality.id,), sentence)
        elif quality.facility < _TINY:
            sentence = Sentence(
                "%(title)s: none of %(count)s submissions has any marks. Check the task and the criterion.",
                title=quality.title,
                count=count,
            )
            yield QualityFinding("all-lost", (quality.id,), sentence)


def _find_agreeing(marks: _Marks) -> Iterator[QualityFinding]:
    columns_by_shares: dict[bytes, list[int]] = {}
    for column in range(len(marks.criteria)):
        shares = np.where(marks.has_marks[:, column], marks.shares[:, column], np.nan)
        columns_by_shares.setdefault(shares.tobytes(), []).append(column)
    for columns in columns_by_shares.values():
        shares = marks.shares[marks.has_marks[:, columns[0]], columns[0]]
        losing_count = int((shares < 1 - _TINY).sum())
        if len(columns) < 2 or min(losing_count, len(shares) - losing_count) < _MIN_ON_EACH_SIDE:
            continue
        criteria = [marks.criteria[column] for column in columns]
        quoted_titles = [Sentence('"%(title)s"', title=each.title) for each in criteria]
        sentence = Sentence(
            "%(titles)s always agree: each submission has the same share of the marks in all of them. "
            "They measure the same thing.",
            titles=join_with_and(quoted_titles),
        )
        yield QualityFinding("agreement", tuple(each.id for each in criteria), sentence)


def _find_undiscriminating(marks: _Marks, qualities: Sequence[CriterionQuality]) -> Iterator[QualityFinding]:
    for column, quality in enumerate(qualities):
        if not _is_undiscriminating(marks, column, quality) or quality.discrimination_interval is None:
            continue
        sentence = Sentence(
            "%(title)s: strong submissions lose its marks about as often as weak ones. Its discrimination is "
            "%(value).2f (95 %%: %(low).2f to %(high).2f), expected at least %(good).1f.",
            title=quality.title,
            value=quality.discrimination,
            low=quality.discrimination_interval.low,
            high=quality.discrimination_interval.high,
            good=_GOOD_DISCRIMINATION,
        )
        yield QualityFinding("discrimination", (quality.id,), sentence)


def _is_undiscriminating(marks: _Marks, column: int, quality: CriterionQuality) -> bool:
    interval = quality.discrimination_interval
    if interval is None or interval.high >= _GOOD_DISCRIMINATION:
        return False
    has_marks = marks.has_marks[:, column]
    other_shares = np.delete(marks.shares, column, axis=1) @ np.delete(marks.max_marks, column)
    # The best submissions would lose the least.
    highest = float(np.corrcoef(np.sort(marks.shares[has_marks, column]), np.sort(other_shares[has_marks]))[0, 1])
    return interval.high < _GOOD_EFFICIENCY * highest


def _find_misweighted(marks: _Marks, qualities: Sequence[CriterionQuality]) -> Iterator[QualityFinding]:
    """Yield the criteria with another weight than intended, unless another finding explains a small one.

    Because of the root in its definition, the effective weight of a criterion with good discrimination grows with the
    root of its marks. Between independent criteria, it grows with the marks. Both are as intended.
    """
    spreads = marks.shares.std(axis=0)
    roots = np.sqrt(marks.max_marks)
    for column, quality in enumerate(qualities):
        if quality.effective_weight is None or quality.effective_weight_interval is None or spreads[column] < _TINY:
            continue
        low, high = quality.effective_weight_interval
        intended_low, intended_high = sorted((quality.intended_weight, float(roots[column] / roots.sum())))
        is_heavier = low > intended_high * _WEIGHT_FACTOR
        is_lighter = high < intended_low / _WEIGHT_FACTOR and not _is_undiscriminating(marks, column, quality)
        if is_heavier or is_lighter:
            sentence = Sentence(
                "%(title)s: it has %(intended).0f %% of all marks, but its effective weight is %(effective).0f %% "
                "(95 %% interval %(low).0f %% to %(high).0f %%).",
                title=quality.title,
                intended=100 * quality.intended_weight,
                effective=100 * quality.effective_weight,
                low=100 * low,
                high=100 * high,
            )
            yield QualityFinding("weight", (quality.id,), sentence)


def _compare_hidden(marks: _Marks) -> HiddenShares | None:
    is_hidden = np.array([criterion.has_hidden_trials for criterion in marks.criteria])
    if is_hidden.all() or not is_hidden.any():
        return None
    has_both = marks.has_marks[:, is_hidden].any(axis=1) & marks.has_marks[:, ~is_hidden].any(axis=1)
    if not has_both.any():
        return None
    visible_shares, hidden_shares = (
        np.average(marks.shares[has_both][:, columns], axis=1, weights=marks.max_marks[columns])
        for columns in (~is_hidden, is_hidden)
    )
    is_overfitted = (visible_shares > 1 - _TINY) & (hidden_shares < _OVERFITTED_HIDDEN_SHARE)
    return HiddenShares(float(visible_shares.mean()), float(hidden_shares.mean()), int(is_overfitted.sum()))


def _find_overfit(marks: _Marks, hidden_shares: HiddenShares | None) -> Iterator[QualityFinding]:
    if hidden_shares is None:
        return
    n = len(marks.shares)
    if hidden_shares.overfitted >= max(_MIN_OVERFITTED, _MIN_OVERFITTED_SHARE * n):
        counts = Sentence(
            "%(count)s of %(n)s submissions have all marks without hidden trials, but less than half of the marks with "
            "hidden trials.",
            count=hidden_shares.overfitted,
            n=n,
        )
        shares = Sentence(
            "The mean shares of marks are %(visible).0f %% and %(hidden).0f %%.",
            visible=100 * hidden_shares.visible,
            hidden=100 * hidden_shares.hidden,
        )
        criteria = tuple(each.id for each in marks.criteria if each.has_hidden_trials)
        yield QualityFinding("overfit", criteria, join_sentences(counts, shares))
