"""Runs a stored grading again, here, and compares every recording's hash and the marks."""

from __future__ import annotations

from service.commands.shown import document, note, show, table, tell
from service.grading.grade import Grade, TrialResult
from service.grading.grader import grade as grade_submission
from service.grading.trial_runner import TrialRunner
from service.settings import load_settings
from service.store.batches import batches, intake
from service.store.engine import open_store
from service.store.grades import results
from service.store.installation import secret_of
from service.store.models import Job
from service.version import GRADER_VERSION, grader_sha256
from sim.errors import HostError
from sim.recording import Verdict
from submissions.seeds import PUBLIC, Secret, name_of

#: How far such a trial came is decided by the machine and its load, so no hash is promised for it.
_CUT = frozenset({Verdict.CPU_LIMIT, Verdict.MEMORY_LIMIT, Verdict.STALLED, Verdict.HOST_ERROR})


def verify_grade(grade: str) -> None:
    """Run the grading with this id again. Raises HostError if anything differs that must not."""
    with open_store(load_settings()) as store:
        own = secret_of(store)
        with store.reading() as session:
            job = session.get_one(Job, batches.find_job(session, grade))
            stored = results.load_graded(session, job.id)
            grading_request = intake.load_grading_request(session, job.id)
    secret = _secret_of(job, own)
    with TrialRunner(spares=False) as runner:
        again = grade_submission(grading_request.submission, grading_request.assignment, secret=secret, runner=runner)
    rows = list(zip(stored.trials, again.trials, strict=False))
    document(**_told(job.id, stored, again, rows))
    compared = table("scenario", "trial", "stored", "again", "")
    for before, after in rows:
        hashes = (before.recording.sha256[:16], after.recording.sha256[:16])
        compared.add_row(before.scenario, str(before.index), *hashes, _compared(before, after))
    show(compared)
    tell(f"marks: {stored.marks} stored, {again.marks} again")
    if job.grader_sha256 != grader_sha256():
        note(f"graded by Robomark {stored.grader_version}, again by {GRADER_VERSION}; their code or libraries differ")
    if not _same(stored, again, rows):
        raise HostError(f"grade {job.id} is not what grading it again gives")
    tell(f"grade {job.id} is what grading it again gives")


def _told(job_id: str, stored: Grade, again: Grade, rows: list[tuple[TrialResult, TrialResult]]) -> dict[str, object]:
    """What a document says of the comparison."""
    return {
        "grade": job_id,
        "same": _same(stored, again, rows),
        "marks": stored.marks,
        "marks_again": again.marks,
        "trials": [
            {
                "scenario": before.scenario,
                "index": before.index,
                "sha256": before.recording.sha256,
                "sha256_again": after.recording.sha256,
                "compared": _compared(before, after),
            }
            for before, after in rows
        ],
    }


def _secret_of(job: Job, own: Secret) -> Secret:
    """The secret that the grade was given with. Raises HostError when it is not the one that is at hand."""
    if job.secret_sha256 is None:
        note("graded before this installation had a secret: again in the worlds of then")
        return PUBLIC
    if job.secret_sha256 != own.sha256:
        raise HostError(
            f"grade {job.id} cannot be verified with this secret: its worlds are of {name_of(job.secret_sha256)}, "
            f"and the secret here is {own.name}; set ROBOMARK_SECRET to the one that it was graded with"
        )
    note(f"secret: {own.name}")
    return own


def _same(stored: Grade, again: Grade, rows: list[tuple[TrialResult, TrialResult]]) -> bool:
    cut = any(before.verdict in _CUT or after.verdict in _CUT for before, after in rows)
    same_marks = cut or [r.marks for r in stored.criteria] == [r.marks for r in again.criteria]
    whole = len(stored.trials) == len(again.trials)
    return whole and same_marks and all(_compared(before, after) != "differs" for before, after in rows)


def _compared(before: TrialResult, after: TrialResult) -> str:
    if before.recording.sha256 == after.recording.sha256:
        return "same"
    return "cut by a limit" if before.verdict in _CUT or after.verdict in _CUT else "differs"
