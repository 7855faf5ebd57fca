"""A grade, or the grades of a batch, as JSON.

It contains everything in the view, for every reader.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from service.grading.grade import Accuracy, Grade, PoolValue, ShownCause, StaffAdjustment
from service.reports.diagnosis import Excerpt, diagnose
from service.reports.display_text import to_json_number
from service.reports.formats.registry import register_document, register_refusal, register_table
from service.reports.rows import TableRow
from service.reports.trace import agent_messages_to_json, replace_surrogates
from service.reports.verdict_sentences import format_hints
from service.reports.view import View, build_staff_view
from sim.recording import Message, Recording
from submissions.submission import Submission

SCHEMA = 1


def build_json_document(view: View, submission: Submission | None = None) -> dict[str, Any]:
    """Return the grade as plain data: marks are numbers, times seconds, ``accuracy`` None without a classification.

    The source lines in ``excerpt`` need the ``submission``.
    """
    grade = view.grade
    diagnosis = diagnose(grade, submission)
    return {
        "schema": SCHEMA,
        "assignment": grade.assignment,
        "marks": to_json_number(grade.marks),
        "max_marks": to_json_number(grade.max_marks),
        "verdict": grade.verdict.value,
        "cause": replace_surrogates(diagnosis.cause),
        "next_step": replace_surrogates(diagnosis.next_step),
        **({"proof": replace_surrogates(diagnosis.proof)} if diagnosis.proof else {}),
        **({"excerpt": _excerpt_to_json(diagnosis.excerpt)} if diagnosis.excerpt else {}),
        "lost_by_cause": [grade.criteria[index].id for index in sorted(diagnosis.lost)],
        **({"hints": [replace_surrogates(hint) for hint in format_hints(grade)]} if grade.hints else {}),
        "criteria": [
            {
                "id": result.id,
                "title": replace_surrogates(result.title),
                "marks": to_json_number(result.marks),
                "max_marks": to_json_number(result.max_marks),
                "message": replace_surrogates(result.message),
                **({"pool": _pool_to_json(result.pool)} if result.pool is not None else {}),
                **({"for_staff": replace_surrogates(result.for_staff)} if result.for_staff else {}),
                **({"set_by_hand": _adjustment_to_json(result.set_by_hand)} if result.set_by_hand is not None else {}),
            }
            for result in grade.criteria
        ],
        **({"causes": [_cause_to_json(cause) for cause in grade.causes]} if grade.causes else {}),
        "trials": [
            {
                "scenario": trial.scenario,
                "seed": trial.seed,
                "verdict": trial.verdict.value,
                "sha256": trial.recording.sha256,
                **_recording_to_json(trial.recording),
                **(
                    {"partner": _recording_to_json(trial.recording.partner)}
                    if trial.recording.partner is not None
                    else {}
                ),
                **agent_messages_to_json(trial.recording),
                "notes": [replace_surrogates(note) for note in trial.recording.notes],
            }
            for trial in grade.trials
        ],
        "accuracy": _accuracy_to_json(grade.accuracy),
        "notes": [replace_surrogates(note) for note in grade.notes],
        **({"comments": [asdict(comment) for comment in grade.comments]} if grade.comments else {}),
        **({"missing": grade.missing} if grade.missing else {}),
        **({"cost": asdict(grade.cost)} if grade.cost else {}),
    }


@register_document("json", ".json", build_staff_view)
def render_json(view: View, submission: Submission | None = None) -> str:
    """Return the document as indented ASCII JSON."""
    return json.dumps(build_json_document(view, submission), indent=2, allow_nan=False) + "\n"


@register_refusal("json")
def render_json_refusal(row: TableRow[Grade]) -> str:
    """Return the student and the reason of a rejection."""
    return json.dumps(_row_to_json(row.apply_view(build_staff_view)), indent=2) + "\n"


@register_table("json", ".json", build_staff_view)
def render_json_list(rows: Sequence[TableRow[View]]) -> str:
    """Return the documents of several rows, each with its student and file, without marks if there is no grade."""
    return json.dumps([_row_to_json(row) for row in rows], indent=2) + "\n"


def _row_to_json(row: TableRow[View]) -> dict[str, Any]:
    student = row.student
    student_fields = {"student": student.id, "name": student.name, "email": student.email, "file": row.source}
    reason_field = {"reason": replace_surrogates(row.reason)} if row.reason else {}
    if row.grade is None:
        empty_grade = {
            "schema": SCHEMA,
            "assignment": row.assignment,
            "marks": None,
            "max_marks": None,
            "verdict": None,
        }
        return {**student_fields, **reason_field, **empty_grade}
    return {**student_fields, **reason_field, **build_json_document(row.grade)}


def _excerpt_to_json(excerpt: Excerpt) -> dict[str, Any]:
    lines = [
        {"number": line.number, "text": replace_surrogates(line.text), "marked": line.marked} for line in excerpt.lines
    ]
    return {"of": replace_surrogates(excerpt.name), "lines": lines}


def _pool_to_json(pool: PoolValue) -> dict[str, Any]:
    """Return the value over a pool; ``least`` and ``most`` are its bounds, from 0 to 1."""
    return {"trials": pool.size, "run": pool.drawn, "least": pool.least, "most": pool.most, "exact": pool.is_exact}


def _adjustment_to_json(adjustment: StaffAdjustment) -> dict[str, Any]:
    """Return a staff adjustment: the grader's marks (None if it could not judge), the maximum, and the change."""
    graded_marks = None if adjustment.graded is None else to_json_number(adjustment.graded)
    return {
        "from": graded_marks,
        "of": to_json_number(adjustment.worth),
        "excused": adjustment.excused,
        "reason": replace_surrogates(adjustment.reason),
    }


def _cause_to_json(cause: ShownCause) -> dict[str, Any]:
    """Return what reruns showed for a criterion."""
    return {
        "criterion": cause.criterion,
        "text": replace_surrogates(cause.text),
        "next_step": replace_surrogates(cause.next_step),
        "for_staff": cause.for_staff,
    }


def _recording_to_json(recording: Recording) -> dict[str, Any]:
    return {
        "spoken": [replace_surrogates(line.text) for line in recording.spoken],
        "messages": [_message_to_json(message) for message in recording.messages],
    }


def _message_to_json(message: Message) -> dict[str, Any]:
    """Return a message with its time and, if the channel lost or corrupted it, how, and the robot's position."""
    data: dict[str, Any] = {"t": message.t, "sender": message.sender, "text": replace_surrogates(message.text)}
    if message.lost:
        data["lost"] = message.lost
        if message.distance is not None:
            data |= {"distance": message.distance, "angle": message.angle}
    if message.arrived_as is not None:
        data["arrived_as"] = replace_surrogates(message.arrived_as)
    return data


def _accuracy_to_json(accuracy: Accuracy | None) -> dict[str, float | int] | None:
    if accuracy is None:
        return None
    return {"value": accuracy.value, "low": accuracy.low, "high": accuracy.high, "n": accuracy.n}
