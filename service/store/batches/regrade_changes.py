"""Changes by regrades: old and new marks of each submission, and the stages that caused the differences.

Reads all changes of a batch in a fixed number of statements. ``change_stages.py`` determines the stages.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from sqlalchemy import ColumnElement, Row, and_, func, or_, select, union_all
from sqlalchemy.orm import Session, aliased

from service.grading.class_statistics import PASS_SHARE
from service.page_rows import select_page
from service.store.batches.change_stages import (
    Comparison,
    CriterionTables,
    TrialKey,
    TrialOutcome,
    VersionDifference,
    compare_versions,
    find_stages,
    find_stages_of_equal_marks,
)
from service.store.batches.changes import Change, ChangesSummary, CriterionChange, compute_share, summarise_changes
from service.store.batches.stage_texts import NOTHING_CHANGED, SAME_MARKS, describe_stages
from service.store.courses.assignment_versions import assignment_from_bytes
from service.store.courses.hidden_names import NO_HIDDEN_NAMES, HiddenNames
from service.store.grades.judged_again import CriterionWorth, JudgedAgain, load_judged_again
from service.store.grades.overrides import compute_overridden_marks
from service.store.states import ChangeStage, JobState
from service.store.tables.courses import AssignmentVersion
from service.store.tables.grades import CriterionResultRow, Override, TrialRow
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Job, SubmissionRow

if TYPE_CHECKING:
    from submissions.assignment.definition import Assignment

_CHANGES_A_PAGE = 50
#: The jobs of a regrade and of the earlier grade (with the prefix ``old_``), with the student and the assignment.
_Pair: TypeAlias = Row[*tuple[Any, ...]]
_CODE_STAGES = frozenset({ChangeStage.JUDGING, ChangeStage.SIMULATOR})


@dataclass(frozen=True, slots=True)
class ChangesPage:
    """A page of the changes of a batch, with a summary of all and the number that differ or are not graded yet."""

    changes: tuple[Change, ...]
    summary: ChangesSummary
    found: int
    differing: int
    page: int
    pages: int


def load_change(session: Session, job_id: str) -> Change | None:
    """Return the change that a regrade makes; None if the job is not a regrade."""
    loaded_changes = _load_changes(session, Job.id == job_id, NO_HIDDEN_NAMES, PASS_SHARE)
    return loaded_changes[0][0] if loaded_changes else None


def load_changes(
    session: Session, batch_id: str, hidden_names: HiddenNames, pass_share: Decimal = PASS_SHARE
) -> list[Change]:
    """Return the changes of a batch of regrades, ordered by displayed student name."""
    loaded_changes = _load_changes(session, _match_batch(batch_id), hidden_names, pass_share)
    return sorted((change for change, _ in loaded_changes), key=lambda each: (each.student, each.job_id))


def load_changes_page(
    session: Session, batch_id: str, page: int, hidden_names: HiddenNames, pass_share: Decimal = PASS_SHARE
) -> ChangesPage:
    """Return a page of the changes of a batch of regrades: different marks first, then by student.

    If names are hidden, the order is that of the random job ids.
    """
    loaded_changes = _load_changes(session, _match_batch(batch_id), hidden_names, pass_share)

    def get_order(loaded_change: tuple[Change, str]) -> tuple[bool, str, str]:
        change, assignment = loaded_change
        name = "" if assignment in hidden_names.assignments else change.student
        return not change.is_open_or_differs, name, change.job_id

    changes = [change for change, _ in sorted(loaded_changes, key=get_order)]
    shown = select_page(changes, page, _CHANGES_A_PAGE)
    return ChangesPage(
        shown.rows,
        summarise_changes(changes, pass_share),
        len(changes),
        sum(change.is_open_or_differs for change in changes),
        shown.page,
        shown.pages,
    )


@dataclass(frozen=True, slots=True)
class _Line:
    """One criterion of a grade: its title, its marks by the grader and as they count, and who set them."""

    title: str
    graded: CriterionWorth
    counted: CriterionWorth
    by_hand: bool


@dataclass(frozen=True, slots=True)
class _TrialChanges:
    """The trials of a regrade with another recording in their position, before and after; and the number of others."""

    before: Mapping[TrialKey, TrialOutcome]
    after: Mapping[TrialKey, TrialOutcome]
    equal_trials: int


_NO_TRIAL_CHANGES = _TrialChanges({}, {}, 0)


@dataclass(frozen=True, slots=True)
class _Gradings:
    """Data of the gradings of a batch, by job; ``trials`` only of regrades with other recordings."""

    lines: Mapping[str, Mapping[str, _Line]]
    trials: Mapping[str, _TrialChanges]
    judged_again: Mapping[str, JudgedAgain]


class _Versions:
    """The assignment versions of a batch, read together when one is needed, and their differences."""

    def __init__(self, session: Session, version_ids: Collection[int]) -> None:
        self._session = session
        self._version_ids = version_ids
        self._contents: dict[int, bytes] = {}
        self._assignments: dict[int, Assignment] = {}
        self._differences: dict[tuple[int, int], VersionDifference] = {}

    def read(self, version_id: int) -> Assignment:
        """Return the assignment of a version. Raises ValueError or TypeError if it cannot be read back."""
        if not self._contents:
            query = select(AssignmentVersion.id, AssignmentVersion.content)
            for row in self._session.execute(query.where(AssignmentVersion.id.in_(self._version_ids))):
                self._contents[row.id] = row.content
        if version_id not in self._assignments:
            self._assignments[version_id] = assignment_from_bytes(self._contents[version_id])
        return self._assignments[version_id]

    def compare(self, before: int, after: int) -> VersionDifference:
        """Return the difference between two versions."""
        if before == after:
            return VersionDifference()
        if (before, after) not in self._differences:
            self._differences[before, after] = compare_versions(self.read(before), self.read(after))
        return self._differences[before, after]


def _match_batch(batch_id: str) -> ColumnElement[bool]:
    return and_(Job.batch_id == batch_id, Job.suspect.is_(None))


def _load_changes(
    session: Session, condition: ColumnElement[bool], hidden_names: HiddenNames, pass_share: Decimal
) -> list[tuple[Change, str]]:
    """Return the changes by the regrades that match the condition, with their assignments, in no order."""
    original = aliased(Job)
    columns = [
        getattr(job, name).label(f"{prefix}{name}")
        for prefix, job in (("", Job), ("old_", original))
        for name in (
            *("id", "state", "standing", "marks", "max_marks", "error", "assignment_version_id"),
            *("grader_version", "grader_sha256", "secret_sha256", "suspect"),
        )
    ]
    query = (
        select(*columns, Enrolment.student, SubmissionRow.assignment)
        .join(original, Job.regrade_of == original.id)
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .join(SubmissionRow, Job.submission_id == SubmissionRow.id)
        .where(condition)
    )
    rows = session.execute(query).all()
    gradings = _load_gradings(session, [row for row in rows if row.state is JobState.DONE])
    version_ids = {each for row in rows for each in (row.assignment_version_id, row.old_assignment_version_id)}
    versions = _Versions(session, version_ids)
    return [
        (
            _build_change(row, hidden_names.label_student(row.assignment, row.student), gradings, versions, pass_share),
            row.assignment,
        )
        for row in rows
    ]


def _load_gradings(session: Session, rows: Sequence[_Pair]) -> _Gradings:
    lines = _load_lines(session, [row.id for row in rows] + [row.old_id for row in rows])
    # Trials are needed only to tell the stages of other marks, and to find other recordings that nothing explains.
    compared_ids = {
        row.id
        for row in rows
        if row.old_state is JobState.DONE
        and (not _has_other_inputs(row) or _have_other_marks(lines[row.old_id], lines[row.id]))
    }
    changed_ids = [row.id for row in rows if row.id in compared_ids and _has_other_inputs(row)]
    return _Gradings(lines, _load_trial_changes(session, compared_ids), load_judged_again(session, changed_ids))


def _load_lines(session: Session, job_ids: Collection[str]) -> Mapping[str, Mapping[str, _Line]]:
    """Return the criteria of each job by id, in their order."""
    row = CriterionResultRow
    is_override = and_(
        Override.submission_id == Job.submission_id,
        Override.criterion == row.criterion,
        Override.withdrawn_at.is_(None),
    )
    query = (
        select(row.job_id, row.criterion, row.title, row.marks, row.max_marks, Override)
        .join(Job, row.job_id == Job.id)
        .outerjoin(Override, is_override)
        .where(row.job_id.in_(job_ids))
        .order_by(row.job_id, row.position)
    )
    lines: dict[str, dict[str, _Line]] = defaultdict(dict)
    for job_id, criterion, title, marks, worth, override in session.execute(query):
        counted = (marks, worth) if override is None else compute_overridden_marks(override.marks, worth)
        lines[job_id][criterion] = _Line(title, (marks, worth), counted, override is not None)
    return lines


def _load_trial_changes(session: Session, job_ids: Collection[str]) -> Mapping[str, _TrialChanges]:
    """Return the trials whose recordings differ from the earlier ones in the same position, by regrade."""
    new, old = aliased(TrialRow), aliased(TrialRow)
    is_same_position = old.position == new.position
    is_other = or_(
        old.id.is_(None),
        old.sha256 != new.sha256,
        old.verdict != new.verdict,
        old.scenario != new.scenario,
        old.scenario_index != new.scenario_index,
    )
    trial_count = select(func.count()).where(TrialRow.job_id == Job.regrade_of).correlate(Job).scalar_subquery()
    columns = [
        *(Job.id, trial_count),
        *(getattr(trial, name) for trial in (old, new) for name in ("scenario", "scenario_index", "sha256", "verdict")),
    ]
    other_trials = (
        select(*columns)
        .join(new, new.job_id == Job.id)
        .outerjoin(old, and_(old.job_id == Job.regrade_of, is_same_position))
        .where(Job.id.in_(job_ids), is_other)
    )
    missing_trials = (
        select(*columns)
        .join(old, old.job_id == Job.regrade_of)
        .outerjoin(new, and_(new.job_id == Job.id, is_same_position))
        .where(Job.id.in_(job_ids), new.id.is_(None))
    )
    before: dict[str, dict[TrialKey, TrialOutcome]] = defaultdict(dict)
    after: dict[str, dict[TrialKey, TrialOutcome]] = defaultdict(dict)
    counts: dict[str, int] = {}
    for job_id, count, *values in session.execute(union_all(other_trials, missing_trials)):
        counts[job_id] = count
        for trials, (scenario, index, sha256, verdict) in ((before, values[:4]), (after, values[4:])):
            if scenario is not None:
                trials[job_id][scenario, index] = sha256, verdict
    return {
        job_id: _TrialChanges(before[job_id], after[job_id], count - len(before[job_id]))
        for job_id, count in counts.items()
    }


def _have_other_marks(before: Mapping[str, _Line], after: Mapping[str, _Line]) -> bool:
    return before.keys() != after.keys() or any(line.counted != after[name].counted for name, line in before.items())


def _has_other_code(row: _Pair) -> bool:
    return row.old_grader_sha256 is None or row.old_grader_sha256 != row.grader_sha256


def _has_other_inputs(row: _Pair) -> bool:
    """Return whether the two gradings had another assignment version, code or secret, or another kind of worker."""
    return (
        row.assignment_version_id != row.old_assignment_version_id
        or _has_other_code(row)
        or row.secret_sha256 != row.old_secret_sha256
        or row.old_suspect is not None
    )


def _build_change(row: _Pair, student: str, gradings: _Gradings, versions: _Versions, pass_share: Decimal) -> Change:
    criteria: tuple[CriterionChange, ...] = ()
    stages: tuple[ChangeStage, ...] = ()
    changed_parts: tuple[str, ...] = ()
    crosses: Literal["up", "down"] | None = None
    if row.state is JobState.DONE and row.old_state is not JobState.DONE:
        stages = (ChangeStage.FIRST_GRADE,)
    elif row.state is JobState.DONE:
        criteria = _compare_criteria(row, gradings, versions)
        found_stages = {stage for criterion in criteria for stage in criterion.stages}
        stages = tuple(stage for stage in ChangeStage if stage in found_stages)
        if not criteria and row.id in gradings.trials and not _has_other_inputs(row):
            stages = find_stages_of_equal_marks(_compare_gradings(row, gradings, versions))
        if ChangeStage.ASSIGNMENT in stages:
            changed_parts = versions.compare(row.old_assignment_version_id, row.assignment_version_id).parts
        crosses = _find_crossing(row, pass_share)
    return Change(
        student=student,
        job_id=row.id,
        before_id=row.old_id,
        state=row.state,
        standing=row.standing,
        before=row.old_marks,
        after=row.marks,
        before_max=row.old_max_marks,
        after_max=row.max_marks,
        criteria=criteria,
        reason=_describe_reason(row, stages, changed_parts),
        stages=stages,
        changed_parts=changed_parts,
        crosses=crosses,
        is_unexplained=ChangeStage.UNEXPLAINED in stages,
    )


def _compare_gradings(row: _Pair, gradings: _Gradings, versions: _Versions) -> Comparison:
    trial_changes = gradings.trials.get(row.id, _NO_TRIAL_CHANGES)
    assignments = [versions.read(each) for each in (row.old_assignment_version_id, row.assignment_version_id)]
    return Comparison(
        version=versions.compare(row.old_assignment_version_id, row.assignment_version_id),
        has_other_code=_has_other_code(row),
        has_other_secret=row.secret_sha256 != row.old_secret_sha256,
        has_suspect_worker=row.old_suspect is not None,
        pools={each.id for assignment in assignments for each in assignment.scenarios if each.draw is not None},
        before=trial_changes.before,
        after=trial_changes.after,
        equal_trials=trial_changes.equal_trials,
    )


def _compare_criteria(row: _Pair, gradings: _Gradings, versions: _Versions) -> tuple[CriterionChange, ...]:
    old_lines, new_lines = gradings.lines[row.old_id], gradings.lines[row.id]
    if not _have_other_marks(old_lines, new_lines):
        return ()
    comparison = _compare_gradings(row, gradings, versions)
    tables = [
        {each.id: each for each in versions.read(version_id).criteria}
        for version_id in (row.old_assignment_version_id, row.assignment_version_id)
    ]
    judged_again = gradings.judged_again.get(row.id)
    if judged_again is not None and judged_again.earlier_id != row.old_id:
        judged_again = None  # a copied file of another regrade
    changes = []
    for name, line in {**old_lines, **new_lines}.items():
        old_line, new_line = old_lines.get(name), new_lines.get(name)
        before, after = (None if each is None else each.counted for each in (old_line, new_line))
        if before == after:
            continue
        criterion_tables = CriterionTables(tables[0].get(name), tables[1].get(name))
        stages: tuple[ChangeStage, ...] = (ChangeStage.CRITERIA,)
        if old_line is not None and new_line is not None:
            worth = old_line.graded, new_line.graded
            stages = find_stages(name, criterion_tables, comparison, worth, judged_again)
        crosses = before is not None and after is not None and _crosses_boundary(before, after, criterion_tables)
        by_hand = new_line is not None and new_line.by_hand
        changes.append(CriterionChange(line.title, before, after, by_hand, stages, crosses))
    return tuple(changes)


def _crosses_boundary(before: CriterionWorth, after: CriterionWorth, tables: CriterionTables) -> bool:
    return tables.has_bands or (before[0] == before[1]) != (after[0] == after[1])


def _find_crossing(row: _Pair, pass_share: Decimal) -> Literal["up", "down"] | None:
    # A student excused from everything has no marks, so neither passes nor fails.
    if not row.old_max_marks or not row.max_marks:
        return None
    passes = [
        compute_share(marks, max_marks) >= Fraction(pass_share)
        for marks, max_marks in ((row.old_marks, row.old_max_marks), (row.marks, row.max_marks))
    ]
    if passes[0] == passes[1]:
        return None
    return "up" if passes[1] else "down"


def _describe_reason(row: _Pair, stages: Sequence[ChangeStage], changed_parts: Sequence[str]) -> str:
    """Return the stages in words, with the parts of the assignment and the releases that differ."""
    if row.state is not JobState.DONE:
        return str(row.error or row.state.value)
    if not stages:
        return SAME_MARKS if _has_other_inputs(row) else NOTHING_CHANGED
    has_other_release = row.old_grader_version != row.grader_version and not _CODE_STAGES.isdisjoint(stages)
    release_note = f" ({row.old_grader_version} to {row.grader_version})" if has_other_release else ""
    return describe_stages(stages, changed_parts) + release_note
