"""The HTML report: its content, what it hides, and that no student text becomes markup."""

import base64
import hashlib
import re
from dataclasses import replace
from decimal import Decimal

import pytest

import report_builders as build
from page_reader import ATTRIBUTES, TAGS, Reader
from service.grading.grade import Grade, StaffAdjustment
from service.reports.html import (
    BatchRow,
    load_report_script,
    load_report_style,
    render_batch_index,
    render_report_page,
    render_report_parts,
)
from service.reports.page import build_page
from service.reports.plots.grade_plots import draw_all_plots, list_plots
from service.reports.replay.document import build_grade_replay
from service.reports.timeline import build_timeline
from service.reports.view import build_staff_view, build_student_view
from sim.recording import Fault, Verdict

pytestmark = pytest.mark.fast


@pytest.fixture(scope="module")
def hostile() -> tuple[str, Reader]:
    page = render_report_page(build_student_view(build.hostile_grade()), {}, build.faulty_submission())
    return page, Reader(page)


def test_hostile_text_makes_no_tags_and_no_attributes(hostile: tuple[str, Reader]) -> None:
    _, reader = hostile
    assert reader.tags <= TAGS
    assert {name for _, name, _ in reader.attributes} <= ATTRIBUTES
    assert reader.scripts == 2  # the replay's data and its script
    assert "<script>alert(1)</script>" in reader.text
    assert "{{7*7}}" in reader.text


def test_hostile_text_is_visible_encodable_and_capped(hostile: tuple[str, Reader]) -> None:
    page, reader = hostile
    assert len(page.encode("utf-8")) < 200_000
    assert not {"\x1b", "\x00", "\u202e", "\u200b", "\u2028"} & set(page)
    assert "\\u202eevil\\ud800\\x00" in reader.text
    assert page.count("\u0301") <= 6 * 2


def test_source_with_hostile_lines_is_escaped() -> None:
    grade, submission = build.faulty_grade(), build.faulty_submission()
    assert submission.program is not None
    program = replace(submission.program, name="</pre><img src=x>", text="a\nb\n" + build.HOSTILE.replace("\u2028", ""))
    reader = Reader(render_report_page(build_student_view(grade), {}, replace(submission, program=program)))
    assert reader.tags <= TAGS
    assert all(source.startswith("data:image/svg+xml,") for source in reader.values("img", "src"))


def test_the_page_is_self_contained_and_its_policy_fits_its_style() -> None:
    grade = build.shape_grade()
    reader = Reader(render_report_page(build_student_view(grade), draw_all_plots(grade)))
    sources = reader.values("img", "src")
    assert len(sources) == 3
    kinds = [source.partition(",")[0] for source in sources]
    assert kinds == ["data:image/svg+xml", "data:image/png;base64", "data:image/png;base64"]
    assert base64.b64decode(sources[1].split(",")[1]).startswith(b"\x89PNG")
    assert all(len(alt) > 20 for alt in reader.values("img", "alt"))
    digest = base64.b64encode(hashlib.sha256(reader.style.encode()).digest()).decode()
    policy = next(value for value in reader.values("meta", "content") if value.startswith("default-src"))
    assert policy.startswith("default-src 'none'; img-src data:; ")
    assert f"'sha256-{digest}'" in policy
    assert "unsafe" not in policy
    assert not re.search(r"url\(|@import", reader.style)
    assert "@media print" in reader.style


def test_plots_of_conversations_that_earlier_versions_kept_are_not_shown_and_break_nothing() -> None:
    grade = build.shape_grade()
    drawn = draw_all_plots(grade)
    (first, *_) = drawn.values()
    kept = drawn | {"conversation-each-shape-5": first, "talk-each-shape-5": first}
    assert render_report_page(build_student_view(grade), kept) == render_report_page(build_student_view(grade), drawn)
    assert not any(plot.kind in ("conversation", "talk") for plot in list_plots(grade))
    assert "IMG_DATA::{left, right}" in Reader(render_report_page(build_student_view(grade), {})).text


def test_the_parts_of_a_report_are_its_body_and_two_files_that_are_the_same_for_all() -> None:
    shapes, line = (
        render_report_parts(build_student_view(made()), {}) for made in (build.shape_grade, build.line_follower_grade)
    )
    assert shapes.body != line.body
    assert (shapes.style, shapes.script) == (line.style, line.script) == (load_report_style(), load_report_script())
    reader = Reader(shapes.body)
    assert reader.tags.isdisjoint({"html", "head", "body", "main", "style", "meta"})
    assert reader.values("script", "type") == ["application/json"]
    assert reader.scripts == 1
    whole = render_report_page(build_student_view(build.shape_grade()), {})
    assert shapes.body in whole
    assert f"<title>{shapes.title}</title>" in whole


def test_students_see_nothing_hidden_and_staff_see_all() -> None:
    grade = build.hidden_grade()
    plots = draw_all_plots(grade)
    student, staff = (
        render_report_page(build_student_view(grade), plots),
        render_report_page(build_staff_view(grade), plots),
    )
    assert "SECRET" not in student
    assert "Other parts of the assignment are marked but not shown" in student
    assert "SECRETCRITERION" in staff
    assert "SECRETSCENARIO" in staff
    assert "staff only" in staff
    assert "staff only" not in student
    for seed in ("1004", "1005"):
        assert f">{seed}<" not in student
        assert f">{seed}<" in staff
    hidden_images = {base64.b64encode(data).decode() for name, data in plots.items() if name.endswith("-staff")}
    assert hidden_images
    assert not any(image in student for image in hidden_images)
    first_hidden = replace(grade, trials=grade.trials[::-1])
    assert "SECRETSCENARIO" not in render_report_page(build_student_view(first_hidden), {})
    after = render_report_page(build_student_view(grade, frozenset({"visible", "hidden"})), plots)
    assert "SECRETCRITERION" in after


