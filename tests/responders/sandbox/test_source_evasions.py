"""Evasions of the rules about code, each graded as a submission: findings, refusals, and messages to staff."""

from __future__ import annotations

import importlib.util
import io
import marshal
import py_compile
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import pytest

from judging import criterion
from paths import DATA, ROOT
from report_builders import row_of
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.reports.formats.csv_output import render_marks_csv
from service.reports.formats.json_output import render_json
from service.reports.formats.text import render_plain_text
from service.reports.html import render_report_page
from service.reports.view import build_staff_view, build_student_view
from sim.recording import Pose, Verdict
from submissions.assignment.definition import Assignment, Parts, Scenario, WorldSpec
from submissions.bundle import read_submission
from submissions.submission import Cell, Notebook, Submission

_TABLE = tomllib.loads((DATA / "source_evasions.toml").read_text("utf-8"))
CASES: list[dict[str, Any]] = _TABLE["case"]
_RULES = ("uses", "avoids", "in_loop", "defines")


def assignment(part: str, rules: dict[str, Any]) -> Assignment:
    source = criterion("source", **{"id": "source", "marks": "1", "part": part, **rules})
    if part == "program":
        scenario = Scenario("s", (Pose(200, 800, 0),), seconds=5.0)
        return Assignment("a", "A", WorldSpec(), Parts("student", "none"), (scenario,), (source,))
    rule = criterion("functions", id="functions", marks="1", function="f", calls=[{"returns": True}])
    return Assignment("a", "A", WorldSpec(), Parts("none", "student"), (), (source, rule))


def files_of(case: dict[str, Any]) -> dict[str, bytes]:
    """Return the files beside the part. Files that are not text are created here."""
    files = {name: text.encode() for name, text in case.get("files", {}).items()}
    for number in range(case.get("many_files", 0)):
        files[f"part_{number}.py"] = b"run = eval\n" if number == 30 else b"x = 1\n"
    if case.get("large_file"):
        files["helper.py"] = b"run = eval\n" + b"# x\n" * 200_000
    if "compiled" in case:
        code = marshal.dumps(compile("run = eval", "helper.py", "exec"))
        files[case["compiled"]] = importlib.util.MAGIC_NUMBER + b"\0" * 12 + code
    if "archive" in case:
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w") as archive:
            archive.writestr("helper.py", "run = eval")
        files[case["archive"]] = b"not an archive at first prediction" + stream.getvalue()
    return files


def graded(case: dict[str, Any], folder: Path, runner: TrialRunner) -> Grade:
    part = case.get("part", "responder")
    graded_assignment = assignment(part, {name: case[name] for name in _RULES if name in case})
    if "cells" in case:
        cells = tuple(Cell(number, source) for number, source in enumerate(case["cells"], 1))
        return grade(
            Submission("ada", notebook=Notebook("a.ipynb", cells), files=files_of(case)),
            graded_assignment,
            runner=runner,
        )
    (folder / ("robot.py" if part == "program" else "responder.py")).write_text(case["text"].lstrip("\n"), "utf-8")
    for name, data in files_of(case).items():
        (folder / name).write_bytes(data)
    return grade(read_submission(folder, required_parts=graded_assignment.parts), graded_assignment, runner=runner)


# Cases that remove the same modules are adjacent, so that they share a zygote.
@pytest.mark.long
@pytest.mark.parametrize(
    "case", [pytest.param(case, id=case["name"]) for case in sorted(CASES, key=lambda case: str(case.get("avoids")))]
)
def test_what_becomes_of_it(case: dict[str, Any], tmp_path: Path, runner: TrialRunner) -> None:
    result = graded(case, tmp_path, runner)
    source, *others = result.criteria
    became = case["became"]
    if became == "fails":
        assert source.marks == 0, "it is not seen"
        return
    assert source.marks == 1, source.message
    assert bool(source.for_staff) is (became == "staff" or case.get("staff", False)), source.for_staff
    for had in others if "text" in case else ():
        assert had.marks == (0 if became == "refused" else 1), had.message


def test_each_case_has_a_name_of_its_own() -> None:
    assert len({case["name"] for case in CASES}) == len(CASES)
    assert {case["became"] for case in CASES} == {"fails", "refused", "staff", "remains", "holds"}


NETWORK = "from joblib import load\ndef responder(text): return text\n"
WITHOUT = criterion("source", part="responder", avoids=["import joblib"])


def test_a_refused_import_is_an_error_of_its_line_and_a_note(tmp_path: Path, runner: TrialRunner) -> None:
    (tmp_path / "robot.py").write_text("print('PY::x')\nimport time\ntime.sleep(1)")
    (tmp_path / "responder.py").write_text(NETWORK)
    scenario = Scenario("s", (Pose(200, 800, 0),), seconds=5.0)
    graded_assignment = Assignment("a", "A", WorldSpec(), Parts(), (scenario,), (WITHOUT,))
    recording = (
        grade(read_submission(tmp_path, required_parts=graded_assignment.parts), graded_assignment, runner=runner)
        .trials[0]
        .recording
    )
    assert recording.verdict is Verdict.RESPONDER_ERROR
    assert recording.faults[0].message == "ModuleNotFoundError: joblib is not allowed in this assignment"
    assert recording.faults[0].line == 1
    assert recording.notes == ("line 1 of the responder: joblib is not allowed in this assignment",)


