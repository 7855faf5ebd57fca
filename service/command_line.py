"""The ``robomark`` command line: assembles the commands and converts errors to one sentence and an exit status.

Each command is in its own module; ``cli.py`` is the entry point.
"""

from __future__ import annotations

import gc
import importlib
import os
import signal
import sys
import traceback
from collections.abc import Callable, Mapping
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperCommand, TyperGroup
from typer.exceptions import TyperException
from typer.main import get_command

from service.command_table import COMMANDS, Command, CommandGroup
from service.commands.output import set_json_output, set_quiet_output
from service.home import keep_files_private
from service.reports.display_text import to_display_text
from sim.errors import Cancelled, RobomarkError, UsageError

_CALLER, _OURS, _STOPPED = 2, 3, 130
_CONTEXT = {"help_option_names": ["-h", "--help"]}


class _LazyValidation:
    """A command whose parameters Typer validates only if they do not have their final type yet.

    Typer imports pydantic to validate any parameter, even a missing flag, which takes longer than most simple commands.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments and return the remaining ones."""
        command: Any = super()
        for parameter in command.get_params(ctx):
            parameter.process_value = _skip_needless_validation(parameter)
        remaining: list[str] = command.parse_args(ctx, args)
        return remaining


def _skip_needless_validation(parameter: Any) -> Callable[[Any, Any], Any]:
    """Return a value processor that skips validation for values of the right type, and for missing optional ones."""
    process_value = parameter.process_value
    is_optional = not (parameter.required or parameter.multiple or parameter.nargs == -1)

    def taken(ctx: Any, value: Any) -> Any:
        if type(value) is not parameter.type_descriptor.annotation and not (value is None and is_optional):
            return process_value(ctx, value)
        return value if parameter.callback is None else parameter.callback(ctx, parameter, value)

    return taken


class _Command(_LazyValidation, TyperCommand):
    """A command that is not a group."""


