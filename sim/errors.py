"""Exception hierarchy. Each error has one sentence that tells the user how to act.

RobomarkError
├── UsageError          the caller's mistake: a wrong flag, a missing file, an unreadable submission (exit status 2)
│   └── AssignmentError the instructor's mistake: an assignment that cannot be used
├── HostError           a machine, process or service of this installation failed (exit status 3)
└── Cancelled           the grading was cancelled
"""

from sim.sentences import Sentence


class RobomarkError(Exception):
    """Base class of all errors that Robomark raises on purpose; ``str(error)`` is the sentence for the user.

    With values, the text is a template as in ``Sentence``.
    """

    def __init__(self, sentence: str = "", /, **values: object) -> None:
        self.message = sentence if isinstance(sentence, Sentence) else Sentence(sentence, **values)
        super().__init__(str(self.message))


class UsageError(RobomarkError):
    """The caller's input cannot be used."""


class AssignmentError(UsageError):
    """The assignment itself contains a mistake."""


class HostError(RobomarkError):
    """The host failed, not the student. The work can be retried elsewhere."""


class Cancelled(RobomarkError):
    """A user cancelled the grading, or another worker now has the job."""
