"""The role of a responder: loads the student's module once, then answers one message after another.

The bridge decides which texts arrive and how the answers are used.
"""

from __future__ import annotations

import functools
import os
import signal
import sys
import types
from collections.abc import Callable
from types import FrameType
from typing import Any

from . import call_results, determinism, model_files, other_agents, own_modules, refusals, student_code
from .frames import Frame, Wire, can_send_text, clip
from .lockdown import Grants
from .statement_watch import StatementWatch

_RECORDED_NAMES = ("parser", "agent", "logger")
_FUNCTION_TYPES = (types.FunctionType, types.MethodType, types.BuiltinFunctionType, functools.partial)


class ResponderRole:
    """The student's module, and its inner calls for the sequence diagram."""

    def __init__(self, wire: Wire, grants: Grants, spec: Frame) -> None:
        self._wire = wire
        self._grants = grants
        self._spec = spec
        self._name: str = spec["name"]
        self._files = student_code.StudentFiles(self._name)
        if spec.get("watch"):
            self._files.watch = StatementWatch(wire.send, self._name)
        self._function: str | None = spec["function"]
        self._own_name = "responder"
        self._units = 0
        self._namespace: dict[str, Any] = {}
        self._defines_msg = self._defines_sender = False
        self._stack: list[str] = []
        self._calls = 0

    def run(self) -> None:
        """Load the module, then answer until the worker closes the wire."""
        self._prepare()
        self._wire.send({"do": "ready", "error": self._load_module(self._spec["text"])})
        self._serve_messages()

    def _prepare(self) -> None:
        """Prepare for student code: output, clock, randomness, and an empty module."""
        from nbev3devsim.load_nbev3devwidget import eds, roboSim

        signal.signal(signal.SIGXCPU, self._report_busy)
        student_code.install_output(self._emit)
        student_code.install_warnings(self._report_refusal)
        determinism.install_clock(lambda: self._units, self._sleep)
        determinism.install_randomness(self._spec["seed"])
        refusals.install_refusals(self._grants, self._files, self._report_refusal)
        model_files.install_version_notes(self._report_refusal)
        own_modules.install_importer(
            own_modules.read_folder_module, own_modules.list_folder_modules(), self._files, self._report_refusal
        )
        module = types.ModuleType("__main__")
        sys.modules["__main__"] = module
        self._namespace = module.__dict__
        self._namespace.update(roboSim=roboSim, eds=eds)
        self._namespace.update(
            other_agents.build_agent_functions(self._spec.get("agents", ()), self._wire, self._advance_time)
        )

    def _serve_messages(self) -> None:
        while True:
            frame = self._wire.receive()
            if frame["do"] == "call":
                self._wire.send(call_results.call_function(self._namespace, self._files, frame))
            else:
                self._answer_message(frame, 0)

    def _answer_message(self, frame: Frame, start: int) -> None:
        """Answer one message of the run that began at ``start``. Its frame contains the robot's new log entries."""
        from nbev3devsim.load_nbev3devwidget import roboSim

        self._units = max(self._units, start + frame["t"])
        roboSim.collect(frame.get("data", []), frame.get("images", []))
        if "sender" in frame and not self._defines_sender:
            self._namespace["sender"] = frame["sender"]
        self._wire.send(self._answer_text(frame["text"]))

    def _load_module(self, text: str) -> Frame | None:
        """Run the module. Return its error, also if it has no responder, or None."""
        try:
            self._files.execute(text, self._name, self._namespace)
            if self._function != call_results.NO_RESPONDER:
                self._find_function()
        except BaseException as error:
            return self._files.describe_error(error)
        self._defines_msg, self._defines_sender = "msg" in self._namespace, "sender" in self._namespace
        return None

    def _find_function(self) -> Callable[[str], Any]:
        """Return the requested function, else ``roboSim.pyresponder``, ``responder``, or the only ``*_responder``."""
        from nbev3devsim.load_nbev3devwidget import roboSim

        if self._function is not None:
            if not callable(self._namespace.get(self._function)):
                raise LookupError(f"there is no function called {self._function}")
            return self._namespace[self._function]  # type: ignore[no-any-return]
        return roboSim.find_responder(self._namespace)

    def _answer_text(self, text: str) -> Frame:
        from nbev3devsim.load_nbev3devwidget import roboSim

        if not self._defines_msg:
            self._namespace["msg"] = text
        self._wrap_functions()
        self._stack, self._calls = ["responder"], 0
        try:
            answer = roboSim.ask(self._find_function(), text)
        except BaseException as error:
            return {"do": "answer", "kind": "error", "error": self._files.describe_error(error)}
        if not isinstance(answer, str):
            return {"do": "answer", "kind": "other", "type": type(answer).__name__}
        if not can_send_text(answer):
            return {"do": "answer", "kind": "long", "length": len(answer)}
        return {"do": "answer", "kind": "text", "text": str(answer)}

    def _wrap_functions(self) -> None:
        """Wrap the current parser, agent and logger, and ``predict`` of every bound network, to record calls."""
        for name, value in list(self._namespace.items()):
            if name in _RECORDED_NAMES:
                # Callable objects may have state that a wrapping function would lose.
                if (
                    name != self._own_name
                    and isinstance(value, _FUNCTION_TYPES)
                    and not hasattr(value, "_robomark_noted")
                ):
                    self._namespace[name] = self._wrap_function(name, value)
                continue
            predict = getattr(value, "predict", None) if not isinstance(value, type | types.ModuleType) else None
            if callable(predict) and not hasattr(predict, "_robomark_noted"):
                try:
                    value.predict = self._wrap_function(name, predict)
                except Exception:
                    continue

    def _wrap_function(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(function)
        def call(*args: Any, **kwargs: Any) -> Any:
            caller, depth = self._stack[-1] if self._stack else "responder", len(self._stack)
            self._stack.append(name)
            result: Any = None
            try:
                result = function(*args, **kwargs)
            finally:
                if self._stack:
                    self._stack.pop()
                self._report_call(depth, caller, name, args, result)
            return result

        call._robomark_noted = True  # type: ignore[attr-defined]
        return call

    def _report_call(self, depth: int, caller: str, callee: str, args: tuple[Any, ...], result: Any) -> None:
        self._calls += 1
        if self._calls <= 50:
            self._wire.send(
                {
                    "do": "call",
                    "depth": depth,
                    "caller": caller,
                    "callee": clip(callee, 60),
                    "argument": _describe_value(args[0]) if args else "",
                    "result": _describe_value(result),
                }
            )

    def _sleep(self, units: int) -> None:
        self._units += units
        self._wire.send({"do": "sleep", "units": min(units, 10**15)})

    def _advance_time(self, units: int) -> None:
        self._units = max(self._units, units)

    def _emit(self, text: str) -> None:
        self._wire.send({"do": "print", "text": self._files.remove_folders(text)})

    def _report_refusal(self, sentence: str) -> None:
        self._wire.send({"do": "refused", "what": sentence, **self._files.locate_frame(sys._getframe())})

    def _report_busy(self, _: int, frame: FrameType | None) -> None:
        try:
            self._wire.send({"do": "busy", **self._files.locate_frame(frame)})
        finally:
            os._exit(0)


def _describe_value(value: Any) -> str:
    """Return a short text for a value. Never fails, even if its repr does."""
    try:
        return clip(repr(value), 80)
    except Exception:
        return f"<{type(value).__name__}>"
