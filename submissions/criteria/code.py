"""Criteria about the code that was submitted: what its text has, what its functions return, and checks in Python.

Only what is asked; the text is read and the functions are called by the service, inside the walls.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, field_validator, model_validator

from sim.errors import UsageError
from submissions.assignment.truth_file import read_table
from submissions.criteria.common import HOLDS_ANSWERS, Criterion, Misfit, Surroundings, TextOrTexts, Texts
from submissions.magics import Flags, parse_magic
from submissions.strict_table import StrictTable

#: The words that stand for a construct; any other is a name.
CONSTRUCTS = (
    "for",
    "while",
    "if",
    "else",
    "break",
    "continue",
    "def",
    "return",
    "class",
    "lambda",
    "try",
    "with",
    "global",
    "list",
    "dict",
    "comprehension",
)
#: Begins what names a module.
IMPORT = "import "


class SourceRules(Criterion):
    """What the text of the program (or of the responder) has and has not.

    ``uses`` and ``avoids`` list constructs (``for``, ``while``, ``if``, ``break`` ...), calls (``say()``,
    ``tank_drive.on()``, ``on_for_*()`` with any ending), imports (``import time``) and names (``colorLeft``,
    ``colorLeft.rgb``). A name without a dot is found behind a dot as well: ``on()`` is also
    ``tank_drive.on()``. ``in_loop`` lists calls that must stand inside a loop, ``defines`` functions that must
    be defined. What it ``uses`` or has ``in_loop`` must have been run, and must not be a name that the text makes
    itself, unless ``defines`` has it. ``flags`` are flags that the magic line must have:
    ``["-b Simple_Shapes", "-R"]``. A module that it ``avoids`` cannot be imported either when the part is run.

    The score is the part of all this that holds.
    """

    check: Literal["source"]
    part: Literal["program", "responder"] = "program"
    uses: TextOrTexts = ()
    avoids: TextOrTexts = ()
    in_loop: TextOrTexts = ()
    defines: TextOrTexts = ()
    flags: TextOrTexts = ()

    judges_runs: ClassVar[bool] = False

    @property
    def parts_needed(self) -> frozenset[str]:
        """The one that it reads."""
        return frozenset({self.part})

    @field_validator("flags")
    @classmethod
    def _known_flags(cls, value: Texts) -> Texts:
        try:
            flags_in(value)
        except UsageError as error:
            raise ValueError(f"cannot be read: {str(error).removeprefix('line 1: ')}") from None
        return value

    @field_validator("in_loop")
    @classmethod
    def _calls(cls, value: Texts) -> Texts:
        if not all(text.endswith("()") for text in value):
            raise ValueError('has what is no call, expected calls like "say()"')
        return value

    @property
    def avoided_modules(self) -> Texts:
        """``sklearn`` for ``import sklearn``."""
        names = (text.removeprefix(IMPORT).strip() for text in self.avoids if text.startswith(IMPORT))
        return tuple(name for name in names if all(part.isidentifier() for part in name.split(".")))

    def misfits(self, around: Surroundings) -> Iterator[Misfit]:
        """The part whose source it reads has to be there."""
        yield from _without("part", self.part, around)

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if not (self.uses or self.avoids or self.in_loop or self.defines or self.flags):
            raise ValueError("asks for nothing, expected uses, avoids, in_loop, defines or flags")
        if self.flags and self.part != "program":
            raise ValueError("has flags for the responder, expected them for the program")
        return self


class ExpectedCall(StrictTable):
    """A call of a function, and what it must return: exactly ``returns``, or one of ``one_of``.

    Of a ``hidden`` call students learn nothing but whether it counts among those that are right.
    """

    function: str = ""  # the criterion's, if not given
    arguments: tuple[Any, ...] = ()
    named: dict[str, Any] = Field(default_factory=dict)
    returns: Any = None
    one_of: tuple[Any, ...] = ()
    hidden: bool = False

    @model_validator(mode="after")
    def _expects_something(self) -> Self:
        # A function that does nothing returns None, which is what the lack of both would ask for.
        if "returns" not in self.model_fields_set and not self.one_of:
            raise ValueError("says of a call neither returns nor one_of, expected what the function must return")
        return self


class Functions(Criterion):
    """Functions of the responder are called, without a robot, and return what they must.

    ``calls`` are tables ``{ arguments = [600], returns = 1227.8 }``, made one after the other in one process;
    ``function`` is the name for those that give none. Numbers are met within ``tolerance``; texts without
    regard to runs of spaces, and with ``ignore_case`` to case. ``path`` picks the part of a ``JSON::`` answer
    that is compared. With ``each`` an expected list is compared entry by entry, and ``at_least`` of the
    entries must be right: that is how predictions are marked.

    A call that is ``hidden`` comes after those that are not; students read how many of these are right. In place of
    ``calls``, ``table`` is a CSV file beside the assignment with a hidden call in each row below its headings: the
    value that must be returned, then the arguments, as texts. Then ``at_least`` of the calls must be right.

    The score is the part of the calls (of the entries) that is right; of a ``table`` in steps of 5 %.
    """

    check: Literal["functions"]
    function: str = Field(default="responder", min_length=1, max_length=100)
    calls: tuple[ExpectedCall, ...] = ()
    table: str = Field(default="", max_length=100)
    tolerance: float = Field(default=1e-6, ge=0)
    ignore_case: bool = False
    path: str | None = Field(default=None, min_length=1)
    each: bool = False
    at_least: float = Field(default=1.0, gt=0, le=1)

    judges_runs: ClassVar[bool] = False

    @property
    def parts_needed(self) -> frozenset[str]:
        """The one whose functions it calls."""
        return frozenset({"responder"})

    def completed(self, around: Surroundings) -> Self:
        """With a call for each row of its table."""
        if not self.table:
            return self
        if self.calls:
            raise Misfit("table", "needs calls or a table, expected one of them")
        try:
            rows = read_table(self.table, around.files)
        except UsageError as error:
            raise Misfit("table", str(error)) from None
        calls = tuple(
            ExpectedCall(arguments=tuple(arguments), returns=int(answer) if answer.isdecimal() else answer, hidden=True)
            for answer, *arguments in rows
        )
        return self.model_copy(update={"calls": calls})

    def misfits(self, around: Surroundings) -> Iterator[Misfit]:
        """The responder whose functions it calls has to be there."""
        yield from _without("check", "responder", around)

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if not self.calls and not self.table:
            raise ValueError("needs calls or a table, expected one of them")
        if any(before.hidden and not after.hidden for before, after in pairwise(self.calls)):
            # It could keep what it was called with, and tell it when a call is shown.
            raise ValueError("has a hidden call before one that is not, expected the hidden ones last")
        if self.each and not all(isinstance(call.returns, list | tuple) and call.returns for call in self.calls):
            raise ValueError("has each with a call that returns no list, expected a list in every returns")
        if self.each and self.table:
            raise ValueError("has each beside a table, expected a value in each row")
        if self.at_least < 1 and not self.each and not self.table:
            raise ValueError("has at_least without each, expected each = true beside it")
        return self


class PythonCheck(Criterion):
    """What no other criterion can ask: a Python file beside the assignment judges each trial.

    The file defines ``check(trial)``. ``trial`` is a dict with what was recorded: ``scenario``, ``index``,
    ``start`` and ``end`` (``x``, ``y``, ``heading``), ``end_t``, ``verdict``, ``ticks`` (lists ``t``, ``x``,
    ``y``, ``heading``, ``left_rgb``, ``right_rgb``, ``ultrasonic``, ``gyro``), ``printed``, ``spoken`` (lists of
    [time, text]), ``messages``, ``datalog``, ``images``, ``image_log``. It returns True or False, or a dict with
    ``passed``, ``message`` (a sentence for the student), ``score`` from 0 to 1 and ``measures`` (name to number).

    It runs inside the sandbox, like student code. If it fails in a trial, the line is not judged for that
    submission and staff are told why; the other lines stand.
    """

    check: Literal["python"]
    measures: ClassVar[Texts] = ("...",)
    file: Annotated[str, HOLDS_ANSWERS] = Field(pattern=r"^[\w.-]+\.py$", max_length=100)

    @property
    def python_files(self) -> Texts:
        """The one file that has ``check``."""
        return (self.file,)

    def misfits(self, around: Surroundings) -> Iterator[Misfit]:
        """Its file has to be beside the assignment."""
        if self.file not in around.files:
            yield Misfit("file", f'file is "{self.file[:60]}", expected a .py file beside this file')


def flags_in(texts: Texts) -> Flags:
    """The flags that these texts are. Raises UsageError for one that does not exist."""
    return parse_magic("%%sim_magic_preloaded " + " ".join(texts))


def _without(key: str, part: str, around: Surroundings) -> Iterator[Misfit]:
    if part in around.without:
        yield Misfit(key, f'{key} looks at the {part}, but parts has {part} = "none", expected one')
