"""Grades one submission against one assignment: every trial run, every criterion judged.

A plain function that knows no queue and no database; the command line, the workers and the tests all call it.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from responders.bridge import ProgramSpec, TrialSpec
from responders.channel import Channel
from responders.conversation import Code, ResponderSpec
from responders.sandbox.meter import JobLimits, JobMeter
from responders.sandbox.running_child import ChildLimits
from service.grading.grade import Cost, CriterionResult, Grade, TrialResult
from service.grading.judging.bounded import bounds_for, judge_within
from service.grading.notebook_trial import Marking, NotebookToRun, run_notebook_trial
from service.grading.static_analysis import SubmittedParts, analyse, does_without, reads_program, responder_limits
from service.grading.training import with_models_answers
from service.grading.trial_runner import TrialRunner
from service.version import GRADER_VERSION
from sim.backgrounds import Floor, floor, floor_from_image
from sim.chance import Stream
from sim.errors import AssignmentError, UsageError
from sim.motion import Physics
from sim.recording import Recording
from sim.robot import robot
from sim.world import Noise
from submissions.assignment.definition import Assignment, ChannelSpec, Trial, WorldSpec
from submissions.magics import Flags, setup, split_program, without_magic
from submissions.marked_cell import marked_site, program_of
from submissions.plain_cells import python_of
from submissions.seeds import PUBLIC, Secret, child_seed, world_seed
from submissions.submission import Notebook, Source, Submission

_MEGABYTE = 1 << 20
_OBSERVE_SECONDS = 1.0
_IGNORED = "the program's magic line is ignored"


@dataclass(frozen=True, slots=True)
class GradingProgress:
    """How far a grading has come."""

    trials_done: int
    trials: int


class Observe(Protocol):
    """Called after each trial and about once a second; raises Cancelled to stop the grading."""

    def __call__(self, progress: GradingProgress, /) -> None: ...


def _nobody(progress: GradingProgress) -> None:
    """The default observer."""


@dataclass(frozen=True, slots=True)
class _Parts:
    """Who takes part: the sources to run, and the files in the responder's folder."""

    program: Source | None  # None where the assignment runs no robot
    flags: Flags
    responder: Source | None
    files: Mapping[str, bytes]
    notes: tuple[str, ...]
    notebook: Notebook | None = None  # answers the robot, and runs its own program if ``marked_cell`` says which
    marked_cell: str | None = None
    program_cell: int | None = None  # of a notebook that is not executed: where the program is


def grade(
    submission: Submission,
    assignment: Assignment,
    *,
    secret: Secret = PUBLIC,
    observe: Observe | None = None,
    runner: TrialRunner | None = None,
) -> Grade:
    """The marks of ``submission`` in the worlds of the installation that has this secret.

    Without a ``runner`` one is made for this grading and closed afterwards.

    Raises UsageError when a part is missing that the assignment asks for, HostError when this machine fails,
    and whatever ``observe`` raises.
    """
    if runner is None:
        with TrialRunner() as own:
            return grade(submission, assignment, secret=secret, observe=observe, runner=own)
    parts = _parts(submission, assignment)
    trials = tuple(assignment.trials(secret))
    own_seed = child_seed(world_seed(secret, assignment.id), submission.sha256)
    run: dict[int, TrialResult] = {}
    if any(trial.scenario.visibility != "visible" for trial in trials):
        runner.check_forgetting()
    watch = _Watch(observe or _nobody, len(trials))
    meter = JobMeter(_limits_of_job(assignment, len(trials)), watch.heartbeat)
    for number in _run_spec(trials, own_seed):
        trial = trials[number]
        spec = _spec(trial, parts, assignment, _floor(assignment.world, trial.seed), submission)
        run[number] = TrialResult(
            trial.scenario.id,
            trial.index,
            trial.seed,
            trial.light_noise,
            trial.motor_noise,
            trial.scenario.visibility,
            _recording(spec, parts, assignment, runner, meter),
            trial.sweep,
            trial.place,
        )
        watch.finished_one()
    results = [run[number] for number in range(len(trials))]
    if assignment.training is not None and parts.responder is not None:
        results = with_models_answers(
            results, assignment, assignment.training, parts.responder, parts.files, own_seed, runner, meter
        )
    analysis = analyse(_submitted_parts(submission, parts, own_seed), assignment, results, runner, meter)
    criteria = judge_within(bounds_for(results), assignment, tuple(results), analysis, meter.heartbeat)
    return Grade(
        assignment=assignment.id,
        assignment_title=assignment.title,
        assignment_version=assignment.version,
        submission=submission.sha256,
        student=submission.student,
        criteria=criteria,
        trials=tuple(results),
        sandbox=results[0].recording.sandbox if results else analysis.sandbox or "no student code was run",
        grader_version=GRADER_VERSION,
        notes=(*submission.notes, *parts.notes, *_cell_notes(parts, results), *_unjudged_notes(criteria)),
        secret_sha256=secret.sha256,
        cost=Cost(meter.limits, meter.spent),
    )


