"""The single cause: its content, the affected criteria, and that every format shows it once, first and equally."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from decimal import Decimal
from html import unescape

import pytest

import report_builders as build
from service.grading.grade import CriterionResult, Evidence, Grade, StaffAdjustment
from service.grading.judging.message_parts import describe_line
from service.reports.diagnosis import diagnose
from service.reports.formats.gradescope import build_gradescope_document
from service.reports.formats.json_output import build_json_document
from service.reports.formats.junit import render_junit
from service.reports.formats.text import render_plain_text
from service.reports.html import render_report_page
from service.reports.page import build_page
from service.reports.verdict_sentences import FULL_MARKS, describe_verdict
from service.reports.view import build_gradebook_view, build_staff_view, build_student_view
from sim.recording import Fault, Verdict
from sim.sentences import Sentence

ERROR = "NameError: name 'pasrer' is not defined"
FAULT = f"{ERROR} (line 2)"
HINT = Sentence(
    "%(place)s: %(problem)s. Did you mean parser?",
    place=describe_line("responder.py", 2),
    problem=ERROR,
    fault=FAULT,
)


def criterion(name: str, *evidence: Evidence, marks: int = 0, message: str = "It went otherwise.") -> CriterionResult:
    return CriterionResult(name, name.title(), Decimal(marks), Decimal(2), message, evidence=evidence)


def missed(trial: int, t: float | None, message: str = "Expected this, but it was that.") -> Evidence:
    return Evidence(trial, False, message, t)


def hinted(*hints: str, criteria: tuple[CriterionResult, ...] = ()) -> Grade:
    grade = build.faulty_grade()
    return replace(grade, hints=hints, criteria=criteria or grade.criteria)


def test_a_hint_is_the_cause_and_its_line_the_excerpt_and_the_next_step() -> None:
    diagnosis = diagnose(hinted(HINT, "another thing"), build.faulty_submission())
    assert diagnosis.cause == f"Line 2 of responder.py: {ERROR}. Did you mean parser?"
    assert diagnosis.next_step.startswith("Fix line 2 of responder.py")
    assert diagnosis.further == ("Another thing.",)
    assert diagnosis.excerpt is not None
    assert diagnosis.excerpt.name == "responder.py"
    assert [line.number for line in diagnosis.excerpt.lines if line.marked] == [2]
    assert diagnose(hinted(HINT)).excerpt is None


@pytest.mark.parametrize(
    ("evidence", "is_lost"),
    [
        ((missed(1, None),), True),
        ((missed(1, 9.0),), True),
        ((missed(1, 0.0),), False),  # before the error
        (
            (missed(1, 0.0, Sentence("no answer: %(fault)s", fault=FAULT)),),
            True,
        ),  # yet caused by it
        ((missed(0, None),), False),  # in a trial without it
        ((missed(0, None), missed(1, None)), False),
        ((), False),
    ],
)
def test_what_comes_after_an_error_where_it_came_is_lost_through_it(
    evidence: tuple[Evidence, ...], is_lost: bool
) -> None:
    whole = criterion("whole", marks=2)
    rule = diagnose(hinted(HINT, criteria=(whole, criterion("asked", *evidence))))
    assert rule.lost == (frozenset({1}) if is_lost else frozenset())


def test_a_text_that_is_nearly_right_costs_only_what_asks_for_it() -> None:
    says = criterion("says", message='Expected "all done" at the end, but it said "all donne".')
    drives = criterion("drives", message="Expected the robot to drive 300 mm.")
    hint = Sentence(
        'line 8 of robot.py says "all donne"; expected %(expected)s', expected='"all done"', criterion="says"
    )
    grade = replace(build.line_follower_grade(), hints=(hint,), criteria=(drives, says))
    assert diagnose(grade).lost == {1}


def test_a_message_that_was_never_one_costs_what_has_no_marks_at_all() -> None:
    hint = 'line 5 of robot.py prints "py::0", which is not sent as a message; expected "PY::" at its very start'
    criteria = (criterion("sends"), criterion("drives", marks=1), criterion("ends", marks=2))
    assert diagnose(replace(build.line_follower_grade(), hints=(hint,), criteria=criteria)).lost == {0}


def test_without_a_hint_the_first_error_is_the_cause() -> None:
    diagnosis = diagnose(build.faulty_grade(), build.faulty_submission())
    assert diagnosis.cause.startswith(f"Responder (responder.py), line 2: {ERROR}.")
    assert diagnosis.excerpt is not None


def test_time_that_was_up_is_the_cause_only_where_it_cost_marks() -> None:
    words = "the program was still running after 10 seconds"
    grade = build.line_follower_grade()
    recording = replace(grade.trials[0].recording, faults=(Fault(10.0, Verdict.TIME_LIMIT, "program", words),))
    ended = replace(grade, trials=(replace(grade.trials[0], recording=recording),))
    message = Sentence("Expected an end, but %(fault)s.", fault=words)
    cost = replace(ended, criteria=(criterion("ends", missed(0, 10.0, message)),))
    other = replace(ended, criteria=(criterion("line", missed(0, 1.5, "Expected 65 mm, but it was 72 mm off.")),))
    assert diagnose(cost).cause == "Your program was still running at the end of the simulated time."
    assert diagnose(other).cause == "Expected 65 mm, but it was 72 mm off, at 1.50 s."


def test_a_missing_part_comes_before_the_time_that_was_up_for_want_of_it() -> None:
    words = "The program was still running after 10 seconds"
    grade = build.shape_grade()
    recording = replace(grade.trials[0].recording, faults=(Fault(10.0, Verdict.TIME_LIMIT, "program", words),))
    graded = replace(
        grade,
        hints=(),
        missing="responder.py",
        trials=(replace(grade.trials[0], recording=recording), *grade.trials[1:]),
        criteria=(
            criterion("ends", missed(0, 10.0, Sentence("%(fault)s.", fault=words))),
            criterion("names", missed(0, None), message=Sentence("There is no %(file)s.", file="responder.py")),
        ),
    )
    diagnosis = diagnose(graded)
    assert diagnosis.cause.startswith("There is no responder.py")
    assert diagnosis.next_step.startswith("Submit responder.py")
    assert diagnosis.lost == {1}


def test_the_dearest_criterion_is_the_cause_with_those_that_failed_where_it_did() -> None:
    grade = build.line_follower_grade()
    end = grade.trials[0].recording.end_t
    line = replace(criterion("line", missed(0, 1.5)), max_marks=Decimal(4))
    closer = criterion("closer", missed(0, 1.5))
    later = criterion("later", missed(0, 2.5))
    at_the_end = (criterion("stops", missed(0, end)), criterion("says", missed(0, end)))
    assert diagnose(replace(grade, criteria=(closer, line, later, *at_the_end))).lost == {0, 1}
    assert diagnose(replace(grade, criteria=(*at_the_end, later))).lost == {0}


def test_what_was_set_by_hand_is_no_cause_and_keeps_its_words() -> None:
    by_hand = StaffAdjustment(Decimal(0), Decimal(2), "It drove well.", excused=False)
    dear = replace(criterion("dear", missed(0, 1.5), message="Adjusted by staff from 0 to 1."), set_by_hand=by_hand)
    full = replace(dear, id="full", marks=Decimal(2), message="Adjusted by staff from 0 to 2.")
    grade = replace(build.line_follower_grade(), criteria=(replace(dear, marks=Decimal(1)), full, criterion("cheap")))
    assert diagnose(grade).lost == {2}
    for line, marks in zip(build_page(build_staff_view(grade)).others, (1, 2), strict=True):
        assert line.told.startswith(f"Adjusted by staff from 0 to {marks}: It drove well.")


def test_the_same_confusions_are_the_same_cause() -> None:
    grade = build.shape_grade()
    first = grade.criteria[0]
    diagnosis = diagnose(replace(grade, criteria=(first, replace(first, id="again"), grade.criteria[1])))
    assert (
        diagnosis.cause
        == "5 of 6 images were identified correctly: “upwards facing triangle” was identified as “diamond”."
    )
    assert diagnosis.lost == {0, 1}


@pytest.mark.parametrize("verdict", [Verdict.HOST_ERROR, Verdict.ASSIGNMENT_ERROR])
def test_what_is_ours_is_told_before_any_hint(verdict: Verdict) -> None:
    grade = hinted(HINT)
    broken = replace(grade.trials[0], recording=replace(grade.trials[0].recording, verdict=verdict))
    diagnosis = diagnose(replace(grade, trials=(broken,)))
    assert diagnosis.next_step == describe_verdict(verdict).next_step
    assert diagnosis.lost == frozenset()


def test_full_marks_have_no_cause() -> None:
    grade = build.shape_grade()
    full = replace(grade, criteria=tuple(replace(each, marks=each.max_marks) for each in grade.criteria))
    diagnosis = diagnose(full)
    assert (diagnosis.cause, diagnosis.lost, diagnosis.excerpt) == (FULL_MARKS, frozenset(), None)


WRITERS: dict[str, Callable[[Grade], str]] = {
    "text": lambda grade: render_plain_text(build_staff_view(grade), build.faulty_submission()),
    "gradescope": lambda grade: build_gradescope_document(build_gradebook_view(grade), build.faulty_submission())[
        "output"
    ],
    "junit": lambda grade: unescape(render_junit(build_staff_view(grade), build.faulty_submission())),
    "page": lambda grade: unescape(render_report_page(build_student_view(grade), {}, build.faulty_submission())),
}


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_tells_cause_lines_and_next_step_in_this_order(name: str) -> None:
    grade = hinted(HINT)
    diagnosis = diagnose(grade, build.faulty_submission())
    assert diagnosis.excerpt is not None
    (line,) = (each.text.strip() for each in diagnosis.excerpt.lines if each.marked)
    text = " ".join(WRITERS[name](grade).split())
    assert text.count(diagnosis.cause) == 1 + (name == "junit")  # junit contains the hints as well
    after = [text.index(each) for each in (diagnosis.cause, diagnosis.next_step)]
    assert after == sorted(after)
    assert line in text
    if name != "gradescope":
        assert after[-1] < text.index(grade.criteria[0].title)


def test_json_and_page_say_the_same() -> None:
    grade, submission = hinted(HINT), build.faulty_submission()
    document = json.loads(json.dumps(build_json_document(build_staff_view(grade), submission)))
    page = build_page(build_staff_view(grade), submission)
    assert document["cause"] == page.diagnosis.cause
    assert document["next_step"] == page.diagnosis.next_step
    assert document["excerpt"]["of"] == "responder.py"
    assert [line["number"] for line in document["excerpt"]["lines"] if line["marked"]] == [2]
    assert [grade.criteria[index].id for index in sorted(page.diagnosis.lost)] == document["lost_by_cause"]


def test_what_was_lost_through_the_cause_has_one_line_and_the_others_their_own_words() -> None:
    criteria = (criterion("asked", missed(1, None)), criterion("drives", missed(0, 1.0, "Expected 5 mm.")))
    page = build_page(build_student_view(hinted(HINT, criteria=criteria)))
    assert [(line.title, line.told) for line in page.lost] == [("Asked", "")]
    assert [(line.title, line.told[:14]) for line in page.others] == [("Drives", "Expected 5 mm,")]


def test_a_student_reads_no_cause_of_hidden_trials() -> None:
    diagnosis = diagnose(build_student_view(build.hidden_grade()).grade)
    assert "SECRET" not in diagnosis.cause + diagnosis.next_step
