"""The engine on this machine: a ``robomark`` command that runs robots and checks in its sandbox.

The command starts ahead, so that the first cell does not wait for it, and again after it has ended.
"""

from __future__ import annotations

import base64
import contextlib
import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from robomark_notebook.engine import (
    Answerer,
    Check,
    EngineError,
    MagicCall,
    MagicResult,
    Page,
    Submitted,
)
from robomark_notebook.results import describe_call, read_check, read_magic_result, read_question

_PROTOCOL = 1
#: Names the command, if it is neither beside this Python nor in a folder of PATH.
COMMAND_VARIABLE = "ROBOMARK_COMMAND"
#: Longest silence of the engine while it works. A robot's processes may compute for 150 s, a check for ten minutes.
_MAGIC_SECONDS, _CHECK_SECONDS, _START_SECONDS = 300.0, 900.0, 120.0
_END_SECONDS = 5.0
_MAX_LINE_BYTES = 256 << 20
#: Far more than the robot accepts; a longer answer is a mistake that should not fill the memory of both processes.
_MAX_ANSWER_LENGTH = 4 << 20
_READ_BYTES = 1 << 20
#: Variables that make a library of the engine read a file of the notebook's folder, or use the notebook's display.
_REMOVED_VARIABLES = frozenset({"MATPLOTLIBRC", "MPLBACKEND", "CELERY_CONFIG_MODULE", "CELERY_LOADER"})


def find_command() -> tuple[str, ...]:
    """Return the ``robomark`` command: of ``ROBOMARK_COMMAND``, beside this Python, or in a folder of PATH.

    Raises:
        EngineError: There is none.
    """
    named = os.environ.get(COMMAND_VARIABLE)
    if named:
        return (named,)
    # A relative folder of PATH could be the notebook's own, with files of anybody.
    folders = [folder for folder in os.environ.get("PATH", os.defpath).split(os.pathsep) if Path(folder).is_absolute()]
    command = shutil.which("robomark", path=os.pathsep.join([str(Path(sys.executable).parent), *folders]))
    if command is None:
        raise EngineError(
            "There is no robomark command on this machine. Install robomark, or connect to a server with "
            "%robomark connect."
        )
    return (command,)


class LocalEngine:
    """Runs robots and checks notebooks with a ``robomark`` command. ``seed`` is that of everything random."""

    def __init__(self, command: Sequence[str] | None = None, seed: int = 0) -> None:
        """Start the command (by default, the one that ``find_command`` finds), without waiting for it.

        Raises:
            EngineError: It cannot be started.
        """
        self.seed = seed
        self._command = tuple(find_command() if command is None else command)
        self._process: _EngineProcess | None = _EngineProcess(self._command)
        self._is_busy = False

    def call_magic(self, call: MagicCall, page: Page | None, answer: Answerer) -> MagicResult:
        """Apply a magic's flags to the page, and run the robot if it starts one; ``answer`` answers its texts."""
        request = {"do": "magic", "magic": describe_call(call, page, self.seed)}
        return read_magic_result(self._perform(request, _MAGIC_SECONDS, answer))

    def check(self, assignment: str, name: str, notebook: bytes, files: Mapping[str, bytes]) -> Check:
        """Grade a notebook in the visible scenarios of a catalogue assignment, or of an assignment's folder."""
        folder = Path(assignment)
        request = {
            "do": "check",
            "assignment": str(folder.resolve()) if folder.is_dir() else assignment,
            "name": name,
            "notebook": _encode_file(notebook),
            "files": {each: _encode_file(data) for each, data in files.items()},
        }
        return read_check(self._perform(request, _CHECK_SECONDS))

    def submit(self, assignment: str, name: str, notebook: bytes, files: Mapping[str, bytes]) -> Submitted:
        """Raise EngineError: only a server takes submissions."""
        raise EngineError("Only a server takes submissions. Connect to your course's server with %robomark connect.")

    def follow(self, submitted: Submitted) -> Submitted:
        """Raise EngineError: only a server has submissions."""
        raise EngineError("Only a server has submissions. Connect to your course's server with %robomark connect.")

    def close(self) -> None:
        """End the command and every run."""
        process, self._process = self._process, None
        if process is not None:
            process.close()

    def _perform(self, request: Mapping[str, Any], seconds: float, answer: Answerer | None = None) -> dict[str, Any]:
        """Send a request and return its result; ``answer`` answers the questions before it."""
        if self._is_busy:
            raise EngineError("The robot is waiting for an answer. A responder cannot start another run or check.")
        if self._process is None or self._process.has_ended:
            self.close()
            self._process = _EngineProcess(self._command)
        self._is_busy = True
        try:
            return self._process.perform(request, seconds, answer)
        except EngineError:
            raise
        except BaseException:
            # An interrupt, or an error of the responder: the run is of no use any more, and its process would wait.
            self.close()
            self._process = _EngineProcess(self._command)
            raise
        finally:
            self._is_busy = False


