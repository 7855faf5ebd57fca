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
from responders.sandbox.zygote import FULL, NONE
from service.commands.options import ChannelFlags, changed
from service.commands.run import Conditions, Kept, MagicFlags, Tick
from service.commands.shown import document, note, tell
from service.commands.unsafe import warn_of_no_sandbox
from service.grading.grade import TrialResult
from service.grading.standalone import (
    ProgramFile,
    RunLimits,
    RunOptions,
    find_responder,
    own_floor,
    read_files_beside,
    read_program,
    read_runnable,
    run_notebook,
    run_program,
)
from service.grading.trial_runner import TrialRunner
from service.home import for_the_user
from service.reports.plots.diagram_parts import Highlights
from service.reports.plots.drawn_diagrams import draw_diagram
from service.reports.plots.own_diagrams import title_of_cell
from service.reports.plots.path import draw_path
from service.reports.plots.style import png
from service.reports.readable import readable
from service.reports.replay.document import Pixels, replay_of_run
from service.reports.replay.sources import Sources, sources_of_cells, sources_of_files
from service.reports.robots import robots_of
from service.reports.trace import storable, trace
from service.reports.transcript import transcript
from service.reports.view import NO_OTHERS, OtherTrials
from service.reports.written import prepare_folder, write_file, write_film, write_replay
from sim.errors import UsageError
from sim.floors import Floor
from sim.recorded import faults_of, floor_of
from sim.recording import BROWSER_TICK, TICK, Recording
from submissions.diagram_cells import diagrams_in
from submissions.magics import Flags
from submissions.submission import Notebook


def run_file(
    path: Path, magic: MagicFlags, conditions: Conditions, channel: ChannelFlags, kept: Kept, *, unsafe: bool
) -> None:
    """Run a robot program or notebook, show the results, and save the requested files."""
    if kept.diagrams is not None:
        prepare_folder(kept.diagrams)
    options = _options(magic, conditions, channel)
    if unsafe:
        warn_of_no_sandbox()
    read = read_runnable(path)
    with TrialRunner(Sandboxes(NONE if unsafe else FULL)) as runner:
        if isinstance(read, ProgramFile):
            _run_program(read, options, conditions, kept, runner)
        else:
            for each in read.notes:
                note(f"note: {each}")
            _run_notebook(path, read.notebook, options, conditions, kept, runner)


def _options(magic: MagicFlags, conditions: Conditions, channel: ChannelFlags) -> RunOptions:
    floor = own_floor(magic.background)
    values = {**magic.values, "b": magic.background if floor is None else None}
    limits = RunLimits()
    return RunOptions(
        flags=Flags(switches=magic.switches).with_values(**values),
        channel=changed(Channel(), channel.given()),
        floor=floor,
        seconds=conditions.seconds,
        seed=conditions.seed,
        sheet=conditions.sheet,
        tick=BROWSER_TICK if conditions.tick is Tick.BROWSER else TICK,
        limits=RunLimits(ChildLimits(conditions.responder_cpu, limits.responder.memory_bytes)),
    )


def _run_notebook(
    path: Path, notebook: Notebook, options: RunOptions, conditions: Conditions, kept: Kept, runner: TrialRunner
) -> None:
    if conditions.responder is not None:
        raise UsageError(f"{path.name} is a notebook and answers the robot itself; omit --responder")
    if conditions.second is not None:
        raise UsageError(f"{path.name} is a notebook and starts its robots itself; omit --second")
    if kept.over is not None:
        raise UsageError(f"{path.name} is a notebook and cannot have an overlay; omit --over")
    text = "\n".join(cell.source for cell in notebook.cells)
    executed = run_notebook(notebook, read_files_beside(path, text), options, runner)
    runs = [{"cell": run.cell, **_told(run.recording)} for run in executed.runs]
    document(output=executed.output, runs=runs, notes=executed.notes, stopped=executed.stopped)
    _show_notebook(executed, _show)
    _show_diagrams(notebook, kept.diagrams)
    if executed.runs:
        _keep(kept, executed.runs[-1].recording, path.name, options, sources_of_cells(notebook))


def _run_program(
    program: ProgramFile, options: RunOptions, conditions: Conditions, kept: Kept, runner: TrialRunner
) -> None:
    if kept.diagrams is not None:
        raise UsageError(f"{program.path.name} is not a notebook and has no diagrams; omit --diagrams")
    ran = run_program(
        program,
        options,
        runner,
        responder=None if conditions.responder is None else find_responder(conditions.responder, options.limits),
        second=None if conditions.second is None else read_program(conditions.second),
        over=None if kept.over is None else _other_program(kept.over),
    )
    for each in ran.notes:
        note(f"note: {each}")
    document(run=_told(ran.recording), notes=ran.notes)
    _show(ran.recording)
    others = NO_OTHERS
    if ran.over is not None and kept.over is not None:
        others = OtherTrials(kept.over.name, {0: _as_trial(ran.over, options.seed)})
    answering = None if ran.spec.responder is None else ran.spec.responder.code
    _keep(kept, ran.recording, program.path.name, options, sources_of_files(ran.spec.program.code, answering), others)


