"""The penalty for output that names everything, for criteria that search for items in a lot of output.

The modules of the families find the stray items. Criteria with ``only`` allow no stray items and are handled there.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from service.grading.findings import StrayItems
from service.grading.judging.outcome import Outcome, fail_with
from sim.sentences import Sentence, join_sentences
from submissions.criteria.common import CriterionWithStrays

#: This many irrelevant items weigh as much as one required item in a wrong place.
_OTHERS_PER_ITEM = 20


@dataclass(frozen=True, slots=True)
class Strays:
    """Stray items: output that was not required. ``words`` is a clause that describes it."""

    words: str
    misplaced: int = 0  # required items in a wrong place
    others: int = 0  # items of the same kind that are not required

    @property
    def weight(self) -> Fraction:
        """The weight, as a number of required items."""
        return self.misplaced + Fraction(self.others, _OTHERS_PER_ITEM)


def apply_stray_penalty(outcome: Outcome, criterion: CriterionWithStrays, count: int, strays: Strays) -> Outcome:
    """Reduce the outcome for ``count`` items: strays beyond the allowed number count like additional missing items."""
    excess = strays.weight - (count if criterion.strays is None else criterion.strays)
    if excess <= 0:
        return outcome
    return fail_with(
        join_sentences(
            outcome.message,
            Sentence(
                "Also, %(strays)s. This costs marks. Give only the required answers, not every possible one.",
                strays=strays.words,
            ),
        ),
        outcome.t,
        outcome.pose,
        outcome.score * count / (count + excess),
        outcome.measures,
        outcome.for_staff,
        (*outcome.findings, StrayItems(strays.misplaced + strays.others, outcome.passed)),
    )
