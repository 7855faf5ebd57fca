"""The run plan: the code of a submission to run, call, train and read, resolved once for all trials.

Nothing runs here. Later steps don't depend on the form of the submission.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

from responders.notebook_process import NotebookSpec
from responders.sandbox.meter import JobMeter
from responders.source_file import SourceFile
from responders.trial_spec import AgentSpec, ExecutedStatements, ProgramSpec, ResponderSpec, TrialSpec
from service.grading.grade import TrialResult
from service.grading.notebook_trial import NotebookTrial
from service.grading.part_specs import (
    ProgramHead,
    build_program_spec,
    build_responder_spec,
    choose_code,
    collect_files,
    read_head,
)
from service.grading.trial_runner import TrialRunner
from service.language import translatable
from sim.errors import UsageError
from sim.motion import Rectangle
from sim.recording import Recording
from sim.sentences import Sentence
from submissions.assignment.definition import Assignment
from submissions.assignment.other_parts import SAME
from submissions.criteria.code import Functions, SourceRules
from submissions.diagram_cells import read_diagrams
from submissions.magics import Flags
from submissions.marked_run import RunChoice, choose_run
from submissions.notebook_python import extract_python
from submissions.part_fitting import find_missing_part
from submissions.seeds import PUBLIC_SECRET, SeedSource, compute_child_seed
from submissions.submission import SECOND_PROGRAM, Notebook, Part, Submission


@dataclass(frozen=True, slots=True)
class ProgramTrial:
    """A trial of a robot program. ``cell`` is the notebook cell that the program was taken from, if any."""

    cell: int | None = None

    def run(self, spec: TrialSpec, obstacles: tuple[Rectangle, ...], runner: TrialRunner, meter: JobMeter) -> Recording:
        """Run the trial. Raises the same errors as ``TrialRunner.run``."""
        recording = runner.run(spec, obstacles, meter)
        if self.cell is None:
            return recording
        faults = (
            replace(fault, cell=self.cell) if fault.who == "program" and fault.line is not None else fault
            for fault in recording.faults
        )
        return replace(recording, faults=tuple(faults))

    def collect_shared_notes(self, results: Sequence[TrialResult]) -> tuple[str, ...]:
        """Return notes on all trials together: none, because each recording has its own."""
        return ()


@dataclass(frozen=True, slots=True)
class RunPlan:
    """The participants of every trial, and the code to analyse.

    ``program`` is None if no robot runs; then there are no trials. ``responder`` is the responder, unless ``trial``
    supplies it. ``functions`` is the module whose functions are called. ``read_as`` has the parts in the form for the
    source reader.
    """

    assignment: Assignment
    trial: ProgramTrial | NotebookTrial
    program: ProgramSpec | None = None
    responder: ResponderSpec | None = None
    functions: ResponderSpec | None = None
    collaborative: bool = False
    flags: Flags = field(default_factory=Flags)
    read_as: Mapping[Part, Mapping[str, Any]] = field(default_factory=lambda: MappingProxyType({}))
    own_files: Mapping[str, bytes] = field(default_factory=lambda: MappingProxyType({}))  # submitted files
    notes: tuple[str, ...] = ()
    submission: str = ""  # content hash
    missing: Part | None = None  # required, but not submitted
    child_seed: int = 0  # seed of the submission's own chance, shared by all trials
    agents: Mapping[str, AgentSpec] = field(default_factory=lambda: MappingProxyType({}))  # agents of ``responder``
    second_program: ProgramSpec | None = None  # if there are two robots
    second_flags: Flags = field(default_factory=Flags)
    executed_statements: Mapping[Part, ExecutedStatements] = field(
        default_factory=lambda: MappingProxyType({})
    )  # of the watched parts
    ignored_magic: str = ""  # why a program's magic line is ignored

    @property
    def processes(self) -> tuple[ProgramSpec | ResponderSpec, ...]:
        """The processes that take part in every trial, the slowest to start first."""
        answers = self.trial.notebook.responder_spec if isinstance(self.trial, NotebookTrial) else self.responder
        participants = (answers, *self.agents.values(), self.program, self.second_program)
        return tuple(each for each in participants if each is not None)

    def get_source(self, part: str) -> str | None:
        """Return the text of a part as it runs: ``program``, ``responder``, ``second program``, or an agent's name.

        Returns None if the submission does not have the part as a file of its own.
        """
        if isinstance(self.trial, NotebookTrial):
            return None
        specs = {"program": self.program, "responder": self.responder, "second program": self.second_program}
        spec = specs.get(part) or self.agents.get(part)
        return None if spec is None else spec.code.text

    def to_hidden_plan(self) -> RunPlan:
        """Return the plan for hidden trials. Recorded statements could reveal sensor values, so none are recorded."""
        program, second_program, answers = self.program, self.second_program, self.responder
        return replace(
            self,
            program=program and replace(program, executed_statements=None),
            second_program=second_program and replace(second_program, executed_statements=None),
            responder=answers and replace(answers, executed_statements=None),
        )


def plan_run(submission: Submission, assignment: Assignment, secret: SeedSource = PUBLIC_SECRET) -> RunPlan:
    """Return the plan for grading ``submission``, with seeds derived from ``secret``.

    Raises:
        UsageError: The submission has none of the parts that the assignment needs.
    """
    notebook = submission.notebook
    if notebook is not None and assignment.training is not None:
        function = assignment.training.function
        raise UsageError(f"{notebook.name}: is a notebook, expected responder.py with a function {function}")
    if notebook is not None and "student" in (assignment.parts.program, assignment.parts.responder):
        plan = _plan_notebook(submission, notebook, assignment)
    else:
        plan = _plan_files(submission, assignment)
    plan = replace(plan, agents=MappingProxyType(_plan_agents(submission, assignment)))
    plan = _record_statements(plan)
    if assignment.world.robots == 2:
        plan = _add_second_program(plan, submission)
    return replace(
        plan,
        own_files=submission.files,
        notes=(*plan.notes, *read_diagrams(notebook).problems),
        submission=submission.sha256,
        child_seed=compute_child_seed(secret.compute_seed(assignment.id), submission.sha256),
    )


def _record_statements(plan: RunPlan) -> RunPlan:
    """Return the plan with recording of executed statements for the parts that rules on used code check.

    Notebooks and trained models are not watched, and no responder with a function that has only hidden calls. For
    these, reachable code counts.
    """
    watched_parts = {
        criterion.part
        for criterion in plan.assignment.criteria
        if isinstance(criterion, SourceRules) and (criterion.uses or criterion.in_loop)
    }
    if isinstance(plan.trial, NotebookTrial) or plan.assignment.training is not None:
        return plan
    if _has_hidden_only_function(plan.assignment):
        watched_parts.discard("responder")
    statements_by_part: dict[Part, ExecutedStatements] = {
        part: ExecutedStatements() for part in sorted(watched_parts) if part in plan.read_as
    }
    program, answers, functions = plan.program, plan.responder, plan.functions
    return replace(
        plan,
        program=program and replace(program, executed_statements=statements_by_part.get("program")),
        responder=answers and replace(answers, executed_statements=statements_by_part.get("responder")),
        functions=functions and replace(functions, executed_statements=statements_by_part.get("responder")),
        executed_statements=MappingProxyType(statements_by_part),
    )


def _has_hidden_only_function(assignment: Assignment) -> bool:
    names_by_hidden: dict[bool, set[str]] = {
        True: set(),
        False: set(),
    }  # names of functions in hidden and in visible calls
    for criterion in (each for each in assignment.criteria if isinstance(each, Functions)):
        for call in criterion.calls:
            names_by_hidden[call.hidden].add(call.function or criterion.function)
    return not names_by_hidden[True] <= names_by_hidden[False]


def _plan_files(submission: Submission, assignment: Assignment) -> RunPlan:
    parts, missing_part = assignment.parts, find_missing_part(submission, assignment.parts)
    if missing_part == "program":
        parts = replace(parts, program="none")
    elif missing_part == "responder":
        parts = replace(parts, responder="none")
    code = choose_code("robot program", "robot.py", parts.program, submission.program, assignment)
    responder = choose_code("responder", "responder.py", parts.responder, submission.responder, assignment)
    head = read_head(code.text, assignment) if code is not None else ProgramHead(Flags(), "", ())
    notes = head.notes
    if submission.responder is not None and responder is not submission.responder:
        notes += (Sentence("your responder is not used: this assignment uses another one, or none"),)
    files = collect_files(submission, assignment, parts.program)
    program = (
        build_program_spec(SourceFile(code.name, head.text), head.flags, files, assignment)
        if code is not None
        else None
    )
    responder_spec = build_responder_spec(responder, collect_files(submission, assignment, parts.responder), assignment)
    plan = _plan_separate_parts(ProgramTrial(), program, head.flags, responder_spec, assignment, notes)
    if missing_part == "program" and (question_program := _build_question_program(assignment)) is not None:
        note = Sentence("your responder was called by a Robomark program that only sends the texts")
        plan = replace(plan, program=question_program, notes=(*plan.notes, note))
    # Text sent to a missing responder is still a message.
    collaborative = plan.collaborative or missing_part == "responder"
    return replace(plan, missing=missing_part, collaborative=collaborative, ignored_magic=head.ignored)


def _build_question_program(assignment: Assignment) -> ProgramSpec | None:
    """Return a program that sends all questions of the criteria to the responder; None if there are none."""
    texts = list(dict.fromkeys(text for criterion in assignment.criteria for text in criterion.questions))
    if not texts:
        return None
    text = f"import time\nfor text in {texts!r}:\n    print(text)\n    time.sleep(0.5)\n"
    return build_program_spec(SourceFile("questions.py", text), Flags(), {}, assignment)


def _plan_notebook(submission: Submission, notebook: Notebook, assignment: Assignment) -> RunPlan:
    """Plan a notebook: executed if it must answer the robot, otherwise only its marked robot program is used."""
    parts = assignment.parts
    if parts.program == "none":
        return _plan_executed_notebook(submission, notebook, assignment, None, Flags(), ())
    if parts.program != "student":
        head = read_head(assignment.given_parts[parts.program], assignment)
        plan = _plan_executed_notebook(
            submission, notebook, assignment, SourceFile(parts.program, head.text), head.flags, head.notes
        )
        return replace(plan, ignored_magic=head.ignored)
    choice = choose_run(notebook, assignment, submission.run)
    site, cell = choice.site, choice.run.program
    head = read_head(cell.source if cell is not None else "", assignment)
    if parts.responder == "student":
        # Executing the notebook reports an unreadable magic line, and may reach another cell.
        notes = () if head.ignored else head.notes
        if cell is not None:
            template = (
                translatable("the robot program in cell %(cell)s of %(notebook)s is marked")
                if site.cell == cell.number
                else translatable(
                    "the robot program in cell %(cell)s of %(notebook)s is marked, because it is run again by cell "
                    "%(site)s"
                )
            )
            marked_note = Sentence(template, cell=cell.number, notebook=notebook.name, site=site.cell)
            notes = (marked_note, *choice.notes, *notes)
        return _plan_executed_notebook(
            submission, notebook, assignment, SourceFile(notebook.name, head.text), head.flags, notes, choice
        )
    if cell is None:
        raise UsageError(f"{notebook.name}: has no cell that begins with %%sim_magic_preloaded, expected one.")
    responder = choose_code("responder", "responder.py", parts.responder, None, assignment)
    files = collect_files(submission, assignment, parts.program)
    program = build_program_spec(SourceFile(f"cell {cell.number}", head.text), head.flags, files, assignment)
    responder_spec = build_responder_spec(responder, collect_files(submission, assignment, parts.responder), assignment)
    only_note = Sentence(
        "of %(notebook)s only the robot program in cell %(cell)s is run", notebook=notebook.name, cell=cell.number
    )
    notes = (*head.notes, only_note, *choice.notes)
    plan = _plan_separate_parts(ProgramTrial(cell.number), program, head.flags, responder_spec, assignment, notes)
    return replace(plan, ignored_magic=head.ignored)


def _plan_separate_parts(
    trial: ProgramTrial,
    program: ProgramSpec | None,
    flags: Flags,
    responder: ResponderSpec | None,
    assignment: Assignment,
    notes: tuple[str, ...],
) -> RunPlan:
    """Plan a robot program with a responder in its own module. A responder that is trained does not answer robots."""
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


def _plan_executed_notebook(
    submission: Submission,
    notebook: Notebook,
    assignment: Assignment,
    program: SourceFile | None,
    flags: Flags,
    notes: tuple[str, ...],
    choice: RunChoice | None = None,
) -> RunPlan:
    """Plan a notebook that runs from top to bottom. Its cells without robot programs are the responder."""
    files = collect_files(submission, assignment, "student")
    functions = build_responder_spec(SourceFile(notebook.name, extract_python(notebook)), files, assignment)
    assert functions is not None
    sources = tuple(cell.source for cell in notebook.cells)
    spec = NotebookSpec(notebook.name, sources, files, functions.limits, functions.output_bytes, 0)
    is_text_checked = choice is not None and any(
        isinstance(each, SourceRules) and each.part == "program" for each in assignment.criteria
    )
    read_as: dict[Part, Mapping[str, Any]] = {
        "responder": {"cells": [(cell.number, cell.source) for cell in notebook.cells]}
    }
    if program is not None:
        read_as["program"] = {"text": program.text}
    return RunPlan(
        assignment,
        NotebookTrial(spec, choice, is_text_checked),
        build_program_spec(program, flags, collect_files(submission, assignment, assignment.parts.program), assignment)
        if program
        else None,
        None,
        functions,
        True,
        flags,
        MappingProxyType(read_as),
        notes=notes,
    )


def _add_second_program(plan: RunPlan, submission: Submission) -> RunPlan:
    """Return the plan with a second robot. Robots without a responder talk to each other."""
    assignment = plan.assignment
    source = assignment.parts.second_program
    if plan.program is None or isinstance(plan.trial, NotebookTrial):
        raise UsageError(f"{assignment.id} has two robots, which no notebook can answer, expected robot.py")
    if source == SAME:
        return replace(plan, second_program=plan.program, second_flags=plan.flags, collaborative=True)
    code = choose_code("second robot program", SECOND_PROGRAM, source, submission.find_code(SECOND_PROGRAM), assignment)
    assert code is not None
    head = read_head(code.text, assignment)
    program = build_program_spec(
        SourceFile(code.name, head.text), head.flags, collect_files(submission, assignment, source), assignment
    )
    return replace(
        plan,
        second_program=program,
        second_flags=head.flags,
        collaborative=True,
        notes=(*plan.notes, *head.notes),
        ignored_magic=plan.ignored_magic or head.ignored,
    )


def _plan_agents(submission: Submission, assignment: Assignment) -> dict[str, AgentSpec]:
    """Plan the agents. Each has a folder and limits like the responder's; given agents see only given files."""
    agents = {}
    for name, source in assignment.parts.agents.items():
        is_given = source != "student"
        code = SourceFile(source, assignment.given_parts[source]) if is_given else submission.find_agent_code(name)
        spec = build_responder_spec(
            code, assignment.given if is_given else collect_files(submission, assignment, source), assignment
        )
        if spec is None:
            raise UsageError(f"the submission has no agent {name}; {assignment.id} requires {name}.py")
        agents[name] = AgentSpec(spec.code, spec.files, spec.limits, spec.output_bytes, given=is_given)
    return agents
