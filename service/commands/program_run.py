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
from responders.sandbox.isolation import FULL_ISOLATION, NO_ISOLATION
from responders.sandbox.manager import Sandboxes
from responders.sandbox.running_child import ChildLimits
from service.commands.options import ChannelFlags, apply_channel_flags
from service.commands.output import print_json, print_line, print_note, warn_about_missing_sandbox
from service.commands.run_options import MagicFlags, OutputFiles, RunConditions, TickLength
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
from service.grading.verdict_labels import VERDICT_LABELS
from service.home import user_permissions
from service.reports.display_text import to_display_text
from service.reports.messages import iterate_robots
from service.reports.output_files import prepare_folder, write_file, write_film, write_replay
from service.reports.plots.diagram_drawing import draw_diagram
from service.reports.plots.diagram_parts import Highlights
from service.reports.plots.own_diagrams import format_cell_title
from service.reports.plots.path import draw_path
from service.reports.plots.png import render_png
from service.reports.replay.document import Pixels, build_run_replay
from service.reports.replay.sources import Sources, collect_cell_sources, collect_file_sources
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
    path: Path,
    magic: MagicFlags,
    conditions: RunConditions,
    channel: ChannelFlags,
    output_files: OutputFiles,
    *,
    unsafe: bool,
) -> None:
    """Run a robot program or notebook, show the results, and save the requested files."""
    if output_files.diagrams is not None:
        prepare_folder(output_files.diagrams)
    options = _build_options(magic, conditions, channel)
    if unsafe:
        warn_about_missing_sandbox()
    runnable = read_runnable(path)
    with TrialRunner(Sandboxes(NO_ISOLATION if unsafe else FULL_ISOLATION)) as runner:
        if isinstance(runnable, ProgramFile):
            _run_program(runnable, options, conditions, output_files, runner)
        else:
            for note in runnable.notes:
                print_note(f"note: {note}")
            _run_notebook(path, runnable.notebook, options, conditions, output_files, runner)


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
    output_files: OutputFiles,
    runner: TrialRunner,
) -> None:
    if conditions.responder is not None:
        raise UsageError(f"{path.name} is a notebook and answers the robot itself; omit --responder")
    if conditions.second is not None:
        raise UsageError(f"{path.name} is a notebook and starts its robots itself; omit --second")
    if output_files.over is not None:
        raise UsageError(f"{path.name} is a notebook and cannot have an overlay; omit --over")
    text = "\n".join(cell.source for cell in notebook.cells)
    executed_notebook = run_notebook(notebook, read_neighbour_files(path, text), options, runner)
    runs = [{"cell": run.cell, **_recording_to_json(run.recording)} for run in executed_notebook.runs]
    print_json(
        output=executed_notebook.output, runs=runs, notes=executed_notebook.notes, stopped=executed_notebook.stopped
    )
    _show_notebook(executed_notebook, _show_recording)
    _show_diagrams(notebook, output_files.diagrams)
    if executed_notebook.runs:
        _save_files(
            output_files, executed_notebook.runs[-1].recording, path.name, options, collect_cell_sources(notebook)
        )


def _run_program(
    program: ProgramFile, options: RunOptions, conditions: RunConditions, output_files: OutputFiles, runner: TrialRunner
) -> None:
    if output_files.diagrams is not None:
        raise UsageError(f"{program.path.name} is not a notebook and has no diagrams; omit --diagrams")
    run_result = run_program(
        program,
        options,
        runner,
        responder=None if conditions.responder is None else load_responder(conditions.responder, options.limits),
        second=None if conditions.second is None else read_program(conditions.second),
        over=None if output_files.over is None else _read_overlay_program(output_files.over),
    )
    for note in run_result.notes:
        print_note(f"note: {note}")
    print_json(run=_recording_to_json(run_result.recording), notes=run_result.notes)
    _show_recording(run_result.recording)
    overlay_trials = NO_OVERLAY
    if run_result.over is not None and output_files.over is not None:
        overlay_trials = OverlayTrials(output_files.over.name, {0: _to_trial(run_result.over, options.seed)})
    responder_code = None if run_result.spec.responder is None else run_result.spec.responder.code
    _save_files(
        output_files,
        run_result.recording,
        program.path.name,
        options,
        collect_file_sources(run_result.spec.program.code, responder_code),
        overlay_trials,
    )


