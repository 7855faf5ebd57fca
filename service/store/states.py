"""Enumerations of the store: roles, queues, and the states of jobs, plots, batches and grades.

``jobs.py`` defines the transitions between job states.
"""

from __future__ import annotations

from enum import StrEnum


class Role(StrEnum):
    """What somebody is in a course."""

    STUDENT = "student"
    INSTRUCTOR = "instructor"


class CredentialKind(StrEnum):
    """What a secret is good for."""

    LINK = "link"  # signs in once
    SESSION = "session"  # a signed-in browser
    TOKEN = "token"  # for a program


class Lane(StrEnum):
    """Who waits for the job: a person now, or a batch."""

    INTERACTIVE = "interactive"
    BATCH = "batch"


class JobState(StrEnum):
    """How far a job has come on its way to a grade."""

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


class TryoutState(StrEnum):
    """How far a program has come that a student tries without submitting it."""

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
    """What a claim looks at; how far a batch is follows from its jobs."""

    OPEN = "open"
    PAUSED = "paused"  # running jobs continue, queued jobs do not start
    CANCELLED = "cancelled"


class Standing(StrEnum):
    """What a job's grade is to its submission. Of one submission at most one grade stands."""

    STANDS = "stands"  # the one shown in reports and exports
    PROPOSED = "proposed"  # a regrade that is not published yet
    KEPT = "kept"  # replaced by another grade
