"""Run a robot program or notebook for ``robomark run``, and show and save the results.

``run.py`` contains the options. The program runs as it does in grading.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from responders.channel import Channel
from responders.notebook_executor import ExecutedNotebook
from responders.sandbox.manager import Sandboxes
from responders.sandbox.running_child import ChildLimits
from responders.sandbox.zygote import FULL_ISOLATION, NO_ISOLATION
from service.commands.options import ChannelFlags, apply_channel_flags
from service.commands.output import print_json, print_line, print_note
from service.commands.run import MagicFlags, OutputFiles, RunConditions, TickLength
from service.commands.sandbox_warning import warn_about_missing_sandbox
from service.grading.grade import TrialResult
from service.grading.standalone_runs import (
    ProgramFile,
    RunLimits,
    RunOptions,
    load_floor,
    load_responder,
    read_neighbour_files,
    read_program,
    read_runnable,
    run_notebook,
    run_program,
)
from service.grading.trial_runner import TrialRunner
from service.home import user_permissions
from service.reports.display_text import to_display_text
from service.reports.output_files import prepare_folder, write_file, write_film, write_replay
from service.reports.plots.diagram_drawing import draw_diagram
from service.reports.plots.diagram_parts import Highlights
from service.reports.plots.own_diagrams import format_cell_title
from service.reports.plots.path import draw_path
from service.reports.plots.style import render_png
from service.reports.replay.document import Pixels, build_run_replay
from service.reports.replay.sources import Sources, collect_cell_sources, collect_file_sources
from service.reports.robots import iterate_robots
from service.reports.trace import build_trace, replace_surrogates
from service.reports.transcript import build_transcript
from service.reports.view import NO_OVERLAY, OverlayTrials
from sim.errors import UsageError
from sim.floors import Floor
from sim.recording import BROWSER_TICK, TICK, Recording
from sim.recording_values import collect_faults, rebuild_floor
from submissions.diagram_cells import read_diagrams
from submissions.magics import Flags
from submissions.submission import Notebook


def run_file(
    path: Path, magic: MagicFlags, conditions: RunConditions, channel: ChannelFlags, kept: OutputFiles, *, unsafe: bool
) -> None:
    """Run a robot program or notebook, show the results, and save the requested files."""
    if kept.diagrams is not None:
        prepare_folder(kept.diagrams)
    options = _build_options(magic, conditions, channel)
    if unsafe:
        warn_about_missing_sandbox()
    read = read_runnable(path)
    with TrialRunner(Sandboxes(NO_ISOLATION if unsafe else FULL_ISOLATION)) as runner:
        if isinstance(read, ProgramFile):
            _run_program(read, options, conditions, kept, runner)
        else:
            for each in read.notes:
                print_note(f"note: {each}")
            _run_notebook(path, read.notebook, options, conditions, kept, runner)


def _build_options(magic: MagicFlags, conditions: RunConditions, channel: ChannelFlags) -> RunOptions:
    floor = load_floor(magic.background)
    values = {**magic.values, "b": magic.background if floor is None else None}
    limits = RunLimits()
    return RunOptions(
        flags=Flags(switches=magic.switches).with_values(**values),
        channel=apply_channel_flags(Channel(), channel.to_table()),
        floor=floor,
        seconds=conditions.seconds,
        seed=conditions.seed,
        sheet=conditions.sheet,
        tick=BROWSER_TICK if conditions.tick is TickLength.BROWSER else TICK,
        limits=RunLimits(ChildLimits(conditions.responder_cpu, limits.responder.memory_bytes)),
    )


def _run_notebook(
    path: Path,
    notebook: Notebook,
    options: RunOptions,
    conditions: RunConditions,
    kept: OutputFiles,
    runner: TrialRunner,
) -> None:
    if conditions.responder is not None:
        raise UsageError(f"{path.name} is a notebook and answers the robot itself; omit --responder")
    if conditions.second is not None:
        raise UsageError(f"{path.name} is a notebook and starts its robots itself; omit --second")
    if kept.over is not None:
        raise UsageError(f"{path.name} is a notebook and cannot have an overlay; omit --over")
    text = "\n".join(cell.source for cell in notebook.cells)
    executed = run_notebook(notebook, read_neighbour_files(path, text), options, runner)
    runs = [{"cell": run.cell, **_recording_to_json(run.recording)} for run in executed.runs]
    print_json(output=executed.output, runs=runs, notes=executed.notes, stopped=executed.stopped)
    _show_notebook(executed, _show_recording)
    _show_diagrams(notebook, kept.diagrams)
    if executed.runs:
        _save_files(kept, executed.runs[-1].recording, path.name, options, collect_cell_sources(notebook))


def _run_program(
    program: ProgramFile, options: RunOptions, conditions: RunConditions, kept: OutputFiles, runner: TrialRunner
) -> None:
    if kept.diagrams is not None:
        raise UsageError(f"{program.path.name} is not a notebook and has no diagrams; omit --diagrams")
    ran = run_program(
        program,
        options,
        runner,
        responder=None if conditions.responder is None else load_responder(conditions.responder, options.limits),
        second=None if conditions.second is None else read_program(conditions.second),
        over=None if kept.over is None else _read_overlay_program(kept.over),
    )
    for each in ran.notes:
        print_note(f"note: {each}")
    print_json(run=_recording_to_json(ran.recording), notes=ran.notes)
    _show_recording(ran.recording)
    others = NO_OVERLAY
    if ran.over is not None and kept.over is not None:
        others = OverlayTrials(kept.over.name, {0: _to_trial(ran.over, options.seed)})
    answering = None if ran.spec.responder is None else ran.spec.responder.code
    _save_files(
        kept, ran.recording, program.path.name, options, collect_file_sources(ran.spec.program.code, answering), others
    )


def _read_overlay_program(path: Path) -> ProgramFile:
    """Read a program that runs in the first program's world. Its ``%%sim_magic`` line is ignored."""
    read = read_runnable(path)
    if not isinstance(read, ProgramFile):
        raise UsageError(f"--over {path.name} is a notebook, expected a robot program")
    return read


