"""Function calls into a responder or an instructor's check, inside the sandbox and without a robot.

The module is loaded once in a fresh child, then its functions are called in order. The values are judged elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from responders import wire
from responders.faults import build_error_fault, to_child_data_error
from responders.responder_process import ResponderProcess
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import ChildStopped, JobMeter
from responders.sandbox.running_child import ChildLimits
from responders.source_file import SourceFile
from responders.trial_spec import ExecutedStatements, ResponderSpec
from sim.readers.json_text import read_json
from sim.recording import Fault, Verdict

#: Tells the child that the module needs no responder function.
_NO_RESPONDER = ""


#: The required field of each kind of value.
_REQUIRED_FIELDS = {"value": "text", "error": "error", "other": "type"}


@dataclass(frozen=True, slots=True)
class FunctionCall:
    """A function's name and its arguments, which must be JSON-serialisable.

    The statements that a ``hidden`` call executes are not collected, because they depend on its arguments.
    """

    function: str
    arguments: Sequence[Any] = ()
    named: Mapping[str, Any] = field(default_factory=dict)
    hidden: bool = False


@dataclass(frozen=True, slots=True)
class CallResult:
    """The result of a call: a JSON value, or the fault."""

    value: Any = None
    fault: Fault | None = None


@dataclass(frozen=True, slots=True)
class CallResults:
    """The results of all calls, in order. ``fault`` is set if the module could not be loaded.

    ``printed`` holds the output from loading the module, then the output of each call. ``notes`` holds the notes made
    by the end of each of these.
    """

    returned: tuple[CallResult, ...]
    fault: Fault | None
    sandbox: str
    printed: tuple[tuple[str, ...], ...] = ()
    notes: tuple[tuple[str, ...], ...] = ()


def call_functions(
    code: SourceFile,
    files: Mapping[str, bytes],
    calls: Sequence[FunctionCall],
    limits: ChildLimits,
    output_bytes: int,
    sandboxes: Sandboxes,
    seed: int,
    meter: JobMeter,
    executed_statements: ExecutedStatements | None = None,
) -> CallResults:
    """Load ``code`` with ``files`` in its folder and make the calls.

    Args:
        code: The module.
        files: Files for the child's folder: name to content.
        calls: The calls, in order.
        limits: Limits for all calls together.
        output_bytes: Limit for the printed output.
        sandboxes: Starts the child.
        seed: Seed for the child.
        meter: Counts the costs of the job.
        executed_statements: Collects the executed statements, if given.

    Raises:
        HostError: If the machine fails, not the module.
    """
    with sandboxes.open_private_folder() as folder:
        spec = ResponderSpec(code, files, limits, output_bytes, _NO_RESPONDER, executed_statements)
        caller = _CallProcess(spec, sandboxes, folder, seed, meter)
        try:
            sandbox = caller.sandbox
            fault = caller.load()
            printed, notes = [caller.take_output()], [tuple(caller.notes)]
            results = []
            for call in calls if fault is None else ():
                results.append(caller.call_function(call))
                printed.append(caller.take_output())
                notes.append(tuple(caller.notes))
            return CallResults(tuple(results), fault, sandbox, tuple(printed), tuple(notes))
        finally:
            caller.close()


class _CallProcess(ResponderProcess):
    """A responder process whose functions are called by name."""

    _schema = wire.CALLS

    def __init__(self, spec: ResponderSpec, sandboxes: Sandboxes, folder: Path, seed: int, meter: JobMeter) -> None:
        super().__init__(spec, sandboxes, folder, seed, meter)
        self._ended: Fault | None = None

    def take_output(self) -> tuple[str, ...]:
        """Return the output printed since the last call of this method."""
        printed, self.output = tuple(self.output), []
        return printed

    def call_function(self, call: FunctionCall) -> CallResult:
        """Return the result of one call. Raises no exception for errors in the called code.

        After the process has been stopped, every call returns the same fault.
        """
        if self._child is None:
            return CallResult(fault=self._ended)
        self._watches = not call.hidden
        try:
            self._child.send(
                {"do": "call", "function": call.function, "arguments": list(call.arguments), "named": dict(call.named)}
            )
            frame = self._receive_until("returned")
            needed = _REQUIRED_FIELDS.get(frame["kind"])
            if needed is not None and needed not in frame:
                raise ChildStopped(Verdict.SANDBOX_VIOLATION, "the process sent a value without its content")
            return _parse_result(frame, call.function)
        except ChildStopped as stop:
            self._ended = self._convert_stop(stop, 0)
        except Exception as error:
            self._ended = self._convert_stop(to_child_data_error(error), 0)
        return CallResult(fault=self._ended)


def _parse_result(frame: wire.Frame, function: str) -> CallResult:
    """Return the result in a frame that has the required field for its kind."""
    match frame["kind"]:
        case "value":
            try:
                return CallResult(read_json(frame["text"], parse_constant=_reject_constant))
            except ValueError:
                sentence = f"{function} returned a value that cannot be read"
        case "missing":
            sentence = describe_missing_function(function)
        case "long":
            sentence = f"{function} returned a value that is too long to be passed on"
        case "other":
            sentence = f"{function} returned {frame['type'][:100]}, which cannot be passed on"
        case _:
            return CallResult(fault=build_error_fault(frame["error"], 0, "responder"))
    return CallResult(fault=Fault(0.0, Verdict.RESPONDER_ERROR, "responder", sentence))


def describe_missing_function(name: str) -> str:
    """Return the fault's message for a module that has no function of this name."""
    return f"there is no function called {name}"


def _reject_constant(name: str) -> None:
    raise ValueError(f"{name} is not JSON")
