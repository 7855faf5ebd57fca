"""Criteria about a program's reports: right values, right order, right place.

Criteria about single texts are in ``texts.py``; word sequences are in ``sequence.py``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

from pydantic import Field, field_serializer, field_validator

from submissions.criteria.common import (
    AssignmentContext,
    CriterionWithStrays,
    NotBlank,
    TextOrTexts,
    Texts,
    UnmetRequirement,
)
from submissions.criteria.places import Range, Zone
from submissions.strict_table import StrictTable

Source = Literal["print", "speech", "either"]
_MAX_LABEL_TOLERANCE = 0.49  # less than half of the distance between the numbers of two labels


class Reading(StrictTable):
    """A reading of a light sensor: its reflected light in percent, [least, most]."""

    light: Literal["left", "right"] = "left"
    reflected: Range


class Reports(CriterionWithStrays):
    """Numbers and words in the output match the pose.

    ``expected`` has a list for each pose of the scenario, or one list for all poses. The entries, numbers or texts,
    must occur in this order in the program's printed and spoken output. ``source`` selects part of the output;
    ``reply`` selects the responder's answers. Numbers may differ by ``tolerance``; texts match whole words, ignoring
    case. After a text, the next entry must be among the first numbers, or the first texts in ``expected``, that follow
    it.

    Guessing does not help:

    - Any other word of ``among`` is wrong.
    - A report is wrong if it also has the entries of more than half of all poses.
    - Entries before a missing one get no marks if the report has as many entries of more than half of all poses, unless
      these poses have the same answer.
    - With ``only``, no other number may be reported.

    Only reports in ``zone`` (of the left light sensor) and from the first reading ``after`` on count, if given.

    ``expected = "label"`` is the floor's label under the left light sensor at the start. Any other label of the floor
    is wrong, as with ``among``.
    """

    check: Literal["reports"]
    measures: ClassVar[Texts] = ("reported #",)
    source: Literal["print", "speech", "either", "reply"] = "either"
    expected: Literal["label"] | tuple[tuple[float | str, ...], ...]
    tolerance: float = Field(default=0.5, ge=0)
    among: Annotated[Texts, NotBlank] = ()
    only: bool = False
    zone: Zone | None = None
    after: Reading | None = None

    @property
    def asks_responder(self) -> bool:
        """Return whether it judges answers alone."""
        return self.source == "reply"

    @property
    def leeway(self) -> float:
        """The maximum difference of numbers. For labels, it is small enough that no number matches two labels."""
        return self.tolerance if self.expected != "label" else min(self.tolerance, _MAX_LABEL_TOLERANCE)

    @field_validator("expected", mode="plain")
    @classmethod
    def _parse_expected(cls, value: object) -> object:
        if value == "label":
            return value
        rows = value if isinstance(value, list | tuple) else ()
        if rows and all(isinstance(row, list | tuple) and row and all(map(_is_entry, row)) for row in rows):
            return tuple(tuple(row) for row in rows)
        raise ValueError('is neither "label" nor a list of lists, expected [[100, "white"], ...], one for each pose')

    def find_unmet_requirements(self, context: AssignmentContext) -> Iterator[UnmetRequirement]:
        """Yield a problem for each scenario whose number of poses differs from the number of lists."""
        if self.expected == "label" or len(self.expected) == 1:
            return
        for scenario in context.find_scenarios(self):
            if len(self.expected) != len(scenario.poses):
                yield UnmetRequirement(
                    "expected",
                    f"expected has {len(self.expected)} lists for the {len(scenario.poses)} poses of scenario "
                    f'"{scenario.id}", expected one list for each pose, or one for all',
                )

    @field_serializer("expected")
    def _serialise_rows(
        self, value: Literal["label"] | tuple[tuple[float | str, ...], ...]
    ) -> str | list[list[int | float | str]]:
        # Pydantic's validation does not accept the integers or the nesting.
        return value if isinstance(value, str) else [list(row) for row in value]


class EventAt(StrictTable):
    """A text, and the zone of the sensor at that time."""

    text: TextOrTexts = Field(min_length=1)  # any of these
    zone: Zone


class Events(CriterionWithStrays):
    """Each text is said or printed, in this order, while the sensor is in its zone.

    ``events`` are tables ``{ text = "1", zone = [left, bottom, right, top] }``. Texts match whole words anywhere in the
    output; number words match numbers. A text said in the zone of another text does not count. The sensor (``middle``:
    the middle of the axle) may be up to ``margin`` mm outside the zone.
    """

    check: Literal["events"]
    measures: ClassVar[Texts] = ("x at ...",)
    source: Source = "either"
    sensor: Literal["left", "right", "middle"] = "left"
    events: tuple[EventAt, ...] = Field(min_length=1)
    margin: float = Field(default=0.0, ge=0)


def _is_entry(value: object) -> bool:
    if isinstance(value, str):
        return any(c.isalnum() for c in value)
    return isinstance(value, int | float) and not isinstance(value, bool)
