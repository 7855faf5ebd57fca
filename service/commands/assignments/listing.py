"""``robomark assignments list``: the catalogue as a table."""

from __future__ import annotations

from service.commands.output import create_table, print_json, print_renderables
from service.reports.display_text import format_decimal, to_one_line
from submissions.assignment.assignment_overview import read_overview
from submissions.assignment.folder import list_catalogue_ids, locate_assignment_folder


def list_assignments() -> None:
    """The assignments of the catalogue."""
    assignments = [read_overview(locate_assignment_folder(name)) for name in list_catalogue_ids()]
    print_json(assignments=assignments)
    table = create_table("section", "id", "title", "marks", "trials", right=("marks", "trials"))
    for overview in assignments:
        table.add_row(
            overview.section,
            overview.id,
            to_one_line(overview.title),
            format_decimal(overview.marks),
            str(overview.trials),
        )
    print_renderables(table)
