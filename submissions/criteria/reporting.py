"""Criteria about what a program reports: the right figures, in the right order, at the right place.

Single texts and how often they come are asked in ``texts.py``, words one after the other in ``sequence.py``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

from pydantic import Field, field_serializer, field_validator

from submissions.criteria.common import AmongMany, Misfit, NotBlank, Surroundings, TextOrTexts, Texts
from submissions.criteria.places import Zone
from submissions.strict_table import StrictTable

Source = Literal["print", "speech", "either"]
_MOST_FOR_LABELS = 0.49  # less than half of the distance between the numbers of two labels


class Reports(AmongMany):
    """Printed, said or answered figures and words are those that belong to the pose.

    ``expected`` has a list for each pose of the scenario, or a single one for all poses; each entry, a number
    or a text, must come in this order somewhere in what the program prints and says (``source`` narrows it
    down; ``reply`` looks at the responder's answers). Numbers are met within ``tolerance``, texts as whole
    words without regard to case; after a text, the next entry is one of the first numbers, or of the first texts
    in ``expected``, that follow it. ``among`` lists the words to choose from: any of them that is not expected
    is wrong, so that saying all of them does not help; so is a report that has the entries of other poses as well,
    if it has those of more than half of all poses. ``only`` asks that no other number is reported.
    ``expected = "label"`` is what the floor has under the left light sensor at the start; any other label of the
    floor is wrong, as with ``among``. The entries before a missing one are worth nothing if as many entries of more
    than half of all poses are reported, unless these poses have the same answer.
    """

    check: Literal["reports"]
    measures: ClassVar[Texts] = ("reported #",)
    source: Literal["print", "speech", "either", "reply"] = "either"
    expected: Literal["label"] | tuple[tuple[float | str, ...], ...]
    tolerance: float = Field(default=0.5, ge=0)
    among: Annotated[Texts, NotBlank] = ()
    only: bool = False

    @property
    def asks_responder(self) -> bool:
        """Whether it looks at answers alone."""
        return self.source == "reply"

    @property
    def leeway(self) -> float:
        """How far off a number may be; for a label at most so far that no number is two labels."""
        return self.tolerance if self.expected != "label" else min(self.tolerance, _MOST_FOR_LABELS)

    @field_validator("expected", mode="plain")
    @classmethod
    def _rows(cls, value: object) -> object:
        if value == "label":
            return value
        rows = value if isinstance(value, list | tuple) else ()
        if rows and all(isinstance(row, list | tuple) and row and all(map(_entry, row)) for row in rows):
            return tuple(tuple(row) for row in rows)
        raise ValueError('is neither "label" nor a list of lists, expected [[100, "white"], ...], one for each pose')

    def misfits(self, around: Surroundings) -> Iterator[Misfit]:
        """Lists for single poses must be as many as each scenario has poses."""
        if self.expected == "label" or len(self.expected) == 1:
            return
        for scenario in around.looked_at_by(self):
            if len(self.expected) != len(scenario.poses):
                yield Misfit(
                    "expected",
                    f"expected has {len(self.expected)} lists for the {len(scenario.poses)} poses of scenario "
                    f'"{scenario.id}", expected one list for each pose, or one for all',
                )

    @field_serializer("expected")
    def _plain_rows(
        self, value: Literal["label"] | tuple[tuple[float | str, ...], ...]
    ) -> str | list[list[int | float | str]]:
        # Pydantic's own takes neither the whole numbers nor the nesting.
        return value if isinstance(value, str) else [list(row) for row in value]


class EventAt(StrictTable):
    """A text, and the zone that the sensor must be in when it comes."""

    text: TextOrTexts = Field(min_length=1)  # any of these
    zone: Zone


class Events(AmongMany):
    """Each text is said or printed, in this order, while the sensor is where it belongs.

    ``events`` are tables ``{ text = "1", zone = [left, bottom, right, top] }``; a text is found anywhere in
    what is said, as whole words, number words counting as numbers. One that is said in the zone of another text
    does not count. The sensor (``middle`` is the middle of
    the axle) may be up to ``margin`` mm outside of the zone.
    """

    check: Literal["events"]
    measures: ClassVar[Texts] = ("x at ...",)
    source: Source = "either"
    sensor: Literal["left", "right", "middle"] = "left"
    events: tuple[EventAt, ...] = Field(min_length=1)
    margin: float = Field(default=0.0, ge=0)


def _entry(value: object) -> bool:
    if isinstance(value, str):
        return any(c.isalnum() for c in value)
    return isinstance(value, int | float) and not isinstance(value, bool)
