"""Short description of catalogue assignments for lists, read without validation.

``reader.py`` reads and validates a whole assignment, which takes longer.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from types import MappingProxyType
from typing import Any

from sim.readers.toml_text import read_toml
from submissions.assignment.folder import FILE_NAME

#: Titles of the parts of the course, by the number at the start of a section.
TOPICS: Mapping[str, str] = MappingProxyType(
    {
        "01": "Introducing notebooks and the RoboLab environment",
        "02": "Getting started with robot and Python programming",
        "03": "Controlling program execution flow",
        "04": "Not quite intelligent robots",
        "05": "Experimenting with sensors",
        "06": "Where in the world are we",
        "07": "Neural networks",
        "08": "Remote services and multi-agent systems",
    }
)
_SENTENCE_ENDS = re.compile(r"(?<=[.!?]) (?=[A-Z])")
_START_POSE_SENTENCE = re.compile(r"(The|This)( small)? robot |There are two robots")
_MAX_SENTENCE_LENGTH = 200


@dataclass(frozen=True, slots=True)
class AssignmentOverview:
    """One row of the list of assignments."""

    section: str
    id: str
    title: str
    sentence: str  # from the description
    marks: Decimal
    trials: int

    @property
    def topic(self) -> str:
        """The number of the assignment's part of the course; empty if it has none."""
        return self.section[:2] if self.section[:2] in TOPICS else ""

    def matches_text(self, text: str) -> bool:
        """Return whether the overview contains every word of the text, ignoring case."""
        searched_text = f"{self.section} {self.id} {self.title} {self.sentence} {TOPICS.get(self.topic, '')}".casefold()
        return all(word in searched_text for word in text.casefold().split())


def read_overview(folder: Path) -> AssignmentOverview:
    """Read the overview of the catalogue assignment in this folder."""
    table = read_toml((folder / FILE_NAME).read_text(encoding="utf-8"), Decimal)
    return AssignmentOverview(
        table.get("section", ""),
        table["id"],
        table["title"],
        _choose_sentence(table.get("description", "")),
        sum((Decimal(criterion["marks"]) for criterion in table["criterion"]), Decimal(0)),
        sum(_count_trials(scenario) for scenario in table.get("scenario", ())),
    )


def _choose_sentence(description: str) -> str:
    """Return the first sentence of the task, skipping sentences about the start pose.

    A sentence that begins with "Write" takes precedence.
    """
    sentences = _SENTENCE_ENDS.split(" ".join(description.split()))
    instructions = (each for each in sentences if each.startswith("Write "))
    candidates = (each for each in sentences if not _START_POSE_SENTENCE.match(each))
    return textwrap.shorten(next(instructions, next(candidates, sentences[0])), _MAX_SENTENCE_LENGTH, placeholder=" …")


def _count_trials(scenario: Mapping[str, Any]) -> int:
    """Return the number of trials: poses x swept levels x noise levels x seeds."""
    poses = 1 if scenario.get("choose") == "random" else len(scenario["poses"])
    sweep_levels = sum(map(len, scenario.get("sweep", {}).values())) or 1
    noises = [scenario.get(name, 0) for name in ("light_noise", "motor_noise")]
    light_levels, motor_levels = (len(levels) if isinstance(levels, list) else 1 for levels in noises)
    repetitions = scenario.get("pool") or scenario.get("trials", 1)
    trials: int = poses * sweep_levels * light_levels * motor_levels * repetitions
    return trials
