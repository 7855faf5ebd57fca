"""List similar submissions of a batch for staff to review.

``service.similarity`` finds them. Similarity never changes marks.
"""

from __future__ import annotations

from pathlib import Path

from service.commands.operating import operating
from service.commands.shown import document, note, show, table, tell
from service.operations import batches
from service.operations.similarity import show_similar_in_batch
from service.reports.similarity import as_plain, similarity_page, similarity_rows, what_it_says
from service.reports.view import SimilarityView, staff_similarity
from service.reports.written import prepare_folder, write_page

#: Maximum number of pairs on the screen and on the page. The JSON output contains all pairs.
_MOST_SHOWN = 100


def find_similar(batch: str, given: Path | None, output: Path | None) -> None:
    """Print the similar pairs and write the page with the evidence.

    Args:
        batch: Batch id, or the beginning of it.
        given: File or folder of Python code to ignore, because students received it.
        output: Page to write, or None.

    Raises:
        UsageError: A file cannot be read or written.
    """
    if output is not None:
        prepare_folder(output)
    with operating() as (service, actor):
        found = batches.find(service, actor, batch)
        shown = show_similar_in_batch(service, actor, found.course_id, found.id, given)
        view = staff_similarity(shown.found or ())
        if output is not None:
            page = similarity_page(view, shown.source, f"Similar submissions in {shown.batch.name}", _MOST_SHOWN)
            path = write_page(output, "similar.html", page)
            note(f"evidence: {path}")
    document(assignments=as_plain(view))
    _show(view)


def _show(view: SimilarityView) -> None:
    for found in view.found:
        tell(what_it_says(found))
        for kind, groups in (("the same file", found.same), ("the same recordings", found.same_recordings)):
            for group in groups[:_MOST_SHOWN]:
                tell(f"{kind}: {', '.join(group)}")
        alike = table("student", "student", "alike", "where", "same behaviour")
        for row in similarity_rows(found)[:_MOST_SHOWN]:
            alike.add_row(*row)
        if found.pairs:
            show(alike)
        if len(found.pairs) > _MOST_SHOWN:
            tell(f"{len(found.pairs) - _MOST_SHOWN} more pairs are not shown; --json shows all")
