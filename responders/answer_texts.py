"""Answers from the texts of a responder, and the faults of texts that the robot cannot read.

The texts come from a responder's process or from outside. Both are treated alike.
"""

from __future__ import annotations

from responders import message_format
from responders.conversation import Answer
from responders.faults import describe_wrong_return
from responders.sandbox.meter import JobMeter
from sim.recording import SECOND, Fault, Verdict

RETURN_HINT = "A function returns nothing where it comes to its end, or to a bare return: return the answer."
JSON_HINT = 'For an object return "JSON::" + json.dumps(the object).'


def build_text_answer(text: str, t: int, slept: int, meter: JobMeter, agent: str = "") -> Answer:
    """Return the answer with this text. A valid ``JSON::`` text also has an entry for the robot's queue.

    Args:
        text: The responder's answer.
        t: The time of the question, in units of simulated time.
        slept: How long the responder slept, in the same units.
        meter: The meter of the job, charged for the entry.
        agent: The name of the agent that answered; empty for the responder itself.

    Raises:
        ChildStopped: If the job exceeds its limit on stored bytes.
    """
    if not text.startswith(message_format.JSON):
        return Answer(text, slept)
    try:
        entry = message_format.format_queue_entry(text)
    except ValueError as error:
        sentence = f"the responder's answer begins with JSON:: but is not JSON: {error}"
        return Answer(text, slept, build_protocol_fault(t + slept, sentence, JSON_HINT, agent), note="malformed")
    meter.charge_bytes(len(entry))
    return Answer(text, slept, entry=entry)


def build_length_fault(length: int, t: int, agent: str = "") -> Fault:
    """Return the fault of an answer that is too long, ``length`` characters."""
    description = f"an answer of {length} characters; the most is about 60000"
    return build_protocol_fault(t, describe_wrong_return(description), "", agent)


def build_protocol_fault(t: int, sentence: str, hint: str = "", agent: str = "") -> Fault:
    """Return the fault of an answer that the robot cannot read, at ``t`` in units of simulated time."""
    return Fault(t / SECOND, Verdict.PROTOCOL_ERROR, "responder", sentence, hint=hint, agent=agent)
