"""The data that hints search: the submission's texts by line, and the results of its visible trials.

Student code is split into tokens, not parsed, so the cost is bounded by the length of the text.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

from service.grading.findings import Finding
from service.grading.grade import CriterionResult, TrialResult
from service.grading.hint_code import CodeStatements, read_code
from service.grading.judging.message_parts import describe_line
from service.grading.run_plan import RunPlan
from sim.recording import Fault, Message, Recording
from sim.recording_values import collect_faults, is_stationary
from sim.sentences import Sentence, join_sentences
from submissions.assignment.definition import Assignment
from submissions.criteria import Criterion
from submissions.raw_files import sanitise_name
from submissions.source_text import find_magic_line, is_program_magic
from submissions.submission import PART_FILES, SECOND_PROGRAM, Part, Submission

_MAX_LINES, _MAX_LINE_LENGTH = 5000, 300
_MAX_TEXTS, MAX_TEXT_LENGTH = 400, 300
_MAX_EXTRA_FILES = 20
F = TypeVar("F", bound=Finding)
_QUEUE = re.compile("pyState")


@dataclass(frozen=True)
class Listing:
    """One text of the student: a file, or a notebook cell, which belongs to no part."""

    name: str
    part: Part | None
    lines: tuple[str, ...]

    @cached_property
    def code(self) -> CodeStatements:
        """The statements of the text. It is tokenized on first use."""
        return read_code(self.lines)

    @cached_property
    def magic_place(self) -> int | None:
        """The index of its magic line, if it has one."""
        return find_magic_line("\n".join(self.lines))

    @property
    def is_robot_cell(self) -> bool:
        """Return whether this is a cell with a robot program."""
        return self.magic_place is not None and is_program_magic(self.lines[self.magic_place])

    def find_line(self, pattern: re.Pattern[str]) -> int | None:
        """Return the number, from 1, of the first line that matches; None if no line does."""
        return next((n for n, line in enumerate(self.lines, 1) if pattern.search(line)), None)

    def locate(self, line: int | None) -> str:
        """Return ``line 3 of robot.py``, or only the name if the line is unknown."""
        return self.name if line is None else describe_line(self.name, line)


@dataclass(frozen=True, slots=True)
class Clues:
    """The evidence for hints, limited to what the student may see.

    Attributes:
        lost: Visible criteria without full marks.
        missing: The part that was not submitted.
        messages: The student's feedback on each lost criterion, by id.
        results: The results of the lost criteria.
        limit: Simulated time of the shortest visible scenario, in seconds.
        task: The description of the assignment.
        extra_listings: Python files submitted with the parts, including agents.
        marked_cell: The notebook cell whose robot program runs alone; None if the whole notebook runs.
        ignored_magic: Why its magic line is ignored.
        idle_responder: The first line of a Raw cell that contains a responder.
        assignment: The id of the assignment.
        definition: The assignment.
        practice: The results of visible criteria without marks, which show what the marked ones look at.
        shown: The visible trials.
        recordings_by_trial: Their recordings, by the index of the trial in the grade.
        table_columns: The column names of the CSV files beside the responder.
    """

    listings: tuple[Listing, ...]
    recordings: tuple[Recording, ...]
    lost: tuple[Criterion, ...]
    files: tuple[str, ...]
    missing: Part | None
    preamble: str
    collaborative: bool
    results: tuple[CriterionResult, ...] = ()
    limit: float = 0.0
    task: str = ""
    extra_listings: tuple[Listing, ...] = ()
    marked_cell: int | None = None
    ignored_magic: str = ""
    idle_responder: str = ""
    agents: frozenset[str] = frozenset()
    assignment: str = ""
    definition: Assignment | None = None
    practice: tuple[CriterionResult, ...] = ()
    shown: tuple[TrialResult, ...] = ()
    recordings_by_trial: Mapping[int, Recording] = field(default_factory=dict)
    table_columns: tuple[str, ...] = ()

    @property
    def cell_errors(self) -> tuple[Fault, ...]:
        """The notebook cells that failed, in the first trial with failed cells."""
        return next((each.cell_errors for each in self.recordings if each.cell_errors), ())

    @property
    def programs(self) -> Iterator[Listing]:
        """The robot programs: files, and cells that begin with a simulator magic."""
        return (each for each in self.listings if each.part == "program" or (each.part is None and each.is_robot_cell))

    @property
    def responders(self) -> Iterator[Listing]:
        """The responder's texts that are not robot programs."""
        programs = {each.name for each in self.programs}
        return (each for each in self.list_texts("responder") if each.name not in programs)

    @property
    def responder_process_listings(self) -> Iterator[Listing]:
        """The texts that run in the responder's process: the responder and its agents."""
        yield from self.responders
        yield from self.extra_listings

    @property
    def texts(self) -> tuple[Listing, ...]:
        """All texts of the submission."""
        return (*self.listings, *self.extra_listings)

    @property
    def should_use_queue(self) -> bool:
        """Return whether a criterion asks for JSON objects or the program reads the queue."""
        is_json_required = any(
            getattr(each, "is_json", False) or getattr(each, "path", None) or getattr(each, "json_queue", False)
            for each in self.lost
        )
        return is_json_required or any(listing.find_line(_QUEUE) for listing in self.list_texts("program"))

    @property
    def costliest_criteria(self) -> list[Criterion]:
        """The visible criteria that lost marks, the costliest first."""
        results = {each.id: each for each in self.results}
        return sorted(self.lost, key=lambda each: results[each.id].marks - results[each.id].max_marks)

    @property
    def is_stationary(self) -> bool:
        """Return whether no robot moved in any visible trial."""
        return bool(self.recordings) and all(map(is_stationary, self.recordings))

    @property
    def seconds(self) -> float:
        """The duration of the longest visible trial, in seconds."""
        return max((each.end_t for each in self.recordings), default=0.0)

    @property
    def faults(self) -> Iterator[Fault]:
        """The first three faults of each visible trial, in order of time."""
        return (fault for recording in self.recordings for fault in collect_faults(recording)[:3])

    @property
    def printed(self) -> tuple[str, ...]:
        """The distinct texts that programs printed."""
        return _collect_distinct_texts(line.text for recording in self.recordings for line in recording.printed)

    @property
    def spoken(self) -> tuple[str, ...]:
        """The distinct texts that robots said."""
        return _collect_distinct_texts(line.text for recording in self.recordings for line in recording.spoken)

    @property
    def messages(self) -> Iterator[Message]:
        """All messages of the visible trials."""
        return (message for recording in self.recordings for message in recording.messages)

    @property
    def sent(self) -> tuple[str, ...]:
        """The distinct messages from robots."""
        return self._collect_messages("robot")

    @property
    def answers(self) -> tuple[str, ...]:
        """The distinct answers of the responder."""
        return self._collect_messages("responder")

    def find_finding(self, criterion: Criterion, kind: type[F]) -> F | None:
        """Return the first finding of this kind about a criterion that lost marks; None if there is none."""
        return find_finding(next((each for each in self.results if each.id == criterion.id), None), kind)

    def find_measures(self, criterion: Criterion) -> dict[str, float]:
        """Return the measures of the first failure of a criterion that lost marks, by name; empty without one."""
        result = next((each for each in self.results if each.id == criterion.id), None)
        failure = next((each for each in result.evidence if not each.passed), None) if result else None
        return {each.name: each.value for each in failure.measures} if failure else {}

    def list_texts(self, part: Part) -> Iterator[Listing]:
        """Return the texts that may contain the part."""
        return (each for each in self.listings if each.part in (part, None))

    def describe_matching_line(self, part: Part, pattern: re.Pattern[str]) -> str:
        """Return the first matching line as ``line 3 of robot.py``; the part's file if no line matches."""
        for listing in self.list_texts(part):
            line = listing.find_line(pattern)
            if line is not None:
                return listing.locate(line)
        return PART_FILES[part] if any(each.part == part for each in self.listings) else Sentence("the notebook")

    def _collect_messages(self, sender: str) -> tuple[str, ...]:
        return _collect_distinct_texts(
            message.text for recording in self.recordings for message in recording.messages if message.sender == sender
        )


