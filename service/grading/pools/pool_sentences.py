"""Sentences about a value over a pool: whether it is exact, and between which bounds it lies.

Students see values over hidden trials in steps of 5 %, and no numbers of trials.
"""

from __future__ import annotations

import math

from service.grading.grade import PoolValue
from service.grading.judging.outcome import Over
from sim.sentences import Sentence, join_sentences

_CERTAINTY = 95  # per cent; see ``ERROR_OF_GRADE``


def describe_pool_value(value: PoolValue, rule: Over) -> str:
    """Return whether the marks are exact or provisional, and the bounds in per cent."""
    if value.is_exact:
        return Sentence("Exact: all %(size)s trials of the pool were run.", size=value.size)
    drawn = Sentence("Provisional: %(drawn)s of %(size)s trials were run.", drawn=value.drawn, size=value.size)
    return join_sentences(drawn, _describe_bounds(value, rule, 1), _describe_decision(value))


def describe_public_value(value: PoolValue, rule: Over) -> str:
    """Return the same for students if trials of the pool are hidden."""
    if value.is_exact:
        return Sentence("Exact: all trials of the pool were run.")
    bounds = _describe_bounds(value, rule, 5)
    return join_sentences(Sentence("Provisional: not all trials were run yet."), bounds, _describe_decision(value))


def _describe_bounds(value: PoolValue, rule: Over, step: int) -> str:
    # Rounded outwards, so that they stay true.
    least = step * math.floor(round(value.least * 100 / step, 6))
    most = step * math.ceil(round(value.most * 100 / step, 6))
    match rule:
        case "share":
            return Sentence(
                "With %(certainty)s %% certainty, %(least)s to %(most)s %% of all trials are as expected.",
                certainty=_CERTAINTY,
                least=least,
                most=most,
            )
        case "mean":
            return Sentence(
                "With %(certainty)s %% certainty, the mean over all trials is %(least)s to %(most)s %%.",
                certainty=_CERTAINTY,
                least=least,
                most=most,
            )
    return ""


def _describe_decision(value: PoolValue) -> str:
    if value.is_decided:
        return Sentence("These marks are decided.")
    return Sentence("These marks can still change.")