@pytest.mark.long
@pytest.mark.parametrize("rules", [{"avoids": ["joblib"]}, {"avoids": ["import joblib"], "marks": "0"}, {}])
def test_only_what_carries_marks_is_refused(rules: dict[str, Any], tmp_path: Path, runner: TrialRunner) -> None:
    text = "import joblib\ndef f(): return True\n"
    (tmp_path / "responder.py").write_text(text)
    graded_assignment = assignment("responder", {"uses": ["import joblib"], **rules})
    assert (
        grade(read_submission(tmp_path, required_parts=graded_assignment.parts), graded_assignment, runner=runner)
        .criteria[1]
        .marks
        == 1
    )


COMPILED = """
import nn_tools
from importlib.machinery import SourcelessFileLoader
def f(): return hasattr(SourcelessFileLoader("x", nn_tools.__path__[0] + "/__pycache__/{name}").load_module(), "np")
"""


@pytest.mark.long
@pytest.mark.parametrize(("module", "marks"), [("nn_tools.weights", 0), ("sklearn", 1)])
def test_what_was_compiled_of_a_closed_file_is_closed_too(
    module: str, marks: int, tmp_path: Path, runner: TrialRunner
) -> None:
    source = ROOT / "responders" / "kit" / "nn_tools" / "weights.py"
    compiled = Path(py_compile.compile(str(source), doraise=True) or "")
    # The parent folder may be closed to other users.
    compiled.parent.chmod(0o755)
    (tmp_path / "responder.py").write_text(COMPILED.format(name=compiled.name))
    graded_assignment = assignment("responder", {"avoids": [f"import {module}"]})
    assert (
        grade(read_submission(tmp_path, required_parts=graded_assignment.parts), graded_assignment, runner=runner)
        .criteria[1]
        .marks
        == marks
    )


def test_a_robot_program_does_without_what_its_preamble_needs(tmp_path: Path, runner: TrialRunner) -> None:
    text = "say('x')\nfrom ev3dev2.sound import Sound\nsay('y')"
    (tmp_path / "robot.py").write_text(text)
    graded_assignment = assignment("program", {"avoids": ["import ev3dev2.sound", "import time"]})
    trial = grade(
        read_submission(tmp_path, required_parts=graded_assignment.parts), graded_assignment, runner=runner
    ).trials[0]
    assert [line.text for line in trial.recording.spoken] == ["x"]
    assert trial.recording.faults[0].message == "ModuleNotFoundError: ev3dev2.sound is not allowed in this assignment"


def test_one_job_after_the_other_has_its_own_modules(tmp_path: Path, runner: TrialRunner) -> None:
    (tmp_path / "responder.py").write_text("def f():\n    import sklearn\n    return True\n")
    for rules, marks in (({"avoids": ["import sklearn"]}, 0), ({"uses": ["import sklearn"]}, 1)) * 2:
        graded_assignment = assignment("responder", rules)
        assert (
            grade(read_submission(tmp_path, required_parts=graded_assignment.parts), graded_assignment, runner=runner)
            .criteria[1]
            .marks
            == marks
        )


def test_what_staff_are_told_no_student_reads(tmp_path: Path, runner: TrialRunner) -> None:
    case = {"avoids": ["eval"], "text": "import gc\ndef f(): return True\n"}
    result = graded(case, tmp_path, runner)
    words = "line 1 has gc"
    for staff in (
        render_plain_text(build_staff_view(result)),
        render_json(build_staff_view(result)),
        render_marks_csv([row_of(result).apply_view(build_staff_view)]),
        render_report_page(build_staff_view(result), {}),
    ):
        assert words in staff
    assert words not in render_report_page(build_student_view(result), {})
    view = build_student_view(result)
    assert all(
        words not in text
        for text in (
            render_plain_text(view),
            render_json(view),
            render_marks_csv([row_of(result).apply_view(build_student_view)]),
        )
    )


def test_compiled_code_is_left_out_with_a_note(tmp_path: Path) -> None:
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as made:
        made.writestr("coefs_0.npy", b"numbers")
    kept = {
        "net.npz": archive.getvalue(),
        "net.joblib": b"\x80model",
        "notes.txt": b"PK\x01\x02",
        "helper.py": b"x = 1",
    }
    files = {**kept, "helper.pyc": b"\xa7\r\r\n", "a.so": b"", "model.bin": b"\x7fELF", "lib.egg": b""}
    for name, data in {**files, "responder.py": b"x = 1\n"}.items():
        (tmp_path / name).write_bytes(data)
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__" / "helper.cpython-311.pyc").write_bytes(b"\xa7\r\r\n")
    submission = read_submission(tmp_path)
    assert dict(submission.files) == kept
    assert sorted(note.split()[0] for note in submission.notes) == ["a.so", "helper.pyc", "lib.egg", "model.bin"]