class _CommandGroup(_LazyValidation, TyperGroup):
    """A group of commands. Only the selected command is imported, because imports are slow."""

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Return the name, the command, and the remaining arguments."""
        name, placeholder, remaining = super().resolve_command(ctx, args)
        if name is None or isinstance(placeholder, _CommandGroup):
            return name, placeholder, remaining
        command = load_command(*ctx.command_path.split()[1:], name)
        # Imported objects are permanent, so the collector skips them.
        gc.freeze()
        gc.enable()
        return name, command, remaining


def load_command(*path: str) -> Any:
    """Import a command by its path and return it as Typer runs it."""
    *groups, name = path
    entry: Any = COMMANDS
    for group in groups:
        entry = entry[group].commands
    command: Command = entry[name]
    keep_files_private()
    module, _, attribute = command.entry_point.partition(":")
    function = getattr(importlib.import_module(f"service.commands.{module}"), attribute)
    app = typer.Typer(context_settings=_CONTEXT, rich_markup_mode=None, add_completion=False)
    app.command(name, cls=_Command)(function)
    result = get_command(app)
    if not command.serves:
        result.params += _build_shared_options()
    return result


def _build_shared_options() -> list[Any]:
    """Return the options shared by all commands that print a result and exit."""
    app = typer.Typer(add_completion=False)
    app.command()(_declare_shared_options)
    return get_command(app).params


def _declare_shared_options(
    _as_json: Annotated[
        bool,
        typer.Option(
            "--json", is_eager=True, callback=set_json_output, expose_value=False, help="Print one JSON document."
        ),
    ] = False,
    _quietly: Annotated[
        bool,
        typer.Option(
            "-q",
            "--quiet",
            is_eager=True,
            callback=set_quiet_output,
            expose_value=False,
            help="Print only results and errors.",
        ),
    ] = False,
) -> None:
    """Stands for any command."""


def _build_command_line() -> Any:
    app = typer.Typer(
        name="robomark",
        help="Grades robot programs and responders of the RoboLab activities, without a screen.",
        **_build_group_arguments(),
    )
    app.callback()(_declare_root_options)
    _add_commands(app, COMMANDS)
    return get_command(app)


def _build_group_arguments() -> dict[str, Any]:
    return {"cls": _CommandGroup, "no_args_is_help": True, "rich_markup_mode": None, "context_settings": _CONTEXT}


def _add_commands(app: typer.Typer, commands: Mapping[str, Command | CommandGroup]) -> None:
    for name, entry in commands.items():
        if isinstance(entry, Command):
            app.command(name, short_help=entry.summary, hidden=entry.hidden)(_do_nothing)
        else:
            group = typer.Typer(help=entry.summary, **_build_group_arguments())
            group.callback()(_do_nothing)
            _add_commands(group, entry.commands)
            app.add_typer(group, name=name, short_help=entry.summary)


def _print_version(is_requested: bool) -> None:
    if is_requested:
        # Imported here, because it takes longer than the rest of --help.
        from service.version import GRADER_VERSION

        print(f"robomark {GRADER_VERSION}")
        raise typer.Exit


def _declare_root_options(
    _version: Annotated[
        bool,
        typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version and exit."),
    ] = False,
) -> None:
    """Options before the command."""


def _do_nothing() -> None:
    """Stands for a command that is only listed."""


def main() -> NoReturn:
    """Run the command. Exit status 0 for success, 2 for a mistake by the caller, 3 for a failure."""
    _prepare_streams()
    # A stop by a service manager is handled like Ctrl-C: children and temporary files are cleaned up.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        # Typer returns the status of its own exits: help, and a stop by Ctrl-C.
        exit_code = _build_command_line()(prog_name="robomark", standalone_mode=False)
        sys.stdout.flush()
    except UsageError as error:
        _exit_with_error(str(error), _CALLER)
    except Cancelled as error:
        _exit_with_error(str(error) or "stopped", _STOPPED)
    except RobomarkError as error:
        _exit_with_error(str(error), _OURS)
    except TyperException as error:
        _exit_for_usage_error(error)
    except (typer.Abort, KeyboardInterrupt):
        _exit_with_error("stopped", _STOPPED)
    except BrokenPipeError:
        _exit_silently()
    except SystemExit as system_exit:
        # Typer itself exits this way after shell completion, or if the output is closed.
        if not system_exit.code:
            raise
        _exit_silently()
    except OSError as error:
        _print_debug_traceback()
        file_prefix = "" if error.filename is None else f"{error.filename}: "
        _exit_with_error(f"the operating system reported an error: {file_prefix}{error.strerror or error}", _OURS)
    except Exception as error:
        _print_debug_traceback()
        database = sys.modules.get("sqlalchemy.exc")
        if database is not None and isinstance(error, database.DBAPIError):
            _exit_with_error(f"the database reported an error: {error.orig}; run robomark doctor", _OURS)
        _exit_with_error(
            f"internal error in Robomark, not in your files: {type(error).__name__}: {error} "
            "(set ROBOMARK_DEBUG=1 to see where)",
            _OURS,
        )
    if exit_code == _STOPPED:
        _exit_with_error("stopped", _STOPPED)
    sys.exit(exit_code if isinstance(exit_code, int) else 0)


def _prepare_streams() -> None:
    """Make all text printable in any locale, and replace closed streams.

    Without a replacement, the descriptor of a closed stream would be reused for another file.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            # The lowest free descriptor is that of the closed stream.
            setattr(sys, name, Path(os.devnull).open(mode, encoding="utf-8"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _print_debug_traceback() -> None:
    if os.environ.get("ROBOMARK_DEBUG"):
        traceback.print_exc()


def _exit_for_usage_error(error: TyperException) -> NoReturn:
    """Exit for an invalid command line; a group without a command prints its help."""
    sentence = error.format_message().strip()
    if not sentence or "\n" in sentence:
        print(sentence, file=sys.stderr)
        sys.exit(_CALLER)
    context = getattr(error, "ctx", None)
    command = "robomark" if context is None else context.command_path
    sentence = sentence.replace("Value error, ", "").replace("'?", "'")
    _exit_with_error(f"{sentence[:1].lower()}{sentence[1:].rstrip('.')}; see {command} --help", _CALLER)


def _exit_silently() -> NoReturn:
    """Exit silently after the reader closed our output, so that the interpreter does not write to it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(_STOPPED)


def _exit_with_error(sentence: str, status: int) -> NoReturn:
    print(f"robomark: {to_display_text(sentence, 8000)}", file=sys.stderr)
    sys.exit(status)
