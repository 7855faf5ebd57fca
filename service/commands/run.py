"""``robomark run``: what can be said to it, the magic's flags among it. What it does is ``running.py``'s."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.commands import channel_flags
from service.commands.film_option import FilmOption
from sim.errors import UsageError


def run(
    program: Annotated[Path, typer.Argument(help="The robot program, a .py file, or a notebook.")],
    background: Annotated[
        str | None, typer.Option("-b", "--background", help="Floor, or an image of 2362 x 1143 pixels.")
    ] = None,
    robot_setup: Annotated[str | None, typer.Option("-r", "--robotSetup", help="Robot.")] = None,
    obstacles: Annotated[str | None, typer.Option("-o", "--obstacles", help="Obstacle preset.")] = None,
    x: Annotated[str | None, typer.Option("-x", "--xpos", help="Start, mm from the left.")] = None,
    y: Annotated[str | None, typer.Option("-y", "--ypos", help="Start, mm from the bottom.")] = None,
    angle: Annotated[str | None, typer.Option("--angle", help="Start heading, degrees.")] = None,
    light_noise: Annotated[str | None, typer.Option("-N", "--sensornoise", help="Light noise, 0 to 128.")] = None,
    motor_noise: Annotated[str | None, typer.Option("-M", "--motornoise", help="Wheel noise, 0 to 500.")] = None,
    pen_colour: Annotated[str | None, typer.Option("-P", "--pencolor", help="Colour of the pen.")] = None,
    pen_down: Annotated[bool, typer.Option("-p", "--pendown", help="Draw the path.")] = False,
    collab: Annotated[bool, typer.Option("-L", "--collab", help="Pass PY:: texts on.")] = False,
    autorun: Annotated[bool, typer.Option("-R", "--autorun", help="Always so here.")] = False,
    output: Annotated[bool, typer.Option("-O", "--output", hidden=True)] = False,
    array: Annotated[bool, typer.Option("-A", "--array", hidden=True)] = False,
    hide: Annotated[bool, typer.Option("-H", "--hide", hidden=True)] = False,
    world: Annotated[bool, typer.Option("-W", "--world", hidden=True)] = False,
    settings: Annotated[bool, typer.Option("-Z", "--settings", hidden=True)] = False,
    noise_controls: Annotated[bool, typer.Option("-z", "--noisecontrols", hidden=True)] = False,
    positioning: Annotated[bool, typer.Option("-X", "--positioning", hidden=True)] = False,
    code: Annotated[bool, typer.Option("-D", "--code", hidden=True)] = False,
    instrumentation: Annotated[bool, typer.Option("-i", "--instrumentation", hidden=True)] = False,
    chart: Annotated[bool, typer.Option("-c", "--chart", hidden=True)] = False,
    ultrasound: Annotated[bool, typer.Option("-u", "--ultrasound", hidden=True)] = False,
    clear: Annotated[bool, typer.Option("-C", "--clear", hidden=True)] = False,
    preview: Annotated[bool, typer.Option("-v", "--preview", "--previewcode", hidden=True)] = False,
    simulator: Annotated[str | None, typer.Option("-s", "--sim", hidden=True)] = None,
    stop: Annotated[bool, typer.Option("-S", "--stop", hidden=True)] = False,
    move: Annotated[bool, typer.Option("-m", "--move", hidden=True)] = False,
    refresh: Annotated[bool, typer.Option("-F", "--refresh", hidden=True)] = False,
    responder: Annotated[str | None, typer.Option(help="FILE[:NAME] that answers the program's messages.")] = None,
    second: Annotated[
        Path | None, typer.Option(help="A second robot's program; -x and -y in its first line say where it starts.")
    ] = None,
    responder_cpu: Annotated[
        float, typer.Option(min=0.1, max=3600, help="Seconds that the responder, or the notebook, may compute.")
    ] = 10,
    seconds: Annotated[float, typer.Option(min=0.1, max=3600, help="Stop after this much simulated time.")] = 60,
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything that is left to chance.")] = 0,
    sheet: Annotated[int | None, typer.Option(min=0, help="Which digit sheet; the seed's unless given.")] = None,
    link: channel_flags.LinkFlag = None,
    beacon: channel_flags.BeaconFlag = None,
    reach: channel_flags.RangeFlag = None,
    facing: channel_flags.FacingFlag = None,
    blocked_by: channel_flags.BlockedByFlag = None,
    loss: channel_flags.LossFlag = None,
    delay: channel_flags.DelayFlag = None,
    jitter: channel_flags.JitterFlag = None,
    duplication: channel_flags.DuplicationFlag = None,
    reordering: channel_flags.ReorderingFlag = None,
    corruption: channel_flags.CorruptionFlag = None,
    replay: Annotated[
        Path | None, typer.Option(help="Write a page that plays the run to this file; its data if it is a .json.")
    ] = None,
    over: Annotated[
        Path | None,
        typer.Option(help="Run this program too, in the same world, and draw it over the first in --replay."),
    ] = None,
    film: FilmOption = None,
    trace_file: Annotated[Path | None, typer.Option("--trace", help="Write everything that happened, as JSON.")] = None,
    image: Annotated[Path | None, typer.Option("--picture", help="Draw the path over the floor, as PNG.")] = None,
    diagrams: Annotated[
        Path | None, typer.Option(help="Draw the diagrams of a notebook's cells into this folder, as PNG.")
    ] = None,
    unsafe: Annotated[
        bool, typer.Option("--unsafe-no-sandbox", help="Let programs do anything on this machine; for development.")
    ] = False,
) -> None:
    """Run a robot program or a notebook in the simulator, set up by the flags of %sim_magic; print what is said."""
    if image is not None and image.suffix.lower() != ".png":
        raise UsageError(f"--picture {image}: expected a name that ends in .png")
    if over is not None and replay is None:
        raise UsageError("--over draws over what a replay shows; expected --replay too")
    values = {
        "b": background,
        "r": robot_setup,
        "o": obstacles,
        "x": x,
        "y": y,
        "a": angle,
        "N": light_noise,
        "M": motor_noise,
        "P": pen_colour,
    }
    switches = {letter for letter, on in (("p", pen_down), ("L", collab), ("m", move)) if on}
    given = channel_flags.given_flags(
        link=link,
        beacon=beacon,
        range=reach,
        facing=facing,
        blocked_by=blocked_by,
        loss=loss,
        delay=delay,
        jitter=jitter,
        duplication=duplication,
        reordering=reordering,
        corruption=corruption,
    )
    from service.commands.running import run_program

    run_program(
        program,
        values,
        switches,
        given,
        responder=responder,
        second=second,
        responder_cpu=responder_cpu,
        seconds=seconds,
        seed=seed,
        sheet=sheet,
        replay=replay,
        over=over,
        film=film,
        trace_file=trace_file,
        image=image,
        diagrams=diagrams,
        unsafe=unsafe,
    )
