"""Calls functions of a responder, or of an instructor's check, inside the sandbox and without a robot.

The module is loaded once in a fresh child and its functions are called one after the other; what the values are worth
is judged elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from responders import wire
from responders.code import Code
from responders.faults import error_fault, surprise
from responders.responder_process import ResponderProcess
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import ChildStopped, JobMeter
from responders.sandbox.running_child import ChildLimits
from responders.trial_spec import RanStatements, ResponderSpec
from sim.readers.json_text import read_json
from sim.recording import Fault, Verdict

#: Tells the child that no function of the module has to be a responder.
_NO_RESPONDER = ""


#: The field that each kind of value must have.
_NEEDED = {"value": "text", "error": "error", "other": "type"}


@dataclass(frozen=True, slots=True)
class FunctionCall:
    """A function's name and what it is called with; all of it has to have a form in JSON."""

    function: str
    arguments: Sequence[Any] = ()
    named: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Returned:
    """What a call gave: a value as JSON has it, or what went wrong instead."""

    value: Any = None
    fault: Fault | None = None


@dataclass(frozen=True, slots=True)
class Called:
    """What all calls gave, in their order. ``fault`` is what kept the module from being loaded.

    ``printed`` has what the module printed while it was loaded, and then what it printed in each call; ``notes`` what
    had been noted by the end of each of these.
    """

    returned: tuple[Returned, ...]
    fault: Fault | None
    sandbox: str
    printed: tuple[tuple[str, ...], ...] = ()
    notes: tuple[tuple[str, ...], ...] = ()


def call_functions(
    code: Code,
    files: Mapping[str, bytes],
    calls: Sequence[FunctionCall],
    limits: ChildLimits,
    output_bytes: int,
    sandboxes: Sandboxes,
    seed: int,
    meter: JobMeter,
    ran: RanStatements | None = None,
) -> Called:
    """Load ``code`` with ``files`` in its folder, and make the calls. ``limits`` are for all of them together.

    ``meter`` counts what their job costs; ``ran`` notes which statements are run, if it is there.

    Raises HostError when the machine, not the module, fails.
    """
    with sandboxes.private_folder() as folder:
        spec = ResponderSpec(code, files, limits, output_bytes, _NO_RESPONDER, ran)
        caller = _Caller(spec, sandboxes, folder, seed, meter)
        try:
            sandbox = caller.sandbox
            fault = caller.load()
            printed, notes = [caller.taken()], [tuple(caller.notes)]
            gave = []
            for call in calls if fault is None else ():
                gave.append(caller.call(call))
                printed.append(caller.taken())
                notes.append(tuple(caller.notes))
            return Called(tuple(gave), fault, sandbox, tuple(printed), tuple(notes))
        finally:
            caller.close()


class _Caller(ResponderProcess):
    """A responder's process that is asked for functions by their names."""

    _schema = wire.CALLS

    def __init__(self, spec: ResponderSpec, sandboxes: Sandboxes, folder: Path, seed: int, meter: JobMeter) -> None:
        super().__init__(spec, sandboxes, folder, seed, meter)
        self._ended: Fault | None = None

    def taken(self) -> tuple[str, ...]:
        """What has been printed since this was last asked."""
        printed, self.output = tuple(self.output), []
        return printed

    def call(self, call: FunctionCall) -> Returned:
        """Never raises for what the called code does; after its process has been stopped, every call has that fault."""
        if self._child is None:
            return Returned(fault=self._ended)
        try:
            self._child.send(
                {"do": "call", "function": call.function, "arguments": list(call.arguments), "named": dict(call.named)}
            )
            frame = self._until("returned")
            needed = _NEEDED.get(frame["kind"])
            if needed is not None and needed not in frame:
                raise ChildStopped(Verdict.SANDBOX_VIOLATION, "the process sent a value without its content")
            return _read(frame, call.function)
        except ChildStopped as stop:
            self._ended = self._stopped(stop, 0)
        except Exception as error:
            self._ended = self._stopped(surprise(error), 0)
        return Returned(fault=self._ended)


def _read(frame: wire.Frame, function: str) -> Returned:
    """What a frame says that has the field its kind needs."""
    match frame["kind"]:
        case "value":
            try:
                return Returned(read_json(frame["text"], parse_constant=_no_constant))
            except ValueError:
                sentence = f"{function} returned a value that cannot be read"
        case "missing":
            sentence = no_function(function)
        case "long":
            sentence = f"{function} returned a value that is too long to be passed on"
        case "other":
            sentence = f"{function} returned {frame['type'][:100]}, which cannot be passed on"
        case _:
            return Returned(fault=error_fault(frame["error"], 0, "responder"))
    return Returned(fault=Fault(0.0, Verdict.RESPONDER_ERROR, "responder", sentence))


def no_function(name: str) -> str:
    """The message of the fault where a module has no function of this name."""
    return f"there is no function called {name}"


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is not JSON")
