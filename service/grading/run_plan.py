"""What of a submission is run, called, trained and read, resolved once for all trials of an assignment.

Nothing is run here, and after it nobody asks again in what form the submission came.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

from responders.code import Code
from responders.notebook_process import NotebookSpec
from responders.sandbox.meter import JobMeter
from responders.sandbox.running_child import ChildLimits
from responders.trial_spec import AgentSpec, ProgramSpec, RanStatements, ResponderSpec, TrialSpec
from service.grading.grade import TrialResult
from service.grading.notebook_trial import NotebookTrial
from service.grading.trial_runner import TrialRunner
from sim.errors import UsageError
from sim.motion import Rectangle
from sim.recording import Recording
from submissions.assignment.definition import Assignment
from submissions.assignment.other_parts import SAME
from submissions.bundle import missing_part
from submissions.criteria.code import SourceRules
from submissions.diagram_cells import diagrams_in
from submissions.magics import Flags, setup, split_program, without_magic
from submissions.marked_run import RunChoice, choose_run
from submissions.plain_cells import python_of
from submissions.seeds import PUBLIC, Secret, child_seed, world_seed
from submissions.source_text import modules_of
from submissions.submission import SECOND_PROGRAM, Notebook, Part, Submission

_MEGABYTE = 1 << 20


@dataclass(frozen=True, slots=True)
class ProgramTrial:
    """A trial of a robot program by itself; ``cell`` is the cell of a notebook that it was taken from."""

    cell: int | None = None

    def run(self, spec: TrialSpec, obstacles: tuple[Rectangle, ...], runner: TrialRunner, meter: JobMeter) -> Recording:
        """Raises as ``TrialRunner.run`` does."""
        recording = runner.run(spec, obstacles, meter)
        if self.cell is None:
            return recording
        faults = (
            replace(fault, cell=self.cell) if fault.who == "program" and fault.line is not None else fault
            for fault in recording.faults
        )
        return replace(recording, faults=tuple(faults))

    def notes_on_all(self, results: Sequence[TrialResult]) -> tuple[str, ...]:
        """What is told once of all trials; nothing, for each recording tells its own."""
        return ()


@dataclass(frozen=True, slots=True)
class RunPlan:
    """Who takes part in every trial, and what of the submission is looked at beside them.

    ``program`` is None where no robot is run; then there are no trials. ``answers`` is what answers it, unless
    ``trial`` sees to that; ``functions`` is what a responder's functions are called of, ``read_as`` the parts as the
    source reader takes them.
    """

    assignment: Assignment
    trial: ProgramTrial | NotebookTrial
    program: ProgramSpec | None = None
    answers: ResponderSpec | None = None
    functions: ResponderSpec | None = None
    collaborative: bool = False
    flags: Flags = field(default_factory=Flags)
    read_as: Mapping[Part, Mapping[str, Any]] = field(default_factory=lambda: MappingProxyType({}))
    own_files: Mapping[str, bytes] = field(default_factory=lambda: MappingProxyType({}))  # those submitted
    notes: tuple[str, ...] = ()
    submission: str = ""  # content hash
    missing: Part | None = None  # asked for, and not submitted
    child_seed: int = 0  # of the chance that is the submission's own, and no trial's
    agents: Mapping[str, AgentSpec] = field(default_factory=lambda: MappingProxyType({}))  # whom ``answers`` may ask
    second_program: ProgramSpec | None = None  # where there are two robots
    second_flags: Flags = field(default_factory=Flags)
    ran: Mapping[Part, RanStatements] = field(default_factory=lambda: MappingProxyType({}))  # of parts that are watched
    ignored_magic: str = ""  # why a program's magic line is ignored

    @property
    def processes(self) -> tuple[ProgramSpec | ResponderSpec, ...]:
        """Those that take part in every trial; the one that takes longest to start first."""
        answers = self.trial.notebook.as_responder if isinstance(self.trial, NotebookTrial) else self.answers
        found = (answers, *self.agents.values(), self.program, self.second_program)
        return tuple(each for each in found if each is not None)

    def unwatched(self) -> RunPlan:
        """The plan for a trial that is not shown: which statements are run there could tell what the robot sees."""
        program, second, answers = self.program, self.second_program, self.answers
        return replace(
            self,
            program=program and replace(program, ran=None),
            second_program=second and replace(second, ran=None),
            answers=answers and replace(answers, ran=None),
        )


def plan_run(submission: Submission, assignment: Assignment, secret: Secret = PUBLIC) -> RunPlan:
    """The plan for grading ``submission`` in the installation that has this secret.

    Raises UsageError when no part is there that the assignment asks for.
    """
    notebook = submission.notebook
    if notebook is not None and assignment.training is not None:
        function = assignment.training.function
        raise UsageError(f"{notebook.name}: is a notebook, expected responder.py with a function {function}")
    if notebook is not None and "student" in (assignment.parts.program, assignment.parts.responder):
        plan = _of_notebook(submission, notebook, assignment)
    else:
        plan = _of_files(submission, assignment)
    plan = replace(plan, agents=MappingProxyType(_agents(submission, assignment)))
    plan = _watched(plan)
    if assignment.world.robots == 2:
        plan = _with_second_program(plan, submission)
    return replace(
        plan,
        own_files=submission.files,
        notes=(*plan.notes, *diagrams_in(notebook).problems),
        submission=submission.sha256,
        child_seed=child_seed(world_seed(secret, assignment.id), submission.sha256),
    )


def _watched(plan: RunPlan) -> RunPlan:
    """The plan with a look at which statements are run of the parts of which rules ask what they use.

    A notebook is not watched, and nor is what is trained: of these, what can be run counts.
    """
    asked = {
        criterion.part
        for criterion in plan.assignment.criteria
        if isinstance(criterion, SourceRules) and (criterion.uses or criterion.in_loop)
    }
    if isinstance(plan.trial, NotebookTrial) or plan.assignment.training is not None:
        return plan
    ran: dict[Part, RanStatements] = {part: RanStatements() for part in sorted(asked) if part in plan.read_as}
    program, answers, functions = plan.program, plan.answers, plan.functions
    return replace(
        plan,
        program=program and replace(program, ran=ran.get("program")),
        answers=answers and replace(answers, ran=ran.get("responder")),
        functions=functions and replace(functions, ran=ran.get("responder")),
        ran=MappingProxyType(ran),
    )


def _of_files(submission: Submission, assignment: Assignment) -> RunPlan:
    asked, missing = assignment.parts, missing_part(submission, assignment.parts)
    if missing == "program":
        asked = replace(asked, program="none")
    elif missing == "responder":
        asked = replace(asked, responder="none")
    code = _part("robot program", "robot.py", asked.program, submission.program, assignment)
    responder = _part("responder", "responder.py", asked.responder, submission.responder, assignment)
    head = _read_head(code.text, assignment) if code is not None else _Head(Flags(), "", ())
    notes = head.notes
    if submission.responder is not None and responder is not submission.responder:
        notes += ("your responder is not used: this assignment brings its own, or none",)
    files = _files(submission, assignment, asked.program)
    program = _program(Code(code.name, head.text), head.flags, files, assignment) if code is not None else None
    beside = _responder(responder, _files(submission, assignment, asked.responder), assignment)
    plan = _beside_each_other(ProgramTrial(), program, head.flags, beside, assignment, notes)
    if missing == "program" and (asking := _stand_in(assignment)) is not None:
        asked_by = "your responder was asked by a program of Robomark's own, which only sends the texts"
        plan = replace(plan, program=asking, notes=(*plan.notes, asked_by))
    # What is sent to a responder that is not there is a message all the same.
    collaborative = plan.collaborative or missing == "responder"
    return replace(plan, missing=missing, collaborative=collaborative, ignored_magic=head.ignored)


def _stand_in(assignment: Assignment) -> ProgramSpec | None:
    """A program that asks a responder all that it is judged by alone; None where that is nothing."""
    texts = list(dict.fromkeys(text for criterion in assignment.criteria for text in criterion.questions))
    if not texts:
        return None
    text = f"import time\nfor text in {texts!r}:\n    print(text)\n    time.sleep(0.5)\n"
    return _program(Code("questions.py", text), Flags(), {}, assignment)


def _of_notebook(submission: Submission, notebook: Notebook, assignment: Assignment) -> RunPlan:
    """A notebook that has to answer the robot is executed; of any other only the marked robot program is taken."""
    asked = assignment.parts
    if asked.program == "none":
        return _executed(submission, notebook, assignment, None, Flags(), ())
    if asked.program != "student":
        head = _read_head(assignment.given_parts[asked.program], assignment)
        plan = _executed(submission, notebook, assignment, Code(asked.program, head.text), head.flags, head.notes)
        return replace(plan, ignored_magic=head.ignored)
    choice = choose_run(notebook, assignment, submission.run)
    site, cell = choice.site, choice.run.program
    head = _read_head(cell.source if cell is not None else "", assignment)
    if asked.responder == "student":
        # A line that cannot be read is told by its execution, which may come to another cell.
        notes = () if head.ignored else head.notes
        if cell is not None:
            again = "" if site.cell == cell.number else f", as it is run again by cell {site.cell}"
            marked = f"the robot program in cell {cell.number} of {notebook.name} is marked{again}"
            notes = (marked, *choice.notes, *notes)
        return _executed(submission, notebook, assignment, Code(notebook.name, head.text), head.flags, notes, choice)
    if cell is None:
        raise UsageError(f"{notebook.name}: has no cell that begins with %%sim_magic_preloaded, expected one.")
    responder = _part("responder", "responder.py", asked.responder, None, assignment)
    files = _files(submission, assignment, asked.program)
    program = _program(Code(f"cell {cell.number}", head.text), head.flags, files, assignment)
    beside = _responder(responder, _files(submission, assignment, asked.responder), assignment)
    notes = (*head.notes, f"of {notebook.name} only the robot program in cell {cell.number} is run", *choice.notes)
    plan = _beside_each_other(ProgramTrial(cell.number), program, head.flags, beside, assignment, notes)
    return replace(plan, ignored_magic=head.ignored)


def _beside_each_other(
    trial: ProgramTrial,
    program: ProgramSpec | None,
    flags: Flags,
    responder: ResponderSpec | None,
    assignment: Assignment,
    notes: tuple[str, ...],
) -> RunPlan:
    """A robot program, and a responder that is a module of its own; one that is trained answers no robot."""
    answers = responder if assignment.training is None else None
    codes: Mapping[Part, ProgramSpec | ResponderSpec | None] = {"program": program, "responder": responder}
    return RunPlan(
        assignment,
        trial,
        program,
        answers,
        responder,
        answers is not None or "L" in flags.switches,
        flags,
        MappingProxyType({part: {"text": spec.code.text} for part, spec in codes.items() if spec is not None}),
        notes=notes,
    )


def _executed(
    submission: Submission,
    notebook: Notebook,
    assignment: Assignment,
    program: Code | None,
    flags: Flags,
    notes: tuple[str, ...],
    choice: RunChoice | None = None,
) -> RunPlan:
    """A notebook from top to bottom; what in it is no robot program stands for the responder."""
    files = _files(submission, assignment, "student")
    functions = _responder(Code(notebook.name, python_of(notebook)), files, assignment)
    assert functions is not None
    sources = tuple(cell.source for cell in notebook.cells)
    spec = NotebookSpec(notebook.name, sources, files, functions.limits, functions.output_bytes, 0)
    as_read = choice is not None and any(
        isinstance(each, SourceRules) and each.part == "program" for each in assignment.criteria
    )
    read_as: dict[Part, Mapping[str, Any]] = {
        "responder": {"cells": [(cell.number, cell.source) for cell in notebook.cells]}
    }
    if program is not None:
        read_as["program"] = {"text": program.text}
    return RunPlan(
        assignment,
        NotebookTrial(spec, choice, as_read),
        _program(program, flags, _files(submission, assignment, assignment.parts.program), assignment)
        if program
        else None,
        None,
        functions,
        True,
        flags,
        MappingProxyType(read_as),
        notes=notes,
    )


def _with_second_program(plan: RunPlan, submission: Submission) -> RunPlan:
    """The plan with what runs on the second robot. Robots that nobody answers talk to each other."""
    assignment = plan.assignment
    who = assignment.parts.second_program
    if plan.program is None or isinstance(plan.trial, NotebookTrial):
        raise UsageError(f"{assignment.id} has two robots, which no notebook can answer, expected robot.py")
    if who == SAME:
        return replace(plan, second_program=plan.program, second_flags=plan.flags, collaborative=True)
    code = _part("second robot program", SECOND_PROGRAM, who, submission.code(SECOND_PROGRAM), assignment)
    assert code is not None
    head = _read_head(code.text, assignment)
    program = _program(Code(code.name, head.text), head.flags, _files(submission, assignment, who), assignment)
    return replace(
        plan,
        second_program=program,
        second_flags=head.flags,
        collaborative=True,
        notes=(*plan.notes, *head.notes),
        ignored_magic=plan.ignored_magic or head.ignored,
    )


def _part(what: str, usual: str, who: str, submitted: Code | None, assignment: Assignment) -> Code | None:
    if who == "none":
        return None
    if who != "student":
        return Code(who, assignment.given_parts[who])
    if submitted is None:
        raise UsageError(f"the submission has no {what}; {assignment.id} asks for {usual}")
    return submitted


@dataclass(frozen=True, slots=True)
class _Head:
    """A program's flags, its text after its magic line, notes on both, and why that line is ignored, if it is."""

    flags: Flags
    text: str
    notes: tuple[str, ...]
    ignored: str = ""


