"""Near misses of students: each report begins with the finding, its place, and the expected value."""

from __future__ import annotations

import ast
import time
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import pytest

from notebook_builder import notebook
from paths import DATA, ROOT
from report_builders import line_follower_recording
from service.grading import hints
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.hint_clues import collect_clues
from service.grading.hint_names import PRELOADED
from service.grading.hints import collect_near_misses
from service.grading.judging import limited_judging
from service.grading.run_plan import plan_run
from service.grading.trial_runner import TrialRunner
from service.reports.formats import FORMATS
from service.reports.html import render_report_page
from service.reports.rows import TableRow
from service.reports.view import build_student_view
from sim.errors import UsageError
from sim.recording import TimedText
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import locate_examples
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission
from submissions.student_identity import Student

NEAR_MISSES = tomllib.loads((DATA / "near_misses.toml").read_text("utf-8"))["near_miss"]
IS_THAT_A = """
id = "is-that-a"
title = "Say it"
[world]
background = "Empty_Map"
[parts]
responder = "none"
[[scenario]]
id = "once"
poses = [[100, 800, 0]]
seconds = 5
[[criterion]]
title = "Asks"
marks = 1
check = "says"
starts_with = "Is that a"
"""


def asked_in(name: str, folder: Path) -> Assignment:
    """Return the assignment with one pose per scenario, which is enough for a mistake."""
    if name != "is-that-a":
        whole = find_assignment(name)
        return replace(whole, scenarios=tuple(replace(each, poses=each.poses[:1]) for each in whole.scenarios))
    (folder / "is-that-a").mkdir()
    (folder / "is-that-a" / "assignment.toml").write_text(IS_THAT_A)
    return find_assignment(str(folder / "is-that-a"))


def written(case: Mapping[str, Any], folder: Path) -> Path:
    """Write the reference with the mistake in it."""
    own = folder / "ada"
    own.mkdir()
    for part in ("robot.py", "responder.py"):
        change = case.get(part, {})
        if "text" in change:
            text = change["text"]
        else:
            reference = locate_examples(case["assignment"]) / "reference" / part
            text = reference.read_text("utf-8") if reference.exists() else ""
        if "from" in change:
            assert change["from"] in text
            text = text.replace(change["from"], change["to"])
        if text:
            (own / change.get("rename", part)).write_text(text, "utf-8")
    return own


def graded_case(case: Mapping[str, Any], folder: Path, runner: TrialRunner) -> Grade:
    assignment = asked_in(case["assignment"], folder)
    return grade(read_submission(written(case, folder), required_parts=assignment.parts), assignment, runner=runner)


@pytest.mark.long
@pytest.mark.parametrize("case", NEAR_MISSES, ids=lambda case: case["name"])
def test_a_near_miss_is_named_first(case: Mapping[str, Any], runner: TrialRunner, tmp_path: Path) -> None:
    graded = graded_case(case, tmp_path, runner)
    assert graded.marks < graded.max_marks
    first = plain(graded).partition("→ ")[2]
    assert first.startswith(case["hint"])
    assert case.get("also", "") in first


def plain(graded: Grade) -> str:
    form = FORMATS["text"]
    assert form.document is not None
    return " ".join(form.document(graded).split())


def one_like(name: str) -> Mapping[str, Any]:
    return next(case for case in NEAR_MISSES if case["name"] == name)


def test_every_format_begins_with_the_cause(runner: TrialRunner, tmp_path: Path) -> None:
    graded = graded_case(one_like("py in small letters"), tmp_path, runner)
    hint = graded.hints[0]
    cause, criterion = 'prints "py::0"', graded.criteria[0].title
    assert cause in hint
    row = TableRow(Student("ada"), "ada.zip", graded.assignment, graded)
    documents = {"page": unescape(render_report_page(build_student_view(graded), {}))}
    for name, form in FORMATS.items():
        if form.document is not None:
            documents[f"{name} document"] = unescape(form.document(graded)).replace('\\"', '"')
        if form.table is not None:
            documents[f"{name} table"] = unescape(form.table([row])).replace('\\"', '"').replace('""', '"')
    for name, text in documents.items():
        assert cause in text, name
        if name not in ("csv table", "csv-long table"):
            # Tables have their own columns and order.
            assert text.index(cause) < text.index(criterion), name