class _EngineProcess:
    """One process of the command, with its lines."""

    def __init__(self, command: Sequence[str]) -> None:
        self._errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the process
        try:
            self._process = subprocess.Popen(
                [*command, "notebook-engine"],
                cwd="/",
                env=_build_environment(),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                # An interrupt of the notebook's kernel reaches all processes of its group.
                start_new_session=True,
            )
        except OSError as error:
            self._errors.close()
            raise EngineError(f"{command[0]} cannot be started: {error.strerror}. Reinstall robomark.") from None
        self._pending = bytearray()
        self._requests = 0
        self._is_ready = False

    @property
    def has_ended(self) -> bool:
        return self._process.poll() is not None

    def perform(self, request: Mapping[str, Any], seconds: float, answer: Answerer | None) -> dict[str, Any]:
        """Return the result of a request. Raises EngineError if there is none."""
        self._wait_until_ready()
        self._requests += 1
        self._send({"id": self._requests, **request})
        while True:
            event = self._receive(seconds)
            # An error about a line that could not be read has no number.
            if event.get("id") not in (self._requests, None):
                raise self._give_up("The robomark command answered another request.")
            match event.get("event"):
                case "question" if answer is not None:
                    reply = answer(read_question(event["question"]))
                    if reply is not None and len(reply) > _MAX_ANSWER_LENGTH:
                        raise self._give_up(f"The responder answered {len(reply):,} characters; the most is 60,000.")
                    self._send({"id": self._requests, "do": "answer", "text": reply})
                case "result":
                    result: dict[str, Any] = event["result"]
                    return result
                case "error":
                    raise EngineError(_to_sentence(str(event.get("message", ""))))
                case kind:
                    raise self._give_up(f"The robomark command sent an unknown event ({str(kind)[:40]}).")

    def close(self) -> None:
        """End the process: at the end of its requests, or else by force. One that has not begun is stopped at once."""
        if not self._is_ready:
            self._process.terminate()
        for stream in (self._process.stdin, self._process.stdout):
            assert stream is not None
            with contextlib.suppress(OSError):
                stream.close()
        try:
            self._process.wait(_END_SECONDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._errors.close()

    def _wait_until_ready(self) -> None:
        if self._is_ready:
            return
        event = self._receive(_START_SECONDS)
        if event.get("event") != "ready" or event.get("protocol") != _PROTOCOL:
            raise self._give_up("This robomark is another release. Install the same one as robomark-notebook.")
        self._is_ready = True

    def _send(self, request: Mapping[str, Any]) -> None:
        assert self._process.stdin is not None
        line = json.dumps(request, separators=(",", ":"), allow_nan=False) + "\n"
        try:
            self._process.stdin.write(line.encode("ascii"))
            self._process.stdin.flush()
        except OSError:
            raise self._give_up(self._describe_end()) from None

    def _receive(self, seconds: float) -> dict[str, Any]:
        """Return the next event. Raises EngineError if the process has ended or is silent for too long."""
        line = self._read_line(time.monotonic() + seconds)
        try:
            event = json.loads(line)
        except ValueError:
            event = None
        if not isinstance(event, dict):
            raise self._give_up("The robomark command printed something that is not an event.")
        return event

    def _read_line(self, deadline: float) -> bytes:
        assert self._process.stdout is not None
        searched = 0
        while (end := self._pending.find(b"\n", searched)) < 0:
            searched = len(self._pending)
            left = max(0.0, deadline - time.monotonic())
            if not select.select([self._process.stdout], [], [], left)[0]:
                raise self._give_up("The robomark command did not answer in time, and was stopped. Run the cell again.")
            data = os.read(self._process.stdout.fileno(), _READ_BYTES)
            if not data or searched + len(data) > _MAX_LINE_BYTES:
                raise self._give_up(self._describe_end())
            self._pending += data
        line = bytes(self._pending[:end])
        del self._pending[: end + 1]
        return line

    def _describe_end(self) -> str:
        """Return why the process ended, in its own last words."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_END_SECONDS)
        self._errors.seek(0)
        words = self._errors.read().decode("utf-8", "replace").strip().rpartition("\n")[2][:500]
        reason = words.removeprefix("robomark: ") or f"with status {self._process.poll()}"
        return f"The robomark command ended: {reason}. Run the cell again; robomark doctor finds problems."

    def _give_up(self, sentence: str) -> EngineError:
        """Kill the process, which cannot be used any more, and return the error to raise."""
        self._process.kill()
        self.close()
        return EngineError(sentence)


def _build_environment() -> dict[str, str]:
    """Return the environment without variables that make Python or a library run or read an arbitrary file."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith("PYTHON") and name not in _REMOVED_VARIABLES
    }
    return kept | {"PYTHONSAFEPATH": "1", "PYTHONNOUSERSITE": "1"}


def _encode_file(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


def _to_sentence(message: str) -> str:
    """Return the message as a sentence. A name of a file at its start stays as it is."""
    if message.partition(" ")[0].isalpha():
        message = message[:1].upper() + message[1:]
    return message if message.endswith((".", "!", "?")) else f"{message}."
