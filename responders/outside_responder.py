"""The responder of a run that is answered from outside: from a person's notebook, or with the answers of earlier runs.

Answers are untrusted and cost no simulated time. While the run waits for one, neither the program nor its limits move.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from responders.answer_texts import RETURN_HINT, build_length_fault, build_protocol_fault, build_text_answer
from responders.conversation import Answer
from responders.faults import build_stop_fault, describe_wrong_return
from responders.responder_process import LoggedData
from responders.sandbox.inside.frames import can_send_text
from responders.sandbox.meter import ChildStopped, JobMeter
from sim.errors import RobomarkError
from sim.recording import SECOND, Verdict


@dataclass(frozen=True, slots=True)
class OutsideQuestion:
    """A text from the robot, numbered from 0, at ``t`` seconds, with what the robot has logged since the last one."""

    number: int
    t: float
    text: str
    logged_data: LoggedData


#: Returns the answer to a question, or None if the responder returned nothing. Raises only errors of Robomark.
OutsideAnswerer = Callable[[OutsideQuestion], str | None]


class Unanswered(RobomarkError):
    """Raised by an answerer to end the run at this question."""

    def __init__(self, question: OutsideQuestion) -> None:
        super().__init__("the run ended at a question without an answer")
        self.question = question


class RememberedAnswers:
    """The answers to the first questions of a run; ``ask`` answers the others.

    A run that is repeated from the start repeats its questions, and nobody is asked twice.
    """

    def __init__(self, ask: OutsideAnswerer, answers: Sequence[str | None] = ()) -> None:
        self._ask = ask
        self._answers = list(answers)

    def __call__(self, question: OutsideQuestion) -> str | None:
        """Return the answer to a question. Questions come in order, and again from the first in each repeated run."""
        if question.number == len(self._answers):
            self._answers.append(self._ask(question))
        return self._answers[question.number]


class OutsideResponder:
    """Answers the texts of one run with ``ask``. Its answers count as output, at most ``output_bytes`` in all."""

    def __init__(self, ask: OutsideAnswerer, output_bytes: int, meter: JobMeter) -> None:
        self._ask = ask
        self._output_bytes = self._output_left = output_bytes
        self._meter = meter
        self._questions = 0
        #: Whether a limit was exceeded, so that no more texts are answered.
        self.is_stopped = False

    def answer(self, text: str, t: int, message: int, logged_data: LoggedData) -> Answer:
        """Return the answer to ``text``, at ``t`` in units of simulated time; none after a limit was exceeded.

        Raises:
            Unanswered: If the run is to end here.
            RobomarkError: Whatever else ``ask`` raises.
        """
        if self.is_stopped:
            return Answer()
        question = OutsideQuestion(self._questions, t / SECOND, text, logged_data)
        self._questions += 1
        answer = self._ask(question)
        try:
            return self._accept(answer, t)
        except ChildStopped as stop:
            self.is_stopped = True
            return Answer(fault=build_stop_fault(stop, "responder", t))

    def _accept(self, answer: str | None, t: int) -> Answer:
        if answer is None:
            sentence = describe_wrong_return("nothing instead of a text; an answer has to be a str")
            return Answer(fault=build_protocol_fault(t, sentence, RETURN_HINT))
        if not can_send_text(answer):
            return Answer(fault=build_length_fault(len(answer), t))
        # As in the frames of a process: lone surrogates cannot be stored.
        data = answer.encode("utf-8", "replace")
        self._meter.charge_bytes(len(data))
        self._output_left -= len(data) + 1
        if self._output_left < 0:
            raise ChildStopped(
                Verdict.OUTPUT_LIMIT, f"the responder printed and answered more than {self._output_bytes} bytes"
            )
        return build_text_answer(data.decode("utf-8"), t, 0, self._meter)
