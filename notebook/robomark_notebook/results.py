"""Results of engines from plain JSON data. Both engines receive the same data, from a process or from a server."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robomark_notebook.engine import (
    Check,
    CheckedCriterion,
    EngineError,
    MagicCall,
    MagicResult,
    Page,
    Question,
    RobotRun,
    RunFault,
)


def describe_call(call: MagicCall, page: Page | None, seed: int) -> dict[str, Any]:
    """Return the request for a magic as JSON data."""
    return {
        "cell": call.cell,
        "name": call.name,
        "arguments": call.arguments,
        "body": call.body,
        "page": None if page is None else dict(page),
        "seed": seed,
    }


def read_question(data: Mapping[str, Any]) -> Question:
    """Return the robot's question. Raises EngineError if the data are not one."""
    try:
        return Question(
            int(data["number"]), float(data["t"]), str(data["text"]), _read_log(data["data"]), tuple(data["images"])
        )
    except (KeyError, TypeError, ValueError) as error:
        raise _build_error(error) from None


def read_magic_result(data: Mapping[str, Any]) -> MagicResult:
    """Return the result of a magic. Raises EngineError if the data are not one."""
    try:
        run = data["run"]
        return MagicResult(dict(data["page"]), tuple(map(str, data["notes"])), None if run is None else _read_run(run))
    except (KeyError, TypeError, ValueError) as error:
        raise _build_error(error) from None


def read_check(data: Mapping[str, Any]) -> Check:
    """Return the report of a check. Raises EngineError if the data are not one."""
    try:
        return Check(
            title=data["title"],
            happened=data["happened"],
            marks=data["marks"],
            out_of=data["out_of"],
            criteria=tuple(map(_read_criterion, data["criteria"])),
            next_steps=tuple(data["next_steps"]),
            notes=tuple(data["notes"]),
            replay=data["replay"],
        )
    except (KeyError, TypeError, ValueError) as error:
        raise _build_error(error) from None


def read_grade(title: str, grade: Mapping[str, Any], replay: Mapping[str, Any]) -> Check:
    """Return the report of a graded submission, from a server's data. Raises EngineError if the data are not one."""
    try:
        moments = _list_moments(replay)
        return Check(
            title=title,
            happened=grade["cause"],
            marks=_format_marks(grade["marks"]),
            out_of=_format_marks(grade["max_marks"]),
            criteria=tuple(
                CheckedCriterion(
                    each["title"],
                    each["message"],
                    _format_marks(each["marks"]),
                    _format_marks(each["max_marks"]),
                    each["marks"] >= each["max_marks"],
                    moments.get(each["title"]),
                )
                for each in grade["criteria"]
            ),
            next_steps=tuple(each for each in (grade["next_step"],) if each),
            notes=(*grade["notes"], *(str(each["text"]) for each in grade["comments"])),
            replay=replay,
        )
    except (KeyError, TypeError, ValueError) as error:
        raise _build_error(error) from None


def _list_moments(replay: Mapping[str, Any]) -> dict[str, tuple[int, float]]:
    """Return the first lost moment of each criterion, by title: the trial in the replay, and the second."""
    moments: dict[str, tuple[int, float]] = {}
    for number, trial in enumerate(replay["trials"]):
        for lost in trial["lost"]:
            moments.setdefault(lost["title"], (number, float(lost["t"])))
    return moments


def _format_marks(marks: float) -> str:
    return f"{marks:.2f}".rstrip("0").rstrip(".")


def _read_run(data: Mapping[str, Any]) -> RobotRun:
    return RobotRun(
        sha256=data["sha256"],
        verdict=data["verdict"],
        seconds=float(data["seconds"]),
        happened=data["happened"],
        lines=tuple((float(t), str(text)) for t, text in data["lines"]),
        faults=tuple(RunFault(each["who"], each["place"], each["message"], each["hint"]) for each in data["faults"]),
        data=_read_log(data["data"]),
        images=tuple(data["images"]),
        replay=data["replay"],
    )


def _read_log(entries: list[list[Any]]) -> tuple[tuple[str, float, float], ...]:
    return tuple((str(name), float(value), float(t)) for name, value, t in entries)


def _read_criterion(data: Mapping[str, Any]) -> CheckedCriterion:
    moment = data["moment"]
    return CheckedCriterion(
        title=data["title"],
        found=data["found"],
        marks=data["marks"],
        out_of=data["out_of"],
        passed=data["passed"],
        moment=None if moment is None else (int(moment[0]), float(moment[1])),
    )


def _build_error(error: Exception) -> EngineError:
    return EngineError(
        f"Robomark sent a result that this release of robomark-notebook cannot read ({type(error).__name__}: {error}). "
        "Install the same release of both."
    )
