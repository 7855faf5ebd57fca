"""What can be marked without code: one schema for each kind of criterion, told apart by ``check``.

Judging is the service's (``service/grading``); this only says what is asked, and refuses what cannot be
asked.

Every criterion is judged once a trial. A trial passes or fails, and has a score between 0 and 1: the part
of what was asked that was reached (3 of 5 lines in order, 2 of 3 messages answered), 1 exactly when it
passes. ``over`` turns the trials into marks: ``share`` is the share of trials that pass, ``all`` is
everything or nothing, ``mean``, ``median`` and ``worst`` are taken over the scores. Marks are rounded half
up, once, to two places.

Texts are compared without regard to spaces at the ends and to the length of runs of spaces.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from submissions.criteria.classification import Classification
from submissions.criteria.common import CriterionBase
from submissions.criteria.ending import EndPose, Finishes
from submissions.criteria.texts import LONGEST_MATCHED_TEXT, Messages, Prints, Replies, Says

__all__ = [
    "LONGEST_MATCHED_TEXT",
    "SCHEMAS",
    "Classification",
    "Criterion",
    "EndPose",
    "Finishes",
    "Messages",
    "Prints",
    "Replies",
    "Says",
]

Criterion = Annotated[
    Finishes | Prints | Says | Messages | Replies | Classification | EndPose, Field(discriminator="check")
]

#: The schema for each value of ``check``.
SCHEMAS: dict[str, type[CriterionBase]] = {
    "finishes": Finishes,
    "prints": Prints,
    "says": Says,
    "messages": Messages,
    "replies": Replies,
    "classification": Classification,
    "pose": EndPose,
}
