"""The result of grading one submission: marks, verdicts, evidence. Every output is a pure function of it.

Nothing here judges or simulates; ``judge.py`` and ``grader.py`` make grades, reports and the store keep them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from decimal import Decimal

from responders.sandbox.meter import JobLimits, Spent
from sim.recorded import verdict_of
from sim.recording import Image, Pose, Recording, Verdict
from submissions.seeds import PUBLIC


@dataclass(frozen=True, slots=True)
class Counts:
    """What became of the images that were sent: ``sent`` is the sum of the four that follow it.

    ``duplicates`` are answers beyond the one that counts. Accuracy is over ``counted`` images (or patterns) and
    ``missing`` ones, which are wrong.
    """

    sent: int
    answered: int
    late: int
    malformed: int
    unanswered: int
    duplicates: int = 0
    counted: int = 0
    missing: int = 0
    of: str = "images"  # what is counted: images, or the patterns that several images show


@dataclass(frozen=True, slots=True)
class Confidence:
    """The mean confidence, 0 to 1, of the answers that were right and of those that were wrong, and how many said."""

    right: float | None
    n_right: int
    wrong: float | None
    n_wrong: int


@dataclass(frozen=True, slots=True)
class Accuracy:
    """How often a classifier was right, with the 95 % Wilson interval, and who was taken for whom.

    ``confusion`` maps (truth, answer) to a count; the answer is None where none was given or it could not be read.
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
        """The part of the images that was named rightly, 0 to 1; 0 without images."""
        return self.right / self.n if self.n else 0.0


@dataclass(frozen=True, slots=True)
class AccuracyCurve:
    """The accuracy along one swept condition (a key of ``submissions.sweep.CONDITIONS``), ascending."""

    along: str
    levels: tuple[Level, ...]
    asked: float | None = None  # the accuracy that marks are given for, where a criterion says one


@dataclass(frozen=True, slots=True)
class Prediction:
    """One image the robot sent, what it showed and what was answered."""

    image: Image
    truth: str
    answer: str | None
    scenario: str
    trial: int  # index into the grade's trials


@dataclass(frozen=True, slots=True)
class Measure:
    """What was measured on the way to a judgement: ``lap time``, 47.3, ``s``."""

    name: str
    value: float
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Evidence:
    """When and where a criterion was decided, so that a report can point at it."""

    trial: int  # index into the grade's trials
    passed: bool
    message: str
    t: float | None = None
    pose: Pose | None = None
    measures: tuple[Measure, ...] = ()


@dataclass(frozen=True, slots=True)
class Shown:
    """What is told of a criterion while some of its trials are not shown: as if there were the visible ones alone.

    A student can put into a hidden trial's numbers and words what the robot saw there.
    """

    message: str
    accuracy: Accuracy | None = None
    curves: tuple[AccuracyCurve, ...] = ()


@dataclass(frozen=True, slots=True)
class SetByHand:
    """That an instructor set a criterion's marks or excused it, and what the grader had given."""

    graded: Decimal | None  # None where it could not be judged
    worth: Decimal  # the most there are for it, where nobody excuses it
    reason: str
    excused: bool


@dataclass(frozen=True, slots=True)
class WrittenComment:
    """What an instructor wrote to the student; an empty ``criterion`` is for all of the submission."""

    criterion: str
    text: str


@dataclass(frozen=True, slots=True)
class CriterionResult:
    """One marked line; an excused one is out of no marks."""

    id: str
    title: str
    marks: Decimal
    max_marks: Decimal
    message: str  # what was expected, what happened; of all trials, so for staff where ``shown`` is something else
    visibility: str = "visible"
    evidence: tuple[Evidence, ...] = ()
    accuracy: Accuracy | None = None
    predictions: tuple[Prediction, ...] = ()
    curves: tuple[AccuracyCurve, ...] = ()
    shown: Shown | None = None  # None where every trial is visible
    unjudged: str = ""  # why it could not be judged, for staff; empty if it was
    for_staff: str = ""  # where somebody should look, which no student is told
    set_by_hand: SetByHand | None = None  # None of a grade as graded

    @property
    def worth(self) -> Decimal:
        """The most marks there are for it, whoever excused it."""
        return self.max_marks if self.set_by_hand is None else self.set_by_hand.worth

    @property
    def excused(self) -> bool:
        """Whether neither its marks nor the most there are count."""
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
    sweep: tuple[tuple[str, float], ...] = ()  # the condition that is swept and its level in this trial
    place: int = 0  # which of the scenario's poses it started from, whatever noise or the program made of that

    @property
    def verdict(self) -> Verdict:
        """How the run ended, as recorded."""
        return verdict_of(self.recording)


@dataclass(frozen=True, slots=True)
class Cost:
    """What all trials may cost together and, for staff, what they did."""

    limits: JobLimits
    spent: Spent | None = None


@dataclass(frozen=True, slots=True)
class Grade:
    """The marks of one job. ``sandbox`` says which layers stood around the student's code."""

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
    missing: str = ""  # the file that was asked for and not submitted; what needs it has no marks
    hints: tuple[str, ...] = ()  # what probably cost marks, the most telling first; no mark depends on them
    secret_sha256: str = PUBLIC.sha256  # of the secret that the seeds were hashed from
    cost: Cost | None = field(default=None, compare=False)  # measured, so that no two runs need agree
    comments: tuple[WrittenComment, ...] = ()

    @property
    def marks(self) -> Decimal:
        """The marks of all criteria together."""
        return sum((result.marks for result in self.criteria), Decimal(0))

    @property
    def max_marks(self) -> Decimal:
        """The marks that all criteria together could have given, but for those that are excused."""
        return sum((result.max_marks for result in self.criteria), Decimal(0))

    @property
    def worth(self) -> Decimal:
        """The marks that all criteria together could have given, those that are excused included."""
        return sum((result.worth for result in self.criteria), Decimal(0))

    @property
    def verdict(self) -> Verdict:
        """The verdict of the first faulty trial, ``finished`` if there is none."""
        return next((t.verdict for t in self.trials if t.verdict is not Verdict.FINISHED), Verdict.FINISHED)

    @property
    def accuracy(self) -> Accuracy | None:
        """The accuracy of ``recognition``."""
        return self.recognition.accuracy if self.recognition is not None else None

    @property
    def recognition(self) -> CriterionResult | None:
        """The first marked criterion with an accuracy and not excused; without one the first that is for practice."""
        measured = [each for each in self.criteria if each.accuracy is not None and not each.excused]
        return next((result for result in measured if result.worth), measured[0] if measured else None)


def unjudged_notes(criteria: Sequence[CriterionResult]) -> tuple[str, ...]:
    """Return the note that some of these criteria could not be judged, if so."""
    count = sum(bool(result.unjudged) for result in criteria)
    return (f"{count} of {len(criteria)} criteria could not be judged; staff will look at it",) if count else ()
