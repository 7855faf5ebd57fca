"""Starter files: the programs that students begin with.

Stored assignments have none, so only the assignments of the catalogue have them.
"""

from __future__ import annotations

from collections.abc import Mapping

from submissions.assignment.folder import list_catalogue_ids, locate_assignment_folder


def read_starter(assignment: str) -> Mapping[str, str]:
    """Return the text of each starter file, by name; empty for assignments that are not in the catalogue."""
    if assignment not in list_catalogue_ids():
        return {}
    files = sorted((locate_assignment_folder(assignment) / "starter").glob("*.py"))
    return {file.name: file.read_text("utf-8") for file in files}
