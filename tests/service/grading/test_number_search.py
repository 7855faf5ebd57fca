"""The search for the nearest number: the change passes, is small, stays within its budget, and names the direction."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from command import robomark
from service.grading.grader import grade
from service.grading.number_experiments import GradedCriterion, SearchBudget, read_student_files
from service.grading.number_roles import describe_direction, find_direction, find_role
from service.grading.number_search import NumberSearch, find_nearest_number
from service.grading.pools.drawing import PoolExtent
from service.grading.program_numbers import collect_numbers
from service.grading.trial_runner import TrialRunner
from service.language import load_language
from service.mutation.source_tree import SourceTree
from submissions.assignment.examples import locate_examples, read_example
from submissions.assignment.reader import find_assignment
from submissions.seeds import PUBLIC_SECRET
from submissions.submission import Submission


def _search(
    assignment: str, changes: tuple[str, str], runner: TrialRunner, budget: SearchBudget | None = None
) -> tuple[NumberSearch, Submission]:
    """Search for the costliest criterion of a reference in which a text was replaced."""
    definition, reference = find_assignment(assignment), read_example(assignment, "reference")
    assert reference.program is not None
    submission = reference.with_source("robot.py", reference.program.text.replace(*changes, 1))
    graded = grade(submission, definition, runner=runner, with_hints=False)
    lost = min(graded.criteria, key=lambda each: each.marks - each.max_marks)
    criterion = next(each for each in definition.criteria if each.id == lost.id)
    case = GradedCriterion(submission, definition, graded, criterion, runner, PUBLIC_SECRET, PoolExtent.WHOLE)
    # Only runs are limited, because the speed of the machine must not matter.
    return find_nearest_number(case, budget or SearchBudget(60, cpu_seconds=1e9)), submission


@pytest.mark.parametrize(
    ("assignment", "changes", "line", "sentence"),
    [
        # The recorded path suggests it.
        ("trace-a-square", ("SIDES = 4", "SIDES = 3"), 2, "The limit of the loop at line 2 of robot.py is too low."),
        # Only runs can show it, because the criterion is not about the path.
        ("count-aloud", ("count <= 10", "count <= 8"), 6, "The threshold at line 6 of robot.py is too low."),
    ],
)
def test_the_nearest_number_passes(
    assignment: str, changes: tuple[str, str], line: int, sentence: str, runner: TrialRunner
) -> None:
    search, submission = _search(assignment, changes, runner)
    change = search.change
    assert change is not None
    assert (change.line, str(search.direction)) == (line, sentence)
    assert search.runs <= 60
    [number] = [
        each
        for each in collect_numbers(read_student_files(submission, find_assignment(assignment)))
        if (each.line, each.column) == (change.line, change.column)
    ]
    assert number.old == change.old
    changed = submission.with_source(change.file, number.change_text(float(change.new)))
    graded = grade(changed, find_assignment(assignment), runner=runner)
    result = next(each for each in graded.criteria if each.id == search.criterion)
    assert (result.marks, graded.marks) == (result.max_marks, change.marks)


def test_the_same_search_gives_the_same_result(runner: TrialRunner) -> None:
    first, second = (_search("trace-a-square", ("SIDES = 4", "SIDES = 3"), runner)[0] for _ in range(2))
    assert first == second


def test_the_search_stays_within_its_budget(runner: TrialRunner) -> None:
    search, _ = _search("trace-a-square", ("SIDES = 4", "SIDES = 1"), runner, SearchBudget(3, 1e9))
    assert search.runs <= 3
    assert search.is_exhausted
    search, _ = _search("trace-a-square", ("SIDES = 4", "SIDES = 1"), runner, SearchBudget(300, 0.0))
    assert (search.change, search.runs, search.is_exhausted) == (None, 0, True)


@pytest.mark.parametrize(
    ("text", "roles"),
    [
        ("tank_drive.on_for_degrees(SpeedPercent(40), SpeedPercent(30), 2)", ["left speed", "right speed", "distance"]),
        ("tank_drive.on_for_seconds(40, -40, seconds=2)", ["left speed", "right speed", "turn"]),
        ("tank_turn.on_for_degrees(-100, SpeedPercent(40), 90)", ["steering", "speed", "turn"]),
        ("while x > 3 and y[0] < 5:\n    time.sleep(0.1)", ["threshold", "index", "threshold", "wait"]),
        ("for i in range(4):\n    x = 5", ["loop", "number"]),
        ("N = 4\nV = 40\nfor i in range(N): tank_drive.on(V, V)", ["loop", "speed"]),
        ("V = 40\nm.on(SpeedPercent(V))", ["speed"]),
        # A larger number has the opposite effect, or none that is known.
        ("MM = 44\ntank_drive.on_for_rotations(20, 20, mm / MM)", ["number", "left speed", "right speed"]),
        ("if red - 5 > 2 * blue:\n    m.on(SpeedPercent(50 - 2 * x))", ["number", "number", "speed", "number"]),
        ("for i in range(2, 8, 3): pass", ["range", "loop", "range"]),
    ],
)  # fmt: skip
def test_the_role_of_a_number_is_found(text: str, roles: list[str]) -> None:
    tree = SourceTree(text)
    assert [find_role(tree, each) for each in tree.numbers] == roles


def test_the_direction_of_a_change_is_named() -> None:
    assert find_direction(-40, -50, "speed") == "larger"
    assert find_direction(-40, -50, "threshold") == "smaller"
    assert find_direction(-40, 40, "steering") == "other sign"
    sentence = describe_direction("turn", "larger", "line 8")
    assert sentence == "The turn at line 8 is too short."
    assert load_language("de").translate_sentence(sentence) == "Die Drehung in line 8 ist zu kurz."


@pytest.mark.long
def test_the_command_shows_staff_the_number(tmp_path: Path) -> None:
    reference = locate_examples("trace-a-square") / "reference" / "robot.py"
    program = tmp_path / "robot.py"
    program.write_text(reference.read_text().replace("SIDES = 4", "SIDES = 3"))
    ended = robomark("grade", program, "-a", "trace-a-square", "--nearest", "--json")
    document = json.loads(ended.stdout)
    assert document["marks"] == 0
    [nearest] = document["nearest"]
    assert (nearest["line"], nearest["old"], nearest["new"], nearest["marks"]) == (2, "3", "4", 10)
    ended = robomark("grade", program, program, "-a", "trace-a-square", "--nearest")
    assert (ended.returncode, ended.stdout) == (2, "")
    assert "--nearest needs one submission" in ended.stderr
