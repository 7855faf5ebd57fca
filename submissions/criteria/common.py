"""What every criterion has, what an assignment must have around it, and the types of its lists of texts.

No kind of criterion is here; each has a module of its family.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field

from sim.errors import UsageError
from sim.floors import Floor
from submissions.strict_table import StrictTable

if TYPE_CHECKING:
    from submissions.assignment.definition import Scenario


def one_or_many(value: object) -> object:
    """A single text stands for a list of one."""
    if isinstance(value, str):
        return (value,)
    return tuple(value) if isinstance(value, list) else value


def _not_blank(value: Texts) -> Texts:
    if not all(text.strip() for text in value):
        raise ValueError("has an empty text in it, which every text contains, expected something to look for")
    return value


Texts = tuple[str, ...]
#: Marks a list that asks for nothing, and so is a mistake, where it is written with nothing in it.
NOT_EMPTY = "not empty"
#: Refuses a text that is part of every text.
NotBlank = AfterValidator(_not_blank)
SomeTexts = Annotated[Texts, NOT_EMPTY]
TextOrTexts = Annotated[Texts, BeforeValidator(one_or_many)]
SomeTextOrTexts = Annotated[TextOrTexts, NOT_EMPTY]
#: Marks a key that may name a file beside the assignment which no student may read.
HOLDS_ANSWERS = "holds answers"


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What an assignment has around a criterion, as far as it could be read."""

    scenarios: Sequence[Scenario] = ()
    ground: Floor | None = None
    without: frozenset[str] = frozenset()  # the parts, program and responder, that nobody writes
    agents: frozenset[str] = frozenset()
    robots: int = 1
    files: Mapping[str, bytes] = field(default_factory=dict)
    aliases: Mapping[str, Texts] = field(default_factory=dict)
    criteria: Sequence[Criterion] = ()

    def looked_at_by(self, criterion: Criterion) -> Iterator[Scenario]:
        """The scenarios of the criterion."""
        for scenario in self.scenarios:
            if not criterion.scenarios or scenario.id in criterion.scenarios:
                yield scenario


class Misfit(UsageError):
    """What a criterion asks and the assignment does not have: the key that asks, and what is wrong with it."""

    def __init__(self, key: str, sentence: str) -> None:
        super().__init__(sentence)
        self.key, self.sentence = key, sentence


class Criterion(StrictTable):
    """What every criterion has. ``scenarios`` names those it looks at; all, if empty.

    A kind is a class below this one with ``check: Literal["its name"]``.
    """

    id: str = Field(default="", pattern=r"^[a-z0-9][a-z0-9_-]*$|^$", max_length=80)  # from the title, if not given
    check: str  # the kind
    title: str = Field(min_length=1, max_length=200)
    marks: Decimal = Field(ge=0, le=10000, decimal_places=2)
    scenarios: SomeTexts = ()
    robot: Literal[1, 2] = 1  # which one it looks at, where there are two
    #: how the trials become marks
    over: Literal["share", "all", "mean", "median", "worst"] = "share"
    visibility: Literal["visible", "hidden", "after_due_date", "after_published"] = "visible"

    #: Whether it looks at runs of the robot; else at the code alone.
    judges_runs: ClassVar[bool] = True
    #: The figures that it measures in a trial, by name; # stands for a number from 1, ... for any words.
    measures: ClassVar[Texts] = ()

    @property
    def asks_responder(self) -> bool:
        """Whether it looks at what a responder answers."""
        return False

    @property
    def questions(self) -> Texts:
        """The texts for a responder by whose answers alone it judges; without any it looks at the robot as well."""
        return ()

    @property
    def parts_needed(self) -> frozenset[str]:
        """The parts without which there is nothing to look at."""
        if self.questions:
            return frozenset({"responder"})
        return frozenset({"program", "responder"} if self.asks_responder else {"program"})

    @property
    def result_needed(self) -> str | None:
        """The id of the criterion that has to be judged before it."""
        return None

    def measures_a(self, name: str) -> bool:
        """Whether it measures a figure of this name."""
        known = (re.escape(each).replace(r"\#", r"[1-9]\d*").replace(r"\.\.\.", r".+") for each in self.measures)
        return any(re.fullmatch(each, name) for each in known)

    @property
    def python_files(self) -> Texts:
        """The files beside the assignment that are run to judge it."""
        return ()

    def completed(self, around: Surroundings) -> Self:
        """The criterion with what the assignment says elsewhere. Raises Misfit where that cannot be read."""
        return self

    def misfits(self, around: Surroundings) -> Iterator[Misfit]:
        """All that it asks and that is not there."""
        yield from ()


class AmongMany(Criterion):
    """One that looks for something among all that a program prints, says, sends or logs.

    Whoever names everything has named what is looked for as well, so strays count: a thing that is looked for and came
    where it does not belong is one, twenty other things of its sort are another. ``strays`` is how many cost nothing,
    as many as things are looked for if not given; each further one lowers the score like one more thing that was
    looked for and did not come.
    """

    strays: int | None = Field(default=None, ge=0)
