"""Causes that reruns showed, in the reports: before the next step, and only for readers who may see them."""

from __future__ import annotations

import json
from dataclasses import replace
from decimal import Decimal
from html import unescape

import pytest

from report_builders import line_follower_grade
from service.grading.grade import Grade, ShownCause
from service.grading.judging.message_parts import WITHHELD_MARKS, describe_line
from service.language import load_language
from service.reports.diagnosis import diagnose
from service.reports.formats.json_output import build_json_document
from service.reports.formats.text import render_plain_text
from service.reports.html import render_report_page
from service.reports.view import build_staff_view, build_student_view
from sim.sentences import Sentence, join_sentences

pytestmark = pytest.mark.fast

PROOF = Sentence("With %(conditions)s, the same submission %(result)s.", conditions="x", result="y")
STEP = Sentence("Fix your program, then submit again.")
GENERAL_STEP = "Compare each criterion with the actions of your robot."


def lost() -> Grade:
    """Return a grade that completed, lost marks and has no hints, so that its next step is the general one."""
    grade = replace(line_follower_grade(), hints=())
    assert diagnose(grade).next_step.endswith(GENERAL_STEP)
    return grade


def with_cause(grade: Grade, number: int = 0, **changes: object) -> Grade:
    """Return the grade with a cause of the criterion with this number among those that lost marks."""
    lost_ids = [result.id for result in grade.criteria if result.marks < result.max_marks]
    cause = ShownCause(lost_ids[number], PROOF, STEP)
    return replace(grade, causes=(*grade.causes, replace(cause, **changes)))  # type: ignore[arg-type]


def test_proof_and_step_replace_the_general_step() -> None:
    diagnosis = diagnose(with_cause(lost()))
    assert (diagnosis.proof, diagnosis.next_step) == (PROOF, STEP)
    for text in (
        render_plain_text(build_staff_view(with_cause(lost()))),
        render_report_page(build_student_view(with_cause(lost())), {}),
    ):
        assert "Shown by running it again:" in text
        assert str(PROOF) in text
        assert GENERAL_STEP not in text


def test_json_has_causes_and_proof() -> None:
    document = build_json_document(build_staff_view(with_cause(lost())))
    assert document["proof"] == PROOF
    assert [each["text"] for each in document["causes"]] == [PROOF]
    assert "causes" not in json.dumps(build_json_document(build_staff_view(lost())))


def test_students_see_no_causes_for_staff() -> None:
    grade = with_cause(lost(), for_staff=True)
    assert diagnose(build_student_view(grade).grade).next_step.endswith(GENERAL_STEP)
    assert str(PROOF) not in render_report_page(build_student_view(grade), {})
    assert diagnose(build_staff_view(grade).grade).proof == PROOF


def test_causes_are_translated() -> None:
    german = load_language("de")
    diagnosis = diagnose(build_student_view(with_cause(lost()), language=german).grade, language=german)
    assert diagnosis.next_step == "Korrigieren Sie Ihr Programm und reichen Sie dann erneut ein."


def test_hints_about_a_part_that_loses_nothing_are_dropped() -> None:
    places = (describe_line("responder.py", 3), describe_line("robot.py", 4))
    hints = tuple(Sentence("%(place)s: something.", place=place) for place in places)
    grade = replace(lost(), hints=hints)
    assert diagnose(grade).cause.startswith("Line 3 of responder.py")
    assert diagnose(with_cause(grade, files=("robot.py",))).cause.startswith("Line 4 of robot.py")
    assert diagnose(with_cause(grade, files=("responder.py",))).cause.startswith("Line 3 of responder.py")


@pytest.mark.parametrize(
    ("name", "line", "step"),
    [
        ("robot.py", 4, "Fix line 4 of robot.py, run it without submitting, then submit again."),
        ("robot.py", 3, "Check line 3 of robot.py, then submit again."),
        ("cell 2", 3, "Fix line 4 of cell 2, run it without submitting, then submit again."),
    ],
)
def test_the_step_names_the_line_that_reruns_showed_if_a_hint_is_about_another(name: str, line: int, step: str) -> None:
    hint = Sentence("%(place)s: something.", place=describe_line(name, 4))
    shown = Sentence("Check line %(line)s of %(file)s, then submit again.", line=line, file="robot.py")
    assert diagnose(with_cause(replace(lost(), hints=(hint,)), next_step=shown)).next_step == step


def test_affected_criteria_without_marks_because_of_another_say_so() -> None:
    hint = Sentence("%(place)s: something.", place=describe_line("robot.py", 4))
    first, *others = lost().criteria
    reason = Sentence(WITHHELD_MARKS, title="Follows the line")
    withheld = replace(first, marks=Decimal(0), message=join_sentences("As expected in all 4 trials.", reason))
    grade = replace(lost(), hints=(hint,), criteria=(withheld, *others))
    assert 0 in diagnose(grade).lost
    reading = " ".join(render_plain_text(build_staff_view(grade)).split())
    assert str(reason) in reading
    assert "As expected in all 4 trials" not in reading
    german = load_language("de")
    translated = german.translate_sentence(reason)
    assert translated != reason
    page = unescape(render_report_page(build_student_view(grade, language=german), {}))
    assert translated in page
