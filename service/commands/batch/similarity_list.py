"""List similar submissions of a batch for staff to review.

``service.similarity`` finds them. Similarity never changes marks.
"""

from __future__ import annotations

from pathlib import Path

from service.commands.installation import open_installation
from service.commands.output import create_table, print_json, print_line, print_note, print_renderables
from service.operations import batches
from service.operations.similarity import show_similar_in_batch
from service.reports.output_files import prepare_folder, write_page
from service.reports.similarity import (
    build_similarity_rows,
    describe_similarity,
    render_similarity_page,
    similarity_to_json,
)
from service.reports.view import SimilarityView, build_similarity_view

#: Maximum number of pairs on the screen and on the page. The JSON output contains all pairs.
_MAX_LISTED_PAIRS = 100


def find_similar(batch: str, given_path: Path | None, output: Path | None) -> None:
    """Print the similar pairs and write the page with the evidence.

    Args:
        batch: Batch id, or the beginning of it.
        given_path: File or folder of Python code to ignore, because students received it.
        output: Page to write, or None.

    Raises:
        UsageError: A file cannot be read or written.
    """
    if output is not None:
        prepare_folder(output)
    with open_installation() as (service, actor):
        stored_batch = batches.find(service, actor, batch)
        findings = show_similar_in_batch(service, actor, stored_batch.course_id, stored_batch.id, given_path)
        view = build_similarity_view(findings.found or ())
        if output is not None:
            page = render_similarity_page(
                view, findings.source, f"Similar submissions in {findings.batch.name}", _MAX_LISTED_PAIRS
            )
            path = write_page(output, "similar.html", page)
            print_note(f"evidence: {path}")
    print_json(assignments=similarity_to_json(view))
    _show_similarity(view)


def _show_similarity(view: SimilarityView) -> None:
    for similarity in view.found:
        print_line(describe_similarity(similarity))
        for kind, groups in (("the same file", similarity.same), ("the same recordings", similarity.same_recordings)):
            for group in groups[:_MAX_LISTED_PAIRS]:
                print_line(f"{kind}: {', '.join(group)}")
        table = create_table("student", "student", "alike", "where", "same behaviour")
        for row in build_similarity_rows(similarity)[:_MAX_LISTED_PAIRS]:
            table.add_row(*row)
        if similarity.pairs:
            print_renderables(table)
        if len(similarity.pairs) > _MAX_LISTED_PAIRS:
            print_line(f"{len(similarity.pairs) - _MAX_LISTED_PAIRS} more pairs are not shown; --json shows all")
