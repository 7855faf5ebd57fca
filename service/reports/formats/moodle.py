"""Imports for Moodle: its grade import, its offline grading worksheet, and a zip of feedback files.

Moodle identifies a submission by the number in the names of its download and in the worksheet's column Identifier.
"""

from __future__ import annotations

import re
import zipfile
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from decimal import Decimal, InvalidOperation
from typing import BinaryIO

from service.grading.grade import CriterionResult
from service.reports.diagnosis import diagnose
from service.reports.display_text import format_decimal, to_one_line
from service.reports.formats.csv_output import render_csv, render_safe_csv, to_safe_cell
from service.reports.formats.registry import FilledWorksheet, register_archive, register_table, register_worksheet
from service.reports.rows import ReportPage, TableRow, select_student_rows
from service.reports.verdict_sentences import format_comments
from service.reports.view import GradebookView, build_gradebook_view
from sim.errors import UsageError
from sim.readers.csv_text import read_rows
from sim.readers.reader_errors import UnreadableDataError
from submissions.downloads import parse_moodle_number

_IDENTIFIER, _GRADE, _FEEDBACK, _MAXIMUM = "Identifier", "Grade", "Feedback comments", "Maximum Grade"
#: Columns that identify a row if its submission did not come from Moodle, in order of priority.
_NAMES = ("ID number", "Email address", "Full name")
_MAX_COMMENT_LENGTH = 2000
_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest time in a zip archive


@register_table("moodle", ".csv", build_gradebook_view)
def render_moodle_csv(rows: Sequence[TableRow[GradebookView]]) -> str:
    """Return Moodle's grade import: ID number, grade, and feedback without anything about hidden criteria."""
    # A row without a known student would make the whole import fail.
    cells = [
        [row.student.id, _format_marks(row), _format_feedback(row)]
        for row in select_student_rows(rows)
        if row.student.id
    ]
    return render_safe_csv([["ID number", "Grade", "Feedback comments"], *cells])


@register_worksheet("moodle-worksheet", ".csv", build_gradebook_view)
def fill_moodle_worksheet(rows: Sequence[TableRow[GradebookView]], worksheet: str) -> FilledWorksheet:
    """Fill in Grade and Feedback comments of the worksheet. All other rows and cells stay unchanged.

    Raises:
        UsageError: It is not a worksheet, or its assignment has another maximum.
    """
    byte_order_mark = "\ufeff" if worksheet.startswith("\ufeff") else ""
    text = worksheet.removeprefix("\ufeff")
    header_line = text.partition("\n")[0]
    separator = max(",;\t", key=header_line.count)
    try:
        lines = read_rows(text, separator)
    except UnreadableDataError as error:
        raise UsageError(f"the worksheet cannot be read: {error}, expected Moodle's grading worksheet") from None
    columns = {heading: place for place, heading in enumerate(lines[0])} if lines else {}
    missing = [heading for heading in (_IDENTIFIER, _GRADE) if heading not in columns]
    if missing:
        raise UsageError(
            f"the worksheet has no column {' and no column '.join(missing)}, expected the grading worksheet as Moodle "
            "lets it be downloaded, in English"
        )
    line_numbers = _index_lines(lines, columns)
    left_over = []
    for row in select_student_rows(rows):
        line_number = _find_line(row, line_numbers)
        if line_number is None:
            left_over.append(row.who)
            continue
        line = lines[line_number]
        line += [""] * (len(lines[0]) - len(line))
        if row.grade is not None:
            _check_maximum(row.grade.entry.worth, line, columns)
            line[columns[_GRADE]] = _format_marks(row)
        feedback_column = columns.get(_FEEDBACK)
        # A pending submission does not overwrite existing feedback.
        if feedback_column is not None and (row.grade is not None or row.refused or not line[feedback_column]):
            line[feedback_column] = to_safe_cell(_format_feedback(row))
    ending = "\r\n" if header_line.endswith("\r") else "\n"
    return FilledWorksheet(byte_order_mark + render_csv(lines, separator, ending), tuple(left_over))


