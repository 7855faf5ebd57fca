"""Similar submissions, compared by source code and recordings. Read-only.

``service.similarity`` defines similarity; ``service.reports.view`` decides who may see it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from service.similarity.behaviour import extract_behaviour
from service.similarity.pairs import Similarity, compare_submissions
from service.similarity.similar_sources import build_source
from service.similarity.sources import collect_given_code, extract_sources
from service.store.batches import stored_requests
from service.store.batches.job_lines import JobLine
from service.store.engine import Store
from service.store.grades import current_grades, results

#: Maximum number of submissions compared in a request; this takes some seconds.
MAX_COMPARED_SUBMISSIONS = 300


def find_similar_submissions(
    store: Store, lines: Sequence[JobLine], given_code: Path | None = None
) -> list[Similarity]:
    """Return the similar submissions of each assignment of a batch.

    Ignores code given with the assignment and the code in ``given_code``. Only the recordings of one submission are in
    memory at a time. Raises UsageError if ``given_code`` cannot be read.
    """
    assignments = sorted({line.assignment for line in lines})
    return [
        _compare_assignment(store, [line for line in lines if line.assignment == each], given_code)
        for each in assignments
    ]


class SourceTexts:
    """Source files that a page quotes, read on first use."""

    def __init__(self, store: Store, lines: Sequence[JobLine]) -> None:
        self._store = store
        self._jobs = {(line.assignment, line.student): line.id for line in lines}
        self._texts: dict[str, Mapping[str, str]] = {}

    def load_text(self, assignment: str, student: str, file: str) -> str:
        """Return the text of one file of a student."""
        if not self._texts:
            with self._store.reading() as session:
                submissions = stored_requests.load_each_submission(session, self._jobs.values())
                self._texts = {job_id: extract_sources(submission) for job_id, submission in submissions}
        return self._texts[self._jobs[assignment, student]][file]


def _compare_assignment(store: Store, lines: Sequence[JobLine], given_code: Path | None) -> Similarity:
    graded_ids = [line.id for line in lines if current_grades.is_trusted(line)]
    with store.reading() as session:
        assignment = stored_requests.load_assignment(session, lines[0].id)
        ignored_code = collect_given_code(assignment, given_code)
        submissions = stored_requests.load_each_submission(session, [line.id for line in lines])
        texts = {job_id: extract_sources(submission) for job_id, submission in submissions}
        trials = results.load_each_trials(session, graded_ids)
        behaviours_by_job = {job_id: extract_behaviour(of_job) for job_id, of_job in trials}
    sources = [build_source(line.student, file, text) for line in lines for file, text in texts[line.id].items()]
    behaviours = {line.student: behaviours_by_job[line.id] for line in lines if line.id in behaviours_by_job}
    return compare_submissions(assignment.id, sources, ignored_code, behaviours)