def _run_spec(trials: Sequence[Trial], own_seed: int) -> Sequence[int]:
    """The numbers of the trials as they are run: visible ones first, and else in an order of each submission's own.

    So what counts processes or looks at a clock does not tell a trial again, and what is shown was there before the
    first hidden trial was.
    """
    chance = Stream(own_seed, "order of trials")
    return sorted(
        range(len(trials)),
        key=lambda number: (trials[number].scenario.visibility != "visible", chance.integer(number)),
    )


def _cell_notes(parts: _Parts, results: Sequence[TrialResult]) -> tuple[str, ...]:
    """What the cells of a notebook could not do is much the same in every trial, and told once.

    Never that of a hidden trial: a cell can put into the words of an error where its robot stood.
    """
    visible = (result.recording.notes for result in results if result.visibility == "visible")
    return next(visible, ()) if parts.notebook is not None else ()


def _unjudged_notes(criteria: Sequence[CriterionResult]) -> tuple[str, ...]:
    count = sum(bool(result.unjudged) for result in criteria)
    return (f"{count} of {len(criteria)} criteria could not be judged; staff will look at it",) if count else ()


def _submitted_parts(submission: Submission, parts: _Parts, own_seed: int) -> SubmittedParts:
    """What is looked at without driving; of a notebook what is no robot program stands for the responder."""
    responder = parts.responder
    if parts.notebook is not None:
        responder = Source(parts.notebook.name, python_of(parts.notebook))
    cells = parts.notebook.cells if parts.notebook is not None else ()
    return SubmittedParts(parts.program, responder, parts.flags, parts.files, submission.files, cells, own_seed)


def _limits_of_job(assignment: Assignment, trials: int) -> JobLimits:
    limits = assignment.limits
    return JobLimits(limits.all_output_mb * _MEGABYTE, limits.all_cpu_of(trials), limits.all_sleep)


class _Watch:
    """Turns the many heartbeats of a trial into one call of the observer a second."""

    def __init__(self, observe: Callable[[GradingProgress], None], trials: int) -> None:
        self._observe = observe
        self._trials = trials
        self._done = 0
        self._last = time.monotonic()

    def heartbeat(self) -> None:
        if time.monotonic() - self._last >= _OBSERVE_SECONDS:
            self._tell()

    def finished_one(self) -> None:
        self._done += 1
        self._tell()

    def _tell(self) -> None:
        self._last = time.monotonic()
        self._observe(GradingProgress(self._done, self._trials))


def _parts(submission: Submission, assignment: Assignment) -> _Parts:
    if submission.notebook is not None and assignment.training is not None:
        function = assignment.training.function
        raise UsageError(f"{submission.notebook.name}: is a notebook, expected responder.py with a function {function}")
    if submission.notebook is not None and "student" in (assignment.parts.program, assignment.parts.responder):
        return _notebook_parts(submission, submission.notebook, assignment)
    program = _part("robot program", "robot.py", assignment.parts.program, submission.program, assignment)
    responder = _part("responder", "responder.py", assignment.parts.responder, submission.responder, assignment)
    flags, text, notes = _flags(program.text, assignment) if program is not None else (Flags(), "", ())
    if submission.responder is not None and responder is not submission.responder:
        notes += ("your responder is not used: this assignment brings its own, or none",)
    program = Source(program.name, text) if program is not None else None
    return _Parts(program, flags, responder, {**assignment.given, **submission.files}, notes)


def _notebook_parts(submission: Submission, notebook: Notebook, assignment: Assignment) -> _Parts:
    """A notebook that has to answer the robot is executed; of any other only the marked robot program is taken."""
    files = {**assignment.given, **submission.files}
    asked = assignment.parts
    if asked.program == "none":
        return _Parts(None, Flags(), None, files, (), notebook)
    if asked.program != "student":
        given = Source(asked.program, assignment.given_parts[asked.program])
        flags, text, notes = _flags(given.text, assignment)
        return _Parts(Source(given.name, text), flags, None, files, notes, notebook)
    site = marked_site(notebook, asked.cell)
    cell = program_of(notebook, site)
    flags, text, notes = _flags(cell.source if cell is not None else "", assignment)
    if asked.responder == "student":
        # A line that cannot be read is told by its execution, which may come to another cell.
        notes = tuple(note for note in notes if not note.startswith(_IGNORED))
        if cell is not None:
            again = "" if site.cell == cell.number else f", as it is run again by cell {site.cell}"
            notes = (f"the robot program in cell {cell.number} of {notebook.name} is marked{again}", *notes)
        return _Parts(Source(notebook.name, text), flags, None, files, notes, notebook, asked.cell)
    if cell is None:
        raise UsageError(f"{notebook.name}: has no cell that begins with %%sim_magic_preloaded, expected one.")
    program = Source(f"cell {cell.number}", text)
    responder = _part("responder", "responder.py", asked.responder, None, assignment)
    notes += (f"of {notebook.name} only the robot program in cell {cell.number} is run",)
    return _Parts(program, flags, responder, files, notes, program_cell=cell.number)