def test_headline_criteria_and_stamp() -> None:
    reader = Reader(render_report_page(build_student_view(build.shape_grade()), {}))
    assert "7of 8 marks" in reader.text
    assert "5 / 6" in reader.text
    assert "The most marks are available for “Names the right shape”" in reader.text
    assert reader.text.count("sandbox: process limits only") == 1
    assert "First failed in each-shape, trial 5" in reader.text
    assert build.shape_grade().assignment_version in reader.text
    assert "Robomark 0.1.0" in reader.text
    strong = Reader(
        render_report_page(
            build_student_view(replace(build.shape_grade(), sandbox="process limits, landlock, seccomp")), {}
        )
    )
    assert strong.text.count("sandbox: ") == 0


def test_faults_show_line_numbers_and_the_students_own_line() -> None:
    with_source = Reader(
        render_report_page(build_student_view(build.faulty_grade()), {}, build.faulty_submission())
    ).text
    assert "Robot program (robot.py), line 3" in with_source
    assert "3    print(1 / (i - i))" in with_source
    assert "Did you mean parser?" in with_source
    without = Reader(render_report_page(build_student_view(build.faulty_grade()), {})).text
    assert "Robot program, line 3" in without
    assert "print(1 / (i - i))" not in without


def test_a_line_number_outside_the_file_gives_no_excerpt() -> None:
    submission = build.faulty_submission()
    assert submission.responder is not None
    short = replace(submission, responder=replace(submission.responder, text=""))
    groups = build_page(build_staff_view(build.faulty_grade()), short).faults
    assert groups[0].excerpt == ()
    assert groups[0].where == "Responder (responder.py), line 2"


def test_time_that_was_up_is_told_and_not_called_wrong() -> None:
    time_up = Fault(10.0, Verdict.TIME_LIMIT, "program", "the program was still running after 10 seconds")
    grade = build.line_follower_grade()
    recording = replace(grade.trials[0].recording, faults=(time_up,))
    ended = replace(grade, trials=(replace(grade.trials[0], recording=recording),))
    reader = Reader(render_report_page(build_student_view(ended), {}))
    titles = [words for words in reader.text.split("\n") if words in ("Result", "Errors")]
    assert "Result" in titles
    assert "Errors" not in titles
    assert ("10.00", "stopped") in [(entry.t, entry.kind) for entry in build_timeline(recording)]
    assert "\nErrors\n" in Reader(render_report_page(build_student_view(build.faulty_grade()), {})).text


def test_timelines_are_capped_and_say_so() -> None:
    entries = build_timeline(build.hostile_grade().trials[0].recording)
    assert len(entries) == 56
    assert [entry.text for entry in entries if not entry.t] == ["2,949 more entries are not shown"]


def test_messages_name_images_and_losses() -> None:
    assert "IMG_DATA::{left, right}" in Reader(render_report_page(build_student_view(build.shape_grade()), {})).text
    assert "never (lost)" in Reader(render_report_page(build_student_view(build.faulty_grade()), {})).text
    astray = Reader(render_report_page(build_student_view(build.astray_grade()), {})).text
    for words in ("lost by chance", "out of range, 1601 mm away", "facing away, 91° off", "blocked"):
        assert f"never ({words})" in astray
    assert "0.50 s (duplicated, corrupted to PY::7)" in astray


@pytest.mark.parametrize("verdict", list(Verdict))
def test_a_grade_with_nothing_in_it_still_has_a_page(verdict: Verdict) -> None:
    grade = build.faulty_grade()
    empty = replace(build.line_follower_recording(0), verdict=verdict)
    trials = (replace(grade.trials[0], recording=empty),)
    Reader(render_report_page(build_student_view(replace(grade, trials=trials, criteria=())), {}))
    bare: Grade = replace(grade, trials=(), criteria=())
    assert list_plots(bare) == ()
    assert "0of 0 marks" in Reader(render_report_page(build_student_view(bare), draw_all_plots(bare))).text


def test_batch_index_links_and_escapes() -> None:
    rows = [
        BatchRow("s1", Decimal("2.50"), Decimal(8), Verdict.PROGRAM_ERROR, "reports/s 1.html"),
        BatchRow("<b>s2", Decimal(0), Decimal(8), Verdict.FINISHED, "javascript:alert(1)"),
        BatchRow("s3", note=build.HOSTILE),
        BatchRow("s4", Decimal(8), Decimal(8), Verdict.FINISHED, "//evil.example/x"),
    ]
    assert "ada_<wbr>l@<wbr>ou.<wbr>uk&lt;b&gt;" in render_batch_index([BatchRow("ada_l@ou.uk<b>")])
    reader = Reader(render_batch_index(rows, "Batch <1>", "process limits only"))
    assert reader.values("a", "href") == ["reports/s%201.html", "javascript%3Aalert%281%29", "evil.example/x"]
    assert reader.tags <= TAGS
    assert "2.5 / 8" in reader.text
    assert "0 / 8" in reader.text
    assert "not graded" in reader.text
    assert "3 of 4 graded" in reader.text


def test_an_excused_criterion_is_neither_won_nor_lost() -> None:
    grade = build.line_follower_grade()
    adjustment = StaffAdjustment(Decimal(0), grade.criteria[0].max_marks, "The floor was wet.", excused=True)
    first = replace(grade.criteria[0], marks=Decimal(0), max_marks=Decimal(0), set_by_hand=adjustment)
    view = build_student_view(replace(grade, criteria=(first, *grade.criteria[1:])))
    assert build_page(view).criteria[0].state == "excused"
    lost = [loss["title"] for trial in build_grade_replay(view)["trials"] for loss in trial["lost"]]
    assert first.title not in lost
