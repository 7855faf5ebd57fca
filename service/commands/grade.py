"""``robomark grade``: its options. ``grading.py``, which loads slowly, does the work."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.commands.options import ChannelFlags, LanguageOption, create_format_option, with_option_groups
from service.commands.output import is_json_output
from service.language import SOURCE_LANGUAGE


def _list_document_formats() -> tuple[str, ...]:
    """Return the names of the formats that can show one grade."""
    from service.reports.formats import FORMATS

    return tuple(name for name, form in FORMATS.items() if form.document is not None)


@with_option_groups
def grade(
    submissions: Annotated[
        list[Path], typer.Argument(help="Submissions. Each is a .py file, a folder or a .zip file.")
    ],
    assignment: Annotated[
        str | None, typer.Option("-a", "--assignment", help="The assignment's id in the catalogue, or its folder.")
    ] = None,
    report: Annotated[Path | None, typer.Option(help="Write a report for each submission to this folder.")] = None,
    form: Annotated[
        str, create_format_option("Output format. An unknown format lists the available ones.", _list_document_formats)
    ] = "text",
    language: LanguageOption = SOURCE_LANGUAGE,
    run: Annotated[
        str | None, typer.Option(metavar="N|TAG", help="For a notebook: the number of the run to mark, or its tag.")
    ] = None,
    *,
    causes: Annotated[
        bool,
        typer.Option("--causes", help="Run trials that lost marks again, with one thing exchanged, to show causes."),
    ] = False,
    all_trials: Annotated[
        bool, typer.Option("--all-trials", help="Run all trials of pools, so that no marks are provisional.")
    ] = False,
    nearest: Annotated[
        bool,
        typer.Option("--nearest", help="For staff: also search for the smallest change of a number that passes."),
    ] = False,
    channel: ChannelFlags,
    unsafe: Annotated[
        bool, typer.Option("--unsafe-no-sandbox", help="Run submissions without a sandbox. For development only.")
    ] = False,
) -> None:
    """Grade submissions now. Exit status 0 if all were graded, whatever the marks.

    In every format except text, several submissions form one document, including failed ones with the reason.
    """
    from service.commands.grading import grade_all
    from service.grading.pools.drawing import PoolExtent

    extent = PoolExtent.WHOLE if all_trials else PoolExtent.UNTIL_DECIDED
    format_name = "json" if is_json_output() else form
    grade_all(
        submissions,
        assignment,
        report,
        format_name,
        channel.to_table(),
        language,
        run=run,
        extent=extent,
        causes=causes,
        unsafe=unsafe,
        nearest=nearest,
    )
