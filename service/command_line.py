"""The ``robomark`` command line: puts the commands together and turns every error into one sentence and a status.

The commands themselves are in modules of their own, named after them; ``cli.py`` is where the command begins.
"""

from __future__ import annotations

import importlib
import os
import signal
import sys
import traceback
from collections.abc import Mapping, Sequence
from io import TextIOWrapper
from pathlib import Path
from types import MappingProxyType
from typing import NoReturn

import typer
from sqlalchemy.exc import DBAPIError
from typer.exceptions import TyperException

from service.home import keep_private
from service.reports.readable import readable
from sim.errors import Cancelled, RobomarkError, UsageError

_CALLER, _OURS, _STOPPED = 2, 3, 130

#: Where each command is, in the order in which help lists them; a name that ends in ``_app`` is a group of commands.
_COMMANDS: Mapping[str, str] = MappingProxyType(
    {
        "run": "run:run",
        "grade": "grade:grade",
        "batch": "batch.app:batch_app",
        "assignments": "assignments:assignments_app",
        "models": "models:models_app",
        "floors": "floors:floors",
        "show": "operator:show",
        "verify": "verify:verify",
        "course": "course:course_app",
        "up": "up:up",
        "serve": "up:serve",
        "worker": "operator:worker",
        "doctor": "operator:doctor",
        "db": "operator:database_app",
        "sandbox": "sandbox:sandbox_app",
        "demo": "demo:demo",
    }
)


def commands(words: Sequence[str] = ()) -> typer.Typer:
    """The command that ``words`` begins with, or all of them: only what is needed is imported, which takes a while."""
    app = typer.Typer(
        name="robomark",
        help="Grades robot programs and responders of the RoboLab activities, without a screen.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        add_completion=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_nothing)
    for name in words[:1] if words and words[0] in _COMMANDS else _COMMANDS:
        module, _, attribute = _COMMANDS[name].partition(":")
        found = getattr(importlib.import_module(f"service.commands.{module}"), attribute)
        if attribute.endswith("_app"):
            app.add_typer(found, name=name)
        else:
            app.command(name)(found)
    return app


def _nothing() -> None:
    """Keeps a lone command a command of ``robomark``."""


def main() -> NoReturn:
    """Run the command; 0 when it did what it should, 2 for a mistake of the caller's, 3 when it could not."""
    _prepare_streams()
    # What a service manager sends is taken like Ctrl-C: children and temporary files are cleared away.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        # Typer gives back the status of what it ends by itself: help, and a stop by Ctrl-C.
        command = commands(sys.argv[1:])
        # Not before they are imported: what Python keeps of its modules is for the users that children run as, too.
        keep_private()
        ending = command(standalone_mode=False)
        sys.stdout.flush()
    except UsageError as error:
        _end(str(error), _CALLER)
    except Cancelled as error:
        _end(str(error) or "stopped", _STOPPED)
    except RobomarkError as error:
        _end(str(error), _OURS)
    except TyperException as error:
        _end_misspelt(error)
    except (typer.Abort, KeyboardInterrupt):
        _end("stopped", _STOPPED)
    except (BrokenPipeError, SystemExit):
        # Typer itself ends so, and only so, when nobody reads what it prints.
        _end_unread()
    except DBAPIError as error:
        _debug()
        _end(f"the database would not do it: {error.orig}; robomark doctor looks at it", _OURS)
    except OSError as error:
        _debug()
        where = "" if error.filename is None else f"{error.filename}: "
        _end(f"the machine would not do it: {where}{error.strerror or error}", _OURS)
    except Exception as error:
        _debug()
        _end(
            f"something went wrong in Robomark itself, not in your files: {type(error).__name__}: {error} "
            "(set ROBOMARK_DEBUG=1 to see where)",
            _OURS,
        )
    if ending == _STOPPED:
        _end("stopped", _STOPPED)
    sys.exit(ending if isinstance(ending, int) else 0)


def _prepare_streams() -> None:
    """Text of any kind can be printed, whatever the locale; a closed stream takes no other file's place."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            # The lowest free descriptor is the closed stream's own.
            setattr(sys, name, Path(os.devnull).open(mode, encoding="utf-8"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _debug() -> None:
    if os.environ.get("ROBOMARK_DEBUG"):
        traceback.print_exc()


def _end_misspelt(error: TyperException) -> NoReturn:
    """A command line that cannot be read; a group of commands without one shows its help instead."""
    sentence = error.format_message().strip()
    if not sentence or "\n" in sentence:
        print(sentence, file=sys.stderr)
        sys.exit(_CALLER)
    context = getattr(error, "ctx", None)
    command = "robomark" if context is None else context.command_path
    sentence = sentence.replace("Value error, ", "").replace("'?", "'")
    _end(f"{sentence[:1].lower()}{sentence[1:].rstrip('.')}; {command} --help lists what there is", _CALLER)


def _end_unread() -> NoReturn:
    """The reader of our output has gone; nothing is left to say, and the interpreter must not try to."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(_STOPPED)


def _end(sentence: str, status: int) -> NoReturn:
    print(f"robomark: {readable(sentence, 8000)}", file=sys.stderr)
    sys.exit(status)
