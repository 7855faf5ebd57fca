"""Render the report on a grade, for its student or for staff."""

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
    """Return the report on a grade as one self-contained HTML page.

    Args:
        grade: The grade.
        submission: The graded submission, for the code lines and diagrams in the report.
        reader: The reader of the report. For students, hidden content is left out.
        language: The code of the report's language, such as ``de``.

    Raises:
        UsageError: If the language is not available.
    """
    from service.reports.html import report
    from service.reports.plots.drawn import draw_all
    from service.reports.view import staff_view, student_view
    from submissions.diagram_cells import diagrams_in

    view = staff_view if reader == "staff" else student_view
    cells = () if submission is None else diagrams_in(submission.notebook).cells
    return report(view(grade, language=language_called(language)), draw_all(grade, cells=cells), submission)
