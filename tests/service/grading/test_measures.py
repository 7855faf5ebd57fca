"""A judge measures only the measures of its criterion, so the rankable measures are a closed list."""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from driving import along, driven, rest, spin, straight
from judging import judged
from paths import ROOT
from sim.floors.tracks import load_centrelines
from sim.recording import DatalogEntry, Message, Recording, TimedText
from submissions.criteria import SCHEMAS

DOCUMENT = (ROOT / "docs" / "criteria.md").read_text()
TABLES = [tomllib.loads(text) for text in re.findall(r"```toml\n(.*?)```", DOCUMENT, re.DOTALL)]
#: Kinds that need more than their trials.
APART = {"ranking", "python", "source", "functions"}
SQUARE = [each for _ in range(4) for each in (straight(100), rest(), spin(90), rest())]
#: Words required by the examples in the documentation.
TOLD = tuple(TimedText(t / 10, text) for t, text in enumerate(["3", "2", "1", "0", "OK", "medium", "2", "all", "done"]))


def runs() -> list[Recording]:
    log = tuple(DatalogEntry(t / 10, "Colour", 100.0, None) for t in range(1, 50))
    sent = tuple(Message(float(t), "robot", f"PY::{t}", float(t)) for t in range(3))
    square = driven(*SQUARE, spoken=TOLD, printed=TOLD, datalog=log, messages=sent)
    there = driven(straight(100), rest(), straight(-100), straight(200, 2), straight(-200), rest())
    corners = np.array(load_centrelines()["Thruxton_Circuit"] * 2)
    circuit = along(corners, np.zeros(len(corners)))
    return [driven(), square, there, replace(there, background="Simple_Shapes"), circuit]


@pytest.mark.parametrize(
    "table", [pytest.param(each, id=each["title"]) for each in TABLES if each["check"] not in APART]
)
def test_what_is_measured_is_listed(table: dict[str, object]) -> None:
    keys = {"id": "c"} | table
    criterion = SCHEMAS[str(table["check"])].model_validate_json(json.dumps(keys))
    measured = {measure.name for run in runs() for each in judged(criterion, run).evidence for measure in each.measures}
    # Measures of a wrong move occur in failed trials only, and are never ranked.
    assert [name for name in measured if not (criterion.can_measure(name) or name.startswith("this move "))] == []
    assert bool(measured) or not criterion.measures or table["check"] in ("reports", "events", "sequence")


@pytest.mark.parametrize(
    ("check", "name", "known"),
    [
        ("laps", "lap time", True),
        ("laps", "lap times", False),
        ("moves", "move 12 turn", True),
        ("moves", "move 0 turn", False),
        ("moves", "move # turn", False),
        ("collects", "different: right facing triangle", True),
        ("collects", "different: ", False),
        ("python", "anything", True),
        ("finishes", "", False),
        ("classification", "accuracy", False),
    ],
)
def test_names_with_numbers_and_words(check: str, name: str, known: bool) -> None:
    table = next(each for each in TABLES if each["check"] == check)
    assert SCHEMAS[check].model_validate(table | {"marks": str(table["marks"])}).can_measure(name) is known
