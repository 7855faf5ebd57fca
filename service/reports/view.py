"""The parts of a grade that a reader may see: staff, a student, or a gradebook with student access.

It hides and never re-marks: visible parts keep their marks, and their messages after staff adjustments. Nothing is
rendered here, and renderers of a view don't check the reader again.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from decimal import Decimal
from types import MappingProxyType
from typing import TYPE_CHECKING

from service.grading.class_statistics import scale_marks
from service.grading.grade import (
    CriterionResult,
    Grade,
    TrialResult,
    VisibleFeedback,
    build_unjudged_notes,
    convert_texts,
)
from service.grading.judging.message_parts import add_hidden_note
from service.language import ENGLISH, Language
from service.reports.verdict_sentences import describe_adjustment
from sim.errors import UsageError
from sim.recording import Verdict
from sim.sentences import join_sentences
from submissions.assignment.folder import REFERENCE

if TYPE_CHECKING:
    from service.similarity.pairs import Similarity

#: Visibilities that students see before publication.
BEFORE_PUBLICATION = frozenset({"visible"})


@dataclass(frozen=True, slots=True)
class View:
    """A grade as one reader may see it, with the reader's language.

    ``grade`` is the visible part. ``withheld`` says whether anything is hidden.
    """

    grade: Grade
    staff: bool
    withheld: bool
    language: Language = ENGLISH


@dataclass(frozen=True, slots=True)
class GradebookView:
    """A grade for a gradebook, without trials.

    ``entry`` has every criterion, each with text for the readers who may see it. ``shown`` is what the student sees
    immediately.
    """

    entry: Grade
    shown: Grade

    @property
    def marks(self) -> Decimal | None:
        """The marks scaled to the assignment's maximum, which is all a gradebook knows; None if all are excused."""
        return scale_marks(self.entry.marks, self.entry.max_marks, self.entry.worth)


@dataclass(frozen=True, slots=True)
class OverlayTrials:
    """Trials that may be drawn over those of a view: the owner's name, and the trials by index in the view."""

    name: str
    trials: Mapping[int, TrialResult]


@dataclass(frozen=True, slots=True)
class SimilarityView:
    """The similarities of a batch, for staff. Students have no view of them, and grades don't contain them."""

    found: tuple[Similarity, ...]
    language: Language = ENGLISH


#: No trials to draw over others.
NO_OVERLAY = OverlayTrials("", MappingProxyType({}))


def build_similarity_view(similarities: Sequence[Similarity], language: Language = ENGLISH) -> SimilarityView:
    """Return the view of the similarities for staff."""
    return SimilarityView(tuple(similarities), language)


def build_staff_view(grade: Grade, language: Language = ENGLISH) -> View:
    """Return the view of a grade for staff, with all its data."""
    criteria = tuple(_add_adjustment(result, language) for result in grade.criteria)
    return View(_translate(replace(grade, criteria=criteria), language), staff=True, withheld=False, language=language)


def build_student_view(
    grade: Grade, released: frozenset[str] = BEFORE_PUBLICATION, language: Language = ENGLISH
) -> View:
    """Return ``grade`` for a student: without staff notes, cost, and parts whose visibility is not in ``released``.

    A comment on a criterion is visible with the criterion, one on the whole submission with any visible part.

    Evidence and images from hidden trials are removed. If a criterion loses trials, its message, accuracy and curves
    are those of the visible trials. So only the marks depend on hidden trials. Totals are those of the visible
    criteria.
    """
    trial_indices = [index for index, trial in enumerate(grade.trials) if trial.visibility in released]
    new_index = {old: new for new, old in enumerate(trial_indices)}
    visible_ids = {result.id for result in grade.criteria if result.visibility in released}
    visible_grade = replace(
        grade,
        criteria=tuple(
            _add_adjustment(replace(_remove_hidden_trials(result, new_index), for_staff="", unjudged=""), language)
            for result in grade.criteria
            if result.id in visible_ids
        ),
        trials=tuple(grade.trials[index] for index in trial_indices),
        notes=_select_notes(grade, visible_ids),
        cost=None,  # the CPU limit depends on the number of trials, including hidden ones
        comments=tuple(each for each in grade.comments if visible_ids and each.criterion in ("", *visible_ids)),
        causes=tuple(
            replace(each, staff_note="")
            for each in grade.causes
            if each.criterion in visible_ids and not each.for_staff
        ),
    )
    withheld = len(visible_grade.criteria) < len(grade.criteria) or len(visible_grade.trials) < len(grade.trials)
    return View(_translate(visible_grade, language), staff=False, withheld=withheld, language=language)


def _select_notes(grade: Grade, visible_ids: Set[str]) -> tuple[str, ...]:
    """Return the notes on a grade. The note on unjudged criteria counts only visible ones."""
    visible_criteria = [result for result in grade.criteria if result.id in visible_ids]
    notes = [note for note in grade.notes if note not in build_unjudged_notes(grade.criteria)]
    return (*notes, *build_unjudged_notes(visible_criteria))


