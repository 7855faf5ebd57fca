"""What a reader may see of a grade, decided once: staff, a student, or a gradebook that students look into.

It hides, it never re-marks: what is left keeps its marks, and its messages after what was set by hand. Nothing is
rendered here, and what renders a view asks no more who reads it.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from decimal import Decimal
from types import MappingProxyType
from typing import TYPE_CHECKING

from service.grading.grade import CriterionResult, Grade, Shown, TrialResult, unjudged_notes
from service.grading.judging.message_parts import shown_words
from service.grading.statistics import marks_out_of_all
from service.language import ENGLISH, Language
from service.reports.words import by_hand_words
from sim.errors import UsageError
from sim.recording import Verdict
from submissions.assignment.folder import REFERENCE

if TYPE_CHECKING:
    from service.similarity.pairs import Similarity

#: What a student sees before anything is published.
BEFORE_PUBLICATION = frozenset({"visible"})


@dataclass(frozen=True, slots=True)
class View:
    """A grade as one reader may see it, and in which language they read of it.

    ``grade`` is what is left of it, ``withheld`` says that it is not all.
    """

    grade: Grade
    staff: bool
    withheld: bool
    language: Language = ENGLISH


@dataclass(frozen=True, slots=True)
class GradebookView:
    """A grade for a gradebook: ``entry`` has every criterion, told as to whoever may see it, and no trials.

    ``shown`` is what the student sees at once.
    """

    entry: Grade
    shown: Grade

    @property
    def marks(self) -> Decimal | None:
        """The marks out of all that the assignment gives, as a gradebook knows but that; None if all is excused."""
        return marks_out_of_all(self.entry.marks, self.entry.max_marks, self.entry.worth)


@dataclass(frozen=True, slots=True)
class OtherTrials:
    """What may be drawn over the trials of a view: whose it is, and by a trial's index the one that lies over it."""

    name: str
    trials: Mapping[int, TrialResult]


@dataclass(frozen=True, slots=True)
class SimilarityView:
    """What is alike in a batch, as staff may see it; a student has no view of it, and no grade has anything of it."""

    found: tuple[Similarity, ...]
    language: Language = ENGLISH


#: Where no trial lies over another.
NO_OTHERS = OtherTrials("", MappingProxyType({}))


def staff_similarity(found: Sequence[Similarity], language: Language = ENGLISH) -> SimilarityView:
    """All of it."""
    return SimilarityView(tuple(found), language)


def staff_view(grade: Grade, language: Language = ENGLISH) -> View:
    """All of it."""
    told = tuple(_with_by_hand(result, language) for result in grade.criteria)
    return View(replace(grade, criteria=told), staff=True, withheld=False, language=language)


def student_view(grade: Grade, released: frozenset[str] = BEFORE_PUBLICATION, language: Language = ENGLISH) -> View:
    """``grade`` without what is for staff, what it cost, and what has a visibility that is not in ``released``.

    A comment on a criterion is seen with that, one on all of the submission with whatever is seen of it.

    Evidence and images from hidden trials go too; of a criterion that loses trials the message, the accuracy and
    the curves are those of the visible trials alone. So nothing is left of hidden trials but the marks. Totals are
    then those of the criteria shown.
    """
    kept = [index for index, trial in enumerate(grade.trials) if trial.visibility in released]
    new_index = {old: new for new, old in enumerate(kept)}
    shown = {result.id for result in grade.criteria if result.visibility in released}
    left = replace(
        grade,
        criteria=tuple(
            _with_by_hand(replace(_without_hidden_trials(result, new_index), for_staff="", unjudged=""), language)
            for result in grade.criteria
            if result.id in shown
        ),
        trials=tuple(grade.trials[index] for index in kept),
        notes=_notes_on(grade, shown),
        cost=None,  # the limit of CPU time grows with the number of trials, hidden ones included
        comments=tuple(each for each in grade.comments if shown and each.criterion in ("", *shown)),
    )
    withheld = len(left.criteria) < len(grade.criteria) or len(left.trials) < len(grade.trials)
    return View(left, staff=False, withheld=withheld, language=language)


def _notes_on(grade: Grade, shown: Set[str]) -> tuple[str, ...]:
    """The notes on a grade, of which the one on unjudged criteria counts those that are shown and no others."""
    seen = [result for result in grade.criteria if result.id in shown]
    notes = [note for note in grade.notes if note not in unjudged_notes(grade.criteria)]
    return (*notes, *unjudged_notes(seen))


