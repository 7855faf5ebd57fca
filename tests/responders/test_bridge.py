"""The conversation between program and responder: forwarded messages, arrival times, and failures."""

from __future__ import annotations

import pytest

from responders.channel import Channel, TrialChannel
from responders.sandbox.isolation import NO_ISOLATION
from responders.sandbox.manager import Sandboxes
from responders.trial_world import format_reading
from running import run_program
from service.grading.trial_runner import TrialRunner
from sim.recording import SECOND, Verdict

pytestmark = pytest.mark.fast

ECHO = "def responder(text):\n    return 'JSON::{\"heard\": \"' + text[4:] + '\"}'\n"
LISTEN = "import time, ev3dev2_glue as glue\n"


def test_an_answer_joins_the_queue_at_the_first_tick_after_its_delay(runner: TrialRunner) -> None:
    program = (
        LISTEN
        + "print('PY::a')\nfor _ in range(30):\n    time.sleep(0.01)\n    print(len(glue.pyState()['messages']))\n"
    )
    recording = run_program(runner, program, responder=ECHO)
    arrived = next(line.t for line in recording.printed if line.text == "1")
    assert recording.messages[1].delivered == pytest.approx(0.1)
    assert arrived == pytest.approx(0.1)
    assert recording.messages[1].text == 'JSON::{"heard": "a"}'


@pytest.mark.parametrize(
    ("text", "passed_on"),
    [
        ("'PY::a'", True),
        ("'PY::', 1", True),
        ("'x PY::1'", False),
        ("' PY::1'", False),
        ("'a\\nPY::1'", False),
        ("'py::1'", False),
        ("'PY::a', end=''", True),
        ("'PY:', ':b', sep=''", True),
    ],
)
def test_only_a_text_that_begins_with_the_prefix_is_a_message(runner: TrialRunner, text: str, passed_on: bool) -> None:
    recording = run_program(runner, f"import time\nprint({text})\ntime.sleep(0.5)\n", responder=ECHO)
    assert bool(recording.messages) is passed_on


def test_several_answers_in_one_tick_queue_up_in_order(runner: TrialRunner) -> None:
    program = (
        LISTEN
        + "for i in range(5): print('PY::' + str(i))\ntime.sleep(1)\n"
        + "print([m['heard'] for m in glue.pyState()['messages']])"
    )
    recording = run_program(runner, program, responder=ECHO)
    assert recording.printed[-1].text == "['0', '1', '2', '3', '4']"


def test_the_queue_keeps_what_a_program_took_from_it_and_forgets_nothing(runner: TrialRunner) -> None:
    program = LISTEN + (
        "print('PY::a'); time.sleep(0.3)\nold = glue.pyState()\nold['messages'].pop()\n"
        "print(len(glue.pyState()['messages']))\nprint('PY::b'); time.sleep(0.3)\n"
        "print(len(old['messages']), len(glue.pyState()['messages']))\n"
    )
    recording = run_program(runner, program, responder=ECHO)
    assert [line.text for line in recording.printed if line.text[0].isdigit()] == ["0", "0 1"]


def test_sleeping_in_the_responder_delays_its_answer(runner: TrialRunner) -> None:
    sleepy = "import time\n" + ECHO.replace("return", "time.sleep(0.5); return")
    recording = run_program(runner, "import time\nprint('PY::a')\ntime.sleep(2)", responder=sleepy)
    assert recording.messages[1].delivered == pytest.approx(0.6, abs=0.034)


def test_an_answer_after_the_end_is_undelivered_and_still_the_responders(runner: TrialRunner) -> None:
    recording = run_program(runner, "print('PY::a')", responder=ECHO)
    assert recording.messages[1].delivered is None
    assert recording.messages[1].note == "undelivered"
    assert recording.verdict is Verdict.FINISHED


@pytest.mark.parametrize(
    ("answer", "verdict", "words"),
    [
        ("None", Verdict.PROTOCOL_ERROR, "NoneType instead of a text"),
        ("42", Verdict.PROTOCOL_ERROR, "int instead of a text"),
        ("'JSON::{nonsense'", Verdict.PROTOCOL_ERROR, "is not JSON"),
        ("'JSON::' + '[' * 9000", Verdict.PROTOCOL_ERROR, "is not JSON"),
        ("'JSON::NaN'", Verdict.PROTOCOL_ERROR, "NaN is not allowed"),
        ("'x' * 100000", Verdict.PROTOCOL_ERROR, "100000 characters"),
        ("1 / 0", Verdict.RESPONDER_ERROR, "ZeroDivisionError"),
        ("bytearray(10**10)", Verdict.MEMORY_LIMIT, "more memory"),
    ],
)
def test_a_bad_answer_is_a_fault_and_the_robot_goes_on(
    runner: TrialRunner, answer: str, verdict: Verdict, words: str
) -> None:
    recording = run_program(
        runner,
        LISTEN + "print('PY::a')\ntank_drive.on_for_seconds(50, 50, 1)\nprint('still here')\n",
        responder=f"def responder(text):\n    return {answer}\n",
    )
    assert recording.verdict is verdict
    assert words in recording.faults[0].message
    assert recording.printed[-1].text == "still here"
    assert recording.end.x > recording.start.x + 100


