"""``robomark floors``: a page with every floor, to choose one and to read coordinates from it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.commands.shown import document, progress, tell


def floors(
    output: Annotated[Path, typer.Option("-o", "--output", help="The folder for index.html.")],
    sheet: Annotated[int, typer.Option(min=0, help="The seed of the handwriting on the digit sheets.")] = 0,
) -> None:
    """Draw every floor with its scale, the robot's start and its labels."""
    from rich.progress import track

    from service.reports.html import PrintedFloor, gallery
    from service.reports.plots.floor import draw_floor
    from service.reports.plots.style import png
    from service.reports.written import prepare_folder, write_page
    from sim.floors import floor, label_names, names

    prepare_folder(output)
    printed = []
    for name in track(names(), "drawing", transient=True, console=progress()):
        printed.append(PrintedFloor(name, png(draw_floor(floor(name, seed=sheet))), label_names(name)))
    page = write_page(output, "index.html", gallery(printed))
    document(page=page, floors=names())
    tell(f"floors: {page}")
