"""Options of ``robomark run``, including the flags of the magic.

``run.py`` is the command.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from service.commands.options import FilmOption
from sim.errors import UsageError


class TickLength(StrEnum):
    """Tick lengths, by their names in an assignment's world."""

    THIRTIETH = "thirtieth"
    BROWSER = "browser"


@dataclass(frozen=True, slots=True)
class MagicFlags:
    """The flags of ``%sim_magic`` that change the world."""

    background: Annotated[
        str | None, typer.Option("-b", "--background", help="Floor, or an image of 2362 x 1143 pixels.")
    ] = None
    robot_setup: Annotated[str | None, typer.Option("-r", "--robotSetup", help="Robot configuration.")] = None
    obstacles: Annotated[str | None, typer.Option("-o", "--obstacles", help="Obstacle preset.")] = None
    x: Annotated[str | None, typer.Option("-x", "--xpos", help="Start, mm from the left.")] = None
    y: Annotated[str | None, typer.Option("-y", "--ypos", help="Start, mm from the bottom.")] = None
    angle: Annotated[str | None, typer.Option("--angle", help="Start heading, degrees.")] = None
    light_noise: Annotated[str | None, typer.Option("-N", "--sensornoise", help="Light noise, 0 to 128.")] = None
    motor_noise: Annotated[str | None, typer.Option("-M", "--motornoise", help="Wheel noise, 0 to 500.")] = None
    pen_colour: Annotated[str | None, typer.Option("-P", "--pencolor", help="Colour of the pen.")] = None
    pen_down: Annotated[bool, typer.Option("-p", "--pendown", help="Draw the path.")] = False
    collab: Annotated[bool, typer.Option("-L", "--collab", help="Forward texts that begin with PY::.")] = False
    autorun: Annotated[bool, typer.Option("-R", "--autorun", help="No effect: always on in Robomark.")] = False
    move: Annotated[bool, typer.Option("-m", "--move", hidden=True)] = False

    @property
    def values(self) -> dict[str, str | None]:
        """Return the flags that have a value, by letter."""
        return {
            "b": self.background,
            "r": self.robot_setup,
            "o": self.obstacles,
            "x": self.x,
            "y": self.y,
            "a": self.angle,
            "N": self.light_noise,
            "M": self.motor_noise,
            "P": self.pen_colour,
        }

    @property
    def switches(self) -> frozenset[str]:
        """Return the letters of the switches that were given."""
        return frozenset(letter for letter, on in (("p", self.pen_down), ("L", self.collab), ("m", self.move)) if on)


@dataclass(frozen=True, slots=True)
class PanelFlags:
    """The flags of ``%sim_magic`` for panels of the original simulator's page. They have no effect here."""

    output: Annotated[bool, typer.Option("-O", "--output", hidden=True)] = False
    array: Annotated[bool, typer.Option("-A", "--array", hidden=True)] = False
    hide: Annotated[bool, typer.Option("-H", "--hide", hidden=True)] = False
    world: Annotated[bool, typer.Option("-W", "--world", hidden=True)] = False
    settings: Annotated[bool, typer.Option("-Z", "--settings", hidden=True)] = False
    noise_controls: Annotated[bool, typer.Option("-z", "--noisecontrols", hidden=True)] = False
    positioning: Annotated[bool, typer.Option("-X", "--positioning", hidden=True)] = False
    code: Annotated[bool, typer.Option("-D", "--code", hidden=True)] = False
    instrumentation: Annotated[bool, typer.Option("-i", "--instrumentation", hidden=True)] = False
    chart: Annotated[bool, typer.Option("-c", "--chart", hidden=True)] = False
    ultrasound: Annotated[bool, typer.Option("-u", "--ultrasound", hidden=True)] = False
    clear: Annotated[bool, typer.Option("-C", "--clear", hidden=True)] = False
    preview: Annotated[bool, typer.Option("-v", "--preview", "--previewcode", hidden=True)] = False
    simulator: Annotated[str | None, typer.Option("-s", "--sim", hidden=True)] = None
    stop: Annotated[bool, typer.Option("-S", "--stop", hidden=True)] = False
    refresh: Annotated[bool, typer.Option("-F", "--refresh", hidden=True)] = False


@dataclass(frozen=True, slots=True)
class RunConditions:
    """Conditions of a run that the magic's flags do not cover."""

    responder: Annotated[
        str | None, typer.Option(help="FILE[:NAME] of the responder that answers the program's messages.")
    ] = None
    second: Annotated[
        Path | None, typer.Option(help="The program of a second robot. Its first line sets the start with -x and -y.")
    ] = None
    responder_cpu: Annotated[
        float, typer.Option(min=0.1, max=3600, help="CPU limit of the responder or the notebook, in seconds.")
    ] = 10
    seconds: Annotated[float, typer.Option(min=0.1, max=3600, help="Stop after this much simulated time.")] = 60
    seed: Annotated[int, typer.Option(min=0, help="Seed of all random values.")] = 0
    sheet: Annotated[
        int | None, typer.Option(min=0, help="Number of the digit sheet. Default: depends on the seed.")
    ] = None
    tick: Annotated[
        TickLength, typer.Option(help="Length of a tick: 1/30 s, or 33 ms as in RoboLab in the browser.")
    ] = TickLength.THIRTIETH


@dataclass(frozen=True, slots=True)
class OutputFiles:
    """The files in which a run is saved."""

    replay: Annotated[
        Path | None, typer.Option(help="Write a replay page of the run to this file, or its data to a .json file.")
    ] = None
    over: Annotated[
        Path | None,
        typer.Option(help="Also run this program in the same world, and add it to the replay of --replay."),
    ] = None
    film: FilmOption = None
    trace_file: Annotated[Path | None, typer.Option("--trace", help="Write the recording to this file, as JSON.")] = (
        None
    )
    picture: Annotated[
        Path | None, typer.Option("--picture", help="Write a plot of the path on the floor to this file, as PNG.")
    ] = None
    diagrams: Annotated[
        Path | None, typer.Option(help="Write the diagrams of a notebook's cells to this folder, as PNG.")
    ] = None

    def check_options(self) -> None:
        """Raise UsageError if the options do not fit together."""
        if self.picture is not None and self.picture.suffix.lower() != ".png":
            raise UsageError(f"--picture {self.picture}: expected a name that ends in .png")
        if self.over is not None and self.replay is None:
            raise UsageError("--over needs a replay; expected --replay too")