def test_the_line_of_a_responders_error_is_its_own(runner: TrialRunner) -> None:
    recording = run_program(
        runner, "print('PY::a')", responder="def responder(text):\n    x = 1\n    return text.upcase()\n"
    )
    assert recording.faults[0].line == 3
    assert recording.faults[0].who == "responder"


@pytest.mark.parametrize(
    ("responder", "answer"),
    [
        ("def responder(m): return 'a'\ndef other_responder(m): return 'b'", "a"),
        ("def only_responder(m): return 'c'", "c"),
        ("def a_responder(m): return 'a'\ndef b_responder(m): return 'b'\nroboSim.pyresponder = b_responder", "b"),
        ("def responder(m): roboSim.set_element('response', 'a')", "a"),
        ("def answer_responder(m): return msg", "PY::?"),
        ("msg = 'mine'\ndef answer_responder(m): return msg", "mine"),
    ],
)
def test_which_function_is_the_responder(runner: TrialRunner, responder: str, answer: str) -> None:
    recording = run_program(runner, "print('PY::?')", responder=responder)
    assert recording.messages[1].text == answer


def test_two_candidates_are_a_fault_that_names_them(runner: TrialRunner) -> None:
    recording = run_program(runner, "print('PY::?')", responder="def a_responder(m): ...\ndef b_responder(m): ...")
    assert recording.verdict is Verdict.RESPONDER_ERROR
    assert "a_responder, b_responder" in recording.faults[0].message


def test_names_are_looked_up_when_a_message_comes_and_the_calls_are_noted(runner: TrialRunner) -> None:
    responder = (
        "def first(m): return 'first ' + m\ndef second(m): return 'second ' + m\n"
        "def agent(m): return parser(m)\nparser = first\n"
        "def responder(m):\n    global parser\n    answer = agent(m)\n    parser = second\n    return answer\n"
    )
    recording = run_program(runner, "print('PY::1')\nprint('PY::2')", responder=responder)
    answers = [message.text for message in recording.messages if message.sender == "responder"]
    assert answers == ["first PY::1", "second PY::2"]
    assert [(call.caller, call.callee) for call in recording.calls if call.message == 0] == [
        ("agent", "parser"),
        ("responder", "agent"),
    ]


def test_a_lossy_channel_loses_its_share_and_the_same_texts_every_time() -> None:
    line, again = (TrialChannel(Channel(loss=0.3, duplication=0.2), 5) for _ in range(2))
    copies = [line.count_copies(number) for number in range(2000)]
    assert copies == [again.count_copies(number) for number in range(2000)]
    assert copies.count(0) / 2000 == pytest.approx(0.3, abs=0.04)
    assert copies.count(2) / 2000 == pytest.approx(0.7 * 0.2, abs=0.04)


def test_reordering_lets_later_answers_overtake() -> None:
    line = TrialChannel(Channel(delay=0.1, reordering=0.3), 5)
    arrivals = [line.compute_arrivals(number, 0, number * SECOND // 10, 0)[0] for number in range(100)]
    assert arrivals != sorted(arrivals)
    assert sorted(arrivals)[0] >= SECOND // 10


def test_lost_texts_are_recorded_as_lost(runner: TrialRunner) -> None:
    program = "import time\nfor i in range(20):\n    print('PY::' + str(i))\n    time.sleep(0.2)\n"
    recording = run_program(runner, program, responder=ECHO, channel=Channel(loss=0.4))
    sent = [message for message in recording.messages if message.sender == "robot"]
    lost = [message for message in recording.messages if message.note == "lost"]
    assert len(sent) == 20
    assert 5 < len(lost) < 25
    assert all(message.delivered is None for message in lost)


def test_the_logfile_is_read_and_nothing_else(runner: TrialRunner) -> None:
    responder = "def responder(m):\n    open('logger.txt', 'a').write('seen ' + m + '\\n')\n    return 'ok'\n"
    assert run_program(runner, "print('PY::1')", responder=responder).responder_log == "seen PY::1\n"


@pytest.mark.parametrize("trick", ["os.symlink('/etc/passwd', 'logger.txt')", "os.mkfifo('logger.txt')"])
def test_a_logfile_that_is_no_file_is_not_read_even_without_sandbox(trick: str) -> None:
    with TrialRunner(Sandboxes(NO_ISOLATION)) as unenclosed:
        recording = run_program(
            unenclosed, "print('PY::1')", responder=f"import os\n{trick}\ndef responder(m): return 'ok'\n"
        )
    assert recording.faults == ()
    assert recording.responder_log == ""


@pytest.mark.parametrize(
    "reading", [2550.0, [0.0, -0.0], [-0.0, -0.0, -0.0], [93.77] * 3, [93.77, 93.77, 94.0], [1 / 3, 1 / 3], [-1.5, 2.0]]
)
def test_what_a_program_reads_stands_in_the_chain_as_python_writes_it(reading: float | list[float]) -> None:
    assert format_reading(reading) == repr(reading)
