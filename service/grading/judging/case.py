"""What there is to judge a submission by: its trials, what was found out beside them, and the results so far.

Plain data; what any of it is worth is decided in the modules of the families.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from responders.function_calls import Called, Returned
from service.grading.grade import CriterionResult, TrialResult
from service.grading.judging.source_answers import SourceAnswers
from submissions.assignment.definition import Assignment
from submissions.criteria import Criterion
from submissions.magics import Flags
from submissions.submission import Part

#: Trials with their indices in the grade.
Indexed = Sequence[tuple[int, TrialResult]]


@dataclass(frozen=True, slots=True)
class StaticAnalysis:
    """``answers`` and ``called`` are by the id of a criterion, ``checks`` by that and the place of the trial."""

    answers: Mapping[str, SourceAnswers] = field(default_factory=dict)
    flags: Flags = field(default_factory=Flags)
    called: Mapping[str, Called] = field(default_factory=dict)
    checks: Mapping[tuple[str, int], Returned] = field(default_factory=dict)
    sandbox: str = ""
    missing: Part | None = None  # asked for, and not submitted


@dataclass(frozen=True, slots=True)
class Case:
    """One submission before its judges; ``results`` are those of the criteria before this one in turn, by id."""

    assignment: Assignment
    trials: Sequence[TrialResult]
    analysis: StaticAnalysis
    results: Mapping[str, CriterionResult]

    def looked_at_by(self, criterion: Criterion) -> Indexed:
        """The trials of the criterion's scenarios, as the robot had them that it looks at."""
        return [
            (index, as_had_by(criterion.robot, trial))
            for index, trial in enumerate(self.trials)
            if not criterion.scenarios or trial.scenario in criterion.scenarios
        ]


def has_hidden(trials: Indexed) -> bool:
    """Whether any of the trials is not shown to students at once."""
    return any(trial.visibility != "visible" for _, trial in trials)


def as_had_by(robot: int, trial: TrialResult) -> TrialResult:
    """The trial with the recording of that robot; of the first, where there is one."""
    partner = trial.recording.partner
    return trial if robot == 1 or partner is None else replace(trial, recording=partner)
