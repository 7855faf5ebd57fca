"""Storage of complete grades as rows: marks, evidence, accuracy, and each recording as an artifact.

``jobs`` decides whether a worker may store a grade. This module does not judge.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any, cast

from sqlalchemy import delete, select
from sqlalchemy.orm import Session, defer, undefer
from sqlalchemy.orm.interfaces import ORMOption

from service.grading.grade import (
    Accuracy,
    AccuracyCurve,
    Confidence,
    Cost,
    Counts,
    CriterionResult,
    Evidence,
    Grade,
    PoolValue,
    Prediction,
    StaffAdjustment,
    TrialResult,
    VisibleFeedback,
    WrittenComment,
)
from service.store import artifacts
from service.store.codec import decode, encode
from service.store.grades import causes, comments, overrides
from service.store.grades.grade_sentences import restore_sentences
from service.store.grades.overrides import OverrideLine
from service.store.grades.recording_texts import texts_from_bytes
from service.store.tables.courses import AssignmentVersion
from service.store.tables.grades import CriterionResultRow, TrialRow
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Job, SubmissionRow
from sim.errors import HostError, UsageError
from sim.recording import Image, Recording
from sim.recording_values import collect_faults
from submissions.seeds import PUBLIC_SECRET

_RECORDING = "application/x-robomark-recording"
_NO_CAUSES = causes.StoredCauses(())


@dataclass(frozen=True, slots=True)
class PreparedGrade:
    """A grade prepared before its transaction, so that compressing it delays no lock."""

    grade: Grade
    files: list[artifacts.File]
    predictions: list[list[dict[str, Any]]]  # one list per criterion


def prepare_grade(grade: Grade) -> PreparedGrade:
    """Compress the recordings and replace the images in predictions by references."""
    from service.store.grades import recordings

    size_limit = recordings.compute_size_limit(len(grade.trials))
    encoded_recordings = [recordings.encode_within_limit(trial.recording, size_limit) for trial in grade.trials]
    files = [
        artifacts.File(_format_recording_name(position), _RECORDING, item.data)
        for position, item in enumerate(encoded_recordings)
    ]
    numbers = [{image: number for number, image in enumerate(item.recording.images)} for item in encoded_recordings]
    predictions = [
        [
            encoded_prediction
            for prediction in result.predictions
            if (encoded_prediction := _encode_prediction(prediction, numbers[prediction.trial])) is not None
        ]
        for result in grade.criteria
    ]
    return PreparedGrade(grade, files, predictions)


def insert_grade(session: Session, job_id: str, prepared_grade: PreparedGrade, current_time: datetime) -> None:
    """Insert the rows of a grade, replacing those of an earlier grading of the same job."""
    grade = prepared_grade.grade
    session.execute(delete(TrialRow).where(TrialRow.job_id == job_id))
    session.execute(delete(CriterionResultRow).where(CriterionResultRow.job_id == job_id))
    session.add_all(_build_trial_row(job_id, position, trial) for position, trial in enumerate(grade.trials))
    session.add_all(
        _build_criterion_row(job_id, position, result, prepared_grade.predictions[position])
        for position, result in enumerate(grade.criteria)
    )
    artifacts.store_files(session, job_id, prepared_grade.files, current_time)


def load_grade(session: Session, job_id: str) -> Grade:
    """Load the grade of a job as it counts, with overrides and comments. Raises UsageError if it has none."""
    return _require_grade(load_each_grade(session, [job_id]), job_id)


def load_each_grade(session: Session, job_ids: Collection[str]) -> Iterator[tuple[str, Grade]]:
    """Yield the grades of jobs that have one, ordered by id. Executes a fixed number of statements.

    Only the recordings of one job are in memory at a time.
    """
    from service.store.grades.recordings import from_bytes

    return _apply_staff_changes(session, job_ids, _load_original_grades(session, job_ids, from_bytes))


def load_grade_texts(session: Session, job_id: str) -> Grade:
    """Load a grade like ``load_grade``, but with recordings without ticks and pixels."""
    return _require_grade(
        _apply_staff_changes(session, [job_id], _load_original_grades(session, [job_id], texts_from_bytes)), job_id
    )


def load_original_grade(session: Session, job_id: str) -> Grade:
    """Load the grade of a job as the grader gave it. Raises UsageError if it has none."""
    from service.store.grades.recordings import from_bytes

    return replace(_require_grade(_load_original_grades(session, [job_id], from_bytes), job_id), causes=())


def load_marks(session: Session, job_ids: Collection[str]) -> dict[str, Grade]:
    """Load the grades of jobs as they count, for lists: without trials, predictions and comments.

    Reads no recordings. Jobs without a grade are left out.
    """
    stored_grades = _load_stored_grades(session, job_ids, defer(CriterionResultRow.predictions))
    overrides_by_job = overrides.load_overrides(session, job_ids)
    return {
        job_id: _apply_overrides(stored_grade.build_grade(()), overrides_by_job.get(job_id, {}))
        for job_id, stored_grade in stored_grades.items()
    }


def load_each_trials(session: Session, job_ids: Collection[str]) -> Iterator[tuple[str, tuple[TrialResult, ...]]]:
    """Yield each job id with its trials, which are empty without a grade. Keeps those of one job in memory."""
    from service.store.grades.recordings import from_bytes

    return ((job_id, trials) for job_id, trials, _ in _load_trials(session, job_ids, from_bytes))


_LoadedGrades = Iterator[tuple[str, Grade]]


def _require_grade(loaded_grades: _LoadedGrades, job_id: str) -> Grade:
    for _, grade in loaded_grades:
        return grade
    raise UsageError(f"{job_id} has no grade")


def _apply_staff_changes(session: Session, job_ids: Collection[str], loaded_grades: _LoadedGrades) -> _LoadedGrades:
    overrides_by_job, comments_by_job = (
        overrides.load_overrides(session, job_ids),
        comments.load_comments_by_job(session, job_ids),
    )
    for job_id, grade in loaded_grades:
        written_comments = tuple(WrittenComment(each.criterion, each.text) for each in comments_by_job.get(job_id, ()))
        yield (
            job_id,
            replace(_apply_overrides(grade, overrides_by_job.get(job_id, {})), comments=written_comments),
        )


def _apply_overrides(grade: Grade, overrides_by_criterion: Mapping[str, OverrideLine]) -> Grade:
    return replace(
        grade,
        criteria=tuple(_apply_override(result, overrides_by_criterion.get(result.id)) for result in grade.criteria),
    )


def _load_original_grades(
    session: Session, job_ids: Collection[str], decode_recording: Callable[[bytes], Recording]
) -> _LoadedGrades:
    stored_grades = _load_stored_grades(session, job_ids)
    for job_id, trials, stored_causes in _load_trials(session, stored_grades, decode_recording):
        yield job_id, replace(stored_grades[job_id].build_grade(trials), causes=stored_causes.causes)


@dataclass(frozen=True, slots=True)
class _StoredGrade:
    """A grade without criteria and trials, its criterion rows, and its encoded sentences."""

    head: Grade
    rows: list[CriterionResultRow]
    sentences: list[Any]

    def build_grade(self, trials: tuple[TrialResult, ...]) -> Grade:
        criteria = tuple(_build_criterion(row, trials) for row in self.rows)
        return restore_sentences(replace(self.head, criteria=criteria, trials=trials), self.sentences)


def _load_stored_grades(session: Session, job_ids: Collection[str], *options: ORMOption) -> dict[str, _StoredGrade]:
    """Return the stored grades by job."""
    query = (
        select(Job, SubmissionRow.sha256, Enrolment.student, AssignmentVersion)
        .join(SubmissionRow, Job.submission_id == SubmissionRow.id)
        .join(Enrolment, SubmissionRow.enrolment_id == Enrolment.id)
        .join(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
        .where(Job.id.in_(job_ids), Job.verdict.is_not(None))
        .options(undefer(Job.sentences))
    )
    stored_grades = {
        job.id: _StoredGrade(_build_head(job, sha256, student, version), [], job.sentences)
        for job, sha256, student, version in session.execute(query)
    }
    rows = select(CriterionResultRow).where(CriterionResultRow.job_id.in_(stored_grades)).options(*options)
    for row in session.scalars(rows.order_by(CriterionResultRow.job_id, CriterionResultRow.position)):
        stored_grades[row.job_id].rows.append(row)
    return stored_grades


def _build_head(job: Job, sha256: str, student: str, version: AssignmentVersion) -> Grade:
    return Grade(
        assignment=version.assignment,
        assignment_title=version.title,
        assignment_version=version.version,
        submission=sha256,
        student=student,
        criteria=(),
        trials=(),
        sandbox=job.sandbox or "",
        grader_version=job.grader_version or "",
        notes=tuple(job.notes),
        missing=job.missing,
        hints=tuple(job.hints),
        secret_sha256=job.secret_sha256 or PUBLIC_SECRET.sha256,
        cost=None if job.cost is None else decode(Cost, job.cost),
    )


def _load_trials(
    session: Session, job_ids: Collection[str], decode_recording: Callable[[bytes], Recording]
) -> Iterator[tuple[str, tuple[TrialResult, ...], causes.StoredCauses]]:
    """Yield the trials and the causes of each job, whose files are read in one statement."""
    query = select(TrialRow).where(TrialRow.job_id.in_(job_ids)).order_by(TrialRow.job_id, TrialRow.position)
    rows: dict[str, list[TrialRow]] = {}
    for row in session.scalars(query):
        rows.setdefault(row.job_id, []).append(row)
    for job_id, files in artifacts.load_each_files(session, job_ids, prefix=("recording-", causes.CAUSES_NAME)):
        causes_file = files.get(causes.CAUSES_NAME)
        yield (
            job_id,
            tuple(
                _build_trial(row, decode_recording(_find_recording(files, job_id, row.position)))
                for row in rows.get(job_id, ())
            ),
            _NO_CAUSES if causes_file is None else causes.read_causes(causes_file),
        )


def _build_trial(row: TrialRow, recording: Recording) -> TrialResult:
    return TrialResult(
        scenario=row.scenario,
        index=row.scenario_index,
        seed=row.seed,
        light_noise=row.light_noise,
        motor_noise=row.motor_noise,
        visibility=row.visibility,
        recording=recording,
        sweep=decode(tuple[tuple[str, float], ...], row.sweep),
        place=row.place,
    )


def _format_recording_name(position: int) -> str:
    return f"recording-{position}"


def _build_trial_row(job_id: str, position: int, trial: TrialResult) -> TrialRow:
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
        sweep=encode(trial.sweep),
        surprise=next((fault.staff for fault in collect_faults(trial.recording) if fault.staff), None),
    )


def _build_criterion_row(
    job_id: str, position: int, result: CriterionResult, predictions: list[dict[str, Any]]
) -> CriterionResultRow:
    accuracy = result.accuracy
    return CriterionResultRow(
        job_id=job_id,
        position=position,
        criterion=result.id,
        title=result.title,
        marks=result.marks,
        max_marks=result.max_marks,
        message=str(result.message),
        visibility=result.visibility,
        evidence=encode(result.evidence),
        accuracy=accuracy and accuracy.value,
        accuracy_low=accuracy and accuracy.low,
        accuracy_high=accuracy and accuracy.high,
        accuracy_n=accuracy and accuracy.n,
        labels=accuracy and encode(accuracy.labels),
        confusion=accuracy and encode(accuracy.confusion),
        counts=accuracy and encode(accuracy.counts),
        confidence=accuracy and encode(accuracy.confidence),
        curves=encode(result.curves),
        unjudged=result.unjudged or None,
        predictions=predictions,
        shown=result.shown and encode(result.shown),
        for_staff=result.for_staff,
        pool=result.pool and encode(result.pool),
    )


def _encode_prediction(prediction: Prediction, numbers: Mapping[Image, int]) -> dict[str, Any] | None:
    """Encode a prediction with its image as a number in the recording; None if the images were too large to store."""
    if not numbers:
        return None
    image_number = numbers.get(prediction.image)
    encoded_prediction = cast(dict[str, Any], encode(replace(prediction, image=cast(Image, None))))
    return encoded_prediction | {"image": image_number if image_number is not None else encode(prediction.image)}


def _find_recording(files: dict[str, artifacts.File], job_id: str, position: int) -> bytes:
    name = _format_recording_name(position)
    if name not in files:
        raise HostError(f"The database is damaged: {name} of {job_id} is gone")
    return files[name].data


def _build_criterion(row: CriterionResultRow, trials: tuple[TrialResult, ...]) -> CriterionResult:
    return CriterionResult(
        id=row.criterion,
        title=row.title,
        marks=row.marks,
        max_marks=row.max_marks,
        message=row.message,
        visibility=row.visibility,
        evidence=decode(tuple[Evidence, ...], row.evidence),
        accuracy=_build_accuracy(row),
        predictions=tuple(_decode_prediction(plain, trials) for plain in row.predictions) if trials else (),
        curves=decode(tuple[AccuracyCurve, ...], row.curves),
        shown=None if row.shown is None else decode(VisibleFeedback, row.shown),
        unjudged=row.unjudged or "",
        for_staff=row.for_staff,
        pool=None if row.pool is None else decode(PoolValue, row.pool),
    )


def _apply_override(result: CriterionResult, override: OverrideLine | None) -> CriterionResult:
    if override is None:
        return result
    marks, max_marks = override.compute_marks(result.max_marks)
    is_excused = override.marks is None
    if not result.unjudged:
        adjustment = StaffAdjustment(result.marks, result.max_marks, override.reason, is_excused)
        return replace(result, marks=marks, max_marks=max_marks, set_by_hand=adjustment)
    # The note that staff will review it no longer applies.
    adjustment = StaffAdjustment(None, result.max_marks, override.reason, is_excused)
    return replace(result, marks=marks, max_marks=max_marks, set_by_hand=adjustment, message="", unjudged="")


def _build_accuracy(row: CriterionResultRow) -> Accuracy | None:
    if row.accuracy is None or row.accuracy_low is None or row.accuracy_high is None or row.accuracy_n is None:
        return None
    return Accuracy(
        value=row.accuracy,
        low=row.accuracy_low,
        high=row.accuracy_high,
        n=row.accuracy_n,
        labels=tuple(row.labels or ()),
        confusion=decode(tuple[tuple[str, str | None, int], ...], row.confusion or []),
        counts=None if row.counts is None else decode(Counts, row.counts),
        confidence=None if row.confidence is None else decode(Confidence, row.confidence),
    )


def _decode_prediction(encoded_prediction: dict[str, Any], trials: tuple[TrialResult, ...]) -> Prediction:
    image_reference = encoded_prediction["image"]
    image = (
        trials[encoded_prediction["trial"]].recording.images[image_reference]
        if isinstance(image_reference, int)
        else decode(Image, image_reference)
    )
    return Prediction(
        image,
        encoded_prediction["truth"],
        encoded_prediction["answer"],
        encoded_prediction["scenario"],
        encoded_prediction["trial"],
    )
