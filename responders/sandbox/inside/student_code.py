"""Compiles and runs a student's files, and locates errors in them.

Only frames of these files count, so students can look up every line number.
"""

from __future__ import annotations

import builtins
import linecache
import os
import sys
import traceback
import warnings
from collections.abc import Callable
from types import CodeType, FrameType
from typing import Any

from .frames import Frame, clip
from .name_suggestions import suggest_fix
from .statement_watch import StatementWatch

_MAX_WARNINGS, _MAX_WARNING_LENGTH = 20, 180
#: Factor of the outermost line in a packed pair of lines, and number of frames searched for that line.
OUTER_LINE_FACTOR, _MAX_FRAMES = 1 << 20, 40
Namespace = dict[str, Any]


def compile_source(text: str, name: str) -> CodeType:
    """Compile a whole file. Tracebacks can show its lines."""
    linecache.cache[name] = (len(text), None, text.splitlines(keepends=True), name)
    return compile(text, name, "exec", dont_inherit=True)


class StudentFiles:
    """The main file and the imported files beside it. Maps frames and errors to places in them."""

    def __init__(self, main: str) -> None:
        self.main = main
        self.watch: StatementWatch | None = None  # only if executed statements are recorded
        self.imported: set[str] = set()
        folder = os.getcwd()
        self._folder = f"{folder}/" if folder != "/" else None
        folders = {folder, sys.prefix, sys.base_prefix, *sys.path, os.path.dirname(os.__file__)} - {"", "/"}
        # The longest first, because one may contain another.
        self._folders = [f"{folder}/" for folder in sorted(folders, key=len, reverse=True)]

    def execute(self, text: str, name: str, namespace: Namespace) -> None:
        """Run a whole file under this name."""
        code = compile_source(text, name)
        exec(code if self.watch is None else self.watch.compile(text, name, namespace), namespace)

    def has(self, name: str) -> bool:
        """Return whether a file name belongs to the student's code."""
        return name == self.main or self._find_flat_name(name) is not None

    def locate_frame(self, frame: FrameType | None) -> Frame:
        """Return ``line`` and ``file`` of the innermost student frame. ``file`` is None for the main file."""
        while frame is not None:
            if self.has(frame.f_code.co_filename):
                return self._build_place(frame.f_code.co_filename, frame.f_lineno)
            frame = frame.f_back
        return {"line": None, "file": None}

    def find_main_line(self, frame: FrameType | None) -> int | None:
        """Return the line of the main file that led to the frame."""
        while frame is not None:
            if frame.f_code.co_filename == self.main:
                return frame.f_lineno
            frame = frame.f_back
        return None

    def pack_main_lines(self) -> int:
        """Return the innermost and the outermost running line of the main file, packed into one positive number."""
        inner = outer = 0
        frame: FrameType | None = sys._getframe(1)
        for _ in range(_MAX_FRAMES):
            if frame is None:
                break
            if frame.f_code.co_filename == self.main:
                outer = frame.f_lineno
                inner = inner or outer
            frame = frame.f_back
        return max(inner, 1) + outer * OUTER_LINE_FACTOR

    def describe_error(self, error: BaseException) -> Frame:
        """Return the error as a frame: type, text, last student line on its way, and a hint."""
        location: Frame = {"line": None, "file": None}
        if isinstance(error, SyntaxError) and error.filename is not None and self.has(error.filename):
            location = self._build_place(error.filename, error.lineno)
            text = error.msg or "invalid syntax"
        else:
            for frame, number in traceback.walk_tb(error.__traceback__):
                if self.has(frame.f_code.co_filename):
                    location = self._build_place(frame.f_code.co_filename, number)
            text = _format_message(error)
        error_frame = {"type": type(error).__name__, "text": clip(self.remove_folders(text)), **location}
        hint = suggest_fix(error)
        return {**error_frame, "hint": hint} if hint else error_frame

    def remove_folders(self, text: str) -> str:
        """Return ``text`` without the paths of this machine's modules and of the working folder."""
        if "/" not in text:
            return text
        for folder in self._folders:
            text = text.replace(folder, "")
        return text if self._folder is None else text.replace(self._folder[:-1], ".")

    def _build_place(self, name: str, line: int | None) -> Frame:
        return {"line": line, "file": None if name == self.main else self._find_flat_name(name)}

    def _find_flat_name(self, name: str) -> str | None:
        """Return the flat name of a file beside the main one, or None."""
        if name in self.imported:
            return name
        if self._folder is not None and name.startswith(self._folder):
            flat = name.removeprefix(self._folder)
            return flat if is_module_file(flat) else None
        return None


def is_module_file(name: str) -> bool:
    """Return whether a file of this name can be imported by its stem."""
    return name.endswith(".py") and name.removesuffix(".py").isidentifier()


def _format_message(error: BaseException) -> str:
    try:
        return str(error)
    except Exception:
        return "(its message cannot be shown)"


class TextStream:
    """A standard stream that sends each write as one text."""

    encoding = "utf-8"
    errors = "strict"
    closed = False

    def __init__(self, emit: Callable[[str], None]) -> None:
        self._emit = emit

    def write(self, text: str) -> int:
        """Send one text without its last line feed. Return its length.

        Raises:
            TypeError: If ``text`` is not a str.
        """
        if not isinstance(text, str):
            raise TypeError(f"write() argument must be str, not {type(text).__name__}")
        stripped = text[:-1] if text.endswith("\n") else text
        if stripped or text == "\n":
            self._emit(stripped)
        return len(text)

    def writelines(self, lines: Any) -> None:
        """Send each line as one text."""
        for line in lines:
            self.write(line)

    def flush(self) -> None:
        """Do nothing: no output is buffered."""

    def isatty(self) -> bool:
        """Return False: the output is not a terminal."""
        return False

    def writable(self) -> bool:
        """Return True."""
        return True

    def readable(self) -> bool:
        """Return False."""
        return False


def install_output(emit: Callable[[str], None]) -> None:
    """Make each call of ``print`` send one text, without its end, and refuse ``input``."""
    stream = TextStream(emit)
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


def install_warnings(report: Callable[[str], None]) -> None:
    """Report warnings with ``tell(sentence)`` instead of printing them, once for each of the first few.

    ``report`` is called inside the code that warns.
    """
    reported_warnings: set[str] = set()

    def show(
        message: Warning | str, category: type[Warning], filename: str, lineno: int, file: Any = None, line: Any = None
    ) -> None:
        sentence = f"{category.__name__}: {message}"
        if sentence not in reported_warnings and len(reported_warnings) < _MAX_WARNINGS:
            reported_warnings.add(sentence)
            report(clip(sentence, _MAX_WARNING_LENGTH))

    warnings.showwarning = show