@register_archive("moodle-feedback", ".zip")
def pack_moodle_feedback(pages: Iterable[ReportPage], sink: BinaryIO) -> tuple[str, ...]:
    """Pack a report for each submission from Moodle, at the path that its feedback import expects.

    Returns the students that were left out.

    Raises:
        UsageError: No submission came from Moodle.
    """
    left_over, packed_count = [], 0
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as archive:
        for page in pages:
            participant_number = parse_moodle_number(page.row.source)
            if not participant_number:
                left_over.append(page.row.who)
                continue
            name = re.sub(r"[_/\\\s]+", " ", page.row.source.partition(f"_{participant_number}_")[0])
            path = f"{name}_{participant_number}_assignfeedback_file_/feedback.html"
            archive.writestr(zipfile.ZipInfo(path, _EPOCH), page.html, zipfile.ZIP_DEFLATED)
            packed_count += 1
    if not packed_count:
        raise UsageError("none of these submissions came from Moodle, expected some of a download of its assignment")
    return tuple(left_over)


def _format_marks(row: TableRow[GradebookView]) -> str:
    return "" if row.grade is None or row.grade.marks is None else format_decimal(row.grade.marks)


def _format_feedback(row: TableRow[GradebookView]) -> str:
    criteria = [] if row.grade is None else row.grade.shown.criteria
    lines = [f"{each.title}: {_format_criterion_marks(each)}. {each.message}" for each in criteria]
    lines += [f"Note: {note}" for note in row.grade.shown.notes[:20]] if row.grade is not None else []
    if row.reason:
        lines.insert(0, row.reason if row.grade is not None else f"Not graded: {row.reason}")
    summary: list[str] = []
    if row.grade is not None:
        diagnosis = diagnose(row.grade.shown)
        summary = [*format_comments(row.grade.shown), diagnosis.cause, diagnosis.next_step, *diagnosis.further]
    return to_one_line(" ".join([*summary, "; ".join(lines)]), _MAX_COMMENT_LENGTH)


def _format_criterion_marks(result: CriterionResult) -> str:
    return "excused" if result.excused else f"{format_decimal(result.marks)} of {format_decimal(result.max_marks)}"


def _index_lines(lines: Sequence[Sequence[str]], columns: Mapping[str, int]) -> dict[tuple[str, str], int]:
    """Return the line of each identifier, by column and value, without values that several lines share."""
    identifiers: list[tuple[tuple[str, str], int]] = []
    for line_number, line in enumerate(lines[1:], start=1):
        for heading in (_IDENTIFIER, *_NAMES):
            cell = line[columns[heading]].strip() if heading in columns and columns[heading] < len(line) else ""
            if heading == _IDENTIFIER:
                cell = (re.findall(r"\d+$", cell) or [""])[0]
            if cell:
                identifiers.append(((heading, cell.casefold()), line_number))
    key_counts = Counter(key for key, _ in identifiers)
    return {key: place for key, place in identifiers if key_counts[key] == 1}


def _find_line(row: TableRow[GradebookView], line_numbers: Mapping[tuple[str, str], int]) -> int | None:
    participant_number = parse_moodle_number(row.source)
    if participant_number:
        return line_numbers.get((_IDENTIFIER, participant_number))
    student = row.student
    names = ((_NAMES[0], student.id), (_NAMES[1], student.email), (_NAMES[2], student.name or student.id))
    candidates = (line_numbers.get((heading, name.casefold())) for heading, name in names if name)
    return next((place for place in candidates if place is not None), None)


def _check_maximum(maximum: Decimal, line: Sequence[str], columns: Mapping[str, int]) -> None:
    try:
        worksheet_maximum = Decimal(line[columns[_MAXIMUM]].replace(",", "."))
    except (KeyError, InvalidOperation):
        return
    if worksheet_maximum != maximum:
        raise UsageError(
            f"the worksheet's Maximum Grade is {format_decimal(worksheet_maximum)} and the assignment gives "
            f"{format_decimal(maximum)} marks; expected "
            "the same: set the maximum in Moodle and download the worksheet again"
        )
