"""The object that ``get_ipython()`` returns to a notebook's cells: magics by name, and refusals with a message.

Magics that start the robot only forward their arguments. The worker does the rest.
"""

from __future__ import annotations

import difflib
import os
import shlex
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from . import libraries, refusals
from .cell_source import LINE_WRAPPERS, WRAPPERS, extract_wrapped_code

_ROBOT_MAGICS = ("sim_magic", "sim_magic_imports", "sim_magic_preloaded")
#: Magics whose cells the report draws as diagrams.
_DIAGRAM_MAGICS = frozenset(("blockdiag", "seqdiag"))
_UNSUPPORTED_DIAGRAM_MAGICS = frozenset(("actdiag", "nwdiag", "packetdiag", "rackdiag"))
#: Magics that only set up or show something in a browser, or ask for a check or a submission.
_IGNORED_MAGICS = frozenset(
    (
        *("load_ext", "reload_ext", "unload_ext", "matplotlib", "pylab", "config", "autoreload", "precision", "xmode"),
        *("colors", "autosave", "alias_magic", "pinfo", "pdoc", "psource"),
        *("who", "who_ls", "whos", "hist", "history", "lsmagic", "magic", "quickref", "pdef", "pfile", "pinfo2", "pdb"),
        *("html", "HTML", "javascript", "js", "markdown", "latex", "svg", "SVG"),
        "robomark",
    )
)
_PROGRAM_MAGICS = frozenset(
    ("bash", "sh", "script", "sx", "system", "cmd", "perl", "ruby", "python", "python2", "python3", "pypy", "R")
)
_MIN_SIMILARITY = 0.7
_PACKAGE_MAGICS = frozenset(("pip", "pip3", "conda", "mamba"))
_PACKAGE_MESSAGE = f"packages cannot be installed here; {libraries.LIBRARY_DESCRIPTION} are there"


class RunRequester(Protocol):
    """The interface of the running notebook for the shell."""

    @property
    def namespace(self) -> dict[str, Any]:
        """The names that all cells have bound."""

    def note(self, text: str) -> None:
        """Report to the worker what was skipped or refused."""

    def start_robot(self, name: str, arguments: str, body: str | None) -> None:
        """Run a robot program or set its flags, for the magic ``%name``. ``body`` is the rest of its cell."""

    def run_line(self, text: str) -> Any:
        """Run code from the current line. Return its value, if it has one."""

    def run_body(self, body: str) -> None:
        """Run the rest of a magic's cell."""

    def run_file(self, name: str) -> None:
        """Run a Python file beside the notebook in the cells' namespace."""

    def expand(self, line: str) -> str:
        """Return a magic's line with ``{expression}`` and ``$name`` replaced by values."""

    def capture_output(self, work: Callable[[], None]) -> str:
        """Call ``work`` and return its output."""


class CapturedOutput:
    """The object that ``%%capture name`` binds to the name."""

    def __init__(self, stdout: str) -> None:
        self.stdout = stdout
        self.stderr = ""
        self.outputs: list[Any] = []

    def show(self) -> None:
        """Print the captured output."""
        if self.stdout:
            print(self.stdout.removesuffix("\n"))

    __call__ = show

    def __str__(self) -> str:
        return self.stdout


