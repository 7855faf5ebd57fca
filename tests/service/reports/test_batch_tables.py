"""Tables of a batch: one graded, one without a part, one refused, one waiting. Other programs can read them."""

from __future__ import annotations

import csv
import io
import json
import re
import zipfile
from collections.abc import Callable
from dataclasses import replace

import pandas
import pytest
from junitparser import Error, Failure, JUnitXml, Skipped

import report_builders as build
from builders import accept_one
from moodle_rules import feedback_taken_by_moodle, imported_by_moodle
from paths import DATA
from service.batch_rows import build_row, describe_missing_grade
from service.grading.grade import Grade, PoolValue
from service.grading.judging.message_parts import describe_line
from service.reports.formats import FORMATS
from service.reports.html import render_refusal_page
from service.reports.rows import ReportPage, TableRow, describe_missing_part, select_student_rows
from service.store.batches import job_lines
from service.store.engine import Store
from service.store.states import JobState
from sim.errors import UsageError
from sim.sentences import Sentence
from submissions.student_identity import Student

GOLDEN = DATA / "tables"
WORKSHEET = (GOLDEN / "worksheet.csv").read_text("utf-8")


def of_moodle(name: str, number: int) -> str:
    return f"{name}_{number}_assignsubmission_file_"


def _without_trials(grade: Grade) -> Grade:
    # The reports' own tests cover the description of a run.
    criteria = tuple(replace(each, evidence=(), predictions=()) for each in grade.criteria)
    return replace(grade, criteria=criteria, trials=())


HINT = Sentence('%(place)s prints "py::0"; expected "PY::"', place=describe_line("robot.py", 4))
ADA = TableRow(
    Student("s1", "Ada Lovelace", "ada@uni.example"),
    of_moodle("Ada Lovelace", 500000),
    "shape-recognition",
    replace(_without_trials(build.shape_grade()), hints=(HINT,)),
)
MARY = TableRow(
    Student("s2", 'O\'Neil, Mary "Mo"', "mary@uni.example"),
    of_moodle("O'Neil, Mary Mo", 500001),
    "shape-recognition",
    _without_trials(build.shape_grade(missing="responder.py")),
    describe_missing_part("responder.py"),
)
ZOE: TableRow[Grade] = TableRow(
    Student("s3", "Zoë Ångström", "zoe@uni.example"),
    of_moodle("Zoë Ångström", 500002),
    "shape-recognition",
    None,
    "has no robot.py, expected robot.py (a robot program).",
    refused=True,
)
EVE: TableRow[Grade] = TableRow(
    Student("=cmd()", "Eve Adams", "eve@uni.example"), of_moodle("Eve Adams", 500003), "shape-recognition", None,
    "queued",
)  # fmt: skip
NOBODY: TableRow[Grade] = TableRow(Student(), "line 9", "", None, "has no student.", refused=True)
ROWS: list[TableRow[Grade]] = [ADA, MARY, ZOE, EVE, NOBODY]


def written(form: str) -> str:
    chosen = FORMATS[form]
    if chosen.worksheet is not None:
        return chosen.worksheet(ROWS, WORKSHEET).text
    assert chosen.table is not None
    return chosen.table(ROWS)


TABLES = sorted(name for name, form in FORMATS.items() if form.table or form.worksheet)


@pytest.mark.parametrize("form", TABLES)
def test_a_table_is_as_it_is_kept(form: str) -> None:
    """After an intended change, write the result of ``written`` to the file."""
    kept = (GOLDEN / f"{form}{FORMATS[form].suffix}").read_bytes().decode("utf-8")
    assert written(form) == kept


@pytest.mark.parametrize("form", ["csv", "csv-long"])
def test_marks_over_a_pool_have_columns_for_their_status_trials_and_bounds(form: str) -> None:
    assert ADA.grade is not None
    first, *others = ADA.grade.criteria
    pools = {"s1": PoolValue(200, 40, 0.62, 0.815, is_decided=False), "s2": PoolValue(200, 200, 0.7, 0.7, True)}
    rows = [
        replace(row, grade=replace(ADA.grade, criteria=(replace(first, pool=pools[row.student.id]), *others)))
        for row in (ADA, MARY)
    ]
    render = FORMATS[form].table
    assert render is not None
    lines = list(csv.DictReader(io.StringIO(render([*rows, ZOE]))))
    suffix = f": {first.id}" if form == "csv" else ""
    lines = [line for line in lines if form == "csv" or line["criterion"] in (first.id, "")]
    columns = [f"{name}{suffix}" for name in ("status", "trials_run", "pool", "value_low", "value_high")]
    assert [[line[column] for column in columns] for line in lines] == [
        ["provisional", "40", "200", "0.6200", "0.8150"],
        ["exact", "200", "200", "0.7000", "0.7000"],
        [""] * 5,
    ]
    assert [line["reason"] for line in lines] == [ADA.reason, MARY.reason, ZOE.reason]
    # Only the criterion with a pool has these columns.
    assert sum("trials_run" in column for column in lines[0]) == 1


