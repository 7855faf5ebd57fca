"""What is wrong with an assignment file, gathered while it is read, each mistake with its line.

Only a list that knows where things stand; what is a mistake is decided by those who read.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from sim.errors import AssignmentError
from submissions.assignment.toml_lines import Path, line_of

_MOST = 100


class AssignmentProblems(AssignmentError):
    """Everything that is wrong with an assignment; ``problems`` has one ``file:line: sentence`` each."""

    def __init__(self, problems: tuple[str, ...]) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems

    def __reduce__(self) -> tuple[type[AssignmentProblems], tuple[tuple[str, ...]]]:
        return type(self), (self.problems,)


@dataclass(slots=True)
class Problems:
    """``where`` is the file as it is shown, ``lines`` where its keys stand."""

    where: str
    lines: Mapping[Path, int]
    found: list[tuple[int, str]] = field(default_factory=list)

    def add(self, path: Path, sentence: str) -> None:
        """Note what is wrong at the line where this key stands.

        Raises AssignmentProblems where there are so many that nobody reads them: a file can have one in every key.
        """
        self.found.append((line_of(self.lines, path), sentence))
        if len(self.found) > _MOST:
            raise AssignmentProblems((*self.sorted(), f"{self.where}:1: has more mistakes, which were not looked for"))

    def sorted(self) -> tuple[str, ...]:
        """``file:line: sentence``, in the order of the lines."""
        return tuple(f"{self.where}:{line}: {sentence}" for line, sentence in sorted(dict.fromkeys(self.found)))
