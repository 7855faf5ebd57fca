"""A grade as text, JSON, Gradescope, JUnit and CSV."""

import csv
import io
import json
import re
from dataclasses import replace
from decimal import Decimal
from xml.etree import ElementTree

import pytest
from rich.text import Text

import report_builders as build
from responders.sandbox.meter import JobCosts, JobLimits
from service.grading.grade import Cost, PoolValue, build_unjudged_notes
from service.grading.pools.pool_sentences import describe_for_staff
from service.reports.formats import FORMATS
from service.reports.formats.csv_output import render_marks_csv
from service.reports.formats.gradescope import build_gradescope_document, render_gradescope
from service.reports.formats.json_output import build_json_document, render_json
from service.reports.formats.junit import render_junit
from service.reports.formats.moodle import render_moodle_csv
from service.reports.formats.text import render_coloured_text, render_plain_text
from service.reports.html import render_report_page
from service.reports.verdict_sentences import describe_verdict
from service.reports.view import View, build_gradebook_view, build_staff_view, build_student_view, find_worst_trial
from sim.recording import Verdict
from submissions.submission import Submission

pytestmark = pytest.mark.fast


def test_json_has_exactly_the_keys_of_the_schema() -> None:
    document = json.loads(render_json(build_staff_view(build.shape_grade())))
    top = ["schema", "assignment", "marks", "max_marks", "verdict", "criteria", "trials", "accuracy", "notes"]
    said_first = ["cause", "next_step", "lost_by_cause"]
    assert [key for key in document if key not in said_first] == top
    assert list(document)[5:8] == said_first
    assert document["schema"] == 1
    assert list(document["criteria"][0]) == ["id", "title", "marks", "max_marks", "message"]
    assert list(document["trials"][0]) == ["scenario", "seed", "verdict", "sha256", "spoken", "messages", "notes"]
    assert list(document["trials"][0]["messages"][0]) == ["t", "sender", "text"]
    assert document["accuracy"] == {"value": 5 / 6, "low": 0.4365, "high": 0.9699, "n": 6}
    assert (document["marks"], document["max_marks"], document["verdict"]) == (7, 8, "finished")
    assert document["trials"][4]["spoken"] == ["Is that a diamond"]


LOST = (
    "The channel lost 5 of 6 messages: 1 by chance, 1 because the robot was out of range, 2 because the robot faced "
    "away, "
    "1 because of a wall or an obstacle between them. Messages lost by chance do not cost marks."
)


def test_every_report_says_what_the_channel_lost_and_why() -> None:
    view = build_staff_view(build.astray_grade())
    assert LOST in " ".join(render_plain_text(view).split())
    assert LOST in " ".join(render_report_page(view, {}).split())
    messages = build_json_document(view)["trials"][1]["messages"]
    assert messages[0] == {"t": 0.1, "sender": "robot", "text": "PY::0", "lost": "chance"}
    assert (messages[1]["lost"], messages[1]["distance"], messages[1]["angle"]) == ("out of range", 1600.2, 3.0)
    assert messages[4]["arrived_as"] == "PY::7"
    assert "The channel" not in render_plain_text(build_staff_view(build.line_follower_grade()))


def test_the_first_line_of_a_text_report_says_that_marks_are_provisional() -> None:
    grade = build.shape_grade()
    first, *others = grade.criteria
    reports = []
    for drawn in (40, 200):
        value = PoolValue(200, drawn, 0.7, 0.7 if drawn == 200 else 0.8, is_decided=False)
        pool = describe_for_staff(value, "share")
        reports.append(
            render_plain_text(
                build_staff_view(replace(grade, criteria=(replace(first, pool=pool), *others)))
            ).splitlines()
        )
    title = render_plain_text(build_staff_view(grade)).splitlines()[0]
    assert [lines[0] for lines in reports] == [f"{title} (provisional marks)", title]
    provisional, exact = (" ".join(" ".join(lines).split()) for lines in reports)
    assert "Provisional: 40 of 200 trials were run. With 95 % certainty, 70 to 80 % of all trials" in provisional
    assert "Exact: all 200 trials of the pool were run." in exact


