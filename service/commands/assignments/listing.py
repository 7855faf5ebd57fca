"""``robomark assignments list``: the catalogue as a table."""

from __future__ import annotations

from service.commands.shown import document, show, table
from service.reports.readable import number, one_line
from submissions.assignment.assignment_overview import overview
from submissions.assignment.folder import assignment_folder, catalogue


def list_assignments() -> None:
    """The assignments of the catalogue."""
    assignments = [overview(assignment_folder(name)) for name in catalogue()]
    document(assignments=assignments)
    listed = table("section", "id", "title", "marks", "trials", right=("marks", "trials"))
    for each in assignments:
        listed.add_row(each.section, each.id, one_line(each.title), number(each.marks), str(each.trials))
    show(listed)
