"""Criteria about submitted code: its source, the results of its functions, and checks written in Python.

``service`` analyses the source and calls the functions inside the sandbox.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, field_validator, model_validator

from sim.errors import UsageError
from submissions.assignment.truth_file import read_table
from submissions.criteria.common import (
    HOLDS_ANSWERS,
    AssignmentContext,
    Criterion,
    TextOrTexts,
    Texts,
    UnmetRequirement,
)
from submissions.magics import Flags, parse_flags
from submissions.strict_table import StrictTable, TableMistake

_MAX_ANSWER_DIGITS = 300
#: Words that denote a construct. Other entries are names.
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
#: Prefix of a module name.
IMPORT = "import "


class SourceRules(Criterion):
    """The source of the program or the responder contains some constructs and avoids others.

    ``uses`` and ``avoids`` list constructs (``for``, ``while``, ``if``, ``break`` ...), calls (``say()``,
    ``tank_drive.on()``, ``on_for_*()`` with any ending), imports (``import time``) and names (``colorLeft``,
    ``colorLeft.rgb``). A name without a dot also matches after a dot: ``on()`` matches ``tank_drive.on()``. ``in_loop``
    lists calls that must be inside a loop, ``defines`` functions that must be defined.

    Entries of ``uses`` and ``in_loop`` must have been executed. They must not be names that the source itself defines,
    unless ``defines`` lists them. ``flags`` are flags that the magic line must have: ``["-b Simple_Shapes", "-R"]``. At
    run time, the part cannot import modules in ``avoids``.

    The score is the share of these requirements that are met.
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
        """The part whose source is analysed."""
        return frozenset({self.part})

    @field_validator("flags")
    @classmethod
    def _check_flags(cls, value: Texts) -> Texts:
        try:
            parse_flag_texts(value)
        except UsageError as error:
            raise ValueError(f"cannot be read: {error}") from None
        return value

    @field_validator("in_loop")
    @classmethod
    def _check_calls(cls, value: Texts) -> Texts:
        if not all(text.endswith("()") for text in value):
            raise ValueError('has an entry that is not a call, expected calls like "say()"')
        return value

    @property
    def avoided_modules(self) -> Texts:
        """The modules that the code must not import: ``sklearn`` for ``import sklearn``."""
        names = (text.removeprefix(IMPORT).strip() for text in self.avoids if text.startswith(IMPORT))
        return tuple(name for name in names if all(part.isidentifier() for part in name.split(".")))

    def find_unmet_requirements(self, context: AssignmentContext) -> Iterator[UnmetRequirement]:
        """Yield a problem if the part whose source is analysed does not exist."""
        yield from _find_missing_part("part", self.part, context)

    @model_validator(mode="after")
    def _check_options(self) -> Self:
        if not (self.uses or self.avoids or self.in_loop or self.defines or self.flags):
            raise ValueError("has no condition, expected uses, avoids, in_loop, defines or flags")
        if self.flags and self.part != "program":
            raise TableMistake("flags", "has flags for the responder, expected them for the program")
        return self


class ExpectedCall(StrictTable):
    """A function call and its expected result: ``returns``, or one of ``one_of``.

    Feedback on a ``hidden`` call contains only the number of correct hidden calls.
    """

    function: str = ""  # defaults to the criterion's function
    arguments: tuple[Any, ...] = ()
    named: dict[str, Any] = Field(default_factory=dict)
    returns: Any = None
    one_of: tuple[Any, ...] = ()
    hidden: bool = False

    @model_validator(mode="after")
    def _check_expectation(self) -> Self:
        # A function that does nothing returns None, so a call without an expected value would always pass.
        if "returns" not in self.model_fields_set and not self.one_of:
            raise TableMistake("returns", "has a call without returns or one_of, expected the result of the function")
        return self


def _parse_answer(answer: str) -> int | str:
    """Return a whole number as such, and any other answer as a text."""
    # Python rejects integers with thousands of digits.
    return int(answer) if answer.isdecimal() and len(answer) <= _MAX_ANSWER_DIGITS else answer


