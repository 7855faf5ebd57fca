"""Base class of criteria, the requirements they check, and the types of their text lists.

Each kind of criterion is in the module of its family.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field

from sim.errors import UsageError
from sim.floors import Floor
from submissions.assignment.scenario import Scenario
from submissions.strict_table import Entries, StrictTable


def as_tuple(value: object) -> object:
    """Return a list with one entry for a single text."""
    if isinstance(value, str):
        return (value,)
    return tuple(value) if isinstance(value, list) else value


def _check_not_blank(value: Texts) -> Texts:
    if not all(text.strip() for text in value):
        raise ValueError("has an empty text in it, which every text contains, expected something to look for")
    return value


Texts = tuple[str, ...]
#: Marks a list that would ask for nothing if it were empty. An explicit empty list is an error.
NOT_EMPTY = "not empty"
#: Rejects a text that every text contains.
NotBlank = AfterValidator(_check_not_blank)
SomeTexts = Annotated[Texts, NOT_EMPTY]
TextOrTexts = Annotated[Texts, BeforeValidator(as_tuple)]
SomeTextOrTexts = Annotated[TextOrTexts, NOT_EMPTY]
#: Marks a key that may name a file beside the assignment. Students must not read this file.
HOLDS_ANSWERS = "holds answers"


@dataclass(frozen=True, slots=True)
class AssignmentContext:
    """The parts of an assignment around a criterion, as far as they could be read."""

    scenarios: Sequence[Scenario] = ()
    ground: Floor | None = None
    without: frozenset[str] = frozenset()  # parts (program, responder) set to ``none``
    agents: frozenset[str] = frozenset()
    robots: int = 1
    files: Mapping[str, bytes] = field(default_factory=dict)
    aliases: Mapping[str, Texts] = field(default_factory=dict)
    criteria: Sequence[Criterion] = ()

    def find_scenarios(self, criterion: Criterion) -> Iterator[Scenario]:
        """Return the scenarios of the criterion."""
        for scenario in self.scenarios:
            if not criterion.scenarios or scenario.id in criterion.scenarios:
                yield scenario


class UnmetRequirement(UsageError):
    """A requirement of a criterion that the assignment does not meet: the key and the problem."""

    def __init__(self, key: str, sentence: str) -> None:
        super().__init__(sentence)
        self.key, self.sentence = key, sentence


def _remove_padding(marks: Decimal) -> Decimal:
    """Return marks with at most two decimal places, which are all zeros beyond them: 0E-400000000 becomes 0.00."""
    exponent = marks.as_tuple().exponent
    return marks if isinstance(exponent, int) and exponent >= -2 else marks.quantize(Decimal("0.01"))


class Criterion(StrictTable):
    """Base class of all criteria. ``scenarios`` names the scenarios it applies to; empty means all.

    With ``needs``, the id of another criterion, it gets marks only if that one gets at least half of its marks.

    A kind of criterion is a subclass with ``check: Literal["its name"]``.
    """

    id: str = Field(default="", pattern=r"^[a-z0-9][a-z0-9_-]*$|^$", max_length=80)  # defaults to a form of the title
    check: str  # the kind of criterion
    title: str = Field(min_length=1, max_length=200)
    marks: Annotated[Decimal, AfterValidator(_remove_padding)] = Field(ge=0, le=10000, decimal_places=2)
    scenarios: SomeTexts = ()
    robot: Literal[1, 2] = 1  # the robot it applies to, if there are two
    #: how trials are converted to marks
    over: Literal["share", "all", "mean", "median", "worst"] = "share"
    visibility: Literal["visible", "hidden", "after_due_date", "after_published"] = "visible"
    needs: str | None = Field(default=None, min_length=1, max_length=80)
    #: [share, marks]: the marks from a share of the pool on, for a scenario with a pool
    bands: tuple[Annotated[tuple[float, float], Entries("[share, marks]")], ...] = ()

    #: True if it judges each trial by itself and combines the trials by ``over``.
    judges_each_trial: ClassVar[bool] = True
    #: True if it judges runs of the robot, False if it judges only code.
    judges_runs: ClassVar[bool] = True
    #: Names of the values it measures in a trial. # matches a number from 1, ... matches any words.
    measures: ClassVar[Texts] = ()

    @property
    def asks_responder(self) -> bool:
        """Return whether it judges answers of a responder."""
        return False

    @property
    def questions(self) -> Texts:
        """The texts sent to a responder, if its answers alone decide; empty if the robot matters too."""
        return ()

    @property
    def parts_needed(self) -> frozenset[str]:
        """The parts that must exist for this criterion."""
        if self.questions:
            return frozenset({"responder"})
        return frozenset({"program", "responder"} if self.asks_responder else {"program"})

    @property
    def result_needed(self) -> str | None:
        """The id of the criterion that must be judged first."""
        return self.needs

    def can_measure(self, name: str) -> bool:
        """Return whether it measures a value with this name."""
        patterns = (re.escape(each).replace(r"\#", r"[1-9]\d*").replace(r"\.\.\.", r".+") for each in self.measures)
        return any(re.fullmatch(each, name) for each in patterns)

    @property
    def python_files(self) -> Texts:
        """The files beside the assignment that run during judging."""
        return ()

    def complete_from(self, context: AssignmentContext) -> Self:
        """Return the criterion completed with data from the rest of the assignment.

        Raises:
            UnmetRequirement: The data cannot be read.
        """
        return self

    def find_unmet_requirements(self, context: AssignmentContext) -> Iterator[UnmetRequirement]:
        """Yield all requirements that the assignment does not meet."""
        yield from ()


class CriterionWithStrays(Criterion):
    """Base class of criteria that look for items among everything a program prints, says, sends or logs.

    A program that outputs every possible item would also output the expected ones. Therefore extra items count as
    strays. An expected item in the wrong position is one stray; 20 other items of the same type are one stray.
    ``strays`` is the number allowed without a penalty; the default is the number of expected items. Each further stray
    reduces the score as much as one missing item.
    """

    strays: int | None = Field(default=None, ge=0)
