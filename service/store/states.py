"""What the rows of the store can be: roles, lanes, and the states of jobs, plots, batches and grades.

Which may follow upon which is said in ``jobs.py``.
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
    SESSION = "session"  # a browser that is signed in
    TOKEN = "token"  # a program's


class Lane(StrEnum):
    """Who waits for the job: a person now, or a batch."""

    INTERACTIVE = "interactive"
    BATCH = "batch"


class JobState(StrEnum):
    """How far a job has come on its way to a grade."""

    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"  # has a grade
    DEAD = "dead"  # could not be graded; ``error`` says why
    CANCELLED = "cancelled"  # by the intake, which gives a ``CancelReason``, or by staff; ``error`` tells people why


class CancelReason(StrEnum):
    """Why the intake cancelled a job."""

    SUPERSEDED = "superseded"  # by a newer submission
    OVER_LIMIT = "over limit"  # graded only when staff ask for it


UNFINISHED = (JobState.QUEUED, JobState.RUNNING)


class TryoutState(StrEnum):
    """How far a program has come that a student tries without submitting it."""

    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"  # by a fault of ours; ``error`` says which


class PlotState(StrEnum):
    """Plots come after the marks and never change them."""

    NONE = "none"
    DUE = "due"
    DONE = "done"
    FAILED = "failed"


class BatchState(StrEnum):
    """What a claim looks at; how far a batch is follows from its jobs."""

    OPEN = "open"
    PAUSED = "paused"  # what runs goes on, what waits is not begun
    CANCELLED = "cancelled"


class Standing(StrEnum):
    """What a job's grade is to its submission. Of one submission at most one grade stands."""

    STANDS = "stands"  # the one that reports and exports show
    PROPOSED = "proposed"  # of a regrade, until it is published
    KEPT = "kept"  # another took its place
