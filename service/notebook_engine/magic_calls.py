"""Performs a magic of a notebook: applies its flags to the simulator's page, and runs the robot if it starts one.

The responder is in the notebook. The hash of a run is that of ``robomark run`` with the same program, flags, seed and
answers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NoReturn

from responders.notebook_executor import PlannedRun
from responders.outside_responder import OutsideAnswerer, OutsideQuestion
from responders.sandbox.meter import JobMeter
from responders.trial_spec import TrialSpec
from service.grading.notebook_runs import (
    NEW_NOTEBOOK_PAGE,
    LoadedProgram,
    NotebookPage,
    NotebookRuns,
    UnmarkedRuns,
)
from service.grading.standalone_runs import RunLimits
from service.grading.trial_runner import TrialRunner
from service.notebook_engine.requests import MagicRequest, page_to_json
from service.reports.display_text import to_display_text
from service.reports.replay.document import build_run_replay
from service.reports.replay.sources import ShownSource, Sources
from service.reports.trace import replace_surrogates
from service.reports.transcript import build_transcript
from service.reports.verdict_sentences import describe_verdict
from sim.recording import Recording
from sim.recording_values import collect_faults
from submissions.magics import Flags
from submissions.simulator_page import SimulatorSettings

#: Simulated seconds, as for ``robomark run``.
MAX_SECONDS = 60.0
_MAX_LINES, _MAX_LINE_LENGTH = 10_000, 2000


@dataclass(frozen=True, slots=True)
class MagicReply:
    """The page after a magic, notes on its flags, and the run that it started, if any.

    A run that ended at ``question`` has to be repeated with one more answer, from the same page as before.
    """

    page: NotebookPage
    notes: tuple[str, ...]
    run: dict[str, Any] | None = None
    question: OutsideQuestion | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the reply as data: a question alone, or the result."""
        if self.question is not None:
            return {"question": question_to_json(self.question)}
        return {
            "page": page_to_json(self.page),
            "notes": [to_display_text(each) for each in self.notes],
            "run": self.run,
        }


def perform_magic(
    request: MagicRequest, runner: TrialRunner, ask: OutsideAnswerer, limits: RunLimits, meter: JobMeter
) -> MagicReply:
    """Perform a magic. ``ask`` answers the robot's texts, and may end the run with ``Unanswered``.

    Raises:
        HostError: The machine failed.
        RobomarkError: Whatever the meter's heartbeat or ``ask`` raises, except ``Unanswered``.
    """
    unmarked_runs = UnmarkedRuns(limits.program, limits.output_bytes, MAX_SECONDS, request.seed, {}, sheet=request.seed)
    page = NEW_NOTEBOOK_PAGE if request.page is None else request.page.to_page()
    runs = NotebookRuns(None, _refuse_marked_run, unmarked_runs, PlannedRun(), page)
    planned_run = runs.plan_call(request.call)
    if planned_run.spec is None:
        return MagicReply(runs.page, planned_run.notes)
    spec = replace(planned_run.spec, seed=request.seed, child_seed=request.seed, records_lines=True)
    answered_run = runner.run_answered(spec, planned_run.obstacles, ask, meter)
    if answered_run.open_question is not None:
        return MagicReply(page, (), question=answered_run.open_question)
    runs.record_run(answered_run.recording)
    program = runs.page.program
    assert program is not None
    run = _run_to_json(answered_run.recording, spec, program, request.seed)
    return MagicReply(runs.page, planned_run.notes, run)


def question_to_json(question: OutsideQuestion) -> dict[str, Any]:
    """Return a question as data. Its logged data have the program's time, or else the time when they were logged."""
    return {
        "number": question.number,
        "t": question.t,
        "text": replace_surrogates(question.text),
        "data": [
            [replace_surrogates(name), value, t if simtime is None else simtime]
            for name, value, simtime, t in question.logged_data.data
        ],
        "images": list(question.logged_data.images),
    }


def _run_to_json(recording: Recording, spec: TrialSpec, program: LoadedProgram, seed: int) -> dict[str, Any]:
    name = f"cell {program.cell}"
    lines = build_transcript(recording)
    shown_lines = [[t, to_display_text(text, _MAX_LINE_LENGTH)] for t, text in lines[:_MAX_LINES]]
    if len(lines) > _MAX_LINES:
        shown_lines.append([recording.end_t, f"… ({len(lines) - _MAX_LINES:,} more lines)"])
    sources = Sources([ShownSource(name, "program", spec.program.code.text, program.cell)])
    located_faults = (
        replace(each, cell=program.cell) if each.who == "program" and each.line is not None else each
        for each in recording.faults
    )
    located = replace(recording, faults=tuple(located_faults))
    return {
        "sha256": recording.sha256,
        "verdict": recording.verdict.value,
        "seconds": recording.end_t,
        "happened": describe_verdict(recording.verdict).happened,
        "lines": shown_lines,
        "faults": [
            {
                "who": fault.who,
                "place": to_display_text(fault.place, 200),
                "message": to_display_text(fault.message, 600),
                "hint": to_display_text(fault.hint, 600),
            }
            for fault in collect_faults(located)
        ],
        "data": [
            [replace_surrogates(each.name), each.value, each.t if each.simtime is None else each.simtime]
            for each in recording.datalog
        ],
        "images": [f"{side} {csv} {tick}" for side, csv, tick in recording.image_log],
        "replay": build_run_replay(located, name, seed, sources, {}),
    }


def _refuse_marked_run(_program: LoadedProgram, _flags: Flags, _settings: SimulatorSettings) -> NoReturn:
    raise AssertionError("a notebook on its own has no marked run")
