"""What is alike among submissions, read from what was submitted and from its recordings. Only reads.

What is alike is decided in ``service.similarity``, who may see it in ``service.reports.view``.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from service.similarity.behaviour import Behaviour, behaviour_of
from service.similarity.pairs import Similarity, similarity
from service.similarity.sources import given_with, sources_of
from service.similarity.writing import Source, source_of
from service.store.batches import intake
from service.store.batches.batches import JobLine
from service.store.engine import Store
from service.store.grades import results
from service.store.states import JobState

#: Submissions that are compared while somebody waits for the answer; it takes some seconds.
MOST_AT_ONCE = 300


def similarities(store: Store, lines: Sequence[JobLine], given: Path | None = None) -> list[Similarity]:
    """For each assignment of a batch what is alike; its code that was given, and that in ``given``, is left out.

    One submission at a time is in memory. Raises UsageError where ``given`` cannot be read.
    """
    assignments = sorted({line.assignment for line in lines})
    return [_of_one(store, [line for line in lines if line.assignment == each], given) for each in assignments]


class SourceTexts:
    """The sources that a page quotes, read when they are asked for."""

    def __init__(self, store: Store, lines: Sequence[JobLine]) -> None:
        self._store = store
        self._jobs = {(line.assignment, line.student): line.id for line in lines}

    def of(self, assignment: str, student: str, file: str) -> str:
        """The text of one file of a student's."""
        with self._store.reading() as session:
            submission = intake.load_submission(session, self._jobs[assignment, student])
        return sources_of(submission)[file]


def _of_one(store: Store, lines: Sequence[JobLine], given: Path | None) -> Similarity:
    with store.reading() as session:
        assignment = intake.load_assignment(session, lines[0].id)
    left_out = given_with(assignment, given)
    sources: list[Source] = []
    behaviours: dict[str, Behaviour] = {}
    for line in lines:
        with store.reading() as session:
            submission = intake.load_submission(session, line.id)
            if line.state is JobState.DONE and line.suspect is None:
                behaviours[line.student] = behaviour_of(results.load_trials(session, line.id))
        sources += [source_of(line.student, file, text) for file, text in sources_of(submission).items()]
    return similarity(assignment.id, sources, left_out, behaviours)