class Shell:
    """The part of IPython's shell that the course's notebooks use."""

    def __init__(self, requester: RunRequester) -> None:
        self._requester = requester
        self._lines: dict[str, Callable[[str], Any]] = {
            "cat": self._print_files,
            "less": self._print_files,
            "more": self._print_files,
            "pycat": self._print_files,
            "ls": self._list_files,
            "run": self._run_file,
            **dict.fromkeys(LINE_WRAPPERS, lambda line: self._requester.run_line(extract_wrapped_code(line))),
        }
        self._cells: dict[str, Callable[[str, str], Any]] = {
            **dict.fromkeys(WRAPPERS, lambda _, body: self._requester.run_body(body)),
            "capture": self._capture_body,
            "writefile": self._write_file,
            "file": self._write_file,
        }

    @property
    def user_ns(self) -> dict[str, Any]:
        """The names that all cells have bound, as in IPython."""
        return self._requester.namespace

    def run_line_magic(self, magic_name: str, line: str, _stack_depth: int = 1) -> Any:
        """Run ``%name line``. An unsupported magic is reported."""
        name = str(magic_name).lstrip("%")
        line = self._requester.expand(str(line))
        if name in _ROBOT_MAGICS:
            return self._requester.start_robot(name, line, None)
        if name in _IGNORED_MAGICS:
            return None
        data = _load_data_magics().get(name)
        if data is not None:
            return data(_split_words(line))
        if name in self._lines:
            return self._lines[name](line)
        return self._report_unsupported(name, f"%{name}")

    def run_cell_magic(self, magic_name: str, line: str, cell: str) -> Any:
        """Run ``%%name line`` with the rest of the cell."""
        name = str(magic_name).lstrip("%")
        line, body = self._requester.expand(str(line)), str(cell)
        if name in _ROBOT_MAGICS:
            return self._requester.start_robot(name, line, body)
        if name in self._cells:
            return self._cells[name](line, body)
        if name in _DIAGRAM_MAGICS:
            return None
        if name in _UNSUPPORTED_DIAGRAM_MAGICS:
            return self._requester.note(f"%%{name} was skipped: only %%blockdiag and %%seqdiag are drawn here")
        return self._report_unsupported(name, f"%%{name}")

    def magic(self, arg_s: str) -> Any:
        """Run ``%name line`` given as one text, as in older notebooks."""
        name, _, line = str(arg_s).lstrip("%").partition(" ")
        return self.run_line_magic(name, line)

    def system(self, cmd: str) -> None:
        """Refuse ``!cmd``."""
        self._requester.note(f"!{_shorten_line(cmd)} was refused: {refusals.PROGRAMS}")

    def getoutput(self, cmd: str, *_: Any, **__: Any) -> list[str]:
        """Refuse ``x = !cmd`` and return an empty list."""
        self.system(cmd)
        return []

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *args, **kwargs: None

    def _report_unsupported(self, name: str, line: str) -> None:
        if name in _PROGRAM_MAGICS:
            self._requester.note(f"{_shorten_line(line)} was refused: {refusals.PROGRAMS}")
        elif name in _PACKAGE_MAGICS:
            self._requester.note(f"{line} was refused: {_PACKAGE_MESSAGE}")
        elif name not in _IGNORED_MAGICS:
            similar_names = difflib.get_close_matches(name, (*_DIAGRAM_MAGICS, *_ROBOT_MAGICS), 1, _MIN_SIMILARITY)
            question = f"; did you mean %%{similar_names[0]}?" if similar_names else ""
            self._requester.note(f"{_shorten_line(line)} was skipped: it is not known here{question}")

    def _print_files(self, line: str) -> None:
        for name in _split_words(line):
            with open(name, encoding="utf-8", errors="replace") as file:
                print(file.read())

    def _run_file(self, line: str) -> None:
        name = next((word for word in _split_words(line) if not word.startswith("-")), "")
        if name.endswith(".ipynb"):
            self._requester.note(f"%run {_shorten_line(name)} was skipped: another notebook cannot be run here")
        else:
            self._requester.run_file(name if name.endswith(".py") else f"{name}.py")

    def _capture_body(self, line: str, body: str) -> None:
        text = self._requester.capture_output(lambda: self._requester.run_body(body))
        for name in [word for word in _split_words(line) if not word.startswith("-")][:1]:
            self._requester.namespace[name] = CapturedOutput(text)

    def _list_files(self, _: str) -> None:
        print("  ".join(sorted(os.listdir("."))))

    def _write_file(self, line: str, body: str) -> None:
        arguments = _split_words(line)
        adds = [word for word in arguments if word in ("-a", "--append")]
        names = [word for word in arguments if word not in ("-a", "--append")]
        if len(names) != 1:
            raise ValueError("%%writefile needs the name of one file")
        verb = "Appending to" if adds else "Overwriting" if os.path.exists(names[0]) else "Writing"
        print(f"{verb} {names[0]}")
        with open(names[0], "a" if adds else "w", encoding="utf-8") as file:
            file.write(body if body.endswith("\n") else body + "\n")


def _load_data_magics() -> Mapping[str, Callable[[list[str]], Any]]:
    try:
        from nbev3devsim.data_magics import MAGICS
    except ImportError:  # pandas may be excluded by the assignment
        return {}
    return MAGICS


def _split_words(line: str) -> list[str]:
    return shlex.split(line, comments=False)


def _shorten_line(text: str) -> str:
    line = " ".join(str(text).split())
    return line if len(line) <= 60 else line[:57] + "..."