def select_overlay_trials(view: View, other_grade: Grade, name: str, released: frozenset[str]) -> OverlayTrials:
    """Return the trials of ``other_grade`` with the same settings as those of the view, if the reader may see them.

    Staff see all. Students see their own. They also see the reference solution's once the grade that they read is
    published; the student of the reference is named like that example. Both are limited to visibilities in
    ``released``.

    Raises:
        UsageError: Nothing is left.
    """
    if view.staff:
        visible_trials = other_grade.trials
    elif other_grade.student == view.grade.student or (
        other_grade.student == REFERENCE and "after_published" in released
    ):
        visible_trials = build_student_view(other_grade, released).grade.trials
    elif other_grade.student == REFERENCE:
        raise UsageError("the reference is shown over a student's trials once the grade is published, not before")
    else:
        raise UsageError("this is another student's grade; expected one of the same student, or the reference's")
    is_same_assignment = other_grade.assignment == view.grade.assignment
    trials_by_settings = {_collect_settings(trial): trial for trial in visible_trials} if is_same_assignment else {}
    pairs = ((index, trials_by_settings.get(_collect_settings(trial))) for index, trial in enumerate(view.grade.trials))
    trials = {index: trial for index, trial in pairs if trial is not None}
    if not trials:
        raise UsageError(
            "no trial of both grades has the same scenario, seed, place and floor, so none lies over another"
        )
    return OverlayTrials(name, trials)


def build_gradebook_view(grade: Grade) -> GradebookView:
    """Return all marks with their visibilities, which the gradebook applies itself."""
    criteria = tuple(_limit_text(grade, result) for result in grade.criteria)
    return GradebookView(replace(grade, criteria=criteria, trials=()), build_student_view(grade).grade)


def is_for_staff(visibility: str) -> bool:
    """Return whether this visibility is hidden from students before publication."""
    return visibility not in BEFORE_PUBLICATION


def has_hidden_content(grade: Grade, result: CriterionResult) -> bool:
    """Return whether a criterion is hidden, or shows images from hidden trials."""
    return is_for_staff(result.visibility) or any(
        is_for_staff(grade.trials[prediction.trial].visibility)
        for prediction in result.predictions
        if 0 <= prediction.trial < len(grade.trials)
    )


def find_worst_trial(grade: Grade, scenario: str) -> int:
    """Return the index in ``grade.trials`` of the scenario's trial that lost most, the first among equals.

    A trial loses the marks of every criterion it failed. Among equals, a fault is worse than a time limit, and a time
    limit is worse than finishing.
    """
    lost_marks = [Decimal(0)] * len(grade.trials)
    for result in grade.criteria:
        for evidence in result.evidence:
            if not evidence.passed and 0 <= evidence.trial < len(lost_marks):
                lost_marks[evidence.trial] += result.worth
    candidates = [index for index, trial in enumerate(grade.trials) if trial.scenario == scenario]
    return max(candidates, key=lambda index: (lost_marks[index], _rank_severity(grade.trials[index]), -index))


def list_scenarios(grade: Grade) -> tuple[str, ...]:
    """Return the scenarios of the grade's trials, in the order they were run."""
    return tuple(dict.fromkeys(trial.scenario for trial in grade.trials))


def _collect_settings(trial: TrialResult) -> Hashable:
    """Return the settings that two trials must share to be drawn together. A new version may change any of them."""
    recording = trial.recording
    ground = (recording.background, recording.label_patches, recording.sheet, recording.obstacles)
    noise = (trial.light_noise, trial.motor_noise, trial.sweep)
    return trial.scenario, trial.index, trial.seed, trial.place, noise, ground


def _limit_text(grade: Grade, result: CriterionResult) -> CriterionResult:
    """Return the criterion with the text for the readers it is visible to."""
    view = build_student_view(replace(grade, criteria=(result,)), BEFORE_PUBLICATION | {result.visibility})
    return replace(view.grade.criteria[0], evidence=(), predictions=())


def _translate(grade: Grade, language: Language) -> Grade:
    """Return the grade with its texts in this language, except hints: the diagnosis reads them first."""
    if language is ENGLISH:
        return grade
    return replace(convert_texts(grade, language.translate_sentence), hints=grade.hints)


def _add_adjustment(result: CriterionResult, language: Language) -> CriterionResult:
    sentence = describe_adjustment(result, language)
    return replace(result, message=join_sentences(sentence, result.message)) if sentence else result


def _rank_severity(trial: TrialResult) -> int:
    if trial.verdict is Verdict.FINISHED:
        return 0
    return 1 if trial.verdict is Verdict.TIME_LIMIT else 2


def _remove_hidden_trials(result: CriterionResult, new_index: dict[int, int]) -> CriterionResult:
    evidence = tuple(replace(item, trial=new_index[item.trial]) for item in result.evidence if item.trial in new_index)
    predictions = tuple(
        replace(prediction, trial=new_index[prediction.trial])
        for prediction in result.predictions
        if prediction.trial in new_index
    )
    visible_result = replace(result, evidence=evidence, predictions=predictions)
    if len(evidence) == len(result.evidence):
        return replace(visible_result, shown=None)
    # Older grades without a separate visible part show nothing.
    visible_feedback = result.shown or VisibleFeedback(add_hidden_note(""))
    return replace(
        visible_result,
        message=visible_feedback.message,
        accuracy=visible_feedback.accuracy,
        curves=visible_feedback.curves,
        shown=None,
        pool=visible_feedback.pool,
    )
