"""The result of grading one submission: marks, verdicts, evidence. Every output is a pure function of it.

This module contains data only. ``judge.py`` and ``grader.py`` create grades; reports and the store read them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal

from responders.sandbox.meter import JobCosts, JobLimits
from service.grading.findings import Finding
from sim.recording import Image, Pose, Recording, Verdict
from sim.recording_values import decide_verdict
from sim.sentences import Sentence
from submissions.seeds import PUBLIC_SECRET


@dataclass(frozen=True, slots=True)
class Counts:
    """Counts of the images that were sent. ``sent`` is the sum of the next four fields.

    ``duplicates`` are answers after the one that counts. Accuracy is calculated over ``counted`` images (or patterns)
    and ``missing`` ones. Missing ones count as wrong.
    """

    sent: int
    answered: int
    late: int
    malformed: int
    unanswered: int
    duplicates: int = 0
    counted: int = 0
    missing: int = 0
    of: str = "images"  # the unit: images, or patterns that several images show


@dataclass(frozen=True, slots=True)
class Confidence:
    """Mean confidence (0 to 1) of the correct and of the wrong answers, and how many answers had one."""

    right: float | None
    n_right: int
    wrong: float | None
    n_wrong: int


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Accuracy of a classifier, with its 95 % Wilson interval and confusion matrix.

    ``confusion`` maps (truth, answer) to a count. The answer is None if there was none or it could not be read.
    """

    value: float
    low: float
    high: float
    n: int
    labels: tuple[str, ...]
    confusion: tuple[tuple[str, str | None, int], ...]
    counts: Counts | None = None
    confidence: Confidence | None = None


@dataclass(frozen=True, slots=True)
class Level:
    """The accuracy at one level of a swept condition, with its 95 % Wilson interval."""

    at: float
    right: int
    n: int
    low: float
    high: float

    @property
    def value(self) -> float:
        """Return the fraction of images identified correctly, 0 to 1; 0 without images."""
        return self.right / self.n if self.n else 0.0


@dataclass(frozen=True, slots=True)
class AccuracyCurve:
    """The accuracy along one swept condition (a key of ``CONDITIONS``), in ascending order."""

    along: str
    levels: tuple[Level, ...]
    asked: float | None = None  # the required accuracy, if the criterion has one


@dataclass(frozen=True, slots=True)
class Prediction:
    """One image that the robot sent, its true label and the answer."""

    image: Image
    truth: str
    answer: str | None
    scenario: str
    trial: int  # index into the grade's trials


@dataclass(frozen=True, slots=True)
class Measure:
    """A measured value that a judgement is based on: ``lap time``, 47.3, ``s``."""

    name: str
    value: float
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Evidence:
    """The time and place at which a criterion was decided, for reports to refer to."""

    trial: int  # index into the grade's trials
    passed: bool
    message: str
    t: float | None = None
    pose: Pose | None = None
    measures: tuple[Measure, ...] = ()


@dataclass(frozen=True, slots=True)
class PoolValue:
    """The value of a criterion over a pool of ``size`` trials, of which ``drawn`` were run.

    ``least`` and ``most`` are the bounds of the value, from 0 to 1; equal if the value is exact. ``is_decided`` says
    whether all values within the bounds give the same marks. ``note`` says all this in sentences. For students, if
    trials are hidden, the bounds are rounded and ``drawn`` is 0 until the value is exact.
    """

    size: int
    drawn: int
    least: float
    most: float
    is_decided: bool
    note: str = ""

    @property
    def is_exact(self) -> bool:
        """Return whether the whole pool was run."""
        return self.drawn == self.size


@dataclass(frozen=True, slots=True)
class VisibleFeedback:
    """The feedback on a criterion that has hidden trials, made from its visible trials only.

    Students could otherwise encode in numbers and texts what the robot saw in a hidden trial.
    """

    message: str
    accuracy: Accuracy | None = None
    curves: tuple[AccuracyCurve, ...] = ()
    pool: PoolValue | None = None


@dataclass(frozen=True, slots=True)
class StaffAdjustment:
    """A staff adjustment of a criterion's marks, or its exclusion, with the marks that the grader gave."""

    graded: Decimal | None  # None if it could not be judged
    worth: Decimal  # maximum marks before it was excused
    reason: str
    excused: bool


@dataclass(frozen=True, slots=True)
class WrittenComment:
    """A comment from an instructor to the student. If ``criterion`` is empty, it is about the whole submission."""

    criterion: str
    text: str


@dataclass(frozen=True, slots=True)
class CriterionResult:
    """The result of one criterion. An excused criterion has a maximum of 0 marks."""

    id: str
    title: str
    marks: Decimal
    max_marks: Decimal
    message: str  # expected and observed, over all trials; staff only if ``shown`` differs
    visibility: str = "visible"
    evidence: tuple[Evidence, ...] = ()
    accuracy: Accuracy | None = None
    predictions: tuple[Prediction, ...] = ()
    curves: tuple[AccuracyCurve, ...] = ()
    shown: VisibleFeedback | None = None  # None if every trial is visible
    unjudged: str = ""  # why it could not be judged, for staff; otherwise empty
    for_staff: str = ""  # what staff should check; not shown to students
    set_by_hand: StaffAdjustment | None = None  # None if the marks are as graded
    pool: PoolValue | None = None  # None if it is not defined over a pool
    #: By trial; None for what was judged once for all of them. Empty in a grade from the database.
    findings: Mapping[int | None, tuple[Finding, ...]] = field(default_factory=dict, compare=False, repr=False)

    @property
    def worth(self) -> Decimal:
        """The maximum marks of the criterion, even if it is excused."""
        return self.max_marks if self.set_by_hand is None else self.set_by_hand.worth

    @property
    def excused(self) -> bool:
        """Return whether the criterion is excused: neither its marks nor its maximum count."""
        return self.set_by_hand is not None and self.set_by_hand.excused


