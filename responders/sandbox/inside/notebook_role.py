"""Executes a notebook from top to bottom in the responder's process, and answers the robots that its magics start.

An error in a cell is reported and the next cell runs. The worker decides which run is marked.
"""

from __future__ import annotations

import ast
import builtins
import linecache
import re
import sys
from collections.abc import Callable
from typing import Any

from . import cell_source, own_modules, student_code
from .frames import Frame, Wire, can_send_text, clip
from .lockdown import Grants
from .responder_role import ResponderRole
from .shell import Shell

_MAX_NOTES = 60
_MAX_OUTPUT_LENGTH = 2000
_ADDRESS = re.compile(r" at 0x[0-9A-Fa-f]+")


class NotebookRole(ResponderRole):
    """A notebook. Its cells share one namespace, clock and file name; line numbers continue from cell to cell."""

    def __init__(self, wire: Wire, grants: Grants, spec: Frame) -> None:
        super().__init__(wire, grants, spec)
        self._notes = 0
        self._captured: list[str] | None = None
        self._body_above = 0
        self._robot_runs = False
        self._given_msg: str | None = None
        self._shell = Shell(self)

    @property
    def namespace(self) -> dict[str, Any]:
        """The names that all cells have bound."""
        return self._namespace

    def run(self) -> None:
        """Execute all cells, then answer until the worker closes the wire."""
        from nbev3devsim import placeholders
        from nbev3devsim.load_nbev3devwidget import roboSim

        self._prepare()
        roboSim.look = self._request_robot_state
        placeholders.install_placeholders(self._shell)
        self._namespace.update(In=[], Out={})
        # As in IPython, modules that a cell imports have these too.
        builtins.display = placeholders.display  # type: ignore[attr-defined]
        builtins.get_ipython = lambda: self._shell  # type: ignore[attr-defined]
        builtins.exit = builtins.quit = _exit_cell  # type: ignore[assignment]
        text = "".join(source + "\n" for source in self._spec["cells"])
        linecache.cache[self._name] = (len(text), None, text.splitlines(keepends=True), self._name)
        line_count = 0
        for index, source in enumerate(self._spec["cells"]):
            self._wire.send({"do": "cell", "place": index, "answers": self._explain_missing_responder() is None})
            error = self._execute_cell(source, line_count)
            if error is not None:
                self._wire.send({"do": "raised", "error": error})
            line_count += source.count("\n") + 1
        self._wire.send({"do": "executed", "missing": self._explain_missing_responder()})
        self._note_own_msg()
        self._serve_messages()

    def note(self, text: str) -> None:
        """Send a note to the worker, with the current line."""
        self._notes += 1
        if self._notes <= _MAX_NOTES:
            self._wire.send({"do": "note", "text": clip(text, 300), **self._files.locate_frame(sys._getframe())})

    def expand(self, line: str) -> str:
        """Return a magic's line with ``{expression}`` and ``$name`` replaced, using the names of the cell."""
        if "{" not in line and "$" not in line:
            return line
        frame = sys._getframe()
        while frame is not None and frame.f_code.co_filename != self._name:
            frame = frame.f_back  # type: ignore[assignment]
        return cell_source.expand_line(line, self._namespace | (frame.f_locals if frame is not None else {}))

    def run_line(self, text: str) -> Any:
        """Run code from the current line, as ``%time`` does. Return its value, if it has one."""
        return self._evaluate(text, (self._files.find_main_line(sys._getframe()) or 1) - 1)

    def run_body(self, body: str) -> None:
        """Run the rest of a cell for its magic."""
        self._run_source(body, self._body_above)

    def run_file(self, name: str) -> None:
        """Run a Python file beside the notebook in the cells' namespace, as ``%run`` does."""
        text = own_modules.read_folder_module(name.removesuffix(".py"))
        if text is None:
            raise FileNotFoundError(f"there is no file {name} beside the notebook")
        self._files.imported.add(name)
        exec(student_code.compile_source(text, name), self._namespace)

    def capture_output(self, work: Callable[[], None]) -> str:
        """Call ``work`` and return its output."""
        outer, self._captured = self._captured, []
        try:
            work()
            return "".join(f"{text}\n" for text in self._captured)
        finally:
            self._captured = outer

    def start_robot(self, name: str, arguments: str, body: str | None) -> None:
        """Send a robot program or its flags to the worker, and answer until the robot has finished."""
        from nbev3devsim.load_nbev3devwidget import roboSim

        if self._robot_runs:
            self.note(f"%{name} was skipped: the robot is still running")
            return
        if body is not None and not can_send_text(body + arguments):
            self.note("the robot program was skipped: it is longer than about 60000 characters")
            return
        self._note_own_msg()
        self._robot_runs = True
        start = self._units
        line = self._files.find_main_line(sys._getframe())
        self._wire.send(
            {
                "do": "magic",
                "name": name,
                "arguments": clip(arguments, _MAX_OUTPUT_LENGTH),
                "body": body,
                "line": line,
                "missing": self._explain_missing_responder(),
            }
        )
        while True:
            frame = self._wire.receive()
            if frame["do"] == "message":
                self._answer_message(frame, start)
                continue
            break
        self._robot_runs = False
        self._units = max(self._units, start + frame["t"])
        roboSim.collect(frame["data"], frame["images"])
        roboSim.robot_state = frame["state"] or {}

    def _request_robot_state(self) -> dict[str, Any]:
        if self._robot_runs:
            return {}
        self._wire.send({"do": "state"})
        state: dict[str, Any] = self._wire.receive()["state"]
        return state

    def _execute_cell(self, source: str, line_offset: int) -> Frame | None:
        """Run one cell. ``line_offset`` is the number of lines before it. Return the error that ended it, or None."""
        try:
            self._run_source(source, line_offset)
        except BaseException as error:
            if isinstance(error, SystemExit) and error.code in (None, 0):
                return None
            return self._files.describe_error(error)
        return None

    def _run_source(self, source: str, line_offset: int) -> None:
        magic = cell_source.parse_cell_magic(source)
        if magic is not None:
            self._call_cell_magic(magic, line_offset)
        else:
            self._run_cell(cell_source.convert_to_python(source), line_offset)

    def _call_cell_magic(self, magic: cell_source.CellMagic, line_offset: int) -> None:
        self._body_above = line_offset + magic.number
        tree = ast.parse("get_ipython().run_cell_magic(_robomark_name, _robomark_line, _robomark_body)", self._name)
        ast.increment_lineno(tree, line_offset + magic.number - 1)
        names = {
            "_robomark_name": magic.name,
            "_robomark_line": magic.line,
            "_robomark_body": magic.body,
        }
        exec(compile(tree, self._name, "exec", dont_inherit=True), names)

    def _run_cell(self, text: str, line_offset: int) -> None:
        value = self._evaluate(text, line_offset)
        if value is not None and not text.rstrip().endswith(";"):
            self._namespace["_"] = value
            # Memory addresses are removed, because they differ between runs.
            print(_ADDRESS.sub("", clip(repr(value), _MAX_OUTPUT_LENGTH)))

    def _evaluate(self, text: str, line_offset: int) -> Any:
        """Run the text and return the value of its last line, if it is an expression.

        ``line_offset`` is the number of lines before it.
        """
        try:
            tree = ast.parse(text, self._name)
        except SyntaxError as error:
            if error.lineno is not None:
                error.lineno += line_offset
            raise
        last_statement = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
        ast.increment_lineno(tree, line_offset)
        exec(compile(tree, self._name, "exec", dont_inherit=True), self._namespace)
        if last_statement is None:
            return None
        assert isinstance(last_statement, ast.Expr)
        expression = ast.Expression(last_statement.value)
        ast.increment_lineno(expression, line_offset)
        return eval(compile(expression, self._name, "eval", dont_inherit=True), self._namespace)

    def _explain_missing_responder(self) -> str | None:
        """Return why there is no responder for the robot, or None if there is one."""
        try:
            self._find_function()
        except LookupError as error:
            return str(error)
        return None

    def _note_own_msg(self) -> None:
        """Note whether the notebook has its own global ``msg``. Otherwise ``msg`` is set to each text received."""
        is_given = self._given_msg is not None and self._namespace.get("msg") == self._given_msg
        self._defines_msg = "msg" in self._namespace and not is_given

    def _answer_text(self, text: str) -> Frame:
        frame = super()._answer_text(text)
        if not self._defines_msg:
            self._given_msg = text
        return frame

    def _emit(self, text: str) -> None:
        if self._captured is None:
            super()._emit(text)
        else:
            self._captured.append(self._files.remove_folders(text))


def _exit_cell(code: object = None) -> None:
    """End the cell, as ``exit()`` does."""
    raise SystemExit(code)
