"""``robomark sandbox``: which layers stand round student code on this machine, and what is missing."""

from __future__ import annotations

import platform

import typer

from responders.sandbox import control_group
from responders.sandbox.manager import Sandboxes

sandbox_app = typer.Typer(help="The sandbox round student code.", no_args_is_help=True)


@sandbox_app.callback()
def _group() -> None:
    """The sandbox round student code."""


@sandbox_app.command()
def check() -> None:
    """Put up the sandbox, try it, and say which layers stand; exit status 3 and the reason when one cannot."""
    typer.echo(f"kernel: {platform.system()} {platform.release()} on {platform.machine()}")
    with Sandboxes() as sandboxes:
        typer.echo(f"robot programs: {sandboxes.check('robot')}")
        typer.echo(f"responders: {sandboxes.check('responder')}")
        reason = sandboxes.why_no_bubblewrap()
        kept = sandboxes.remembers()
    if reason is None:
        typer.echo("extra: bubblewrap gives them name spaces of their own")
    else:
        typer.echo(f"extra: bubblewrap, which would give them name spaces of their own, is not used: {reason}")
    reason = control_group.why_not()
    if reason is None:
        typer.echo("extra: a worker started from here has a control group for each grading at a time")
    else:
        typer.echo(f"extra: a worker started from here has no control group for each grading at a time: {reason}")
    if kept is None:
        typer.echo("between trials: a trial can leave nothing for the next")
    else:
        typer.echo(
            f"between trials: a trial can leave something for the next, so hidden scenarios are not graded: {kept}"
        )