@dataclass(frozen=True, slots=True)
class TrialResult:
    """One run of a scenario at one pose, noise level and seed."""

    scenario: str
    index: int
    seed: int
    light_noise: float
    motor_noise: float
    visibility: str
    recording: Recording
    sweep: tuple[tuple[str, float], ...] = ()  # the swept condition and its level in this trial
    place: int = 0  # index of the scenario's pose, before noise and before the program ran

    @property
    def verdict(self) -> Verdict:
        """The verdict of the run, as recorded."""
        return decide_verdict(self.recording)


@dataclass(frozen=True, slots=True)
class ShownCause:
    """Why a criterion lost marks, as reruns showed it: sentences, the next step, and whether only staff see it.

    ``files`` are those of the parts that lose the marks, if reruns showed them.
    """

    criterion: str
    text: str
    next_step: str
    for_staff: bool = False
    files: tuple[str, ...] = ()
    is_hidden: bool = False  # shown by hidden trials
    staff_note: str = ""  # whether the student sees a cause in hidden trials


@dataclass(frozen=True, slots=True)
class Cost:
    """The shared limits of all trials and, for staff, the resources that they used."""

    limits: JobLimits
    spent: JobCosts | None = None


@dataclass(frozen=True, slots=True)
class Grade:
    """The marks of one job. ``sandbox`` lists the sandbox layers that were active."""

    assignment: str
    assignment_title: str
    assignment_version: str  # content hash
    submission: str  # content hash
    student: str
    criteria: tuple[CriterionResult, ...]
    trials: tuple[TrialResult, ...]
    sandbox: str
    grader_version: str
    notes: tuple[str, ...] = ()
    missing: str = ""  # a required file that was not submitted; criteria that need it get no marks
    hints: tuple[str, ...] = ()  # likely reasons for lost marks, best first; they don't affect marks
    secret_sha256: str = PUBLIC_SECRET.sha256  # hash of the secret that the seeds are derived from
    cost: Cost | None = field(default=None, compare=False)  # measured, so it may differ between two runs
    comments: tuple[WrittenComment, ...] = ()
    causes: tuple[ShownCause, ...] = field(default=(), compare=False)  # from reruns, which may not have been made yet

    @property
    def marks(self) -> Decimal:
        """The total marks of all criteria."""
        return sum((result.marks for result in self.criteria), Decimal(0))

    @property
    def max_marks(self) -> Decimal:
        """The maximum total marks, without excused criteria."""
        return sum((result.max_marks for result in self.criteria), Decimal(0))

    @property
    def worth(self) -> Decimal:
        """The maximum total marks, with excused criteria."""
        return sum((result.worth for result in self.criteria), Decimal(0))

    @property
    def is_provisional(self) -> bool:
        """Return whether marks depend on a pool of which not all trials were run."""
        return any(result.pool is not None and not result.pool.is_exact for result in self.criteria)

    @property
    def verdict(self) -> Verdict:
        """The verdict of the first trial that did not finish; ``finished`` if all did."""
        return next((t.verdict for t in self.trials if t.verdict is not Verdict.FINISHED), Verdict.FINISHED)

    @property
    def accuracy(self) -> Accuracy | None:
        """The accuracy of ``recognition``."""
        return self.recognition.accuracy if self.recognition is not None else None

    @property
    def recognition(self) -> CriterionResult | None:
        """The first marked criterion with an accuracy that is not excused; if there is none, the first unmarked one."""
        measured = [each for each in self.criteria if each.accuracy is not None and not each.excused]
        return next((result for result in measured if result.worth), measured[0] if measured else None)


def build_unjudged_notes(criteria: Sequence[CriterionResult]) -> tuple[str, ...]:
    """Return a note on the number of criteria that could not be judged; empty if all were judged."""
    count = sum(bool(result.unjudged) for result in criteria)
    if not count:
        return ()
    return (
        Sentence(
            "%(count)s of %(criteria)s criteria could not be judged; staff will review them",
            count=count,
            criteria=len(criteria),
        ),
    )


def convert_texts(grade: Grade, convert: Callable[[str], str]) -> Grade:
    """Return the grade with every text that Robomark wrote converted: notes, hints, and those of the criteria."""
    return replace(
        grade,
        criteria=tuple(_convert_result(result, convert) for result in grade.criteria),
        notes=tuple(convert(note) for note in grade.notes),
        hints=tuple(convert(hint) for hint in grade.hints),
        causes=tuple(
            replace(
                each,
                text=convert(each.text),
                next_step=convert(each.next_step),
                staff_note=convert(each.staff_note),
            )
            for each in grade.causes
        ),
    )


def _convert_result(result: CriterionResult, convert: Callable[[str], str]) -> CriterionResult:
    return replace(
        result,
        message=convert(result.message),
        evidence=tuple(replace(each, message=convert(each.message)) for each in result.evidence),
        shown=None if result.shown is None else _convert_feedback(result.shown, convert),
        pool=_convert_pool(result.pool, convert),
        unjudged=convert(result.unjudged),
        for_staff=convert(result.for_staff),
    )


def _convert_feedback(feedback: VisibleFeedback, convert: Callable[[str], str]) -> VisibleFeedback:
    return replace(feedback, message=convert(feedback.message), pool=_convert_pool(feedback.pool, convert))


def _convert_pool(pool: PoolValue | None, convert: Callable[[str], str]) -> PoolValue | None:
    return None if pool is None else replace(pool, note=convert(pool.note))
