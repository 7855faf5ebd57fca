"""Several pictures of one pattern, sent while the robot drives over it, made into one answer.

Pictures belong together if they show the same thing at the same place, whenever they were sent.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from service.grading.judging.naming import Naming
from service.grading.judging.outcome import listed

How = Literal["first", "any", "majority"]


def by_pattern(pictures: Sequence[Naming], how: How, apart: float) -> list[Naming]:
    """One naming for each pattern among a trial's ``pictures``, in the order in which the robot came to them.

    Pictures of the same truth that were taken at most ``apart`` mm from the first of them are of one pattern.
    """
    groups: list[list[Naming]] = []
    for picture in pictures:
        group = next((group for group in groups if _same(group[0], picture, apart)), None)
        if group is None:
            groups.append([picture])
        else:
            group.append(picture)
    return [_one(group, how) for group in groups]


def _same(first: Naming, other: Naming, apart: float) -> bool:
    if first.image is None or other.image is None or first.truth != other.truth:
        return False
    one, two = first.image.pose, other.image.pose
    return math.hypot(one.x - two.x, one.y - two.y) <= apart


def _one(group: Sequence[Naming], how: How) -> Naming:
    match how:
        case "first":
            return group[0]
        case "any":
            return next((naming for naming in group if naming.right), group[0])
        case "majority":
            return _majority(group)


def _majority(group: Sequence[Naming]) -> Naming:
    """The picture whose answer was given most often; silence counts only if nothing was answered."""
    counts = Counter(naming.answer for naming in group if naming.answer is not None).most_common()
    if not counts:
        return group[0]
    most = counts[0][1]
    leaders = tuple(str(answer) for answer, count in counts if count == most)
    if len(leaders) > 1:
        words = f"{listed(leaders)} were answered equally often for its {len(group)} pictures"
        return replace(group[0], answer=None, words=words)
    chosen = next(naming for naming in group if naming.answer == leaders[0])
    return replace(chosen, words=f"it was taken for {listed(leaders)} {most} times in {len(group)} pictures")
