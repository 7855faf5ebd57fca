"""Render the report on a grade, as its student or staff may see it."""

from __future__ import annotations

from typing import Literal

from service.grading.grade import Grade
from service.language import language_called
from submissions.submission import Submission


def render_report(
    grade: Grade,
    submission: Submission | None = None,
    *,
    reader: Literal["student", "staff"] = "student",
    language: str = "en",
) -> str:
    """The report on a grade: one HTML page that needs no other file.

    Args:
        grade: What the report is on.
        submission: What was graded, for the lines of code and the diagrams in the report.
        reader: Who reads it; students do not see what is hidden from them.
        language: The code of the report's language, such as ``de``.

    Raises:
        UsageError: there is no such language.
    """
    from service.reports.html import report
    from service.reports.plots.drawn import draw_all
    from service.reports.view import staff_view, student_view
    from submissions.diagram_cells import diagrams_in

    view = staff_view if reader == "staff" else student_view
    cells = () if submission is None else diagrams_in(submission.notebook).cells
    return report(view(grade, language=language_called(language)), draw_all(grade, cells=cells), submission)
