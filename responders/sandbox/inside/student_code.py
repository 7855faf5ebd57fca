"""Compiling and running a student's file, and saying where in it something went wrong.

Only frames of that file count: a line number is always one that the student can look up.
"""

from __future__ import annotations

import builtins
import linecache
import traceback
from collections.abc import Callable
from types import CodeType, FrameType
from typing import Any

from .frames import Frame, clip

Namespace = dict[str, Any]


def compile_source(text: str, name: str) -> CodeType:
    """Code of a whole file; tracebacks can show its lines."""
    linecache.cache[name] = (len(text), None, text.splitlines(keepends=True), name)
    return compile(text, name, "exec", dont_inherit=True)


def describe(error: BaseException, name: str) -> Frame:
    """The error as a frame: its type, its words, and the last line of the student's file on the way to it."""
    line: int | None = None
    if isinstance(error, SyntaxError) and error.filename == name:
        line = error.lineno
        words = error.msg or "invalid syntax"
    else:
        for frame, number in traceback.walk_tb(error.__traceback__):
            if frame.f_code.co_filename == name:
                line = number
        words = _words(error)
    return {"type": type(error).__name__, "text": clip(words), "line": line}


def _words(error: BaseException) -> str:
    try:
        return str(error)
    except Exception:
        return "(its message cannot be shown)"


def line_of(frame: FrameType | None, name: str) -> int | None:
    """The line of the student's file that is being run, counted from an inner frame outwards."""
    while frame is not None:
        if frame.f_code.co_filename == name:
            return frame.f_lineno
        frame = frame.f_back
    return None


class Output:
    """A standard stream: every write becomes one text."""

    encoding = "utf-8"
    errors = "strict"
    closed = False

    def __init__(self, emit: Callable[[str], None]) -> None:
        self._emit = emit

    def write(self, text: str) -> int:
        """Hand on one text without its last line feed and return its length; raises TypeError for what is no text."""
        if not isinstance(text, str):
            raise TypeError(f"write() argument must be str, not {type(text).__name__}")
        stripped = text[:-1] if text.endswith("\n") else text
        if stripped or text == "\n":
            self._emit(stripped)
        return len(text)

    def writelines(self, lines: Any) -> None:
        """Hand on each line as one text."""
        for line in lines:
            self.write(line)

    def flush(self) -> None:
        """Nothing is held back."""

    def isatty(self) -> bool:
        """False: what is written goes to no terminal."""
        return False

    def writable(self) -> bool:
        """True, as for any stream that is written to."""
        return True

    def readable(self) -> bool:
        """False; nothing can be read from it."""
        return False


def install_output(emit: Callable[[str], None]) -> None:
    """Let one call of ``print`` be one text, without its end, and refuse ``input``."""
    import sys

    stream = Output(emit)
    sys.stdout = sys.stderr = stream
    sys.stdin = None
    real_print = builtins.print

    def one_text(
        *values: Any, sep: str | None = " ", end: str | None = "\n", file: Any = None, flush: bool = False
    ) -> None:
        if file is None or file is stream:
            if sep is not None and not isinstance(sep, str):
                raise TypeError(f"sep must be None or a string, not {type(sep).__name__}")
            emit((" " if sep is None else sep).join([str(value) for value in values]))
        else:
            real_print(*values, sep=sep, end=end, file=file, flush=flush)

    def no_input(prompt: object = "") -> str:
        raise EOFError("nobody is at the keyboard: input() cannot be used in a graded program")

    one_text.__name__, no_input.__name__ = "print", "input"
    builtins.print = one_text
    builtins.input = no_input
