"""Moodle's rules for files that are uploaded to it, implemented again for the tests."""

from __future__ import annotations

import csv
import io
import re
import zipfile
from decimal import Decimal


def imported_by_moodle(text: str) -> dict[str, tuple[Decimal | None, str]]:
    """Apply Moodle's worksheet rules: rows are found by Identifier, and need a grade that is a number in range."""
    lines = list(csv.reader(io.StringIO(text.removeprefix("\ufeff"))))
    places = {name: lines[0].index(name) for name in ("Identifier", "Grade", "Last modified (grade)")}
    feedback = lines[0].index("Feedback comments")
    grades = {}
    for line in lines[1:]:
        assert len(line) == len(lines[0])
        number = re.fullmatch(r"Participant (\d+)", line[places["Identifier"]])
        assert number is not None
        grade = Decimal(line[places["Grade"]]) if line[places["Grade"]] else None
        assert grade is None or 0 <= grade <= Decimal(line[lines[0].index("Maximum Grade")])
        grades[number[1]] = (grade, line[feedback])
    return grades


def feedback_taken_by_moodle(archive: zipfile.ZipFile) -> dict[str, str]:
    """Apply Moodle's rules for a feedback zip: a part of the path identifies the student, the rest is the file name."""
    feedback = {}
    for path in archive.namelist():
        for part in path.split("/"):
            pieces = part.split("_", 4)
            if len(pieces) < 5 or not pieces[1].isdecimal():
                continue
            assert pieces[2] in ("assignsubmission", "assignfeedback")
            assert pieces[3] == "file"
            feedback[pieces[1]] = path.split("/")[-1]
    return feedback
