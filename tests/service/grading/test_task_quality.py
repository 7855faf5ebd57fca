"""Figures on a task from the marks of a batch: values computed by hand, and synthetic batches with known faults."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal
from math import sqrt

import numpy as np
import pytest

from service.grading.class_statistics import MarkedCriterion, MarkedSubmission
from service.grading.task_quality import TaskQuality, assess_task

pytestmark = pytest.mark.fast

_MAX_MARKS = (1, 2, 3, 4, 4, 6)


def _build_batch(
    rows: Sequence[Sequence[float | None]], max_marks: Sequence[int], hidden: Sequence[int] = ()
) -> list[MarkedSubmission]:
    """Return a submission for each row of shares; None means that the criterion is excused."""
    submissions = []
    for number, row in enumerate(rows):
        criteria = tuple(
            MarkedCriterion(
                f"c{column}", f"Does {column}", Decimal(repr(float(share))) * worth, Decimal(worth), column in hidden
            )
            for column, (share, worth) in enumerate(zip(row, max_marks, strict=True))
            if share is not None
        )
        total = sum((each.marks for each in criteria), Decimal(0))
        worth = Decimal(sum(max_marks))
        submissions.append(MarkedSubmission(f"s{number}", "walk", total, worth, "finished", criteria))
    return submissions


def _list_findings(quality: TaskQuality) -> set[tuple[str, tuple[str, ...]]]:
    return {(finding.kind, finding.criteria) for finding in quality.findings}


def _draw_batch(seed: int, *, faulty: bool) -> list[MarkedSubmission]:
    """Return a batch of 200 to 400 submissions whose shares depend on one ability.

    In a faulty one, criterion 3 is a coin, and criterion 5 always agrees with criterion 1.
    """
    generator = np.random.default_rng(1000 + seed)
    n = int(generator.integers(200, 401))
    ability = generator.normal(size=(n, 1))
    skill = ability + generator.normal(scale=0.9, size=(n, len(_MAX_MARKS)))
    difficulty = generator.uniform(-0.9, 0.9, size=len(_MAX_MARKS))
    # Two criteria give a part of their marks, as measured criteria do; the others all or none.
    shares = (skill > difficulty).astype(float)
    shares[:, :2] = ((skill > difficulty).astype(float) + (skill > difficulty - 0.6))[:, :2] / 2
    if faulty:
        shares[:, 3] = generator.integers(0, 2, size=n)
        shares[:, 5] = shares[:, 1]
    return _build_batch(shares.tolist(), _MAX_MARKS)


def test_planted_faults_are_found_and_clean_batches_have_no_finding() -> None:
    for seed in range(20):
        findings = _list_findings(assess_task(_draw_batch(seed, faulty=True)))
        assert findings == {("discrimination", ("c3",)), ("agreement", ("c1", "c5"))}, seed
        assert not _list_findings(assess_task(_draw_batch(seed, faulty=False))), seed


def test_figures_computed_by_hand() -> None:
    """Ten submissions with marks of (2, 2): five have all; two have only the first; one only the second; two none."""
    rows = [(1, 1)] * 5 + [(1, 0)] * 2 + [(0, 1)] + [(0, 0)] * 2
    first, second = assess_task(_build_batch(rows, (2, 2))).criteria
    # Means 0.7 and 0.6, variances 0.21 and 0.24, covariance 0.5 - 0.42 = 0.08.
    phi = 0.08 / sqrt(0.21 * 0.24)
    assert (first.facility, second.facility) == pytest.approx((0.7, 0.6))
    assert (first.discrimination, second.discrimination) == pytest.approx((phi, phi))
    # Covariances with the total: 4 * (0.21 + 0.08) and 4 * (0.24 + 0.08).
    roots = sqrt(0.29), sqrt(0.32)
    assert (first.effective_weight, second.effective_weight) == pytest.approx(
        tuple(root / sum(roots) for root in roots)
    )
    assert first.intended_weight == 0.5
    for each in (first, second):
        assert each.facility_interval[0] < each.facility < each.facility_interval[1]


def test_the_interval_of_a_facility_is_that_of_a_binomial_share() -> None:
    rows = [(1, 1)] * 120 + [(0, 1)] * 80
    (criterion, _) = assess_task(_build_batch(rows, (2, 2))).criteria
    half_width = 1.96 * sqrt(0.6 * 0.4 / 200)
    assert criterion.facility_interval == pytest.approx((0.6 - half_width, 0.6 + half_width), abs=0.012)


def test_undefined_figures_are_none() -> None:
    """The first criterion has no variance. The second has a negative covariance with the total."""
    rows = [(1, 0, 1)] * 8 + [(1, 1, 0)] * 8
    constant, contrary, heavy = assess_task(_build_batch(rows, (1, 1, 5))).criteria
    assert (constant.discrimination, constant.effective_weight) == (None, 0)
    assert (contrary.discrimination, contrary.effective_weight) == (pytest.approx(-1), None)
    assert contrary.effective_weight_interval is None
    assert heavy.effective_weight == 1


def test_the_order_of_the_submissions_does_not_matter() -> None:
    submissions = _draw_batch(3, faulty=True)
    assert assess_task(submissions[::-1]) == assess_task(submissions)


def test_other_criteria_make_up_for_an_excused_one() -> None:
    submissions = _build_batch([(1, 1)] * 10 + [(0, 0)] * 10 + [(1, None)] * 5, (2, 2))
    first, second = assess_task(submissions).criteria
    assert (first.facility, second.facility) == pytest.approx((0.6, 0.5))
    assert second.discrimination == pytest.approx(1)


def test_criteria_that_all_pass_or_nobody_passes() -> None:
    rows = [(1, 0, number % 2) for number in range(20)]
    assert _list_findings(assess_task(_build_batch(rows, (2, 2, 2)))) >= {("all-full", ("c0",)), ("all-lost", ("c1",))}


def test_two_criteria_that_nearly_all_pass_may_agree() -> None:
    rows = [(number > 1, number > 1, number % 2) for number in range(40)]
    assert "agreement" not in {kind for kind, _ in _list_findings(assess_task(_build_batch(rows, (2, 2, 2))))}


def test_a_criterion_with_far_too_little_weight() -> None:
    """Half of the marks are for something that all but one do."""
    rows = [(number >= 1, number >= 100, number >= 140, number >= 120) for number in range(240)]
    assert _list_findings(assess_task(_build_batch(rows, (10, 3, 4, 3)))) == {("weight", ("c0",))}


def test_programs_that_fit_only_the_visible_trials() -> None:
    rows = [(1, 1)] * 12 + [(1, 0.25)] * 5 + [(0, 0)] * 4
    quality = assess_task(_build_batch(rows, (2, 4), hidden=(1,)))
    assert quality.hidden_shares is not None
    assert (quality.hidden_shares.visible, quality.hidden_shares.overfitted) == (pytest.approx(17 / 21), 5)
    assert quality.hidden_shares.hidden == pytest.approx(13.25 / 21)
    (finding,) = [each for each in quality.findings if each.kind == "overfit"]
    assert (finding.criteria, finding.sentence[:7]) == (("c1",), "5 of 21")
    assert assess_task(_build_batch(rows, (2, 4))).hidden_shares is None


def test_too_few_submissions_have_a_note_only() -> None:
    quality = assess_task(_build_batch([(1, 0)] * 9, (2, 2)))
    assert (quality.criteria, quality.findings, quality.n) == ((), (), 9)
    assert "at least 10 graded submissions; there are 9." in quality.note
    assert not assess_task([replace(each, criteria=()) for each in _build_batch([(1,)] * 12, (2,))]).criteria
