"""The outputs of cells: runs and checks as widgets, with forms that need no widgets beside them."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from typing import Any

from IPython.display import display

from robomark_notebook.check_report import format_check, format_check_as_html
from robomark_notebook.engine import Check, RobotRun
from robomark_notebook.picture import draw_last_frame
from robomark_notebook.texts import (
    format_notes,
    format_notes_as_html,
    format_run,
    format_run_as_html,
    summarize_run,
)
from robomark_notebook.widget import build_view


def show_run(run: RobotRun, notes: Sequence[str], responder_notes: Sequence[str]) -> None:
    """Show the replay of a run, and below it its lines, faults and notes.

    Where the kernel has notes on its responder, they replace the engine's faults of it.
    """
    picture = draw_last_frame(run.replay)
    image = {} if picture is None else {"image/png": base64.b64encode(picture).decode("ascii")}
    _publish({"text/plain": summarize_run(run), **image, **build_view(run.replay)})
    faults = [fault for fault in run.faults if not (responder_notes and fault.who == "responder")]
    all_notes = [*responder_notes, *notes]
    _publish_text(format_run(run, all_notes, faults), format_run_as_html(run, all_notes, faults))


def show_notes(notes: Sequence[str]) -> None:
    """Show the notes of a magic that started no run."""
    _publish_text("\n".join(format_notes(notes)), format_notes_as_html(notes))


def show_check(check: Check) -> None:
    """Show the report of a check above its replay."""
    report = format_check_as_html(check)
    _publish({"text/plain": format_check(check), "text/html": report, **build_view(check.replay, report)})


def read_robot_state(run: RobotRun) -> dict[str, Any]:
    """Return the end of a run with the keys of the original ``%sim_robot_state``; values of the last tick."""
    trial = run.replay["trials"][0] if run.replay["trials"] else None
    if trial is None:
        return {}
    robot = trial["robots"][0]
    x, y, heading = robot["end"]
    state: dict[str, Any] = {"x": x, "y": y, "angle": math.radians(heading)}
    for name in ("ultrasonic", "gyro"):
        values = _read_last_values(robot["columns"].get(name))
        if values:
            state[name] = values if len(values) > 1 else values[0]
    for side in ("left", "right"):
        rgb = _read_last_values(robot["columns"].get(f"{side}_rgb"))
        if len(rgb) == 3:
            state[f"{side}_light_raw"] = rgb
            state[f"{side}_light"] = int(rgb[0])
            state[f"{side}_light_pc"] = 100 * int(rgb[0]) / 255
            state[f"{side}_light_full"] = 100 * sum(map(int, rgb)) / 765
    return state


def _read_last_values(column: Mapping[str, Any] | None) -> list[float]:
    return [] if column is None else [sum(step or 0 for step in part) / column["per"] for part in column["added"]]


def _publish_text(text: str, html: str) -> None:
    if text:
        _publish({"text/plain": text, "text/html": html})


def _publish(data: Mapping[str, Any]) -> None:
    """Show an output in these forms, of which each viewer chooses one."""
    display(data, raw=True)  # type: ignore[no-untyped-call]