def other_trials(view: View, other: Grade, name: str, released: frozenset[str]) -> OtherTrials:
    """The trials of ``other`` that were run as those of the view were, as far as its reader may see them.

    Staff see all. Students see their own, and the reference's (who is called as that example is) once the grade that
    they read is published; of both what has a visibility in ``released``. Raises UsageError where nothing is left.
    """
    if view.staff:
        seen = other.trials
    elif other.student == view.grade.student or (other.student == REFERENCE and "after_published" in released):
        seen = student_view(other, released).grade.trials
    elif other.student == REFERENCE:
        raise UsageError("the reference is shown over a student's trials once the grade is published, not before")
    else:
        raise UsageError("this is another student's grade; expected one of the same student, or the reference's")
    same = other.assignment == view.grade.assignment
    run_as = {_circumstances(trial): trial for trial in seen} if same else {}
    pairs = ((index, run_as.get(_circumstances(trial))) for index, trial in enumerate(view.grade.trials))
    trials = {index: trial for index, trial in pairs if trial is not None}
    if not trials:
        raise UsageError(
            "no trial of both grades has the same scenario, seed, place and floor, so none lies over another"
        )
    return OtherTrials(name, trials)


def gradebook_view(grade: Grade) -> GradebookView:
    """All marks with their visibilities, which the gradebook heeds by itself."""
    told = tuple(_told(grade, result) for result in grade.criteria)
    return GradebookView(replace(grade, criteria=told, trials=()), student_view(grade).grade)


def is_for_staff(visibility: str) -> bool:
    """Whether what has this visibility is kept from students before publication."""
    return visibility not in BEFORE_PUBLICATION


def tells_of_hidden(grade: Grade, result: CriterionResult) -> bool:
    """Whether a criterion is hidden itself, or shows what was seen in hidden trials."""
    return is_for_staff(result.visibility) or any(
        is_for_staff(grade.trials[prediction.trial].visibility)
        for prediction in result.predictions
        if 0 <= prediction.trial < len(grade.trials)
    )


def worst_trial(grade: Grade, scenario: str) -> int:
    """Index, in ``grade.trials``, of the scenario's trial that lost most; the first of equals.

    A trial loses the marks of every criterion it failed; of those equal in that, one that ended in a fault is
    worse than one that ran out of time, and that is worse than one that finished.
    """
    lost = [Decimal(0)] * len(grade.trials)
    for result in grade.criteria:
        for evidence in result.evidence:
            if not evidence.passed and 0 <= evidence.trial < len(lost):
                lost[evidence.trial] += result.worth
    candidates = [index for index, trial in enumerate(grade.trials) if trial.scenario == scenario]
    return max(candidates, key=lambda index: (lost[index], _severity(grade.trials[index]), -index))


def scenarios(grade: Grade) -> tuple[str, ...]:
    """The scenarios of the grade's trials, in the order they were run."""
    return tuple(dict.fromkeys(trial.scenario for trial in grade.trials))


def _circumstances(trial: TrialResult) -> Hashable:
    """What two trials share of which one can lie over the other: another version may have changed any of it."""
    recording = trial.recording
    ground = (recording.background, recording.label_patches, recording.sheet, recording.obstacles)
    noise = (trial.light_noise, trial.motor_noise, trial.sweep)
    return trial.scenario, trial.index, trial.seed, trial.place, noise, ground


def _told(grade: Grade, result: CriterionResult) -> CriterionResult:
    """The criterion with what is told to whoever sees it."""
    view = student_view(replace(grade, criteria=(result,)), BEFORE_PUBLICATION | {result.visibility})
    return replace(view.grade.criteria[0], evidence=(), predictions=())


def _with_by_hand(result: CriterionResult, language: Language) -> CriterionResult:
    words = by_hand_words(result, language)
    return replace(result, message=" ".join(filter(None, (words, result.message)))) if words else result


def _severity(trial: TrialResult) -> int:
    if trial.verdict is Verdict.FINISHED:
        return 0
    return 1 if trial.verdict is Verdict.TIME_LIMIT else 2


def _without_hidden_trials(result: CriterionResult, new_index: dict[int, int]) -> CriterionResult:
    evidence = tuple(replace(item, trial=new_index[item.trial]) for item in result.evidence if item.trial in new_index)
    predictions = tuple(
        replace(prediction, trial=new_index[prediction.trial])
        for prediction in result.predictions
        if prediction.trial in new_index
    )
    kept = replace(result, evidence=evidence, predictions=predictions)
    if len(evidence) == len(result.evidence):
        return replace(kept, shown=None)
    # A grade of before this was kept apart tells nothing.
    shown = result.shown or Shown(shown_words(""))
    return replace(kept, message=shown.message, accuracy=shown.accuracy, curves=shown.curves, shown=None)