def _read_overlay_program(path: Path) -> ProgramFile:
    """Read a program that runs in the first program's world. Its ``%%sim_magic`` line is ignored."""
    runnable = read_runnable(path)
    if not isinstance(runnable, ProgramFile):
        raise UsageError(f"--over {path.name} is a notebook, expected a robot program")
    return runnable


def _save_files(
    output_files: OutputFiles,
    recording: Recording,
    name: str,
    options: RunOptions,
    sources: Sources,
    overlay_trials: OverlayTrials = NO_OVERLAY,
) -> None:
    seed, floor = options.seed, options.floor
    pixels: dict[str, Pixels] = {} if floor is None else {floor.name: floor.pixels}
    if output_files.trace_file is not None:
        _write_bytes(output_files.trace_file, json.dumps(build_trace(recording)).encode())
    if output_files.picture is not None:
        _write_bytes(output_files.picture, _draw_picture(recording, name, seed, floor))
    if output_files.film is not None:
        write_film(output_files.film, _to_trial(recording, seed), pixels)
    if output_files.replay is not None:
        write_replay(output_files.replay, build_run_replay(recording, name, seed, sources, pixels, overlay_trials))


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
    for robot, robot_recording in iterate_robots(recording):
        end, owner = robot_recording.end, "" if robot_recording is recording else f"{robot}: "
        print_line(
            f"{robot_recording.end_t:8.2f} s  {owner}end at x {end.x:.1f} mm, y {end.y:.1f} mm, heading "
            f"{end.heading:.1f} degrees; {VERDICT_LABELS[robot_recording.verdict]}"
        )
    for fault in collect_faults(recording):
        owner = "" if fault.file else f" of the {fault.who}"
        location = f" ({fault.place}{owner})" if fault.line is not None else ""
        print(
            f"{fault.t:8.2f} s  {VERDICT_LABELS[fault.verdict]}: {to_display_text(fault.message, 400)}{location}",
            file=sys.stderr,
        )
        if fault.hint:
            print(f"            {fault.hint}", file=sys.stderr)
    for note in recording.notes:
        print_note(f"note: {to_display_text(note, 400)}")


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


def _draw_picture(recording: Recording, name: str, seed: int, own_floor: Floor | None) -> bytes:
    floor = own_floor if own_floor is not None and own_floor.name == recording.background else rebuild_floor(recording)
    return render_png(draw_path(_to_trial(recording, seed), name, floor.pixels if floor else None))


def _show_notebook(executed_notebook: ExecutedNotebook, show_run: Callable[[Recording], None]) -> None:
    """Print the output of the cells and the skipped cells. ``show_run`` prints each robot run."""
    shown_length = 0
    for run in executed_notebook.runs:
        _show_output(executed_notebook.output[shown_length : run.printed])
        shown_length = run.printed
        print_line(f"--- the robot, started by cell {run.cell} ---")
        show_run(run.recording)
    _show_output(executed_notebook.output[shown_length:])
    for note in executed_notebook.notes:
        print_note(f"note: {to_display_text(note, 400)}")
    if executed_notebook.stopped is not None:
        stopped = executed_notebook.stopped
        print(f"{stopped.place}: {VERDICT_LABELS[stopped.verdict]}: {stopped.message}", file=sys.stderr)
    if not executed_notebook.runs:
        print_note("note: no robot was started: no cell begins with %%sim_magic_preloaded")


def _show_output(text: str) -> None:
    for line in text.strip("\n").split("\n") if text.strip("\n") else ():
        print_line(to_display_text(line, 400))


def _show_diagrams(notebook: Notebook, folder: Path | None) -> None:
    """Write the diagrams of the notebook's cells into ``folder``, if given, and report those that cannot be drawn."""
    notebook_diagrams = read_diagrams(notebook)
    for problem in notebook_diagrams.problems:
        print_note(f"note: {to_display_text(problem, 400)}")
    if folder is None:
        if notebook_diagrams.cells:
            print_note("note: the notebook has diagrams; --diagrams FOLDER draws them")
        return
    for cell in notebook_diagrams.cells:
        figure = draw_diagram(cell.diagram, format_cell_title(cell), notebook.name, Highlights())
        print_note(f"diagram: {write_file(folder, f'cell-{cell.cell}.png', render_png(figure))}")
