"""``robomark assignments list``: the catalogue, a line each."""

from __future__ import annotations

from typing import Any

from service.commands.shown import document, show, table


def list_assignments() -> None:
    """The assignments of the catalogue."""
    from service.reports.readable import one_line
    from submissions.assignment.folder import catalogue
    from submissions.assignment.reader import find_assignment

    rows: list[dict[str, Any]] = [
        {
            "section": assignment.section,
            "id": assignment.id,
            "title": assignment.title,
            "marks": assignment.max_marks,
            "trials": sum(1 for _ in assignment.trials()),
        }
        for assignment in map(find_assignment, catalogue())
    ]
    document(assignments=rows)
    listed = table("section", "id", "title", "marks", "trials", right=("marks", "trials"))
    for row in rows:
        listed.add_row(row["section"], row["id"], one_line(row["title"]), f"{row['marks']:g}", str(row["trials"]))
    show(listed)