def _save_files(
    kept: OutputFiles,
    recording: Recording,
    name: str,
    options: RunOptions,
    sources: Sources,
    others: OverlayTrials = NO_OVERLAY,
) -> None:
    seed, floor = options.seed, options.floor
    pixels: dict[str, Pixels] = {} if floor is None else {floor.name: floor.pixels}
    if kept.trace_file is not None:
        _write_bytes(kept.trace_file, json.dumps(build_trace(recording)).encode())
    if kept.picture is not None:
        _write_bytes(kept.picture, _draw_picture(recording, name, seed, floor))
    if kept.film is not None:
        write_film(kept.film, _to_trial(recording, seed), pixels)
    if kept.replay is not None:
        write_replay(kept.replay, build_run_replay(recording, name, seed, sources, pixels, others))


def _to_trial(recording: Recording, seed: int) -> TrialResult:
    return TrialResult("run", 0, seed, 0, 0, "visible", recording)


def _write_bytes(path: Path, data: bytes) -> None:
    try:
        with user_permissions():
            path.write_bytes(data)
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror}") from error


def _show_recording(recording: Recording) -> None:
    """Print the output, speech and messages of a run in order, and the outcome."""
    for t, text in build_transcript(recording):
        print_line(f"{t:8.2f} s  {to_display_text(text, 400)}")
    for which, own in iterate_robots(recording):
        end, whose = own.end, "" if own is recording else f"{which}: "
        print_line(
            f"{own.end_t:8.2f} s  {whose}end at x {end.x:.1f} mm, y {end.y:.1f} mm, heading {end.heading:.1f} degrees; "
            f"{own.verdict}"
        )
    for fault in collect_faults(recording):
        whose = "" if fault.file else f" of the {fault.who}"
        where = f" ({fault.place}{whose})" if fault.line is not None else ""
        print(f"{fault.t:8.2f} s  {fault.verdict}: {to_display_text(fault.message, 400)}{where}", file=sys.stderr)
        if fault.hint:
            print(f"            {fault.hint}", file=sys.stderr)
    for each in recording.notes:
        print_note(f"note: {to_display_text(each, 400)}")


def _recording_to_json(recording: Recording) -> dict[str, Any]:
    """Return the JSON value for a run."""
    faults = [
        {
            "t": fault.t,
            "verdict": fault.verdict,
            "who": fault.who,
            "place": replace_surrogates(fault.place),
            "message": replace_surrogates(fault.message),
            "hint": replace_surrogates(fault.hint),
        }
        for fault in collect_faults(recording)
    ]
    return {**build_trace(recording), "faults": faults}


def _draw_picture(recording: Recording, name: str, seed: int, own: Floor | None) -> bytes:
    driven_on = own if own is not None and own.name == recording.background else rebuild_floor(recording)
    return render_png(draw_path(_to_trial(recording, seed), name, driven_on.pixels if driven_on else None))


def _show_notebook(executed: ExecutedNotebook, show: Callable[[Recording], None]) -> None:
    """Print the output of the cells and the skipped cells. ``show`` prints each robot run."""
    shown = 0
    for run in executed.runs:
        _show_output(executed.output[shown : run.printed])
        shown = run.printed
        print_line(f"--- the robot, started by cell {run.cell} ---")
        show(run.recording)
    _show_output(executed.output[shown:])
    for each in executed.notes:
        print_note(f"note: {to_display_text(each, 400)}")
    if executed.stopped is not None:
        stopped = executed.stopped
        print(f"{stopped.place}: {stopped.verdict}: {stopped.message}", file=sys.stderr)
    if not executed.runs:
        print_note("note: no robot was started: no cell begins with %%sim_magic_preloaded")


def _show_output(text: str) -> None:
    for line in text.strip("\n").split("\n") if text.strip("\n") else ():
        print_line(to_display_text(line, 400))


def _show_diagrams(notebook: Notebook, folder: Path | None) -> None:
    """Write the diagrams of the notebook's cells into ``folder``, if given, and report those that cannot be drawn."""
    found = read_diagrams(notebook)
    for problem in found.problems:
        print_note(f"note: {to_display_text(problem, 400)}")
    if folder is None:
        if found.cells:
            print_note("note: the notebook has diagrams; --diagrams FOLDER draws them")
        return
    for cell in found.cells:
        figure = draw_diagram(cell.diagram, format_cell_title(cell), notebook.name, Highlights())
        print_note(f"diagram: {write_file(folder, f'cell-{cell.cell}.png', render_png(figure))}")
