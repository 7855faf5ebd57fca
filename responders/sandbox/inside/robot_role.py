"""The role of a robot program: runs the preamble, then the student's file, with the brick's modules.

Requests to the world and the end of the program are sent over the wire; the worker decides.
"""

from __future__ import annotations

import functools
import os
import signal
import sys
import types
from collections.abc import Mapping
from types import CodeType, FrameType
from typing import Any

from . import determinism, own_modules, refusals, student_code
from .frames import Frame, Wire, clip
from .lockdown import Grants
from .statement_watch import StatementWatch

#: Modules needed by every robot program.
NEEDED = ("brick_link", "brick_preambles", "ev3dev2_glue")


def preload(exclusions: list[str]) -> None:
    """Compile the preambles."""
    compile_preambles()


@functools.cache
def compile_preambles() -> Mapping[str, CodeType]:
    """Return the compiled preambles by name."""
    from brick_preambles import PREAMBLES

    return {name: compile(text, "<preamble>", "exec", dont_inherit=True) for name, text in PREAMBLES.items()}


def run(wire: Wire, grants: Grants) -> None:
    """Receive a program, run it, and report how it ended."""
    from brick_link import link

    spec = wire.receive()
    files = student_code.StudentFiles(spec["name"])
    if spec.get("watch"):
        files.watch = StatementWatch(wire.send, files.main)

    def stuck() -> None:
        _send_and_exit(wire, {"do": "stuck", **files.locate_frame(sys._getframe())})

    def busy(_: int, frame: FrameType | None) -> None:
        _send_and_exit(wire, {"do": "busy", **files.locate_frame(frame)})

    def emit(text: str) -> None:
        link.notify({"do": "print", "text": text})

    def now() -> int:
        link.read_freely()
        return link.units

    def sleep(units: int) -> None:
        link.wait_units(units)

    def report_refusal(sentence: str) -> None:
        wire.send({"do": "refused", "what": sentence, **files.locate_frame(sys._getframe())})

    signal.signal(signal.SIGXCPU, busy)
    link.number = spec.get("number", 1)
    link.connect(wire, stuck, spec["sensors"], spec["tick"], files.pack_main_lines)
    student_code.install_output(emit)
    student_code.install_warnings(report_refusal)
    determinism.install_clock(now, sleep)
    determinism.install_randomness(spec["seed"])
    refusals.install_refusals(grants, files, report_refusal)
    own_modules.install_importer(own_modules.build_source(spec["modules"]), spec["modules"], files, report_refusal)
    module = types.ModuleType("__main__")
    sys.modules["__main__"] = module
    wire.send({"do": "end", "error": _execute_program(spec, module.__dict__, files)})
    wire.receive()


def _execute_program(spec: Frame, namespace: dict[str, Any], files: student_code.StudentFiles) -> Frame | None:
    """Run the program. Return its error, or None."""
    try:
        exec(compile_preambles()[spec["preamble"]], namespace)
        files.execute(spec["text"], files.main, namespace)
    except SystemExit as ending:
        if ending.code in (None, 0):
            return None
        return {"type": "SystemExit", "text": clip(str(ending.code)), "line": None, "file": None}
    except BaseException as error:
        return files.describe_error(error)
    return None


def _send_and_exit(wire: Wire, frame: Frame) -> None:
    """Send the reason and end the process at once, so that student code can't continue or catch it."""
    try:
        wire.send(frame)
    finally:
        os._exit(0)
