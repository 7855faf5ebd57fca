"""The ``robomark`` command: puts the commands together and turns every error into one sentence and an exit status.

The commands themselves are in modules of their own, named after them.
"""

from __future__ import annotations

import os
import sys
import traceback
from typing import NoReturn

import click
import typer

from service.assignment_commands import assignments_app
from service.batch_commands import batch_app
from service.demo_command import demo
from service.grade_command import grade
from service.models_commands import models_app
from service.operator_commands import database_app, doctor, show, worker
from service.run_command import run
from service.sandbox_command import sandbox_app
from sim.errors import Cancelled, RobomarkError, UsageError

_CALLER, _OURS, _STOPPED = 2, 3, 130

app = typer.Typer(
    name="robomark",
    help="Grades robot programs and responders of the RoboLab activities, without a screen.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)
app.command()(run)
app.command()(grade)
app.add_typer(batch_app, name="batch")
app.add_typer(assignments_app, name="assignments")
app.add_typer(models_app, name="models")
app.command()(show)
app.command()(worker)
app.command()(doctor)
app.add_typer(database_app, name="db")
app.add_typer(sandbox_app, name="sandbox")
app.command()(demo)


def main() -> NoReturn:
    """Run the command; 0 when it did what it should, 2 for a mistake of the caller's, 3 when it could not."""
    try:
        app(standalone_mode=False)
    except UsageError as error:
        _end(str(error), _CALLER)
    except Cancelled as error:
        _end(str(error) or "stopped", _STOPPED)
    except RobomarkError as error:
        _end(str(error), _OURS)
    except click.exceptions.Exit as ending:
        sys.exit(ending.exit_code)
    except click.ClickException as error:
        error.show()
        sys.exit(_CALLER)
    except (click.Abort, KeyboardInterrupt):
        _end("stopped", _STOPPED)
    except BrokenPipeError:
        # The reader of our output has gone; nothing is left to say, and the interpreter must not try to.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(_STOPPED)
    except Exception as error:
        if os.environ.get("ROBOMARK_DEBUG"):
            traceback.print_exc()
        _end(
            f"something went wrong in Robomark itself, not in your files: {type(error).__name__}: {error} "
            "(set ROBOMARK_DEBUG=1 to see where)",
            _OURS,
        )
    sys.exit(0)


def _end(sentence: str, status: int) -> NoReturn:
    print(f"robomark: {sentence}", file=sys.stderr)
    sys.exit(status)