class Functions(Criterion):
    """Functions of the responder return the expected values. They are called without a robot.

    ``calls`` are tables ``{ arguments = [600], returns = 1227.8 }``, executed in order in one process. ``function`` is
    the default name. Numbers may differ by ``tolerance``. Text comparisons ignore runs of spaces, and case with
    ``ignore_case``. ``path`` selects the part of a ``JSON::`` answer that is compared.

    With ``each``, an expected list is compared entry by entry, and ``at_least`` of the entries must be right. Use it to
    mark predictions.

    Calls with ``hidden`` come after the others, and students see only how many of them are right. Instead of ``calls``,
    ``table`` names a CSV file beside the assignment. Each row below its headings is a hidden call: the expected value,
    followed by the arguments as texts. ``at_least`` of the calls must then be right.

    The score is the share of correct calls or entries; for a ``table`` it is rounded to steps of 5 %.
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
        """The part whose functions are called."""
        return frozenset({"responder"})

    def complete_from(self, context: AssignmentContext) -> Self:
        """Return the criterion with a call for each row of its table."""
        if not self.table:
            return self
        if self.calls:
            raise UnmetRequirement("table", "needs calls or a table, expected one of them")
        try:
            rows = read_table(self.table, context.files)
        except UsageError as error:
            raise UnmetRequirement("table", str(error)) from None
        calls = tuple(
            ExpectedCall(arguments=tuple(arguments), returns=_parse_answer(answer), hidden=True)
            for answer, *arguments in rows
        )
        return self.model_copy(update={"calls": calls})

    def find_unmet_requirements(self, context: AssignmentContext) -> Iterator[UnmetRequirement]:
        """Yield a problem if there is no responder."""
        yield from _find_missing_part("check", "responder", context)

    @model_validator(mode="after")
    def _check_options(self) -> Self:
        if not self.calls and not self.table:
            raise TableMistake("calls", "needs calls or a table, expected one of them")
        if any(before.hidden and not after.hidden for before, after in pairwise(self.calls)):
            # The function could store hidden arguments and reveal them during a visible call.
            raise TableMistake("calls", "has a hidden call before one that is not, expected the hidden ones last")
        if self.each and not all(isinstance(call.returns, list | tuple) and call.returns for call in self.calls):
            raise TableMistake("each", "has each with a call that returns no list, expected a list in every returns")
        if self.each and self.table:
            raise TableMistake("each", "has each beside a table, expected a value in each row")
        if self.at_least < 1 and not self.each and not self.table:
            raise TableMistake("at_least", "has at_least without each, expected each = true beside it")
        return self


class PythonCheck(Criterion):
    """A Python file beside the assignment judges each trial, for requirements beyond the other criteria.

    The file defines ``check(trial)``. ``trial`` is a dict of the recorded data: ``scenario``, ``index``, ``start`` and
    ``end`` (``x``, ``y``, ``heading``), ``end_t``, ``verdict``, ``ticks`` (lists ``t``, ``x``, ``y``, ``heading``,
    ``left_rgb``, ``right_rgb``, ``ultrasonic``, ``gyro``), ``printed``, ``spoken`` (lists of [time, text]),
    ``messages``, ``datalog``, ``images``, ``image_log``.

    ``check`` returns True or False, or a dict with ``passed``, ``message`` (a sentence for the student), ``score`` from
    0 to 1 and ``measures`` (name to number).

    The check runs inside the sandbox, like student code. If it fails in a trial, the criterion is not judged for that
    submission, and staff see the reason. Other criteria are not affected.
    """

    check: Literal["python"]
    measures: ClassVar[Texts] = ("...",)
    judges_each_trial: ClassVar[bool] = False
    file: Annotated[str, HOLDS_ANSWERS] = Field(pattern=r"^[\w.-]+\.py$", max_length=100)

    @property
    def python_files(self) -> Texts:
        """The file with ``check``."""
        return (self.file,)

    def find_unmet_requirements(self, context: AssignmentContext) -> Iterator[UnmetRequirement]:
        """Yield a problem if the file is not beside the assignment."""
        if self.file not in context.files:
            yield UnmetRequirement("file", f'file is "{self.file[:60]}", expected a .py file beside this file')


def parse_flag_texts(texts: Texts) -> Flags:
    """Parse these texts as flags.

    Raises:
        UsageError: A flag does not exist.
    """
    return parse_flags("sim_magic_preloaded", " ".join(texts))


def _find_missing_part(key: str, part: str, context: AssignmentContext) -> Iterator[UnmetRequirement]:
    if part in context.without:
        yield UnmetRequirement(key, f'{key} looks at the {part}, but parts has {part} = "none", expected one')
