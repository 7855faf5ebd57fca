"""``robomark run``. ``run_options.py`` contains the options, ``program_run.py`` does the work."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.commands.options import ChannelFlags, with_option_groups
from service.commands.run_options import MagicFlags, OutputFiles, PanelFlags, RunConditions


@with_option_groups
def run(
    program: Annotated[Path, typer.Argument(help="The robot program, a .py file, or a notebook.")],
    magic: MagicFlags,
    panels: PanelFlags,
    conditions: RunConditions,
    channel: ChannelFlags,
    output_files: OutputFiles,
    unsafe: Annotated[
        bool, typer.Option("--unsafe-no-sandbox", help="Run programs without a sandbox. For development only.")
    ] = False,
) -> None:
    """Run a robot program or a notebook in the simulator, with the flags of %sim_magic, and print its output."""
    output_files.check_options()
    from service.commands.program_run import run_file

    run_file(program, magic, conditions, channel, output_files, unsafe=unsafe)
