"""``roboSim`` and ``eds``, which the course's notebooks import: the hook for a responder, and helpers for image data.

There is no widget and no browser here; what only shows something does nothing.
"""

from __future__ import annotations

import datetime
from collections.abc import Callable
from typing import Any

_EPOCH = datetime.datetime(2020, 1, 1)


class RoboSim:
    """The part of the simulator's widget that responder code uses."""

    def __init__(self) -> None:
        self.pyresponder: Callable[[str], Any] | None = None
        self.raw_image_data: list[str] = []
        self.results_log: list[dict[str, Any]] = []
        self.robot_state: dict[str, Any] = {}
        self.live_image_handler: Callable[[int], Any] | None = None

    def process_raw_image_data(self, raw_data: str, mode: str = "rgb", to_str: bool = True) -> str | list[str]:
        """Sensor numbers without every fourth (alpha); red alone for greyscale, 0 or 1 for ``bw``."""
        numbers = raw_data.split(",")
        del numbers[3::4]
        if mode in ("reflected", "greyscale"):
            numbers = numbers[::3]
        elif mode == "bw":
            numbers = ["1" if int(number) > 3 else "0" for number in numbers[::3]]
        elif mode != "rgb":
            print("Unrecognised mode.")
        return ",".join(numbers) if to_str else numbers

    def image_data(self, datatype: str = "dataframe", mode: str = "rgb") -> Any:
        """The logged images: a data frame of side, vals and clock, or the raw list."""
        if datatype == "raw":
            return self.raw_image_data
        import pandas as pd  # here alone: some assignments do without it

        rows = []
        for entry in self.raw_image_data:
            side, values, clock = entry.split(" ")[:3]
            rows.append((side, self.process_raw_image_data(values, mode), clock))
        return pd.DataFrame(rows, columns=["side", "vals", "clock"])

    def collect(self, data: list[list[Any]], images: list[str]) -> None:
        """What the robot has logged: each of ``data`` is name, value, the program's time or None, and the time."""
        for name, value, simtime, seconds in data:
            moment = _EPOCH + datetime.timedelta(seconds=seconds)
            self.results_log.append({"index": moment, "simtime": simtime, name: value})
        self.raw_image_data.extend(images)

    def clear_datalog(self) -> None:
        self.results_log.clear()
        self.raw_image_data.clear()


class Eds:
    """The notebook's display helper: it takes any call and shows nothing."""

    def __getattr__(self, name: str) -> Callable[..., None]:
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *_args, **_kwargs: None


roboSim = RoboSim()
eds = Eds()
