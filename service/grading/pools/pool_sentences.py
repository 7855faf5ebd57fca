"""Sentences about a value over a pool: whether it is exact, and between which bounds it lies.

Students see values over hidden trials in steps of 5 %, and no numbers of trials.
"""

from __future__ import annotations

import math
from dataclasses import replace

from service.grading.grade import PoolValue
from service.grading.judging.marks import Over
from sim.sentences import Sentence, join_sentences

_STUDENTS_STEP = 5  # per cent
_CERTAINTY = 95  # per cent; see ``ERROR_OF_GRADE``


def describe_for_staff(value: PoolValue, rule: Over) -> PoolValue:
    """Return the value with a note: whether the marks are exact or provisional, and the bounds in per cent."""
    if value.is_exact:
        return replace(value, note=Sentence("Exact: all %(size)s trials of the pool were run.", size=value.size))
    drawn = Sentence("Provisional: %(drawn)s of %(size)s trials were run.", drawn=value.drawn, size=value.size)
    return replace(value, note=join_sentences(drawn, _describe_bounds(value, rule, 1), _describe_decision(value)))


def describe_for_students(value: PoolValue, rule: Over) -> PoolValue:
    """Return the value that students see if trials of the pool are hidden, with a note."""
    least, most = round_outwards(value, _STUDENTS_STEP)
    if value.is_exact:
        note = Sentence("Exact: all trials of the pool were run.")
        return replace(value, least=least / 100, most=most / 100, note=note)
    bounds = _describe_bounds(value, rule, _STUDENTS_STEP)
    provisional = Sentence("Provisional: not all trials were run yet.")
    sentences = (provisional, bounds, _describe_decision(value))
    return replace(value, drawn=0, least=least / 100, most=most / 100, note=join_sentences(*sentences))


def _describe_bounds(value: PoolValue, rule: Over, step: int) -> str:
    least, most = round_outwards(value, step)
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


def round_outwards(value: PoolValue, step: int) -> tuple[int, int]:
    """Return the bounds in per cent, as multiples of ``step`` that are still true."""
    least = step * math.floor(round(value.least * 100 / step, 6))
    return least, step * math.ceil(round(value.most * 100 / step, 6))


def _describe_decision(value: PoolValue) -> str:
    if value.is_decided:
        return Sentence("These marks are decided.")
    return Sentence("These marks can still change.")