def _part(what: str, usual: str, who: str, submitted: Source | None, assignment: Assignment) -> Source | None:
    if who == "none":
        return None
    if who != "student":
        return Source(who, assignment.given_parts[who])
    if submitted is None:
        raise UsageError(f"the submission has no {what}; {assignment.id} asks for {usual}")
    return submitted


def _flags(text: str, assignment: Assignment) -> tuple[Flags, str, tuple[str, ...]]:
    """The flags of the program's first line, its text, and notes where the assignment decides otherwise."""
    try:
        flags, text = split_program(text)
        wanted = setup(flags)
    except UsageError as error:
        return Flags(), without_magic(text), (f"{_IGNORED}: {error}",)
    world = assignment.world
    notes = []
    if "b" in flags.values and wanted.background != world.background:
        notes.append(f"the program asks for the background {wanted.background}; the assignment's is {world.background}")
    if "r" in flags.values and wanted.robot != world.robot:
        notes.append(f"the program asks for the robot {wanted.robot}; the assignment's is {world.robot}")
    if flags.values.keys() & {"N", "M"}:
        notes.append("the assignment's noise is used, not the program's -N or -M")
    return flags, text, tuple(notes)


def _floor(world: WorldSpec, seed: int) -> Floor:
    if world.image is not None:
        return _own_floor(world.background, world.image)
    return floor(world.background, labels=world.labels, seed=seed if world.sheet is None else world.sheet)


@functools.lru_cache(maxsize=2)
def _own_floor(name: str, image: bytes) -> Floor:
    """Read once for all trials: cameras know an image again by its identity."""
    return floor_from_image(name, image)


def _recording(
    spec: TrialSpec, parts: _Parts, assignment: Assignment, runner: TrialRunner, meter: JobMeter
) -> Recording:
    limits, obstacles = assignment.limits, assignment.world.obstacles
    if parts.notebook is not None:
        grading_request = NotebookToRun(parts.notebook, parts.files, responder_limits(assignment), limits.output_bytes)
        as_read = parts.marked_cell is not None and reads_program(assignment)
        return run_notebook_trial(grading_request, Marking(spec, obstacles, parts.marked_cell, as_read), runner, meter)
    recording = runner.run(spec, obstacles, meter)
    if parts.program_cell is None:
        return recording
    faults = (
        replace(fault, cell=parts.program_cell) if fault.who == "program" and fault.line is not None else fault
        for fault in recording.faults
    )
    return replace(recording, faults=tuple(faults))


def _spec(trial: Trial, parts: _Parts, assignment: Assignment, ground: Floor, submission: Submission) -> TrialSpec:
    limits = assignment.limits
    if parts.program is None:
        raise AssignmentError(f"Assignment {assignment.id} has scenarios and no robot program to run in them.")
    responder = None
    if parts.responder is not None and assignment.training is None:
        responder = ResponderSpec(
            Code(parts.responder.name, parts.responder.text),
            parts.files,
            responder_limits(assignment),
            limits.output_bytes,
        )
    return TrialSpec(
        program=ProgramSpec(
            Code(parts.program.name, parts.program.text),
            parts.flags.preamble,
            ChildLimits(limits.program_cpu, limits.program_memory_mb * _MEGABYTE, does_without(assignment, "program")),
            limits.output_bytes,
        ),
        responder=responder,
        collaborative=responder is not None or parts.notebook is not None or "L" in parts.flags.switches,
        floor=ground,
        robot=robot(assignment.world.robot),
        pose=trial.pose,
        noise=Noise(trial.light_noise, trial.motor_noise, assignment.world.noise == "both directions"),
        channel=_channel(trial.channel),
        seconds=trial.scenario.seconds,
        seed=trial.seed,
        child_seed=child_seed(trial.seed, submission.sha256),
        pen_down="p" in parts.flags.switches,
        physics=Physics(assignment.world.solid, assignment.world.drive),
    )


def _channel(spec: ChannelSpec) -> Channel:
    return Channel(spec.delay, spec.jitter, spec.loss, spec.duplication, spec.reordering)
