"""Reasons why mutants that keep full marks are solutions too: the file ``survivors.toml`` of an assignment.

The file decides no marks and is not part of the assignment's version.
"""

from __future__ import annotations

import os
from typing import Annotated

from pydantic import Field, field_validator, model_validator

from service.mutation.mutants import Mutant
from service.mutation.operators import OPERATORS
from sim.errors import UsageError
from submissions.assignment.folder import locate_assignment_folder
from submissions.assignment.problems import AssignmentProblems, Problems, find_lines
from submissions.assignment.reader import parse_toml
from submissions.assignment.table_problems import read_table
from submissions.strict_table import StrictTable, TableMistake
from submissions.suggestions import suggest_name

SURVIVORS = "survivors.toml"
_Text = Annotated[str, Field(min_length=1, max_length=500)]


class SurvivorReason(StrictTable):
    """A reason that covers the survivors which have all the given properties."""

    reason: _Text
    operators: tuple[str, ...] = ()  # one of these
    source: str = ""  # the line of the reference, with its indentation
    old: str = ""  # the replaced text
    new: str = ""  # the text that replaces it

    @field_validator("operators")
    @classmethod
    def _check_operators(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        known_names = [each.name for each in OPERATORS]
        for name in names:
            if name not in known_names:
                hint = suggest_name(name, known_names)
                raise ValueError(f'has "{name[:60]}", expected operators of mutants{hint}')
        return names

    @model_validator(mode="after")
    def _check_selection(self) -> SurvivorReason:
        if not (self.operators or self.source or self.old or self.new):
            raise TableMistake("reason", "covers every mutant, expected operators, source, old or new")
        return self

    def covers(self, mutant: Mutant) -> bool:
        """Return whether the reason applies to a mutant, if the mutant survives."""
        return (
            (not self.operators or mutant.operator in self.operators)
            and self.source in ("", mutant.line_text)
            and self.old in ("", mutant.old)
            and self.new in ("", mutant.new)
        )


class _ReasonsFile(StrictTable):
    survivor: tuple[SurvivorReason, ...]


def read_survivor_reasons(name_or_path: str | os.PathLike[str]) -> tuple[SurvivorReason, ...]:
    """Read the reasons of an assignment; empty without the file.

    Raises:
        UsageError: There is no such assignment, or the file cannot be read.
        AssignmentProblems: The file has mistakes. The error lists all.
    """
    path = locate_assignment_folder(name_or_path) / SURVIVORS
    source_name = f"{path.parent.name}/{SURVIVORS}"
    if not path.is_file():
        return ()
    try:
        text, document = parse_toml(path.read_bytes(), source_name)
    except OSError as error:
        raise UsageError(f"{source_name} cannot be read: {error.strerror}") from error
    result = read_table(_ReasonsFile, document)
    if isinstance(result, _ReasonsFile):
        return result.survivor
    problems = Problems(source_name, find_lines(text))
    for problem in result:
        problems.add(problem.path, problem.sentence)
    raise AssignmentProblems(problems.sorted())
