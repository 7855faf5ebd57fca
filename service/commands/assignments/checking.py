"""``robomark assignments check``: its options. ``examples.py``, which loads slowly, does the work."""

from __future__ import annotations

from typing import Annotated

import typer

from sim.errors import UsageError


def check(
    assignment: Annotated[
        str | None, typer.Argument(help="The assignment's id in the catalogue, or its folder.")
    ] = None,
    everything: Annotated[bool, typer.Option("--all", help="Check the whole catalogue and print one table.")] = False,
    write_expected: Annotated[
        bool, typer.Option("--write-expected", help="Add the results of examples without an entry to expected.toml.")
    ] = False,
    mutants: Annotated[
        int,
        typer.Option(metavar="N", min=0, help="Also grade N copies of the reference with one fault each."),
    ] = 0,
) -> None:
    """Find the mistakes in an assignment's files, and grade its examples and submissions without effort."""
    if everything == (assignment is not None):
        raise UsageError("name one assignment to check, or use --all for the whole catalogue")
    if everything and write_expected:
        raise UsageError("name one assignment to use --write-expected")
    from service.commands.assignments import examples

    examples.check_assignments(assignment, write_expected=write_expected, mutant_limit=mutants)