def test_a_hint_tells_nothing_of_hidden_trials_and_criteria(runner: TrialRunner, tmp_path: Path) -> None:
    case = one_like("py in small letters")
    assignment = asked_in(case["assignment"], tmp_path)
    submission = read_submission(written(case, tmp_path), required_parts=assignment.parts)
    hidden_trials = replace(
        assignment, scenarios=tuple(replace(each, visibility="hidden") for each in assignment.scenarios)
    )
    assert grade(submission, hidden_trials, runner=runner).hints == ()
    criteria = tuple(each.model_copy(update={"visibility": "hidden"}) for each in assignment.criteria)
    assert grade(submission, replace(assignment, criteria=criteria), runner=runner).hints == ()


def test_what_costs_nothing_is_no_cause(runner: TrialRunner, tmp_path: Path) -> None:
    case = {
        "assignment": "echo-responder",
        "robot.py": {"from": "import time", "to": 'import time\nprint("py: here we go")'},
    }
    graded = graded_case(case, tmp_path, runner)
    assert (graded.marks, graded.hints) == (graded.max_marks, ())


CELLS = {
    "PY with one colon": (
        ["def responder(text):\n    return 'Python saw >> 0 << that...'", "%%sim_magic_preloaded\nprint('PY:0')"],
        'line 2 of cell 2 prints "PY:0", which is not sent as a message',
    ),
    "a misspelt name": (
        ["def responder(text):\n    return 'hello'", "%%sim_magic_preloaded\nimport time\npritn('PY::0')"],
        "line 3 of cell 2: NameError: name 'pritn' is not defined. Did you mean print?",
    ),
    "a forgotten return": (
        ["def responder(text):\n    print('Python saw >> 0')", "%%sim_magic_preloaded\nprint('PY::0')"],
        "line 2 of cell 1, \"print('Python saw >> 0')\", prints the answer, but no line returns it. Return the answer "
        "with return",
    ),
}


@pytest.mark.parametrize("name", CELLS)
def test_in_a_notebook_the_cell_is_named(name: str, runner: TrialRunner, tmp_path: Path) -> None:
    cells, hint = CELLS[name]
    assignment = find_assignment("echo-responder")
    submission = read_submission(notebook(tmp_path / "ada.ipynb", cells), required_parts=assignment.parts)
    assert grade(submission, assignment, runner=runner).hints[0].startswith(hint)


@pytest.mark.parametrize(
    ("cell", "near_miss"),
    [
        ("%%sim_magic_preload\nprint(1)", "line 1 of cell 1 has %%sim_magic_preload, another word."),
        (
            "import time\n%%sim_magic_preloaded\nprint(1)",
            "; line 2 of cell 1 has %%sim_magic_preloaded, below other code: make it the first line.",
        ),
        ("print(1)", "begins with %%sim_magic_preloaded."),
    ],
)
def test_a_notebook_without_a_robot_program_is_told_what_was_nearly_one(
    cell: str, near_miss: str, tmp_path: Path
) -> None:
    assignment = find_assignment("echo-responder")
    with pytest.raises(UsageError) as refusal:
        read_submission(notebook(tmp_path / "ada.ipynb", [cell]), required_parts=assignment.parts)
    assert str(refusal.value).endswith(near_miss)


def test_files_with_other_names_are_to_be_renamed(tmp_path: Path) -> None:
    for name in ("my_robot.py", "responders.py", "helper.py"):
        (tmp_path / name).write_text("x = 1\n")
    with pytest.raises(UsageError, match=r"; rename my_robot[.]py to robot[.]py and responders[.]py to responder[.]py"):
        read_submission(tmp_path, required_parts=find_assignment("echo-responder").parts)


def test_what_the_preloaded_magic_brings_is_known() -> None:
    given: dict[str, Any] = {}
    exec((ROOT / "sim/brick/brick_preambles.py").read_text("utf-8"), given)
    preloaded, imports = ({*bound_by(given["PREAMBLES"][name])} for name in ("preloaded", "imports"))
    assert preloaded - imports == PRELOADED


def bound_by(text: str) -> Iterator[str]:
    for node in ast.parse(text).body:
        if isinstance(node, ast.ImportFrom):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.FunctionDef):
            yield node.name
        elif isinstance(node, ast.Assign):
            yield from (target.id for target in node.targets if isinstance(target, ast.Name))