def _read_head(text: str, assignment: Assignment) -> _Head:
    """Take a program's magic line apart; a note tells where the assignment decides otherwise."""
    try:
        flags, text = split_program(text)
        wanted = setup(flags)
    except UsageError as error:
        note = f"the program's magic line is ignored: {error}"
        return _Head(Flags(), without_magic(text), (note,), str(error))
    world = assignment.world
    notes = []
    if "b" in flags.values and wanted.background != world.background:
        asked = flags.values["b"][:40]
        notes.append(f"the program asks for the background {asked}; the assignment's is {world.background}")
    if "r" in flags.values and wanted.robot != world.robot:
        notes.append(f"the program asks for the robot {wanted.robot}; the assignment's is {world.robot}")
    if flags.values.keys() & {"N", "M"}:
        notes.append("the assignment's noise is used, not the program's -N or -M")
    return _Head(flags, text, tuple(notes))


def _files(submission: Submission, assignment: Assignment, who: str) -> Mapping[str, bytes]:
    """What lies beside a part of ``who``; a submission's own file wins over a given one.

    What the assignment brings imports none of the submission's code.
    """
    submitted = submission.files_without(assignment.parts.agents)
    own = (each for each in submitted.items() if who == "student" or not each[0].endswith(".py"))
    return {**assignment.given, **dict(own)}


