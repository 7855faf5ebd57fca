"""The tree of errors; each carries one sentence that a user can act on.

RobomarkError
├── UsageError          the caller's mistake: a wrong flag, a missing file, an unreadable submission (exit status 2)
│   └── AssignmentError the instructor's mistake: an assignment that cannot be used
├── HostError           ours: a machine, a process or a service that failed (exit status 3)
└── Cancelled           somebody asked the grading to stop
"""

from sim.sentences import Sentence


class RobomarkError(Exception):
    """Base of every error Robomark raises on purpose; ``str(error)`` is the sentence for the user.

    With values it is the template of one, as ``Sentence`` has it.
    """

    def __init__(self, sentence: str | Sentence = "", /, **values: object) -> None:
        self.said = Sentence(sentence, values) if isinstance(sentence, str) else sentence
        super().__init__(str(self.said))


class UsageError(RobomarkError):
    """What the caller gave cannot be used."""


class AssignmentError(UsageError):
    """The assignment itself is wrong."""


class HostError(RobomarkError):
    """The machine, not the student, failed; the work may be tried again elsewhere."""


class Cancelled(RobomarkError):
    """The grading was asked to stop, by a user or because another worker holds the job now."""