def collect_clues(
    submission: Submission, plan: RunPlan, trials: Sequence[TrialResult], results: Sequence[CriterionResult]
) -> Clues:
    """Collect the clues from what the student may see before publication."""
    lost_ids = {each.id for each in results if each.visibility == "visible" and each.marks < each.max_marks}
    visible_recordings = (trial.recording for trial in trials if trial.visibility == "visible")
    recordings = [each for first in visible_recordings for each in (first, first.partner) if each is not None]
    visible_indices = {index for index, trial in enumerate(trials) if trial.visibility == "visible"}
    return Clues(
        tuple(_build_listings(submission, plan.assignment.world.robots)),
        tuple(recordings),
        tuple(each for each in plan.assignment.criteria if each.id in lost_ids),
        tuple(submission.files),
        plan.missing,
        plan.flags.preamble,
        plan.collaborative,
        tuple(remove_hidden_evidence(each, visible_indices) for each in results if each.id in lost_ids),
        min((each.seconds for each in plan.assignment.scenarios if each.visibility == "visible"), default=0.0),
        plan.assignment.description,
        tuple(_build_extra_listings(submission)),
        getattr(plan.trial, "cell", None),
        plan.ignored_magic,
        submission.notebook.raw_responders[0] if submission.notebook and submission.notebook.raw_responders else "",
        frozenset(plan.agents),
        plan.assignment.id,
        plan.assignment,
        tuple(
            remove_hidden_evidence(each, visible_indices)
            for each in results
            if each.visibility == "visible" and not each.max_marks
        ),
        tuple(trial for trial in trials if trial.visibility == "visible"),
        {index: trials[index].recording for index in visible_indices},
        tuple(_collect_columns({**plan.assignment.given, **submission.files})),
    )


