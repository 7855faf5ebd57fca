"""Submissions without effort, and the marks that an assignment gives for them.

An assignment that gives much for them marks something else than its task. The module prints nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from types import MappingProxyType
from typing import Any

from responders.source_file import SourceFile
from service.grading.answer_guesses import Guesses, collect_guesses
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from sim.errors import UsageError
from submissions.assignment.definition import Assignment
from submissions.assignment.folder import locate_assignment_folder
from submissions.bundle import read_submission
from submissions.submission import PART_FILES, SECOND_PROGRAM, Submission

#: From this share of the marks on, a submission without effort is worth a warning.
NOTABLE_SHARE = Fraction(2, 5)
_STARTER = "starter"
_DESCRIPTIONS: Mapping[str, str] = MappingProxyType(
    {
        "empty": "an empty program",
        "constant": "one constant text",
        "all-answers": "a list of all answers",
        "random-driving": "driving at random",
        "blind-driving": "driving straight on without looking",
        _STARTER: "the unchanged starter",
    }
)
_SEED = 7  # of the random moves and answers, which are the same in each check
_DRIVING_SECONDS = 6.0  # at most, and at most half of the shortest trial


@dataclass(frozen=True, slots=True)
class NoEffortResult:
    """The marks of a submission without effort. ``marks`` is None if it was rejected, for the reason in ``problem``."""

    name: str
    marks: Decimal | None
    max_marks: Decimal
    problem: str = ""

    @property
    def description(self) -> str:
        """What the submission does, as a noun phrase."""
        return _DESCRIPTIONS[self.name]

    @property
    def share(self) -> float:
        """The share of the marks, from 0 to 1."""
        return float(Fraction(self.marks or 0) / Fraction(self.max_marks)) if self.max_marks else 0.0

    @property
    def is_notable(self) -> bool:
        """Return whether it gets so many marks that the assignment should be changed."""
        return self.share >= NOTABLE_SHARE


def grade_without_effort(
    name_or_path: str, assignment: Assignment, *, runner: TrialRunner
) -> tuple[NoEffortResult, ...]:
    """Return the marks of each submission without effort. Without a starter, there are five.

    Raises:
        HostError: This machine failed.
    """
    results = []
    for name, submission in build_submissions(name_or_path, assignment):
        try:
            result = NoEffortResult(name, grade(submission, assignment, runner=runner).marks, assignment.max_marks)
        except UsageError as error:
            result = NoEffortResult(name, None, assignment.max_marks, str(error))
        results.append(result)
    return tuple(results)


def build_submissions(name_or_path: str, assignment: Assignment) -> Iterator[tuple[str, Submission]]:
    """Yield the submissions without effort, with their names. An assignment always has the same ones."""
    starter = _read_starter(name_or_path, assignment)
    guesses = collect_guesses(assignment)
    magic_line = _find_magic_line(starter)
    answers = _list_answers(guesses)
    for name, lines in _list_programs(assignment, guesses).items():
        program = "\n".join((*magic_line, "import time", *lines, ""))
        yield name, _build_submission(name, assignment, program, answers[name])
    if starter is not None:
        yield _STARTER, starter


def _list_programs(assignment: Assignment, guesses: Guesses) -> Mapping[str, Sequence[str]]:
    """Return the lines of the robot program of each submission but the starter."""
    seconds = min([_DRIVING_SECONDS, *(scenario.seconds / 2 for scenario in assignment.scenarios)])
    asks_responder = any(criterion.asks_responder for criterion in assignment.criteria)
    send_image = ('print("IMG_DATA")', "time.sleep(1)") if asks_responder else ()
    say_constant = f"say({guesses.constant_text!r})"
    return {
        "empty": (),
        "constant": (*send_image, say_constant),
        "all-answers": (
            *send_image,
            *(f"print({text!r})" for text in guesses.messages),
            *(f"say({text!r})" for text in guesses.all_texts),
        ),
        "random-driving": (
            "import random",
            f"chance = random.Random({_SEED})",
            f"for _ in range({int(2 * seconds)}):",
            "    left, right = chance.randint(-50, 50), chance.randint(-50, 50)",
            "    tank_drive.on_for_seconds(SpeedPercent(left), SpeedPercent(right), 0.5)",
            *send_image,
            say_constant,
        ),
        "blind-driving": (
            *send_image,
            f"tank_drive.on_for_seconds(SpeedPercent(40), SpeedPercent(40), {seconds:g})",
            *send_image,
            say_constant,
        ),
    }


def _list_answers(guesses: Guesses) -> Mapping[str, str]:
    """Return the source of the functions of each submission but the starter. They answer without looking."""
    constant = _write_functions([guesses.constant_reply], {name: all_[:1] for name, all_ in guesses.results.items()})
    return {
        "empty": "",
        "constant": constant,
        "all-answers": _write_functions(
            [guesses.complete_reply], {name: [list(all_)] for name, all_ in guesses.results.items()}
        ),
        "random-driving": _write_functions(guesses.single_replies, guesses.results),
        "blind-driving": constant,
    }


def _write_functions(replies: Sequence[str], results: Mapping[str, Sequence[Any]]) -> str:
    """Return functions that draw from these values: responder, the functions that are called, and a training."""
    functions = {"responder": list(replies), **{name: list(values) for name, values in results.items()}}
    sources = (
        f"\n\ndef {name}(*arguments, **named):\n    return chance.choice({values!r})\n"
        for name, values in functions.items()
    )
    return "".join((f"import random\n\nchance = random.Random({_SEED})\n", *sources))


def _build_submission(name: str, assignment: Assignment, program: str, responder: str) -> Submission:
    """Return the submission with each part that the student must submit."""
    parts = assignment.parts
    files = {
        f"{agent}.py": responder.replace("def responder(", f"def {agent}(").encode()
        for agent, source in parts.agents.items()
        if source == "student"
    }
    if assignment.training is not None and responder:
        responder += _write_training(assignment.training.function)
    if parts.second_program == "student":
        files[SECOND_PROGRAM] = program.encode()
    return Submission(
        student=name,
        program=SourceFile(PART_FILES["program"], program) if parts.program == "student" else None,
        responder=SourceFile(PART_FILES["responder"], responder) if parts.responder == "student" else None,
        files=MappingProxyType(files),
    )


def _write_training(function: str) -> str:
    """Return a training that ignores its images. Its classifier answers like the responder."""
    return (
        "\n\nclass Classifier:\n    def predict(self, images):\n        return [responder() for _ in images]\n"
        f"\n\ndef {function}(images, labels):\n    return Classifier()\n"
    )


def _read_starter(name_or_path: str, assignment: Assignment) -> Submission | None:
    folder = locate_assignment_folder(name_or_path) / _STARTER
    if not folder.is_dir():
        return None
    try:
        return read_submission(folder, student=_STARTER, required_parts=assignment.parts)
    except UsageError:
        return None  # A starter without a part is not a submission.


def _find_magic_line(starter: Submission | None) -> Sequence[str]:
    """Return the magic line of the starter's program, which lowers the pen for example; empty if there is none."""
    text = starter.program.text if starter is not None and starter.program is not None else ""
    return [line for line in text.splitlines()[:1] if line.startswith("%%")]