@pytest.mark.long
def test_searching_for_hints_takes_time_that_grows_with_the_length(tmp_path: Path) -> None:
    def cost(lines: int) -> float:
        text = "".join(f"print('P Y : :{number}' * 2)  # {'x(' * 40}\n" for number in range(lines))
        (tmp_path / "robot.py").write_text(text)
        (tmp_path / "responder.py").write_text("def responder(text):\n" + "    print(text)\n" * lines)
        assignment = find_assignment("echo-responder")
        submission = read_submission(tmp_path, required_parts=assignment.parts)
        clues = collect_clues(submission, plan_run(submission, assignment), (), ())
        speech = tuple(TimedText(0.0, f"P Y : :{number}") for number in range(lines))
        recording = replace(line_follower_recording(1), printed=speech, spoken=speech)
        lost = tuple(each for each in assignment.criteria)
        began = time.process_time()
        collect_near_misses(replace(clues, recordings=(recording,), lost=lost))
        return time.process_time() - began

    short = max(cost(100), 0.002)
    assert cost(4 * 100) < 20 * 4 * short


def test_a_rule_that_fails_is_logged_and_the_others_give_their_hints(
    runner: TrialRunner, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    assignment = find_assignment("echo-responder")
    submission = read_submission(locate_examples("echo-responder") / "flawed", required_parts=assignment.parts)
    whole = grade(submission, assignment, runner=runner)
    assert whole.hints
    for rules in ("_FILE_RULES", "_ERROR_RULES", "_RESULT_RULES", "_FALLBACK_RULES"):
        others = getattr(hints, rules)
        monkeypatch.setattr(hints, rules, (_raises, *others))
    assert grade(submission, assignment, runner=runner).hints == whole.hints
    causes = {(each.message, str(each.exc_info[1])) for each in caplog.records if each.exc_info}
    assert causes == {("_raises failed, so it gives no hint", "a rule that nobody thought through")}


HIDDEN_TURN = """
id = "ends-there"
title = "Drive"
description = "Drive 300 mm forward."
[world]
background = "Empty_Map"
[parts]
responder = "none"
[[scenario]]
id = "shown"
poses = [[500, 500, 0]]
seconds = 10
[[scenario]]
id = "hidden"
visibility = "hidden"
poses = [[500, 500, 20]]
seconds = 10
[[criterion]]
title = "Ends there"
marks = 5
check = "pose"
x = 800
y = 500
tolerance = 60
"""


def test_a_criterion_that_only_hidden_trials_fail_leaves_all_rules_working(
    tmp_path: Path, runner: TrialRunner, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "assignment.toml").write_text(HIDDEN_TURN)
    (tmp_path / "robot.py").write_text("tank_drive.on_for_seconds(SpeedPercent(30), SpeedPercent(30), 2.44)\n")
    assignment = find_assignment(str(tmp_path))
    graded = grade(read_submission(tmp_path / "robot.py", required_parts=assignment.parts), assignment, runner=runner)
    assert 0 < graded.marks < graded.max_marks
    assert [bool(each.recording.places) for each in graded.trials] == [True, False]
    assert not caplog.records


def _raises(_: object) -> tuple[str, ...]:
    raise ValueError("a rule that nobody thought through")


def _never_ends(_: object) -> tuple[str, ...]:
    while True:
        pass


@pytest.mark.parametrize("rules", [_raises, _never_ends])
@pytest.mark.parametrize("little", [True, False])
def test_rules_that_fail_cost_neither_marks_nor_the_job(
    rules: Callable[[object], tuple[str, ...]], little: bool, runner: TrialRunner, monkeypatch: pytest.MonkeyPatch
) -> None:
    assignment = find_assignment("echo-responder")
    submission = read_submission(locate_examples("echo-responder") / "flawed", required_parts=assignment.parts)
    whole = grade(submission, assignment, runner=runner)
    monkeypatch.setattr("service.grading.hints.collect_near_misses", rules)
    monkeypatch.setattr(limited_judging, "_SMALL_LIMITS", replace(limited_judging._SMALL_LIMITS, cpu_seconds=0.1))
    if not little:
        monkeypatch.setattr(limited_judging, "_SMALL_INPUT", -1)
    without = grade(submission, assignment, runner=runner)
    assert (without.marks, without.hints) == (whole.marks, ())
