"""The responder of the kernel: it answers the robot with the notebook's own functions and variables."""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType
from typing import Any

from robomark_notebook.engine import Question, RobotRun


class KernelResponder:
    """Answers the texts of one run, and passes the robot's log entries on to ``roboSim`` as they arrive."""

    def __init__(self, shell: Any, robo_sim: Any) -> None:
        self._shell = shell
        self._robo_sim = robo_sim
        self._data_count = self._image_count = 0
        self._has_failed = False
        #: Sentences on missing answers. The engine knows less about them.
        self.notes: list[str] = []

    def answer(self, question: Question) -> str | None:
        """Return the answer to a text; None if there is none. Shows the traceback of an error in the responder."""
        self._deliver(question.data, question.images)
        if self._has_failed:
            return None
        try:
            responder = self._robo_sim.find_responder(self._shell.user_ns)
        except LookupError as error:
            self._give_up(question, str(error))
            return None
        try:
            answer = self._robo_sim.ask(responder, question.text)
        except Exception as error:
            self._shell.showtraceback((type(error), error, _find_student_frames(error)), tb_offset=0)
            self._give_up(question, f"the responder ended with {type(error).__name__}, shown above")
            return None
        if answer is None or isinstance(answer, str):
            return answer
        kind = type(answer).__name__
        self._add_note(f"{question.t:.2f} s: the responder returned a value of type {kind}; expected a text")
        return None

    def finish(self, run: RobotRun) -> None:
        """Pass on the log entries that no text came with."""
        self._deliver(run.data[self._data_count :], run.images[self._image_count :])

    def _deliver(self, data: Sequence[tuple[str, float, float]], images: Sequence[str]) -> None:
        self._data_count += len(data)
        self._image_count += len(images)
        self._robo_sim.collect([[name, value, None, seconds] for name, value, seconds in data], list(images))

    def _give_up(self, question: Question, reason: str) -> None:
        self._has_failed = True
        self._add_note(f"{question.t:.2f} s: no more answers, because {reason}")

    def _add_note(self, note: str) -> None:
        if len(self.notes) < 20:
            self.notes.append(note)


def _find_student_frames(error: Exception) -> TracebackType | None:
    """Return the traceback from the responder on, or all of it if the responder could not even be called."""
    called = error.__traceback__ and error.__traceback__.tb_next
    return (called and called.tb_next) or error.__traceback__