@pytest.mark.parametrize("form", [name for name, form in FORMATS.items() if form.document] + ["page"])
def test_full_marks_say_so_and_ask_for_nothing_more(form: str) -> None:
    made = build.shape_grade()
    full = replace(made, criteria=tuple(replace(each, marks=each.max_marks) for each in made.criteria))
    document = FORMATS[form].document if form in FORMATS else None
    outputs = document(full) if document else render_report_page(build_student_view(full), {})
    words = " ".join(re.sub("<script.*?</script>", "", outputs, flags=re.DOTALL).split())
    assert "missing" not in words
    assert "to be gained" not in words
    if form in ("text", "gradescope", "page"):
        assert "Full marks." in words
        assert "No changes needed." in words
    else:
        assert re.search(r'"marks": 8,|name="marks" value="8"', words)


def test_json_without_classification_and_with_half_marks() -> None:
    document = build_json_document(build_staff_view(build.line_follower_grade()))
    assert document["accuracy"] is None
    assert document["marks"] == 4.5
    assert isinstance(document["max_marks"], int)


def test_hostile_text_survives_strict_json() -> None:
    text = render_json(build_staff_view(build.hostile_grade()))
    assert text.isascii()
    assert json.loads(text)["criteria"][0]["title"].encode()  # no lone surrogate remains


def test_gradescope_leaves_hiding_to_gradescope_but_tells_nothing_at_the_top() -> None:
    document = build_gradescope_document(build_gradebook_view(build.hidden_grade()))
    assert [test["visibility"] for test in document["tests"]] == ["visible", "visible", "hidden"]
    assert sum(test["score"] for test in document["tests"]) == document["score"] == 8
    assert [test["status"] for test in document["tests"]] == ["failed", "passed", "failed"]
    assert "SECRET" not in document["output"]
    assert document["output_format"] == "text"
    json.loads(render_gradescope(build_gradebook_view(build.hostile_grade())))


def test_gradescope_names_the_line_of_a_fault() -> None:
    output = build_gradescope_document(build_gradebook_view(build.faulty_grade()))["output"]
    assert re.search(r"line \d+: ", output)


def test_junit_counts_failures_and_is_well_formed_whatever_was_printed() -> None:
    suite = ElementTree.fromstring(render_junit(build_staff_view(build.shape_grade())))[0]
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("2", "1", "0")
    failure = suite.find("testcase/failure")
    assert failure is not None
    assert failure.get("message") == "5 of 6 marks"
    hostile = ElementTree.fromstring(render_junit(build_staff_view(build.hostile_grade())))
    assert "<script>alert(1)</script>" in hostile[0][1].attrib["name"]


def test_junit_calls_an_unmarked_grade_an_error() -> None:
    grade = build.faulty_grade()
    trial = replace(grade.trials[0], recording=replace(grade.trials[0].recording, verdict=Verdict.HOST_ERROR))
    suite = ElementTree.fromstring(render_junit(build_staff_view(replace(grade, trials=(trial,)))))[0]
    assert (suite.get("failures"), suite.get("errors")) == ("0", "1")


def test_csv_has_a_column_a_criterion_and_no_formulas() -> None:
    evil = replace(build.faulty_grade(), student="=HYPERLINK(1)")
    table = render_marks_csv(
        [build.row_of(grade).apply_view(build_staff_view) for grade in (build.shape_grade(), evil)]
    )
    rows = list(csv.DictReader(io.StringIO(table)))
    assert rows[0]["student"] == "s1234567"
    assert rows[0]["accuracy"] == "0.8333"
    assert rows[0]["marks: names-the-right-shape"] == "5"
    assert rows[0]["marks: echoes"] == ""
    assert rows[1]["student"] == "'=HYPERLINK(1)"


