"""The commands of ``%robomark``: connect, local, seed, check, submit."""

from __future__ import annotations

import getpass
import os
import shlex
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from robomark_notebook import outputs
from robomark_notebook.engine import EngineError, Submitted
from robomark_notebook.notebook_files import read_saved_notebook
from robomark_notebook.server_address import parse_address
from robomark_notebook.session import TOKEN_VARIABLE, URL_VARIABLE, Session

#: Seconds between two looks at a submission, and the time after which the cell stops looking.
_POLL_SECONDS, _FOLLOW_SECONDS = 2.0, 600.0

Names = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class _Command:
    """A command: what follows its name, how many words at least and at most, and its function."""

    form: str
    description: str
    least: int
    most: int
    run: Callable[[Session, Sequence[str], Names], None]


def run_command(session: Session, line: str, names: Names) -> None:
    """Run one command line; an empty one shows the state. ``names`` are those of the kernel.

    Raises:
        EngineError: The line is wrong, or the command failed.
    """
    try:
        words = shlex.split(line)
    except ValueError as error:
        raise EngineError(f"The line cannot be read: {str(error).lower()}.") from None
    if not words:
        print(describe_state(session))
        return
    command = _COMMANDS.get(words[0])
    if command is None:
        raise EngineError(f"There is no command {words[0][:40]}. Expected one of {', '.join(_COMMANDS)}.")
    if not command.least <= len(words) - 1 <= command.most:
        raise EngineError(f"Expected %robomark {command.form}.")
    command.run(session, words[1:], names)


def describe_state(session: Session) -> str:
    """Return the state of a session in one line."""
    place = session.url or "this machine"
    return f"Robots run on {place}. Seed: {session.seed}. Commands: %robomark help"


def _connect(session: Session, words: Sequence[str], names: Names) -> None:
    if len(words) == 2:
        raise EngineError(f"Do not write a token into a notebook. Run %robomark connect {words[0]}, which asks for it.")
    given = words[0] if words else os.environ.get(URL_VARIABLE, "")
    if not given:
        raise EngineError(f"Expected %robomark connect URL, or the address in the environment variable {URL_VARIABLE}.")
    url = str(parse_address(given))
    session.connect(url, os.environ.get(TOKEN_VARIABLE) or _ask_for_token(url))
    print(describe_state(session))


def _ask_for_token(url: str) -> str:
    try:
        return getpass.getpass(f"Token for {url}: ")
    except Exception:  # a kernel that nobody can type into
        raise EngineError(
            f"Nobody can type the token here. Set the environment variable {TOKEN_VARIABLE} before the kernel starts."
        ) from None


def _use_local(session: Session, words: Sequence[str], names: Names) -> None:
    session.use_local()
    print(describe_state(session))


def _set_seed(session: Session, words: Sequence[str], names: Names) -> None:
    if not words[0].isdecimal() or len(words[0]) > 18:
        raise EngineError(f"{words[0][:40]} is not a seed. Expected a whole number from 0.")
    session.seed = int(words[0])
    print(f"Seed: {session.seed}. The same program and answers with the same seed give the same run.")


def _check(session: Session, words: Sequence[str], names: Names) -> None:
    saved = read_saved_notebook("".join(words[1:]), names)
    print(f"Checking {saved.describe()}.")
    outputs.show_check(session.engine.check(words[0], saved.name, saved.content, saved.files))


def _submit(session: Session, words: Sequence[str], names: Names) -> None:
    saved = read_saved_notebook("".join(words[1:]), names)
    submitted = session.engine.submit(words[0], saved.name, saved.content, saved.files)
    print(f"Submitted {saved.describe()}. Receipt: {submitted.receipt}")
    _follow(session, submitted)


def _follow(session: Session, submitted: Submitted) -> None:
    """Show the place in the queue as it changes, then the report."""
    shown: int | None = None
    end = time.monotonic() + _FOLLOW_SECONDS
    while submitted.check is None and time.monotonic() < end:
        if submitted.before != shown:
            shown = submitted.before
            print(_describe_place(submitted))
        time.sleep(_POLL_SECONDS)
        submitted = session.engine.follow(submitted)
    if submitted.check is not None:
        outputs.show_check(submitted.check)
    print(f"The report: {submitted.url}")


def _describe_place(submitted: Submitted) -> str:
    if not submitted.before:
        return "It is being graded."
    return f"Submissions before it in the queue: {submitted.before}."


def _show_help(session: Session, words: Sequence[str], names: Names) -> None:
    for command in _COMMANDS.values():
        print(f"%robomark {command.form:<28} {command.description}")


_COMMANDS: Mapping[str, _Command] = MappingProxyType(
    {
        "connect": _Command("connect [URL]", "run robots on a server; asks for your token", 0, 2, _connect),
        "local": _Command("local", "run robots with the command robomark on this machine", 0, 0, _use_local),
        "seed": _Command("seed N", "choose the chance of the next runs: noise and random starts", 1, 1, _set_seed),
        "check": _Command("check ASSIGNMENT [FILE]", "check the saved notebook in the visible scenarios", 1, 2, _check),
        "submit": _Command("submit ASSIGNMENT [FILE]", "submit the saved notebook to the course", 1, 2, _submit),
        "help": _Command("help", "list these commands", 0, 0, _show_help),
    }
)