def _rows_of_csv(text: str) -> dict[str, str]:
    """Return reasons by student, as pandas reads them."""
    frame = pandas.read_csv(io.StringIO(text), dtype=str, keep_default_na=False)
    why = "reason" if "reason" in frame else "Feedback comments"
    who = "student" if "student" in frame else "ID number" if "ID number" in frame else "Full name"
    return dict(zip(frame[who], frame[why], strict=True))


def _rows_of_json(text: str) -> dict[str, str]:
    return {
        row.get("student", row.get("extra_data", {}).get("student")): row.get("reason") or row.get("output", "")
        for row in json.loads(text)
    }


def _rows_of_junit(text: str) -> dict[str, str]:
    rows = {}
    for suite in JUnitXml.fromstring(text.encode()):
        properties = {each.name: each.value for each in suite.properties()}  # type: ignore[no-untyped-call]
        rows[properties.get("student", "")] = properties.get("reason", "")
    return rows


@pytest.mark.parametrize(
    ("form", "read"),
    [
        ("csv", _rows_of_csv),
        ("csv-long", _rows_of_csv),
        ("json", _rows_of_json),
        ("gradescope", _rows_of_json),
        ("junit", _rows_of_junit),
        ("moodle", _rows_of_csv),
        ("moodle-worksheet", _rows_of_csv),
    ],
)
def test_everybody_is_in_every_table_with_the_reason(form: str, read: Callable[[str], dict[str, str]]) -> None:
    rows = read(written(form))
    by_name = form == "moodle-worksheet"
    for row in (ADA, MARY, ZOE, EVE):
        own = row.student.name if by_name else row.student.id
        reason = rows[own] if own in rows else rows[f"'{own}"]
        assert row.reason.partition(";")[0].casefold() in reason.casefold()
    if "moodle" not in form:  # which has no place for a missing id
        assert "has no student" in rows[""]


def test_junit_is_read_as_what_it_says() -> None:
    suites = list(JUnitXml.fromstring(written("junit").encode()))
    assert [(suite.tests, suite.failures, suite.errors, suite.skipped) for suite in suites] == [
        (2, 1, 0, 0), (2, 1, 0, 0), (1, 0, 1, 0), (1, 0, 0, 1), (1, 0, 1, 0),
    ]  # fmt: skip
    kinds = [{type(result) for case in suite for result in case.result} for suite in suites]
    assert kinds == [{Failure}, {Failure}, {Error}, {Skipped}, {Error}]


def test_moodle_takes_the_worksheet_back_with_all_else_untouched() -> None:
    before = list(csv.reader(io.StringIO(WORKSHEET)))
    after = list(csv.reader(io.StringIO(written("moodle-worksheet"))))
    changed = {(x, y) for y, line in enumerate(after) for x, cell in enumerate(line) if cell != before[y][x]}
    grade, feedback = before[0].index("Grade"), before[0].index("Feedback comments")
    assert changed <= {(grade, 1), (grade, 2), *((feedback, y) for y in range(1, 5))}
    taken = imported_by_moodle(written("moodle-worksheet"))
    assert {number: grade for number, (grade, _) in taken.items()} == {
        "500000": 7, "500001": 7, "500002": None, "500003": None,
    }  # fmt: skip
    assert taken["500002"][1].startswith("Not graded: has no robot.py")
    filled_in = FORMATS["moodle-worksheet"].worksheet
    assert filled_in is not None
    assert filled_in(ROWS, WORKSHEET).left_over == ("line 9",)
    marked = filled_in(ROWS, "\ufeff" + WORKSHEET.replace("\n", "\r\n"))
    assert marked.text == "\ufeff" + written("moodle-worksheet").replace("\n", "\r\n")


def test_who_did_not_come_from_moodle_is_found_by_id_address_or_name() -> None:
    filled_in = FORMATS["moodle-worksheet"].worksheet
    assert filled_in is not None
    people = (Student("?", email="ADA@uni.example"), Student('O\'Neil, Mary "Mo"'), Student("x", "Somebody Else"))
    filled = filled_in([replace(ADA, student=each, source="a.zip") for each in people], WORKSHEET)
    assert [grade for grade, _ in imported_by_moodle(filled.text).values()] == [7, 7, None, None]
    assert filled.left_over == ("x",)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("", "no column Identifier and no column Grade"),
        ("a,b\n1,2\n", "expected the grading worksheet"),
        (WORKSHEET.replace("8.00", "100.00"), "Maximum Grade is 100 and the assignment gives 8 marks"),
    ],
)
def test_what_is_not_its_worksheet_is_refused(given: str, expected: str) -> None:
    filled_in = FORMATS["moodle-worksheet"].worksheet
    assert filled_in is not None
    with pytest.raises(UsageError, match=expected):
        filled_in(ROWS, given)