def test_moodle_feedback_says_nothing_of_hidden_criteria() -> None:
    row = next(
        csv.DictReader(
            io.StringIO(render_moodle_csv([build.row_of(build.hidden_grade()).apply_view(build_gradebook_view)]))
        )
    )
    assert row["Grade"] == "8"
    assert "SECRET" not in row["Feedback comments"]
    assert "Names the right shape: 5 of 6" in row["Feedback comments"]


def test_plain_text_says_marks_verdict_and_where_it_failed() -> None:
    text = render_plain_text(build_staff_view(build.faulty_grade()))
    assert "0 of 4 marks; error in the responder" in text
    assert "Responder, line 2: NameError" in text
    assert "2 times in 2 of 3 trials" in text
    assert "sandbox: process limits only" in text
    assert max(len(line) for line in text.split("\n")) <= 96


def test_terminals_get_no_control_codes_from_students() -> None:
    text = render_plain_text(build_staff_view(build.hostile_grade()))
    assert not {"\x1b", "\x00", "\u202e", "\ud800"} & set(text)
    assert "[red]x[/red]" in text


def test_student_view_drops_hidden_parts_and_keeps_indices_right() -> None:
    view = build_student_view(build.hidden_grade()).grade
    assert [result.id for result in view.criteria] == ["names-the-right-shape", "asks-aloud"]
    assert {trial.scenario for trial in view.trials} == {"each-shape"}
    assert [prediction.trial for prediction in view.criteria[0].predictions] == [0, 1, 2, 3]
    assert view.criteria[0].accuracy is not None
    assert (view.criteria[0].accuracy.n, view.criteria[0].message[:8]) == (4, "VISIBLE:")
    released = build_student_view(build.hidden_grade(), frozenset({"visible", "hidden"})).grade
    assert (len(released.criteria), len(released.trials)) == (3, 6)
    assert released.criteria[0].message == build.shape_grade().criteria[0].message


def test_a_grade_of_before_visible_trials_were_told_apart_tells_nothing_of_trials() -> None:
    grade = build.hidden_grade()
    old = replace(grade, criteria=tuple(replace(result, shown=None) for result in grade.criteria))
    first = build_student_view(old).grade.criteria[0]
    assert (first.message, first.accuracy, first.curves) == ("Marked in trials that are not shown.", None, ())


def test_student_view_where_the_first_trial_is_hidden() -> None:
    grade = build.shape_grade()
    first_hidden = replace(grade, trials=(replace(grade.trials[0], visibility="hidden"), *grade.trials[1:]))
    view = build_student_view(first_hidden).grade
    predictions = view.criteria[0].predictions
    assert [(prediction.trial, prediction.truth) for prediction in predictions] == [
        (i, build.SHAPES[i + 1]) for i in range(5)
    ]
    assert find_worst_trial(view, "each-shape") == 3


def test_worst_trial_is_the_one_that_lost_most() -> None:
    assert find_worst_trial(build.shape_grade(), "each-shape") == 4
    assert find_worst_trial(build.faulty_grade(), "talk") == 1


@pytest.mark.parametrize("verdict", list(Verdict))
def test_every_verdict_has_words(verdict: Verdict) -> None:
    words = describe_verdict(verdict)
    assert all((words.short, words.happened, words.next_step))
    assert bool(words.explanation) is (verdict is not Verdict.FINISHED)
    is_ours = verdict in (Verdict.HOST_ERROR, Verdict.ASSIGNMENT_ERROR)
    assert ("not your fault" in words.explanation) is is_ours


def _colour(view: View, submission: Submission | None = None) -> Text:
    text = render_coloured_text(view, submission)
    assert isinstance(text, Text)
    return text