def _other_program(path: Path) -> ProgramFile:
    """Read a program that runs in the first program's world. Its ``%%sim_magic`` line is ignored."""
    read = read_runnable(path)
    if not isinstance(read, ProgramFile):
        raise UsageError(f"--over {path.name} is a notebook, expected a robot program")
    return read


def _keep(
    kept: Kept,
    recording: Recording,
    name: str,
    options: RunOptions,
    sources: Sources,
    others: OtherTrials = NO_OTHERS,
) -> None:
    seed, floor = options.seed, options.floor
    pixels: dict[str, Pixels] = {} if floor is None else {floor.name: floor.pixels}
    if kept.trace_file is not None:
        _write(kept.trace_file, json.dumps(trace(recording)).encode())
    if kept.picture is not None:
        _write(kept.picture, _drawn(recording, name, seed, floor))
    if kept.film is not None:
        write_film(kept.film, _as_trial(recording, seed), pixels)
    if kept.replay is not None:
        write_replay(kept.replay, replay_of_run(recording, name, seed, sources, pixels, others))


def _as_trial(recording: Recording, seed: int) -> TrialResult:
    return TrialResult("run", 0, seed, 0, 0, "visible", recording)


def _write(path: Path, data: bytes) -> None:
    try:
        with for_the_user():
            path.write_bytes(data)
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror}") from error


def _show(recording: Recording) -> None:
    """Print the output, speech and messages of a run in order, and the outcome."""
    for t, text in transcript(recording):
        tell(f"{t:8.2f} s  {readable(text, 400)}")
    for which, own in robots_of(recording):
        end, whose = own.end, "" if own is recording else f"{which}: "
        tell(
            f"{own.end_t:8.2f} s  {whose}end at x {end.x:.1f} mm, y {end.y:.1f} mm, heading {end.heading:.1f} degrees; "
            f"{own.verdict}"
        )
    for fault in faults_of(recording):
        whose = "" if fault.file else f" of the {fault.who}"
        where = f" ({fault.place}{whose})" if fault.line is not None else ""
        print(f"{fault.t:8.2f} s  {fault.verdict}: {readable(fault.message, 400)}{where}", file=sys.stderr)
        if fault.hint:
            print(f"            {fault.hint}", file=sys.stderr)
    for each in recording.notes:
        note(f"note: {readable(each, 400)}")


def _told(recording: Recording) -> dict[str, Any]:
    """Return the JSON value for a run."""
    faults = [
        {
            "t": fault.t,
            "verdict": fault.verdict,
            "who": fault.who,
            "place": storable(fault.place),
            "message": storable(fault.message),
            "hint": storable(fault.hint),
        }
        for fault in faults_of(recording)
    ]
    return {**trace(recording), "faults": faults}


def _drawn(recording: Recording, name: str, seed: int, own: Floor | None) -> bytes:
    driven_on = own if own is not None and own.name == recording.background else floor_of(recording)
    return png(draw_path(_as_trial(recording, seed), name, driven_on.pixels if driven_on else None))


def _show_notebook(executed: ExecutedNotebook, show: Callable[[Recording], None]) -> None:
    """Print the output of the cells and the skipped cells. ``show`` prints each robot run."""
    shown = 0
    for run in executed.runs:
        _show_output(executed.output[shown : run.printed])
        shown = run.printed
        tell(f"--- the robot, started by cell {run.cell} ---")
        show(run.recording)
    _show_output(executed.output[shown:])
    for each in executed.notes:
        note(f"note: {readable(each, 400)}")
    if executed.stopped is not None:
        stopped = executed.stopped
        print(f"{stopped.place}: {stopped.verdict}: {stopped.message}", file=sys.stderr)
    if not executed.runs:
        note("note: no robot was started: no cell begins with %%sim_magic_preloaded")


def _show_output(text: str) -> None:
    for line in text.strip("\n").split("\n") if text.strip("\n") else ():
        tell(readable(line, 400))


def _show_diagrams(notebook: Notebook, folder: Path | None) -> None:
    """Write the diagrams of the notebook's cells into ``folder``, if given, and report those that cannot be drawn."""
    found = diagrams_in(notebook)
    for problem in found.problems:
        note(f"note: {readable(problem, 400)}")
    if folder is None:
        if found.cells:
            note("note: the notebook has diagrams; --diagrams FOLDER draws them")
        return
    for cell in found.cells:
        figure = draw_diagram(cell.diagram, title_of_cell(cell), notebook.name, Highlights())
        note(f"diagram: {write_file(folder, f'cell-{cell.cell}.png', png(figure))}")