def test_moodle_finds_whose_each_feedback_file_is() -> None:
    packed = FORMATS["moodle-feedback"].archive
    assert packed is not None
    odd = replace(ADA, source=of_moodle("a_b/../c", 7))
    pages = [ReportPage(row, f"<p>{row.who}</p>") for row in (ADA, MARY, ZOE, odd, NOBODY)]
    sink, again = io.BytesIO(), io.BytesIO()
    assert packed(iter(pages), sink) == ("line 9",)
    packed(iter(pages), again)
    assert sink.getvalue() == again.getvalue()
    with zipfile.ZipFile(sink) as archive:
        assert archive.namelist() == [
            "Ada Lovelace_500000_assignfeedback_file_/feedback.html",
            "O'Neil, Mary Mo_500001_assignfeedback_file_/feedback.html",
            "Zoë Ångström_500002_assignfeedback_file_/feedback.html",
            "a b .. c_7_assignfeedback_file_/feedback.html",
        ]
        assert feedback_taken_by_moodle(archive) == dict.fromkeys(("500000", "500001", "500002", "7"), "feedback.html")
        assert archive.read(archive.namelist()[2]).decode() == "<p>s3</p>"


def test_gradescope_takes_each_document_of_one_submission() -> None:
    """Gradescope's rules: a score, or tests with a score each; known visibilities; otherwise the autograder failed."""
    form = FORMATS["gradescope"]
    assert form.document is not None
    assert form.refusal is not None
    assert ADA.grade is not None
    for text in (form.document(ADA.grade), form.refusal(ZOE)):
        results = json.loads(text)
        assert isinstance(results["score"], int | float)
        assert results["visibility"] in ("visible", "hidden", "after_due_date", "after_published")
        assert all(test["score"] <= test["max_score"] for test in results.get("tests", []))
    assert json.loads(form.refusal(ZOE))["score"] == 0
    waiting = json.loads(written("gradescope"))[3]
    assert "score" not in waiting


def test_who_was_refused_reads_what_was_found_and_what_to_do() -> None:
    page = render_refusal_page(ZOE)
    page_text = re.sub(r"\s+", " ", re.sub(r"<style>.*</style>|<[^>]+>", " ", page, flags=re.DOTALL))
    assert "Zoë Ångström shape-recognition Your submission was not graded." in page_text
    assert "Problem has no robot.py, expected robot.py (a robot program)." in page_text
    assert "submit again" in page_text
    hostile = render_refusal_page(
        replace(ZOE, student=Student(build.HOSTILE), source=build.HOSTILE, reason=build.HOSTILE)
    )
    assert "<script" not in hostile


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_no_gradebook_has_a_word_that_is_for_staff(name: str) -> None:
    """Formats for students have no row over a limit, and mention no fault of the host."""
    over: TableRow[Grade] = TableRow(
        Student("eve"), "eve.zip", "echo", reason="for staff only: attempt 2, allowed: 1", for_staff=True
    )
    dead: TableRow[Grade] = TableRow(
        Student("zoe"), "zoe.zip", "echo", reason="dead: /srv is full", student_reason="could not be graded yet"
    )
    chosen = FORMATS[name]
    given = "Identifier,ID number,Grade,Feedback comments\nParticipant 1,eve,,\nParticipant 2,zoe,,\n"
    if chosen.table is not None:
        text = chosen.table([over, dead])
    elif chosen.worksheet is not None:
        text = chosen.worksheet([over, dead], given).text
    else:
        return
    staffs = {"csv", "csv-long", "json", "junit"}
    assert ("attempt 2" in text) is (name in staffs)
    assert ("/srv is full" in text) is (name in staffs)
    assert ("could not be graded yet" in text) is (name not in staffs)
    if chosen.worksheet is not None:
        assert "Participant 1,eve,,\n" in text


@pytest.mark.parametrize(
    ("state", "changes", "words", "for_staff"),
    [
        (JobState.DEAD, {"error": "Tried 3 times, the last time: /srv is full"}, "could not be graded yet", False),
        (JobState.CANCELLED, {"error": "the batch was cancelled"}, "was cancelled", False),
        (JobState.DONE, {"suspect": "the worker w1 was found to grade wrongly"}, "is graded again", False),
        (JobState.DONE, {"staff_only": "attempt 2, allowed: 1"}, "", True),
        (JobState.QUEUED, {}, "", False),
    ],
)
def test_what_a_student_is_told_of_a_job_without_a_grade(
    store: Store, state: JobState, changes: dict[str, str], words: str, for_staff: bool
) -> None:
    accepted = accept_one(store)
    with store.reading() as session:
        line = replace(job_lines.load_job_line(session, accepted.job_id), state=state, **changes)  # type: ignore[arg-type]
    row = build_row(line, None, describe_missing_grade(line))
    (student_rows,) = select_student_rows([row]) or [row]
    assert row.for_staff is for_staff
    if words:
        assert student_rows.reason.startswith(words)
        assert all(text not in student_rows.reason for text in changes.values())
    else:
        assert student_rows.reason == row.reason
