"""Similar submissions of a batch's students: a reason for a review, without any effect on marks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from service.operations.context import Actor, Service
from service.operations.errors import Invalid
from service.operations.lookup import load_names_for_actor, require_batch, require_course
from service.similarity.pairs import Similarity
from service.store.batches import batches, job_lines
from service.store.batches.batches import BatchLine
from service.store.batches.job_lines import JobLine
from service.store.batches.similarities import MAX_COMPARED_SUBMISSIONS, SourceTexts, find_similar_submissions
from service.store.states import Role


@dataclass(frozen=True, slots=True)
class ComparedBatch:
    """A batch, the compared submissions, and the similar ones by assignment; None if there are too many to compare.

    ``source`` returns the text of a file by assignment, student and name.
    """

    batch: BatchLine
    lines: tuple[JobLine, ...]
    found: tuple[Similarity, ...] | None
    source: Callable[[str, str, str], str]


def show_similar(service: Service, actor: Actor, course_id: int, batch_id: str) -> ComparedBatch:
    """Compare the newest submissions of the whole course for the assignments of a batch. Raises NotFound."""
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        require_batch(session, course_id, batch_id)
        line = batches.load_batch(session, batch_id)
        assignments = sorted({each.assignment for each in job_lines.load_job_lines(session, batch_id)})
        lines = tuple(job_lines.load_course_lines(session, course_id, assignments, hidden_names))
    similarities = (
        tuple(find_similar_submissions(service.store, lines)) if len(lines) <= MAX_COMPARED_SUBMISSIONS else None
    )
    return ComparedBatch(line, lines, similarities, SourceTexts(service.store, lines).load_text)


def list_similar(service: Service, actor: Actor, course_id: int, batch_id: str) -> tuple[Similarity, ...]:
    """Return the similar submissions like ``show_similar``.

    Raises NotFound, and Invalid if there are too many to compare.
    """
    compared_batch = show_similar(service, actor, course_id, batch_id)
    if compared_batch.found is None:
        raise Invalid(
            "%(count)s submissions are too many for an immediate comparison, expected at most %(most)s; "
            "to compare the submissions of this batch, run robomark batch similar %(batch)s",
            count=len(compared_batch.lines),
            most=MAX_COMPARED_SUBMISSIONS,
            batch=batch_id,
        )
    return compared_batch.found


def show_similar_in_batch(
    service: Service, actor: Actor, course_id: int, batch_id: str, given_code: Path | None = None
) -> ComparedBatch:
    """Compare the submissions of one batch only, in any number, without the code in ``given_code``.

    Raises:
        NotFound: The course does not have the batch, or the actor does not instruct it.
        UsageError: ``given_code`` cannot be read.
    """
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        require_batch(session, course_id, batch_id)
        line = batches.load_batch(session, batch_id)
        lines = tuple(job_lines.load_job_lines(session, batch_id, hidden_names))
    similarities = tuple(find_similar_submissions(service.store, lines, given_code))
    return ComparedBatch(line, lines, similarities, SourceTexts(service.store, lines).load_text)
