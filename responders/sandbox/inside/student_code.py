"""Compiling and running a student's files, and saying where in them something went wrong.

Only frames of those files count: a line number is always one that the student can look up.
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
from .near_names import meant_by
from .statement_watch import StatementWatch

_MOST_WARNINGS, _LONGEST_WARNING = 20, 180
Namespace = dict[str, Any]


def compile_source(text: str, name: str) -> CodeType:
    """Code of a whole file; tracebacks can show its lines."""
    linecache.cache[name] = (len(text), None, text.splitlines(keepends=True), name)
    return compile(text, name, "exec", dont_inherit=True)


class StudentFiles:
    """The file that is run, and those beside it that it has imported; what of them is meant by a frame or an error."""

    def __init__(self, main: str) -> None:
        self.main = main
        self.watch: StatementWatch | None = None  # only where it is asked which statements are run
        self.imported: set[str] = set()
        here = os.getcwd()
        self._folder = f"{here}/" if here != "/" else None
        folders = {here, sys.prefix, sys.base_prefix, *sys.path, os.path.dirname(os.__file__)} - {"", "/"}
        # The longest first: one may lie in another.
        self._folders = [f"{folder}/" for folder in sorted(folders, key=len, reverse=True)]

    def execute(self, text: str, name: str, namespace: Namespace) -> None:
        """Run a whole file of this name."""
        code = compile_source(text, name)
        exec(code if self.watch is None else self.watch.compile(text, name, namespace), namespace)

    def has(self, name: str) -> bool:
        """Whether code with this file name is the student's."""
        return name == self.main or self._beside(name) is not None

    def place(self, frame: FrameType | None) -> Frame:
        """``line`` and ``file`` of what is being run, from an inner frame outwards; the main file is None."""
        while frame is not None:
            if self.has(frame.f_code.co_filename):
                return self._place(frame.f_code.co_filename, frame.f_lineno)
            frame = frame.f_back
        return {"line": None, "file": None}

    def line_in_main(self, frame: FrameType | None) -> int | None:
        """The line of the main file that has led here."""
        while frame is not None:
            if frame.f_code.co_filename == self.main:
                return frame.f_lineno
            frame = frame.f_back
        return None

    def described(self, error: BaseException) -> Frame:
        """The error as a frame: its type, its words, the last line of the student's files on the way to it, a hint."""
        place: Frame = {"line": None, "file": None}
        if isinstance(error, SyntaxError) and error.filename is not None and self.has(error.filename):
            place = self._place(error.filename, error.lineno)
            words = error.msg or "invalid syntax"
        else:
            for frame, number in traceback.walk_tb(error.__traceback__):
                if self.has(frame.f_code.co_filename):
                    place = self._place(frame.f_code.co_filename, number)
            words = _words(error)
        told = {"type": type(error).__name__, "text": clip(self.without_folders(words)), **place}
        hint = meant_by(error)
        return {**told, "hint": hint} if hint else told

    def without_folders(self, text: str) -> str:
        """``text`` without what leads to this machine's modules and to the working folder."""
        if "/" not in text:
            return text
        for folder in self._folders:
            text = text.replace(folder, "")
        return text if self._folder is None else text.replace(self._folder[:-1], ".")

    def _place(self, name: str, line: int | None) -> Frame:
        return {"line": line, "file": None if name == self.main else self._beside(name)}

    def _beside(self, name: str) -> str | None:
        """The flat name of a file beside the main one."""
        if name in self.imported:
            return name
        if self._folder is not None and name.startswith(self._folder):
            flat = name.removeprefix(self._folder)
            return flat if is_module_file(flat) else None
        return None


def is_module_file(name: str) -> bool:
    """Whether a file of this name can be imported by its stem."""
    return name.endswith(".py") and name.removesuffix(".py").isidentifier()


def _words(error: BaseException) -> str:
    try:
        return str(error)
    except Exception:
        return "(its message cannot be shown)"


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


def install_warnings(tell: Callable[[str], None]) -> None:
    """Let a warning be no text of the student's, whoever it comes from: ``tell(sentence)``, once for each of the first.

    It is told from within what has warned.
    """
    told: set[str] = set()

    def show(
        message: Warning | str, category: type[Warning], filename: str, lineno: int, file: Any = None, line: Any = None
    ) -> None:
        sentence = f"{category.__name__}: {message}"
        if sentence not in told and len(told) < _MOST_WARNINGS:
            told.add(sentence)
            tell(clip(sentence, _LONGEST_WARNING))

    warnings.showwarning = show