def _agents(submission: Submission, assignment: Assignment) -> dict[str, AgentSpec]:
    """Each has a folder like the responder's and may use as much; in a given one's lie given files alone."""
    agents = {}
    for name, who in assignment.parts.agents.items():
        given = who != "student"
        code = Code(who, assignment.given_parts[who]) if given else submission.agent(name)
        spec = _responder(code, assignment.given if given else _files(submission, assignment, who), assignment)
        if spec is None:
            raise UsageError(f"the submission has no agent {name}; {assignment.id} asks for {name}.py")
        agents[name] = AgentSpec(spec.code, spec.files, spec.limits, spec.output_bytes, given=given)
    return agents


def _program(code: Code, flags: Flags, files: Mapping[str, bytes], assignment: Assignment) -> ProgramSpec:
    limits = assignment.limits
    allowed = ChildLimits(limits.program_cpu, limits.program_memory_mb * _MEGABYTE, _avoided(assignment, "program"))
    return ProgramSpec(code, flags.preamble, allowed, limits.output_bytes, modules_of(code.text, files.get))


def _responder(code: Code | None, files: Mapping[str, bytes], assignment: Assignment) -> ResponderSpec | None:
    if code is None:
        return None
    limits = assignment.limits
    avoided = _avoided(assignment, "responder")
    allowed = ChildLimits(limits.responder_cpu, limits.responder_memory_mb * _MEGABYTE, avoided)
    return ResponderSpec(code, files, allowed, limits.output_bytes)


def _avoided(assignment: Assignment, part: Part) -> tuple[str, ...]:
    """The modules that a student's part may not import: what carries marks is refused when it is run, too."""
    if getattr(assignment.parts, part) != "student":
        return ()
    rules = (each for each in assignment.criteria if isinstance(each, SourceRules) and each.part == part and each.marks)
    return tuple(sorted({module for each in rules for module in each.avoided_modules}))
