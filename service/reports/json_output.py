"""A grade as the JSON that ``robomark grade --format json`` prints.

It shows all of the grade it is given; pass it a student's view where a student reads it.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from decimal import Decimal
from typing import Any

from service.grading.grade import Accuracy, Grade
from service.reports.trace import storable

SCHEMA = 1


def json_document(grade: Grade) -> dict[str, Any]:
    """``grade`` as plain data; marks are numbers, times seconds, ``accuracy`` None without a classification."""
    return {
        "schema": SCHEMA,
        "assignment": grade.assignment,
        "marks": json_number(grade.marks),
        "max_marks": json_number(grade.max_marks),
        "verdict": grade.verdict.value,
        "criteria": [
            {
                "id": result.id,
                "title": storable(result.title),
                "marks": json_number(result.marks),
                "max_marks": json_number(result.max_marks),
                "message": storable(result.message),
                **({"for_staff": storable(result.for_staff)} if result.for_staff else {}),
            }
            for result in grade.criteria
        ],
        "trials": [
            {
                "scenario": trial.scenario,
                "seed": trial.seed,
                "verdict": trial.verdict.value,
                "sha256": trial.recording.sha256,
                "spoken": [storable(line.text) for line in trial.recording.spoken],
                "messages": [
                    {"t": message.t, "sender": message.sender, "text": storable(message.text)}
                    for message in trial.recording.messages
                ],
            }
            for trial in grade.trials
        ],
        "accuracy": _accuracy(grade.accuracy),
        **({"cost": asdict(grade.cost)} if grade.cost else {}),
    }


def json_text(grade: Grade) -> str:
    """The document as indented ASCII JSON."""
    return json.dumps(json_document(grade), indent=2, allow_nan=False)


def json_number(value: Decimal) -> int | float:
    """A Decimal as JSON writes it: whole numbers without a point."""
    return int(value) if value == value.to_integral_value() else float(value)


def _accuracy(accuracy: Accuracy | None) -> dict[str, float | int] | None:
    if accuracy is None:
        return None
    return {"value": accuracy.value, "low": accuracy.low, "high": accuracy.high, "n": accuracy.n}
