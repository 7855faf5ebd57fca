"""What naming everything is worth: the one rule for criteria that look for something among much that was put out.

What is a stray is found in the modules of the families; where nothing may come beside, ``only`` asks that there.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from service.grading.judging.outcome import Outcome, failed
from submissions.criteria.common import AmongMany

#: So many things beside the point weigh like one that was looked for and came where it does not belong.
_OTHERS = 20


@dataclass(frozen=True, slots=True)
class Strays:
    """What came beside what was looked for; ``words`` tell of it in a sentence, after "besides"."""

    words: str
    misplaced: int = 0  # of what is looked for, where it does not belong
    others: int = 0  # of the same sort, and not looked for

    @property
    def weight(self) -> Fraction:
        """How many things that were looked for they weigh."""
        return self.misplaced + Fraction(self.others, _OTHERS)


def tempered(outcome: Outcome, criterion: AmongMany, wanted: int, strays: Strays) -> Outcome:
    """The outcome of looking for ``wanted`` things; strays that are not forgiven count like more that did not come."""
    excess = strays.weight - (wanted if criterion.strays is None else criterion.strays)
    if excess <= 0:
        return outcome
    return failed(
        f"{outcome.message} Besides, {strays.words}, which costs marks: naming everything is not finding it.",
        outcome.t,
        outcome.pose,
        outcome.score * wanted / (wanted + excess),
        outcome.measures,
        outcome.for_staff,
    )
