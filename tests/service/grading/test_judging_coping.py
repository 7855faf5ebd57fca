"""Judging over a lossy channel: losses that cost no marks, and the meaning of coping with them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from judging import criterion, judged, recorded
from service.grading.grade import CriterionResult
from sim.recording import Fault, LossReason, Message, Recording, TimedText, Verdict

pytestmark = pytest.mark.fast


def build_question(t: float, text: str, lost: LossReason = "", **more: Any) -> Message:
    arrives = None if lost else t
    return Message(t, "robot", text, arrives, note="lost" if lost else "", lost=lost, **more)


def answer(to: int, t: float, text: str, lost: LossReason = "", **more: Any) -> Message:
    return Message(t - 0.1, "responder", text, None if lost else t, to, "lost" if lost else "", lost, **more)


AWAY: dict[str, Any] = {"distance": 812.04, "angle": -95.0}
ECHO = {"PY::0": "saw 0", "PY::1": "saw 1"}


def replies(*messages: Message, **keys: Any) -> CriterionResult:
    return judged(criterion("replies", **({"expect": ECHO, "over": "mean"} | keys)), recorded(messages=messages))


def test_a_text_that_chance_lost_is_not_missed() -> None:
    result = replies(build_question(0, "PY::0", "chance"), build_question(1, "PY::1"), answer(1, 1.1, "saw 1"))
    assert (result.marks, result.message) == (4, "The responder answered 1 of 1 messages as expected.")


def test_a_wrong_answer_beside_a_lost_text_still_costs() -> None:
    result = replies(build_question(0, "PY::0", "chance"), build_question(1, "PY::1"), answer(1, 1.1, "said 1"))
    assert result.marks == 0
    assert '"saw 1", but it answered "said 1" (0 of 1 right)' in result.message


def test_when_chance_lost_all_there_was_nothing_to_answer() -> None:
    result = replies(build_question(0, "PY::0", "chance"), build_question(1, "PY::1", "chance"))
    assert (result.marks, "so there was nothing to answer" in result.message) == (4, True)
    assert replies(build_question(0, "PY::0", "chance"), expect={}, contains="saw").marks == 4


def test_a_text_that_was_never_sent_is_missed_as_ever() -> None:
    result = replies(build_question(0, "PY::0", "chance"))
    assert 'Expected the responder to be sent "PY::1", but it was not' in result.message


@pytest.mark.parametrize(
    ("lost", "words"),
    [
        ("out of range", "the robot was 812 mm from the receiver, which is out of the link's range"),
        ("facing away", "the robot faced 95° away from the receiver"),
        ("blocked", "a wall or an obstacle was between the robot and the receiver"),
    ],
)
def test_what_is_sent_from_out_of_reach_does_not_count_and_the_sentence_says_why(lost: LossReason, words: str) -> None:
    messages = (build_question(0, "PY::0", lost, **AWAY), build_question(1, "PY::1"), answer(1, 1.1, "saw 1"))
    result = replies(*messages)
    assert result.marks == 2
    assert f'Expected the responder to be sent "PY::0", but the channel lost it ({words})' in result.message
    few = replies(*messages, expect={}, contains="saw", at_least=2)
    assert f'but only 1 different reached it: the channel lost "PY::0" ({words})' in few.message
    near = judged(criterion("in_reach", over="mean"), recorded(messages=messages))
    assert near.marks == 2
    assert f'the channel lost "PY::0": {words} (1 of 2 sent in reach)' in near.message


def test_a_corrupted_text_is_answered_as_it_arrived() -> None:
    garbled = (build_question(0, "PY::0", arrived_as="PY::7"), answer(0, 0.1, "saw 7"))
    assert replies(*garbled, build_question(1, "PY::1"), answer(2, 1.1, "saw 1")).marks == 4
    assert replies(*garbled, expect={}, to="PY::7", equals="saw 7").marks == 4


def queue(*messages: Message, **keys: Any) -> CriterionResult:
    return judged(criterion("messages", **keys), recorded(messages=messages))


def test_answers_that_chance_lost_are_not_missed_in_the_queue() -> None:
    lossy = (
        build_question(0, "PY::0"),
        answer(0, 0.1, "JSON::0", "chance"),
        build_question(1, "PY::1"),
        answer(2, 1.1, "JSON::1"),
    )
    assert queue(*lossy, json=True, in_order=["0", "1"]).marks == 4
    assert "count as received" in queue(*lossy, json=True, in_order=["0", "1"]).message
    assert queue(*lossy, json=True, exactly=1).marks == 4
    assert queue(*lossy, json=True, in_order=["1", "0"]).marks == 0
    assert queue(*lossy, queue_grows=True).marks == 4


def test_an_answer_lost_out_of_reach_is_missed_unless_the_text_was_sent_again() -> None:
    lost = (build_question(0, "PY::0"), answer(0, 0.1, "JSON::0", "facing away", **AWAY))
    result = queue(*lost, queue_grows=True)
    assert "the channel lost the answer (the robot faced 95° away from the receiver)" in result.message
    assert queue(*lost, build_question(1, "PY::0"), answer(2, 1.1, "JSON::0"), queue_grows=True).marks == 4


def test_no_sentence_says_that_a_lost_text_was_never_sent() -> None:
    result = queue(build_question(0, "PY::0", "out of range", **AWAY), queue_grows=True)
    assert 'the channel lost "PY::0" (the robot was 812 mm' in result.message
    assert queue(build_question(0, "PY::0", "chance"), queue_grows=True).marks == 4
    assert queue(build_question(0, "PY::0", "chance"), equals="PY::0").marks == 4


def resent(*messages: Message, run: Recording | None = None, **keys: Any) -> CriterionResult:
    run = run or recorded(end_t=20.0)
    return judged(criterion("resends", over="mean", **keys), replace(run, messages=messages))


def test_sent_again_until_the_answer_came() -> None:
    result = resent(
        build_question(0, "PY::0", "chance"),
        build_question(1, "PY::0"),
        answer(1, 1.1, "JSON::0", "chance"),
        build_question(2, "PY::0"),
        answer(3, 2.1, "JSON::0"),
        build_question(3, "PY::1"),
        answer(5, 3.1, "JSON::1"),
        at_least=2,
    )
    assert result.marks == 4
    assert "sent 4 messages, 2 of them again, until each of 2 was answered" in result.message


@pytest.mark.parametrize(
    ("messages", "keys", "words"),
    [
        ((), {}, "but it sent nothing"),
        ((build_question(0, "PY::0"),), {"at_least": 2}, "but it sent only 1 different"),
        ((build_question(0, "PY::0", "chance"),), {}, "it sent the message once, last at 0.00 s, and no answer came"),
        (
            (build_question(0, "PY::0"), answer(0, 0.1, "JSON::0"), build_question(1, "PY::0")),
            {},
            "it sent the message again at 1.00 s, after its answer had come at 0.10 s",
        ),
        (
            tuple(build_question(float(t), "PY::0", "chance") for t in range(4)),
            {"at_most": 3},
            "again until its answer comes, at most 3 times in all, but it sent the message 4 times",
        ),
        (
            (build_question(0, "PY::0", "chance"), build_question(0.05, "PY::0"), answer(1, 0.2, "JSON::0")),
            {},
            "it did not wait for the answer: it sent the message at 0.00 s and again at 0.05 s",
        ),
        (
            (build_question(0, "PY::0", "chance"), build_question(5, "PY::0"), answer(1, 5.1, "JSON::0")),
            {"every": [0.5, 2]},
            "it sent the message at 0.00 s and again only at 5.00 s",
        ),
        (
            (build_question(0, "PY::0", arrived_as="PY::7"), answer(0, 0.1, "JSON::7")),
            {},
            "it sent the message once, last at 0.00 s, and no answer came",
        ),
    ],
)
def test_not_sent_again_as_it_should(messages: tuple[Message, ...], keys: dict[str, Any], words: str) -> None:
    result = resent(*messages, **keys)
    assert result.marks == 0
    assert words in result.message


def test_after_as_many_tries_as_are_allowed_a_program_may_give_up() -> None:
    tries = tuple(build_question(float(t), "PY::0", "chance") for t in range(3))
    assert resent(*tries, at_most=3).marks == 4
    assert resent(*tries).marks == 0


def test_a_program_that_is_cut_while_it_still_tries_has_not_given_up() -> None:
    tries = tuple(build_question(float(t), "PY::0", "chance") for t in range(20))
    stop = Fault(20.0, Verdict.TIME_LIMIT, "program", "still running")
    cut = recorded(end_t=20.0, verdict=Verdict.TIME_LIMIT, faults=(stop,))
    assert resent(*tries, run=cut).marks == 4
    assert resent(tries[0], run=cut).marks == 0


def test_which_messages_must_be_sent_again_can_be_said() -> None:
    messages = (build_question(0, "PY::log", "chance"), build_question(1, "PY::ask"), answer(1, 1.1, "JSON::1"))
    assert resent(*messages).marks == 2
    assert resent(*messages, equals="PY::ask").marks == 4


def test_in_reach() -> None:
    far, near, unlucky = (
        build_question(0, "PY::0", "out of range", **AWAY),
        build_question(1, "PY::1"),
        build_question(2, "PY::2", "chance"),
    )
    assert judged(criterion("in_reach"), recorded(messages=(near, unlucky))).marks == 4
    assert judged(criterion("in_reach"), recorded(messages=(far, near))).marks == 0
    assert judged(criterion("in_reach", misses=1), recorded(messages=(far, near))).marks == 4
    none = judged(criterion("in_reach"), recorded())
    assert (none.marks, "but it sent none" in none.message) == (0, True)


def believed(*spoken_texts: tuple[float, str], messages: tuple[Message, ...] = (), **keys: Any) -> CriterionResult:
    run = recorded(end_t=20.0, printed=tuple(TimedText(t, text) for t, text in spoken_texts), messages=messages or LATE)
    return judged(criterion("fresh_answers", after="Answer:", path="saw", over="mean", **keys), run)


#: The answer to 0 arrives only after 1 was asked, and the answer to 1 after that.
LATE = (
    build_question(0, "PY::0"),
    answer(0, 1.5, 'JSON::{"saw": "n 0"}'),
    build_question(1, "PY::1"),
    answer(2, 2.5, 'JSON::{"saw": "n 1"}'),
)


@pytest.mark.parametrize(
    ("expected_words", "marks", "words"),
    [
        ([(1.6, "Answer: n 0"), (2.6, "Answer: n 1")], 0, 'after "PY::1" it reported "n 0", which is the answer to'),
        ([(2.6, "Answer: n 1")], 2, 'the answer to "PY::0" came at 1.50 s and no line that begins with "Answer:" has'),
        ([(2.6, "Answer: n 0 n 1")], 0, 'it reported "n 0 n 1"'),
        ([(2.6, "n 0")], 0, "no line that begins with"),
        ([(2.2, "Answer: n 1")], 0, "no line that begins with"),  # a guess, before the answer
    ],
)
def test_what_is_reported_is_the_answer_to_what_was_sent_last(
    expected_words: list[tuple[float, str]], marks: int, words: str
) -> None:
    result = believed(*expected_words)
    assert result.marks == marks
    assert words in result.message


def test_an_answer_reported_before_the_next_text_is_sent_at_the_same_moment_is_fresh() -> None:
    messages = (
        build_question(0, "PY::0"),
        answer(0, 0.5, 'JSON::{"saw": 0}'),
        build_question(1, "PY::1"),
        answer(2, 1.5, 'JSON::{"saw": 1}'),
    )
    assert believed((1.0, "Answer: 0"), (2.0, "Answer: 1"), messages=messages).marks == 4


def test_what_never_came_need_not_be_reported() -> None:
    messages = (build_question(0, "PY::0", "chance"), build_question(1, "PY::1"), answer(1, 1.5, 'JSON::{"saw": 1}'))
    assert believed((0.5, "Answer: none"), (2.0, "Answer: 1"), messages=messages).marks == 4
    assert believed((0.5, "Answer: none"), messages=messages[:1]).marks == 4
    unasked = believed((0.5, "Answer: none"), messages=(build_question(0, "PY::0"),))
    assert (unasked.marks, 'no answer to "PY::0" came (0 of 1' in unasked.message) == (0, True)
    unheard = (build_question(0, "PY::0"), answer(0, 0.5, 'JSON::{"saw": 0}', "chance"))
    assert believed((1.0, "Answer: none"), messages=unheard).marks == 4
    away = believed((0.5, "Answer: none"), messages=(build_question(0, "PY::0", "facing away", **AWAY),))
    assert (away.marks, 'no answer to "PY::0" came: the channel lost' in away.message) == (0, True)
    assert believed(messages=messages, at_least=3).marks == 0
