"""Enumerations of the store: roles, queues, the states of jobs, plots, batches and grades, and stages of regrades.

``job_transitions.py`` defines the transitions between job states.
"""

from __future__ import annotations

from enum import StrEnum


class Role(StrEnum):
    """The role of a member in a course."""

    STUDENT = "student"
    INSTRUCTOR = "instructor"


class CountedAttempt(StrEnum):
    """The rule of a course for the attempt that counts, among the graded ones within the limits."""

    LATEST = "latest"
    BEST = "best"  # the highest share of the maximum marks; the latest of several


class CompletionRule(StrEnum):
    """The rule of a course for provisional grades that were published before their pools were complete."""

    HIGHER = "higher"  # only higher exact marks replace the published ones
    EXACT = "exact"  # exact marks replace the published ones in any case


class ReleaseRule(StrEnum):
    """When students see the grades of an assignment, unless a date releases them before."""

    AT_ONCE = "at-once"  # all of them when they are graded
    OWN_AT_ONCE = "own-at-once"  # what students submitted themselves at once; what staff uploaded when it is published
    PUBLISHED = "published"  # all of them when they are published


class CredentialKind(StrEnum):
    """The kind of a credential."""

    LINK = "link"  # signs in once
    SESSION = "session"  # a signed-in browser
    TOKEN = "token"  # for a program


class JobQueue(StrEnum):
    """The queue of a job: interactive for a person who waits, batch, or completion of pools when nothing else waits."""

    INTERACTIVE = "interactive"
    BATCH = "batch"
    COMPLETION = "completion"


class JobState(StrEnum):
    """The state of a job."""

    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"  # has a grade
    DEAD = "dead"  # could not be graded; ``error`` contains the reason
    CANCELLED = "cancelled"  # by the intake, with a ``CancelReason``, or by staff; ``error`` is for display


class CancelReason(StrEnum):
    """The reason why the intake cancelled a job."""

    SUPERSEDED = "superseded"  # by a newer submission
    OVER_LIMIT = "over limit"  # graded only if staff ask for it


UNFINISHED = (JobState.QUEUED, JobState.RUNNING)


class RunState(StrEnum):
    """The state of a test run."""

    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"  # by a host fault; see ``error``


class PlotState(StrEnum):
    """The state of a job's plots, which follow the marks and do not affect them."""

    NONE = "none"
    DUE = "due"
    DONE = "done"
    FAILED = "failed"


class BatchState(StrEnum):
    """The state of a batch, which controls claims. Its progress follows from its jobs."""

    OPEN = "open"
    PAUSED = "paused"  # running jobs continue, queued jobs do not start
    CANCELLED = "cancelled"


class Standing(StrEnum):
    """The standing of a job's grade within its submission. At most one grade of a submission stands."""

    STANDS = "stands"  # the one shown in reports and exports
    PROPOSED = "proposed"  # a regrade that is not published yet
    KEPT = "kept"  # replaced by another grade


class ChangeStage(StrEnum):
    """What changed the marks in a regrade, in the order in which the stages are compared."""

    FIRST_GRADE = "first grade"  # there was no grade
    CRITERIA = "criteria"  # the stored recordings, judged by the criteria of the new version, give the new marks
    JUDGING = "judging"  # the stored recordings, judged by this release, give the new marks
    SIMULATOR = "simulator"  # the same trials, simulated by this release, have other recordings
    SECRET = "secret"  # the secret of the installation differs, and with it the seeds of the trials
    ASSIGNMENT = "assignment"  # the new version has other trials
    POOL = "pool"  # other trials of a pool were run
    WORKER = "worker"  # the worker of the earlier grade was found to grade wrongly
    UNEXPLAINED = "unexplained"  # nothing else: the program's own randomness, or the machine
