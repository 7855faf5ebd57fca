"""Grades to rows and back, whole: marks, evidence, accuracy as data, and every recording as an artifact.

Whether a worker may store a grade is ``jobs``'s to say; nothing here judges.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any, cast

from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from service.grading.grade import (
    Accuracy,
    AccuracyCurve,
    Confidence,
    Cost,
    Counts,
    CriterionResult,
    Evidence,
    Grade,
    Shown,
    Sight,
    TrialResult,
)
from service.store import artifacts, recordings
from service.store.models import AssignmentVersion, CriterionRow, Enrolment, Job, Submission, TrialRow
from service.store.plain import from_plain, to_plain
from sim.errors import HostError, UsageError
from sim.recording import Image, Recording
from submissions.seeds import PUBLIC

_RECORDING = "application/x-robomark-recording"


@dataclass(frozen=True, slots=True)
class Prepared:
    """A grade made ready for its transaction, so that compressing keeps no lock waiting."""

    grade: Grade
    files: list[artifacts.File]
    sights: list[list[dict[str, Any]]]  # a list a criterion


def prepare(grade: Grade) -> Prepared:
    """Compress the recordings and point the sights at their pictures."""
    cap = recordings.cap_for(len(grade.trials))
    kept = [recordings.keep(trial.recording, cap) for trial in grade.trials]
    files = [artifacts.File(_recording_name(position), _RECORDING, item.data) for position, item in enumerate(kept)]
    numbers = [{image: number for number, image in enumerate(item.recording.images)} for item in kept]
    sights = [
        [plain for sight in result.sights if (plain := _plain_sight(sight, numbers[sight.trial])) is not None]
        for result in grade.criteria
    ]
    return Prepared(grade, files, sights)


def insert(session: Session, job_id: str, prepared: Prepared, at: datetime) -> None:
    """Write the rows of a grade; those of an earlier grading of the same job go."""
    grade = prepared.grade
    session.execute(delete(TrialRow).where(TrialRow.job_id == job_id))
    session.execute(delete(CriterionRow).where(CriterionRow.job_id == job_id))
    session.add_all(_trial_row(job_id, position, trial) for position, trial in enumerate(grade.trials))
    session.add_all(
        _criterion_row(job_id, position, result, prepared.sights[position])
        for position, result in enumerate(grade.criteria)
    )
    artifacts.put(session, job_id, prepared.files, at)


def load(session: Session, job_id: str) -> Grade:
    """The grade of a job. Raises UsageError when it has none."""
    query = (
        select(Job, Submission.sha256, Enrolment.student, AssignmentVersion)
        .join(Submission, Job.submission_id == Submission.id)
        .join(Enrolment, Submission.enrolment_id == Enrolment.id)
        .join(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
        .where(Job.id == job_id)
    )
    found = session.execute(query).one_or_none()
    if found is None or found[0].verdict is None:
        raise UsageError(f"{job_id} has no grade")
    job, sha256, student, version = found
    trials = _trials(session, job_id)
    rows = session.scalars(select(CriterionRow).where(CriterionRow.job_id == job_id).order_by(CriterionRow.position))
    return Grade(
        assignment=version.assignment,
        assignment_title=version.title,
        assignment_version=version.version,
        submission=sha256,
        student=student,
        criteria=tuple(_criterion(row, trials) for row in rows),
        trials=trials,
        walls=job.walls or "",
        grader_version=job.grader_version or "",
        notes=tuple(job.notes),
        secret_sha256=job.secret_sha256 or PUBLIC.sha256,
        cost=None if job.cost is None else from_plain(Cost, job.cost),
    )


def _recording_name(position: int) -> str:
    return f"recording-{position}"


def _trial_row(job_id: str, position: int, trial: TrialResult) -> TrialRow:
    return TrialRow(
        job_id=job_id,
        position=position,
        scenario=trial.scenario,
        scenario_index=trial.index,
        seed=trial.seed,
        light_noise=trial.light_noise,
        motor_noise=trial.motor_noise,
        visibility=trial.visibility,
        verdict=trial.verdict.value,
        sha256=trial.recording.sha256,
        end_t=trial.recording.end_t,
        place=trial.place,
        sweep=to_plain(trial.sweep),
        surprise=next((fault.staff for fault in trial.recording.faults if fault.staff), None),
    )


def _criterion_row(job_id: str, position: int, result: CriterionResult, sights: list[dict[str, Any]]) -> CriterionRow:
    accuracy = result.accuracy
    return CriterionRow(
        job_id=job_id,
        position=position,
        criterion=result.id,
        title=result.title,
        marks=result.marks,
        max_marks=result.max_marks,
        message=result.message,
        visibility=result.visibility,
        evidence=to_plain(result.evidence),
        accuracy=accuracy and accuracy.value,
        accuracy_low=accuracy and accuracy.low,
        accuracy_high=accuracy and accuracy.high,
        accuracy_n=accuracy and accuracy.n,
        labels=accuracy and to_plain(accuracy.labels),
        confusion=accuracy and to_plain(accuracy.confusion),
        counts=accuracy and to_plain(accuracy.counts),
        confidence=accuracy and to_plain(accuracy.confidence),
        curves=to_plain(result.curves),
        unjudged=result.unjudged or None,
        sights=sights,
        shown=result.shown and to_plain(result.shown),
        for_staff=result.for_staff,
    )


def _plain_sight(sight: Sight, numbers: Mapping[Image, int]) -> dict[str, Any] | None:
    """A sight that names its picture by number in the recording; none if the picture was too much to keep."""
    if not numbers:
        return None
    where = numbers.get(sight.image)
    plain = cast(dict[str, Any], to_plain(replace(sight, image=cast(Image, None))))
    return plain | {"image": where if where is not None else to_plain(sight.image)}


def _trials(session: Session, job_id: str) -> tuple[TrialResult, ...]:
    files = artifacts.get(session, job_id, prefix="recording-")
    rows = session.scalars(select(TrialRow).where(TrialRow.job_id == job_id).order_by(TrialRow.position))
    return tuple(
        TrialResult(
            scenario=row.scenario,
            index=row.scenario_index,
            seed=row.seed,
            light_noise=row.light_noise,
            motor_noise=row.motor_noise,
            visibility=row.visibility,
            recording=_recording(files, job_id, row.position),
            sweep=from_plain(tuple[tuple[str, float], ...], row.sweep),
            place=row.place,
        )
        for row in rows
    )


def _recording(files: dict[str, artifacts.File], job_id: str, position: int) -> Recording:
    name = _recording_name(position)
    if name not in files:
        raise HostError(f"The database is damaged: {name} of {job_id} is gone")
    return recordings.from_bytes(files[name].data)


def _criterion(row: CriterionRow, trials: tuple[TrialResult, ...]) -> CriterionResult:
    return CriterionResult(
        id=row.criterion,
        title=row.title,
        marks=row.marks,
        max_marks=row.max_marks,
        message=row.message,
        visibility=row.visibility,
        evidence=from_plain(tuple[Evidence, ...], row.evidence),
        accuracy=_accuracy(row),
        sights=tuple(_sight(plain, trials) for plain in row.sights),
        curves=from_plain(tuple[AccuracyCurve, ...], row.curves),
        shown=None if row.shown is None else from_plain(Shown, row.shown),
        unjudged=row.unjudged or "",
        for_staff=row.for_staff,
    )


def _accuracy(row: CriterionRow) -> Accuracy | None:
    if row.accuracy is None or row.accuracy_low is None or row.accuracy_high is None or row.accuracy_n is None:
        return None
    return Accuracy(
        value=row.accuracy,
        low=row.accuracy_low,
        high=row.accuracy_high,
        n=row.accuracy_n,
        labels=tuple(row.labels or ()),
        confusion=from_plain(tuple[tuple[str, str | None, int], ...], row.confusion or []),
        counts=None if row.counts is None else from_plain(Counts, row.counts),
        confidence=None if row.confidence is None else from_plain(Confidence, row.confidence),
    )


def _sight(plain: dict[str, Any], trials: tuple[TrialResult, ...]) -> Sight:
    where = plain["image"]
    image = trials[plain["trial"]].recording.images[where] if isinstance(where, int) else from_plain(Image, where)
    return Sight(image, plain["truth"], plain["answer"], plain["scenario"], plain["trial"])
