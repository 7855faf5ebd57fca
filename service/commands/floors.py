"""``robomark floors``: a page with every floor, to choose one and to read coordinates from it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.commands.output import create_progress_console, print_json, print_line


def floors(
    output: Annotated[Path, typer.Option("-o", "--output", help="The folder for index.html.")],
    sheet: Annotated[int, typer.Option(min=0, help="The seed of the handwriting on the digit sheets.")] = 0,
) -> None:
    """Draw every floor with its scale, the robot's start and its labels."""
    from rich.progress import track

    from service.reports.html import PrintedFloor, render_floor_gallery
    from service.reports.output_files import prepare_folder, write_page
    from service.reports.plots.floor import draw_floor
    from service.reports.plots.png import render_png
    from sim.floors import build_floor, list_floor_names, list_label_names

    prepare_folder(output)
    printed = []
    for name in track(list_floor_names(), "drawing", transient=True, console=create_progress_console()):
        printed.append(
            PrintedFloor(name, render_png(draw_floor(build_floor(name, seed=sheet))), list_label_names(name))
        )
    page = write_page(output, "index.html", render_floor_gallery(printed))
    print_json(page=page, floors=list_floor_names())
    print_line(f"floors: {page}")