def test_a_terminal_shows_the_lines_of_the_text_in_colours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    for grade in (build.faulty_grade(), build.hostile_grade(), build.shape_grade()):
        view = build_staff_view(grade)
        coloured = _colour(view, build.faulty_submission())
        assert coloured.plain == render_plain_text(view, build.faulty_submission())
        assert {"bold", "red"} & {str(span.style) for span in coloured.spans}
    monkeypatch.setenv("COLUMNS", "60")
    lines = _colour(build_staff_view(build.faulty_grade())).plain.split("\n")
    assert [len(line) <= 60 for line in lines if line.startswith("→")] == [True]


def test_marks_are_not_rounded_on_the_way() -> None:
    grade = build.line_follower_grade()
    tenth = replace(grade.criteria[0], marks=Decimal("0.1"))
    assert (
        build_json_document(build_staff_view(replace(grade, criteria=(tenth, replace(tenth, marks=Decimal("0.2"))))))[
            "marks"
        ]
        == 0.3
    )


def _render_without_images(view: View) -> str:
    return re.sub(r'src="data:[^"]+"', "", render_report_page(view, {}))


COSTLY = replace(build.shape_grade(), cost=Cost(JobLimits(64 << 20, 240.0, 20.0), JobCosts(150_000, 3.21, 0.04)))
FIGURES = "CPU time: 3.2 of 240 s. Sleep: 0 of 20 s. Output: 0.1 of 64 MB."


def test_staff_read_what_was_used_and_students_nothing_that_grows_with_hidden_trials() -> None:
    for_staff = (
        render_plain_text(build_staff_view(COSTLY)),
        render_report_page(build_staff_view(COSTLY), {}),
    )
    assert all(FIGURES in page for page in for_staff)
    viewed = build_student_view(COSTLY)
    for_students = (render_plain_text(viewed), _render_without_images(viewed))
    in_files = (
        render_gradescope(build_gradebook_view(COSTLY)),
        render_moodle_csv([build.row_of(COSTLY).apply_view(build_gradebook_view)]),
    )
    assert all("240" not in text for text in (*for_students, *in_files))
    assert build_json_document(build_staff_view(COSTLY))["cost"]["spent"] == {
        "kept_bytes": 150_000,
        "cpu_seconds": 3.21,
        "sleep_seconds": 0.04,
    }
    assert "cost" not in build_json_document(viewed)


def test_students_read_how_many_of_the_criteria_that_they_see_could_not_be_judged() -> None:
    first, second, *_ = build.shape_grade().criteria
    criteria = (
        replace(first, unjudged="too long", visibility="hidden"),
        replace(second, unjudged="too long", visibility="visible"),
        replace(second, id="third", visibility="visible"),
    )
    grade = replace(build.shape_grade(), criteria=criteria, notes=("a note", *build_unjudged_notes(criteria)))
    assert "2 of 3 criteria could not be judged; staff will review them" in build_staff_view(grade).grade.notes
    assert build_student_view(grade).grade.notes == (
        "a note",
        "1 of 2 criteria could not be judged; staff will review them",
    )
    all_hidden = replace(grade, criteria=tuple(replace(each, visibility="hidden") for each in criteria))
    assert build_student_view(all_hidden).grade.notes == ("a note",)


def test_of_a_grade_that_was_given_before_this_was_measured_nothing_is_said() -> None:
    assert all(word not in render_plain_text(build_staff_view(build.shape_grade())) for word in ("Used ", "together"))
    assert "cost" not in build_json_document(build_staff_view(build.shape_grade()))


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_writes_an_odd_grade_and_ends_its_last_line(name: str) -> None:
    form, grade = FORMATS[name], build.hostile_grade()
    assert form.document or form.table or form.worksheet or form.archive
    assert form.suffix.startswith(".")
    written = [form.document(grade)] if form.document else []
    written += [form.table([build.row_of(grade), build.row_of(grade)])] if form.table else []
    written += [form.refusal(replace(build.row_of(grade), grade=None, reason=build.HOSTILE))] if form.refusal else []
    for text in written:
        assert text.endswith("\n")
        assert "\x1b" not in text
        text.encode()
