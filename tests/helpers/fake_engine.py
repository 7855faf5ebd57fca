"""An engine without a simulation, for tests of the notebook: it prints, asks and checks by simple rules.

It runs in kernels too, so it imports nothing of Robomark's other packages.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from robomark_notebook import session
from robomark_notebook.engine import (
    Answerer,
    Check,
    CheckedCriterion,
    Engine,
    EngineError,
    MagicCall,
    MagicResult,
    Page,
    Question,
    RobotRun,
    RunFault,
    Submitted,
)

_PRINT = re.compile(r"""^print\((?P<quote>["'])(?P<text>.*)(?P=quote)\)$""", re.MULTILINE)
_LOGGED = re.compile(r"(?P<name>\w+): (?P<value>[\d.]+)$")
IMAGE = f"left {','.join(['245', '226', '225', '255'] * 400)} 30"


def build_replay(texts: list[str], seconds: float = 2.0) -> dict[str, Any]:
    """Return a replay of a robot that drives straight on along the x axis, and prints a text each 0.1 s."""
    ticks = round(seconds * 30)
    steps: dict[str, list[int]] = {"x": [20000 + 500, *[500] * (ticks - 1)], "y": [80000, *[0] * (ticks - 1)]}
    columns = {
        name: {"unit": "mm", "per": 100, "added": [added]} for name, added in {**steps, "heading": [0] * ticks}.items()
    }
    columns["left_rgb"] = {"unit": "", "per": 10, "added": [[2550, *[0] * (ticks - 1)]] * 3}
    body = {"front": 120, "back": -60, "half_width": 90, "wheel_spacing": 180, "wheel_diameter": 56, "ultrasonic": 110}
    robot = {
        "name": "robot",
        "body": {**body, "left": [-20, 100, 20], "right": [20, 100, 20]},
        "start": [200, 800, 0],
        "end": [200 + 5 * ticks, 800, 0],
        "columns": columns,
        "pen": [[0, True]],
        "images": [],
    }
    events = [
        {"t": round(0.1 * number, 3), "who": "robot", "kind": "printed", "text": text, "line": [0, number + 1]}
        for number, text in enumerate(texts)
    ]
    trial = {
        "trial": 1, "name": "cell 1", "verdict": "finished", "ended": "completed", "seconds": seconds, "tick": 1 / 30,
        "obstacles": [], "beacon": None, "robots": [robot], "messages": [], "events": events, "left_out": 0, "lost": [],
        "floor": 0,
    }  # fmt: skip
    sources = [{"name": "cell 1", "lines": [f"print({text!r})" for text in texts], "more": 0}]
    return {
        "format": "robomark replay", "version": 1, "title": "cell 1", "sources": sources, "trials": [trial], "of": 1,
        "first": 0, "floors": [{"name": "Empty_Map", "image": None}],
    }  # fmt: skip


class FakeEngine:
    """Runs programs of ``print("...")`` lines. It keeps its calls, and the answers that it got."""

    def __init__(self) -> None:
        self.calls: list[tuple[MagicCall, int]] = []  # with the seed
        self.answers: list[str | None] = []
        self.sent: dict[str, Any] = {}
        self.is_closed = False
        self.seed = 0

    def call_magic(self, call: MagicCall, page: Page | None, answer: Answerer) -> MagicResult:
        """Print the texts of a program, ask those that begin with PY::, and log those such as ``Light: 3``."""
        self.calls.append((call, self.seed))
        if "--wrong" in call.arguments:
            raise EngineError("There is no flag --wrong.")
        state = {"count": (page or {"count": 0})["count"] + 1}
        if call.body is None:
            return MagicResult(state, ("nothing was run",) if "-n" in call.arguments else (), None)
        texts = [found["text"] for found in _PRINT.finditer(call.body)]
        data: list[tuple[str, float, float]] = []
        asked = told = 0
        lines: list[tuple[float, str]] = []
        faults: tuple[RunFault, ...] = ()
        for number, text in enumerate(texts):
            t = round(0.1 * number, 3)
            lines.append((t, text))
            if logged := _LOGGED.match(text):
                data.append((logged["name"], float(logged["value"]), t))
            if text.startswith("PY::"):
                returned = answer(Question(asked, t, text, tuple(data[told:]), (IMAGE,)))
                told = len(data)
                self.answers.append(returned)
                if returned is None:
                    faults = (RunFault("responder", "cell 2", "the responder returned nothing", "return the answer"),)
                else:
                    lines.append((t, returned))
                asked += 1
        if "fail" in call.body:
            faults += (RunFault("program", f"cell {call.cell}, line 2", "'fail' is not defined", ""),)
        run = RobotRun(
            "ab" * 32, "finished", 2.0, "the program ended", tuple(lines), faults, tuple(data), (IMAGE,) * asked,
            build_replay(texts),
        )  # fmt: skip
        return MagicResult(state, (), run)

    def check(self, assignment: str, name: str, notebook: bytes, files: Mapping[str, bytes]) -> Check:
        """Return a report with one passed and one failed criterion."""
        self.sent = {"assignment": assignment, "name": name, "notebook": notebook, "files": dict(files)}
        if assignment == "no-such":
            raise EngineError("There is no assignment no-such.")
        criteria = (
            CheckedCriterion("Prints a line", "It printed <b>hello</b>.", "2", "2", True),
            CheckedCriterion("Stops at the line", "It stopped 40 mm too late.", "0", "3", False, (0, 1.2345)),
        )
        happened = "The robot stopped too late."
        steps, notes = ("Stop earlier.",), ("Hidden trials are not part of a check.",)
        return Check("Stop at the <line>", happened, "2", "5", criteria, steps, notes, build_replay(["hello"]))

    def submit(self, assignment: str, name: str, notebook: bytes, files: Mapping[str, bytes]) -> Submitted:
        """Accept a submission, with two others before it."""
        check = self.check(assignment, name, notebook, files)
        self.sent["check"] = check
        return Submitted("R-1", 2, None, "https://robomark.example/r/1")

    def follow(self, submitted: Submitted) -> Submitted:
        """Move the submission up the queue; at its end there is a report."""
        assert submitted.before is not None
        if submitted.before:
            return replace(submitted, before=submitted.before - 1)
        return replace(submitted, before=None, check=self.sent["check"])

    def close(self) -> None:
        """Remember the end."""
        self.is_closed = True


def install() -> FakeEngine:
    """Make the fake engine that of new sessions in this process, and return it."""
    engine = FakeEngine()

    def create_server_engine(url: str, token: str) -> Engine:
        return engine

    session.create_local_engine = lambda: engine
    session.create_server_engine = create_server_engine
    return engine
