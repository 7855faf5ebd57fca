"""What a list says of an assignment, read off its file without checking it: the catalogue's are in order.

Reading one to mark by it, with every mistake named, is ``reader.py``'s, which takes longer.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any

from submissions.assignment.folder import FILE_NAME


@dataclass(frozen=True, slots=True)
class AssignmentOverview:
    """One line of the list of assignments."""

    section: str
    id: str
    title: str
    marks: Decimal
    trials: int


def overview(folder: Path) -> AssignmentOverview:
    """Of the assignment in this folder of the catalogue."""
    table = tomllib.loads((folder / FILE_NAME).read_text(encoding="utf-8"), parse_float=Decimal)
    return AssignmentOverview(
        table.get("section", ""),
        table["id"],
        table["title"],
        sum((Decimal(criterion["marks"]) for criterion in table["criterion"]), Decimal(0)),
        sum(_trials(scenario) for scenario in table.get("scenario", ())),
    )


def _trials(scenario: Mapping[str, Any]) -> int:
    """Poses x swept levels x noise levels x seeds."""
    poses = 1 if scenario.get("choose") == "random" else len(scenario["poses"])
    swept = sum(map(len, scenario.get("sweep", {}).values())) or 1
    noises = [scenario.get(name, 0) for name in ("light_noise", "motor_noise")]
    light, motor = (len(levels) if isinstance(levels, list) else 1 for levels in noises)
    trials: int = poses * swept * light * motor * scenario.get("trials", 1)
    return trials
