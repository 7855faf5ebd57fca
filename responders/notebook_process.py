"""The process of a notebook: it executes the cells and answers the robots that they start.

It records the output and the errors of the cells. ``notebook_executor.py`` runs the robots.
"""

from __future__ import annotations

import bisect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from responders import wire
from responders.faults import build_error_fault, to_child_data_error
from responders.required_libraries import build_notebook_source
from responders.responder_process import ResponderProcess
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import ChildStopped, JobMeter
from responders.sandbox.running_child import ChildLimits
from responders.source_file import SourceFile
from responders.trial_spec import AgentSpec, ResponderSpec
from sim.random_streams import RandomStream
from sim.recording import Fault, Verdict

if TYPE_CHECKING:
    from responders.agents import Agents

#: Maximum number of calls of magics that set up or start the robot.
_MAX_MAGICS = 2000


@dataclass(frozen=True, slots=True)
class NotebookSpec:
    """A notebook's cells in order, and the files in its folder."""

    name: str
    cells: tuple[str, ...]
    files: Mapping[str, bytes]
    limits: ChildLimits
    output_bytes: int
    seed: int
    agents: Mapping[str, AgentSpec] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def responder_spec(self) -> ResponderSpec:
        """Return the responder spec for the Python code of the notebook's process."""
        return ResponderSpec(
            SourceFile(self.name, build_notebook_source(self.cells)), self.files, self.limits, self.output_bytes
        )


class NotebookProcess(ResponderProcess):
    """The process of a notebook during one execution. Cells and their lines are counted from 1."""

    _schema = wire.NOTEBOOK

    def __init__(
        self, spec: NotebookSpec, sandboxes: Sandboxes, folder: Path, meter: JobMeter, agents: Agents | None = None
    ) -> None:
        super().__init__(spec.responder_spec, sandboxes, folder, spec.seed, meter, agents)
        if agents is not None:
            self._schema = wire.NOTEBOOK_WITH_AGENTS
        self._notebook = spec
        self._first_lines = [1]
        for source in spec.cells:
            self._first_lines.append(self._first_lines[-1] + source.count("\n") + 1)
        self._cell = 1
        self._printed_in = 0
        self._magics = 0
        #: Reason for a missing responder, or None if there is one. Updated at each magic and at the end.
        self.missing: str | None = None
        #: The cell since which there is a responder, or None if there is none.
        self.answers_since: int | None = None
        #: The faults that ended single cells, in order, and the fault that ended the process.
        self.raised: list[Fault] = []
        self.stopped: Fault | None = None

    def execute(self, perform: Callable[[wire.Frame], dict[str, Any]]) -> None:
        """Execute all cells. ``perform`` performs the request of a magic and returns the reply."""
        assert self._child is not None
        try:
            self._child.send(
                {
                    "name": self._notebook.name,
                    "cells": self._notebook.cells,
                    "seed": RandomStream(self._seed, "responder").integer(0),
                    "function": None,
                    **self._build_agents_entry(),
                }
            )
            while True:
                frame = self._child.receive(self._schema)
                if frame["do"] == "executed":
                    self.missing = frame["missing"]
                    self._record_answering(self.missing is None)
                    return
                self._accept_cell_frame(frame, perform)
                if self._child is None:
                    return
        except ChildStopped as stop:
            self._convert_stop(stop, 0)
        except Exception as error:
            self._convert_stop(to_child_data_error(error), 0)
        finally:
            self._note_skipped_cells()

    def locate_fault(self, fault: Fault) -> Fault:
        """Return a fault of the process with its cell and line, if known."""
        if fault.who != "responder" or fault.line is None or fault.cell is not None or fault.file:
            return fault
        cell, line = self.locate_line(fault.line)
        return replace(fault, cell=cell, line=line)

    def locate_line(self, line: int | None) -> tuple[int, int | None]:
        """Return the cell, and the line in it, for a line of the whole notebook. Without a line, the current cell."""
        if line is None or not 1 <= line < self._first_lines[-1]:
            return self._cell, None
        cell = bisect.bisect_right(self._first_lines, line)
        return cell, line - self._first_lines[cell - 1] + 1

    def add_note(self, line: int | None, sentence: str, file: str | None = None) -> None:
        """Keep a note for the report with its place. ``file`` is a file beside the notebook."""
        cell, number = self.locate_line(line) if file is None else (self._cell, line)
        location = f"cell {cell}" if number is None else f"cell {cell}, line {number}"
        self._add_note(f"{location}{f' of {file}' if file else ''}: {sentence}")

    def _note_skipped_cells(self) -> None:
        first, last = self._cell + 1, len(self._notebook.cells)
        if self.stopped is not None and first <= last:
            subject = f"cell {last} was" if first == last else f"cells {first} to {last} were"
            self._add_note(f"{subject} not run: the notebook was stopped in cell {self._cell}")

    def _accept_cell_frame(self, frame: wire.Frame, perform: Callable[[wire.Frame], dict[str, Any]]) -> None:
        # Each costs output, so a process can't send them without limit.
        self._charge_output("", "sent")
        match frame["do"]:
            case "cell":
                self._record_answering(frame["answers"])
                self._cell = min(frame["place"] + 1, len(self._notebook.cells))
            case "raised":
                fault = self.locate_fault(build_error_fault(frame["error"], 0, "responder"))
                fault = replace(fault, message=fault.message.replace("the responder asked", "it asked", 1))
                self.raised.append(replace(fault, cell=fault.cell or self._cell))
                self._add_note(f"{self.raised[-1].place}: {fault.message}; the other cells were run all the same")
            case "magic" | "state":
                self._magics += 1
                if self._magics > _MAX_MAGICS:
                    sentence = f"the notebook called %sim_magic more than {_MAX_MAGICS} times"
                    raise ChildStopped(Verdict.OUTPUT_LIMIT, sentence)
                if frame["do"] == "magic":
                    self.missing = None if frame["missing"] is None else frame["missing"][:400]
                reply = perform(frame)
                if self._child is not None:
                    self._child.send(reply)
            case _:
                self._accept_frame(frame)

    def _record_answering(self, is_answering: bool) -> None:
        """Record whether there is a responder after the cell that has just been executed."""
        if not is_answering:
            self.answers_since = None
        elif self.answers_since is None:
            self.answers_since = self._cell

    def _accept_frame(self, frame: wire.Frame) -> None:
        match frame["do"]:
            case "refused":
                self.add_note(frame["line"], frame["what"][:200], frame["file"])
            case "note":
                # A responder may call magics too.
                self._charge_output("", "sent")
                self.add_note(frame["line"], frame["text"][:400], frame["file"])
            case _:
                super()._accept_frame(frame)

    def _print(self, text: str) -> None:
        if self._cell != self._printed_in:
            self._printed_in = self._cell
            self.output.append(f"--- cell {self._cell} ---")
        super()._print(text)

    def _convert_stop(self, stop: ChildStopped, t: int) -> Fault:
        fault = super()._convert_stop(stop, t)
        self.stopped = self.locate_fault(replace(fault, message=fault.message.replace("the responder", "the notebook")))
        if self.stopped.cell is None:
            self.stopped = replace(self.stopped, cell=self._cell)
        return self.stopped