def _collect_columns(files: Mapping[str, bytes]) -> Iterator[str]:
    """Yield the column names in the first line of each CSV file."""
    for name in [each for each in sorted(files) if each.endswith(".csv")][:_MAX_EXTRA_FILES]:
        first_line = files[name][:MAX_TEXT_LENGTH].partition(b"\n")[0].decode("utf-8", "replace")
        yield from (each.strip(" \"'\r\ufeff") for each in first_line.split(",") if each.strip())


def remove_hidden_evidence(result: CriterionResult, visible_indices: Set[int]) -> CriterionResult:
    """Return the result without anything that comes from hidden trials."""
    evidence = tuple(each for each in result.evidence if each.trial in visible_indices)
    findings = {index: each for index, each in result.findings.items() if index is None or index in visible_indices}
    if len(evidence) == len(result.evidence):
        return result
    message = join_sentences(*(each.message for each in evidence if not each.passed))
    accuracy = result.shown.accuracy if result.shown is not None else None
    return replace(
        result,
        evidence=evidence,
        message=message,
        accuracy=accuracy,
        predictions=(),
        curves=(),
        shown=None,
        findings=findings,
    )


def _build_listings(submission: Submission, robots: int) -> Iterator[Listing]:
    if submission.program is not None:
        yield build_listing("robot.py", "program", submission.program.text)
    if submission.responder is not None:
        yield build_listing("responder.py", "responder", submission.responder.text)
    second_program = submission.find_code(SECOND_PROGRAM) if robots == 2 else None
    if second_program is not None:
        yield build_listing(SECOND_PROGRAM, "program", second_program.text)
    for cell in submission.notebook.cells if submission.notebook is not None else ():
        yield build_listing(name_cell(cell.number), None, cell.source)


def _build_extra_listings(submission: Submission) -> Iterator[Listing]:
    for name in [each for each in sorted(submission.files) if each.endswith(".py")][:_MAX_EXTRA_FILES]:
        if name in submission.python_files:
            yield build_listing(name, None, submission.python_files[name].text)


def build_listing(name: str, part: Part | None, text: str) -> Listing:
    """Return the lines of a text, up to their limits."""
    lines = tuple(line[:_MAX_LINE_LENGTH].rstrip("\r") for line in text.split("\n", _MAX_LINES)[:_MAX_LINES])
    return Listing(name, part, lines)


def _collect_distinct_texts(texts: Iterator[str]) -> tuple[str, ...]:
    distinct_texts: dict[str, None] = {}
    for text in texts:
        distinct_texts[text[:MAX_TEXT_LENGTH]] = None
        if len(distinct_texts) == _MAX_TEXTS:
            break
    return tuple(distinct_texts)


def find_finding(result: CriterionResult | None, kind: type[F]) -> F | None:
    """Return the first finding of this kind; None without one or without a result."""
    findings = result.findings.values() if result is not None else ()
    return next((each for one in findings for each in one if isinstance(each, kind)), None)


def describe_first_failure(clues: Clues, criterion: Criterion) -> str:
    """Return the message of the first failure of a criterion that lost marks."""
    result = next(each for each in clues.results if each.id == criterion.id)
    return next((each.message for each in result.evidence if not each.passed and each.message), result.message)


def find_listing(fault: Fault, clues: Clues) -> Listing | None:
    """Return the text that contains the fault; None if it is not one of the student's texts."""
    name = name_faulty_text(fault)
    if name == SECOND_PROGRAM and not any(each.name == name for each in clues.texts):
        name = "robot.py"  # one program runs on both robots
    return next((each for each in clues.texts if each.name == name), None)


def describe_fault_line(fault: Fault, clues: Clues) -> str:
    """Return the position of a fault as ``line 3 of robot.py``; empty if it is not in the student's texts."""
    name = name_faulty_text(fault)
    listing = find_listing(fault, clues) or Listing(sanitise_name(name), None, ())
    return listing.locate(fault.line) if listing.lines or name in clues.files else ""


def name_faulty_text(fault: Fault) -> str:
    """Return the name of the text that contains the fault."""
    if fault.file:
        return fault.file
    if fault.cell is not None:
        return name_cell(fault.cell)
    parts = {"program": "robot.py", "responder": "responder.py", "second program": SECOND_PROGRAM}
    return f"{fault.agent}.py" if fault.agent else parts.get(fault.who, "")


def name_cell(number: int) -> str:
    """Return the name of a notebook's cell in hints."""
    return Sentence("cell %(number)s", number=number)
