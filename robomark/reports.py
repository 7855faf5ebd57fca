"""Render the report on a grade, for its student or for staff."""

from __future__ import annotations

from typing import Literal

from service.grading.grade import Grade
from service.language import load_language
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
    from service.reports.html import render_report_page
    from service.reports.plots.grade_plots import draw_all_plots
    from service.reports.view import build_staff_view, build_student_view
    from submissions.diagram_cells import read_diagrams

    view = build_staff_view if reader == "staff" else build_student_view
    cells = () if submission is None else read_diagrams(submission.notebook).cells
    return render_report_page(
        view(grade, language=load_language(language)), draw_all_plots(grade, cells=cells), submission
    )
