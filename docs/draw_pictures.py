"""Draws the pictures of the documentation again: ``make pictures`` draws all, or the pictures that it is given.

The pictures of the report and of the tutorial are photographs of pages and need Chromium. This module is not part of
Robomark.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from tutorial_pictures import find_browser, photograph_tutorial

from service.reports.plots.diagram_parts import load_font
from service.reports.plots.style import FAULT
from sim.floors import build_floor, list_floor_names
from submissions.assignment.examples import locate_examples

DOCS = Path(__file__).parent
_COLUMNS = 5
_WIDE, _HIGH = 2362, 1143  # mm
_PAGE = "880,1030"  # pixels: as far down as a reader of the README wants to look
_NETWORKS = ("digits", "digits-28", "digits-cnn")


def draw_report() -> None:
    """The beginning of the report on a submission that is neither right nor hopeless."""
    browser = find_browser()
    with tempfile.TemporaryDirectory() as folder:
        _robomark(
            "grade", locate_examples("shape-recognition") / "flawed", "-a", "shape-recognition", "--report", folder
        )
        flags = ["--headless", "--disable-gpu", "--hide-scrollbars", "--no-first-run", f"--window-size={_PAGE}"]
        # Root has no sandbox of Chromium's; the page is our own.
        flags += ["--no-sandbox"] if os.geteuid() == 0 else []
        flags += [f"--user-data-dir={folder}/browser", "--disable-background-networking"]
        picture = f"--screenshot={DOCS / 'report.png'}"
        page = Path(folder, "flawed.html").as_uri()
        subprocess.run([browser, *flags, picture, page], check=True, stderr=subprocess.DEVNULL)


def draw_floors() -> None:
    """Every floor with the robot where it starts, on one sheet."""
    known = [build_floor(name) for name in list_floor_names()]
    rows = -(-len(known) // _COLUMNS)
    figure = Figure(figsize=(20.8, rows * 2.3), dpi=100, facecolor="#eeeeee")
    cells = figure.subplots(rows, _COLUMNS, squeeze=False).ravel()
    for axes in cells[len(known) :]:
        axes.remove()
    for axes, each in zip(cells, known, strict=False):
        axes.imshow(each.pixels[:, :, :3], extent=(0, _WIDE, 0, _HIGH), interpolation="antialiased")
        for x, y, across, up in each.obstacles:
            axes.add_patch(Rectangle((x, y), across, up, facecolor="magenta", edgecolor="black", linewidth=0.5))
        pose = each.default_pose
        axes.plot(pose.x, pose.y, marker=(3, 0, pose.heading - 90), color=FAULT, markersize=11, markeredgecolor="white")
        axes.set(xlim=(0, _WIDE), ylim=(0, _HIGH), xticks=(), yticks=())
        axes.set_title(each.name, font=load_font(11), loc="left", pad=4)
    figure.subplots_adjust(0.006, 0.01, 0.994, 0.97, wspace=0.03, hspace=0.16)
    FigureCanvasAgg(figure).print_png(DOCS / "floors.png")


def draw_digits() -> None:
    """What the digits are taken for, which were misread, and how that falls. Takes minutes."""
    with tempfile.TemporaryDirectory() as folder:
        _robomark("models", "evaluate", "digits", "--report", folder)
        _robomark("models", "compare", *_NETWORKS, "--report", folder)
        for kind in ("confusion", "misread", "robustness"):
            shutil.copyfile(Path(folder, f"digits-{kind}.png"), DOCS / f"digits-{kind}.png")
        shutil.copyfile(Path(folder, f"{'-and-'.join(_NETWORKS)}.png"), DOCS / "digits-compared.png")


def draw_tutorial() -> None:
    """The pages of the tutorial, in the order of its steps."""
    photograph_tutorial(DOCS)


PICTURES: dict[str, Callable[[], None]] = {
    "report": draw_report,
    "tutorial": draw_tutorial,
    "floors": draw_floors,
    "digits": draw_digits,
}


def _robomark(*words: str | Path) -> None:
    command = [sys.executable, "-c", "from service.cli import main; main()", *map(str, words)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw what is named, or everything."""
    parser = argparse.ArgumentParser(description="Draw the documents' pictures again.")
    parser.add_argument("picture", nargs="*", help=f"{', '.join(PICTURES)}; all if none is named")
    for name in parser.parse_args(arguments).picture or PICTURES:
        if name not in PICTURES:
            parser.error(f"there is no {name}; expected {', '.join(PICTURES)}")
        PICTURES[name]()
        print(f"drawn: {name}")


if __name__ == "__main__":
    main()
