"""A grade, or the grades of a batch, as JSON.

It contains everything in the view, for every reader.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from service.grading.grade import Accuracy, Grade, SetByHand
from service.reports.cause import Excerpt, diagnose
from service.reports.formats.registry import document, refusal, table
from service.reports.readable import json_number
from service.reports.rows import TableRow
from service.reports.trace import agent_messages, storable
from service.reports.verdict_sentences import hints_of
from service.reports.view import View, staff_view
from sim.recording import Message, Recording
from submissions.submission import Submission

SCHEMA = 1


def json_document(view: View, submission: Submission | None = None) -> dict[str, Any]:
    """Return the grade as plain data: marks are numbers, times seconds, ``accuracy`` None without a classification.

    The source lines in ``excerpt`` need the ``submission``.
    """
    grade = view.grade
    diagnosis = diagnose(grade, submission)
    return {
        "schema": SCHEMA,
        "assignment": grade.assignment,
        "marks": json_number(grade.marks),
        "max_marks": json_number(grade.max_marks),
        "verdict": grade.verdict.value,
        "cause": storable(diagnosis.cause),
        "next_step": storable(diagnosis.next_step),
        **({"excerpt": _excerpt(diagnosis.excerpt)} if diagnosis.excerpt else {}),
        "lost_by_cause": [grade.criteria[index].id for index in sorted(diagnosis.lost)],
        **({"hints": [storable(hint) for hint in hints_of(grade)]} if grade.hints else {}),
        "criteria": [
            {
                "id": result.id,
                "title": storable(result.title),
                "marks": json_number(result.marks),
                "max_marks": json_number(result.max_marks),
                "message": storable(result.message),
                **({"for_staff": storable(result.for_staff)} if result.for_staff else {}),
                **({"set_by_hand": _by_hand(result.set_by_hand)} if result.set_by_hand is not None else {}),
            }
            for result in grade.criteria
        ],
        "trials": [
            {
                "scenario": trial.scenario,
                "seed": trial.seed,
                "verdict": trial.verdict.value,
                "sha256": trial.recording.sha256,
                **_said(trial.recording),
                **({"partner": _said(trial.recording.partner)} if trial.recording.partner is not None else {}),
                **agent_messages(trial.recording),
                "notes": [storable(note) for note in trial.recording.notes],
            }
            for trial in grade.trials
        ],
        "accuracy": _accuracy(grade.accuracy),
        "notes": [storable(note) for note in grade.notes],
        **({"comments": [asdict(comment) for comment in grade.comments]} if grade.comments else {}),
        **({"missing": grade.missing} if grade.missing else {}),
        **({"cost": asdict(grade.cost)} if grade.cost else {}),
    }


@document("json", ".json", staff_view)
def json_text(view: View, submission: Submission | None = None) -> str:
    """Return the document as indented ASCII JSON."""
    return json.dumps(json_document(view, submission), indent=2, allow_nan=False) + "\n"


@refusal("json")
def json_refusal(row: TableRow[Grade]) -> str:
    """Return the student and the reason of a rejection."""
    return json.dumps(_of_several(row.shown(staff_view)), indent=2) + "\n"


@table("json", ".json", staff_view)
def json_list(rows: Sequence[TableRow[View]]) -> str:
    """Return the documents of several rows, each with its student and file, without marks if there is no grade."""
    return json.dumps([_of_several(row) for row in rows], indent=2) + "\n"


def _of_several(row: TableRow[View]) -> dict[str, Any]:
    student = row.student
    who = {"student": student.id, "name": student.name, "email": student.email, "file": row.source}
    why = {"reason": storable(row.reason)} if row.reason else {}
    if row.grade is None:
        none = {"schema": SCHEMA, "assignment": row.assignment, "marks": None, "max_marks": None, "verdict": None}
        return {**who, **why, **none}
    return {**who, **why, **json_document(row.grade)}


def _excerpt(excerpt: Excerpt) -> dict[str, Any]:
    lines = [{"number": line.number, "text": storable(line.text), "marked": line.marked} for line in excerpt.lines]
    return {"of": storable(excerpt.name), "lines": lines}


def _by_hand(said: SetByHand) -> dict[str, Any]:
    """Return a staff adjustment: the grader's marks (None if it could not judge), the maximum, and the change."""
    graded = None if said.graded is None else json_number(said.graded)
    return {"from": graded, "of": json_number(said.worth), "excused": said.excused, "reason": storable(said.reason)}


def _said(recording: Recording) -> dict[str, Any]:
    return {
        "spoken": [storable(line.text) for line in recording.spoken],
        "messages": [_message(message) for message in recording.messages],
    }


def _message(message: Message) -> dict[str, Any]:
    """Return a message with its time and, if the channel lost or corrupted it, how, and the robot's position."""
    words: dict[str, Any] = {"t": message.t, "sender": message.sender, "text": storable(message.text)}
    if message.lost:
        words["lost"] = message.lost
        if message.distance is not None:
            words |= {"distance": message.distance, "angle": message.angle}
    if message.arrived_as is not None:
        words["arrived_as"] = storable(message.arrived_as)
    return words


def _accuracy(accuracy: Accuracy | None) -> dict[str, float | int] | None:
    if accuracy is None:
        return None
    return {"value": accuracy.value, "low": accuracy.low, "high": accuracy.high, "n": accuracy.n}
