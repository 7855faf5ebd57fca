"""``roboSim`` and ``eds``, which the course's notebooks import: the hook for a responder, and helpers for image data.

There is no widget and no browser here; what only shows something does nothing.
"""

from __future__ import annotations

import datetime
import types
from collections.abc import Callable, Mapping
from typing import Any

from nbev3devsim.tqdma import tqdm_notebook, tqdma

__all__ = ["eds", "roboSim", "tqdm_notebook", "tqdma"]
_EPOCH = datetime.datetime(2020, 1, 1)


class RoboSim:
    """The part of the simulator's widget that responder code uses."""

    def __init__(self) -> None:
        self.pyresponder: Callable[[str], Any] | None = None
        self.raw_image_data: list[str] = []
        self.results_log: list[dict[str, Any]] = []
        #: As the last run has left the robot; empty if it may have been put elsewhere since.
        self.robot_state: dict[str, Any] = {}
        self.look: Callable[[], dict[str, Any]] = dict
        self._rows: dict[tuple[str, str], tuple[str, ...]] = {}  # of each entry and mode, as image_data has it
        self.live_image_handler: Callable[[int], Any] | None = None
        self._elements: dict[str, Any] = {}

    def find_responder(self, namespace: Mapping[str, Any]) -> Callable[[str], Any]:
        """Return ``pyresponder``, else ``responder`` or the only ``*_responder`` in the namespace.

        Raises:
            LookupError: There is none, or more than one.
        """
        if callable(self.pyresponder):
            return self.pyresponder
        if self.pyresponder is not None:
            kind = type(self.pyresponder).__name__
            raise LookupError(f"roboSim.pyresponder is a {kind} and no function: assign the function without brackets")
        if callable(namespace.get("responder")):
            return namespace["responder"]  # type: ignore[no-any-return]
        functions = {
            name: value
            for name, value in namespace.items()
            if name.endswith("_responder") and isinstance(value, types.FunctionType)
        }
        if len(functions) == 1:
            return next(iter(functions.values()))
        if functions:
            raise LookupError(
                f"which of {', '.join(functions)} is the responder? assign one of them to roboSim.pyresponder"
            )
        raise LookupError(
            "there is no responder: define a function called responder, or assign one to roboSim.pyresponder"
        )

    def ask(self, responder: Callable[[str], Any], text: str) -> Any:
        """Return the responder's answer: its value, or the element ``response`` if it sets that and returns None."""
        self._elements.pop("response", None)
        answer = responder(text)
        return self._elements.pop("response", None) if answer is None else answer

    def set_element(self, name: str, value: Any) -> None:
        """Set an element of the widget. Only ``response`` has an effect: it is the answer to the robot's message."""
        self._elements[name] = value

    def process_raw_image_data(self, raw_data: str, mode: str = "rgb", to_str: bool = True) -> str | list[str]:
        """Return the sensor values without alpha: red only for greyscale, 0 or 1 for ``bw``."""
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
        """Return the logged images: a data frame of side, vals and clock, or the raw list.

        A notebook asks again and again, so only entries that are new are taken apart.
        """
        if datatype == "raw":
            return self.raw_image_data
        import pandas as pd  # here alone: some assignments do without it

        return pd.DataFrame(
            [self._parse_entry(entry, mode) for entry in self.raw_image_data], columns=["side", "vals", "clock"]
        )

    def _parse_entry(self, entry: str, mode: str) -> tuple[str, ...]:
        if (entry, mode) not in self._rows:
            side, values, clock = entry.split(" ")[:3]
            self._rows[entry, mode] = (side, str(self.process_raw_image_data(values, mode)), clock)
        return self._rows[entry, mode]

    def collect(self, data: list[list[Any]], images: list[str]) -> None:
        """Add the robot's log entries: each of ``data`` is name, value, the program's time or None, and the time."""
        for name, value, simtime, seconds in data:
            moment = _EPOCH + datetime.timedelta(seconds=seconds)
            self.results_log.append({"index": moment, "simtime": simtime, name: value})
        self.raw_image_data.extend(images)

    def clear_datalog(self) -> None:
        self.results_log.clear()
        self.raw_image_data.clear()
        self._rows.clear()


class Eds:
    """The notebook's display helper. It accepts any call and shows nothing."""

    def __getattr__(self, name: str) -> Callable[..., None]:
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *_args, **_kwargs: None


roboSim = RoboSim()
eds = Eds()
