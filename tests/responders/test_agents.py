"""Agents in separate processes: the messages they exchange, and their isolation from each other."""

from __future__ import annotations

import pickle
from typing import Any

import pytest

import running
from hostile import FIND_WIRE, flood, forged
from responders.sandbox.meter import JobLimits, JobMeter
from responders.sandbox.roles import ChildRole
from responders.sandbox.running_child import ChildLimits
from running import run_program
from service.grading.trial_runner import TrialRunner
from sim.recording import Recording, Verdict

THREE = 'import time\nfor number in range(3):\n    print(f"PY::{number}")\n    time.sleep(1)\n'
ONE = 'import time\nprint("PY::0")\ntime.sleep(1)\n'
PARSER = "def simple_parser(text): return int(text.removeprefix('PY::'))\n"
AGENT = "def agent(text): return f'Py saw: {parser(text)}'\n"
LOGGER = """
logged = 0
def logger(text, response):
    global logged
    logged += 1
    open("logger.txt", "a").write(f"{text} {response}\\n")
    return logged
"""
#: Answers every message of the agents and informs the logger.
RESPONDER = """
def responder(text):
    try:
        answer = agent(text)
    except RuntimeError as error:
        print(error)
        answer = "none"
    logger(text, answer)
    return answer
"""
AGENTS = {"agent": AGENT, "logger": LOGGER, "parser": PARSER}


@pytest.fixture(autouse=True)
def _limits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "RESPONDER_LIMITS", ChildLimits(0.5, 128 << 20))


def run(runner: TrialRunner, responder: str = RESPONDER, program: str = THREE, **agents: str) -> Recording:
    return run_program(runner, program, responder=responder, agents=AGENTS | agents)


def replies(recording: Recording) -> list[str]:
    return [message.text for message in recording.messages if message.sender == "responder"]


def list_agent_messages(recording: Recording) -> list[tuple[str, str, str]]:
    return [(each.sender, each.receiver, each.text) for each in recording.agent_messages]


def test_questions_go_from_process_to_process_and_back(runner: TrialRunner) -> None:
    recording = run(runner)
    assert recording.verdict is Verdict.FINISHED
    assert replies(recording) == ["Py saw: 0", "Py saw: 1", "Py saw: 2"]
    assert list_agent_messages(recording)[:6] == [
        ("responder", "agent", "PY::0"),
        ("agent", "parser", "PY::0"),
        ("parser", "agent", "0"),
        ("agent", "responder", "Py saw: 0"),
        ("responder", "logger", '["PY::0", "Py saw: 0"]'),
        ("logger", "responder", "1"),
    ]
    assert [each.reply_to for each in recording.agent_messages[:6]] == [None, None, 1, 0, None, 4]
    assert [each.is_text for each in recording.agent_messages[:4]] == [True, True, False, True]
    assert [each.message for each in recording.agent_messages[::6]] == [0, 2, 4]
    logs = {each.agent: each.log for each in recording.agent_outputs}
    assert logs == {"agent": "", "logger": "PY::0 Py saw: 0\nPY::1 Py saw: 1\nPY::2 Py saw: 2\n", "parser": ""}
    assert recording.responder_log == ""


def test_an_agents_sleep_delays_the_answer_and_clocks_agree(runner: TrialRunner) -> None:
    recording = run(
        runner,
        "import time\ndef responder(text):\n    agent(text)\n    return str(time.monotonic())",
        ONE,
        agent="import time\ndef agent(text):\n    time.sleep(0.25)\n    parser(text)\n    time.sleep(0.25)\n",
        parser="import time\ndef parser(text): return time.monotonic()",
    )
    assert replies(recording) == ["0.5"]
    assert [each.t for each in recording.agent_messages] == [0.0, 0.25, 0.25, 0.5]
    assert recording.agent_messages[2].text == "0.25"
    assert recording.messages[1].delivered == pytest.approx(0.6, abs=0.04)


def test_each_agent_has_dice_of_its_own_and_the_trials_seed_decides_them(runner: TrialRunner) -> None:
    roll = "import random\ndef {}(text): return random.random()"
    asking = "import random\ndef responder(text): return repr([random.random(), agent(text), parser(text)])"
    agents = {name: roll.format(name) for name in ("agent", "parser")}
    seen = [replies(run(runner, asking, ONE, **agents))[0] for _ in range(2)]
    assert seen[0] == seen[1]
    assert len(set(seen[0].split(", "))) == 3
    alone = "import random\ndef responder(text): return repr(random.random())"
    assert replies(run_program(runner, ONE, responder=alone))[0] in seen[0]


def test_what_is_said_between_agents_is_in_the_chain(runner: TrialRunner) -> None:
    parsers = ["def parser(text): return 0", "def parser(text): return False", "def parser(text): return 0"]
    quiet = "def agent(text): parser(text)"
    hashes = [run(runner, program=ONE, parser=each, agent=quiet).sha256 for each in parsers]
    assert hashes[0] == hashes[2] != hashes[1]


@pytest.mark.parametrize(
    ("sent", "answer"),
    [
        ("(1, (2, 3))", "[1, [2, 3]]"),
        ("{1: None, 'a': [True, 1.5]}", "{'1': None, 'a': [True, 1.5]}"),
        ("__import__('numpy').arange(3)", "[0, 1, 2]"),
        ("'\\ud800 é'", "'\\ud800 é'"),
        ("'a', named={'b': 1}", "{'b': 1}"),
        ("object()", "TypeError: agent cannot be sent object: a message holds what JSON has"),
        ("1, [float('nan')]", "TypeError: agent cannot be sent list: a message holds what JSON has"),
        ("'x' * 100_000", "ValueError: agent cannot be sent 100006 characters of JSON at once; the most is"),
        ("1, 2, 3", "RuntimeError: agent gave no answer: TypeError: agent() takes from 1 to 2 positional arguments"),
    ],
)
def test_what_a_message_can_hold(sent: str, answer: str, runner: TrialRunner) -> None:
    asking = f"def responder(text): return repr(agent({sent}))"
    recording = run(runner, asking, ONE, agent="def agent(first, named=None): return first if named is None else named")
    if "Error" in answer:
        fault = next(each for each in recording.faults if not each.agent)
        assert fault.message.startswith(answer)
        assert fault.line == 1
    else:
        assert replies(recording) == [answer]


FAILING = {
    "raises": ("def parser(text): return 1 / 0", Verdict.RESPONDER_ERROR, "ZeroDivisionError"),
    "cannot be read": ("def parser(text) return 1", Verdict.RESPONDER_ERROR, "it could not be loaded"),
    "is not there": ("x = 1", Verdict.RESPONDER_ERROR, "it could not be loaded"),
    "ends": ("import os\ndef parser(text): os._exit(0)", Verdict.RESPONDER_ERROR, "its process ended"),
    "crashes": (
        "import ctypes\ndef parser(text): ctypes.string_at(0)",
        Verdict.RESPONDER_ERROR,
        "its process crashed",
    ),
    "is busy": ("def parser(text):\n    while True: pass", Verdict.CPU_LIMIT, "it computed for more than 0.5 seconds"),
    "takes memory": ("def parser(text): return len('x' * (1 << 30))", Verdict.MEMORY_LIMIT, "more memory"),
    "prints": ("def parser(text):\n    while True: print('x' * 10_000)", Verdict.OUTPUT_LIMIT, "printed more than"),
    "fills its folder": (
        "def parser(text):\n    for n in range(400): open(str(n), 'w').close()\n    while True: pass",
        Verdict.OUTPUT_LIMIT,
        "files into its folder",
    ),
    "answers no JSON": ("def parser(text): return object()", Verdict.PROTOCOL_ERROR, "object, which no message"),
    "answers much": ("def parser(text): return 'x' * 100_000", Verdict.PROTOCOL_ERROR, "100002 characters"),
    "asks the asker": ("def parser(text): return agent(text)", Verdict.RESPONDER_ERROR, "responder → agent → parser →"),
    "asks itself": (
        f"{FIND_WIRE}def parser(text):\n    "
        + forged('{"do":"ask","agent":"parser","arguments":"[]","named":"{}"}')
        + "\n    line._sent += 1\n    raise ValueError(line.receive()['text'])",
        Verdict.RESPONDER_ERROR,
        "responder → agent → parser → parser",
    ),
    "asks nobody": (
        f"{FIND_WIRE}def parser(text):\n    "
        + forged('{"do":"ask","agent":"nobody","arguments":"[]","named":"{}"}')
        + "\n    line.receive()",
        Verdict.SANDBOX_VIOLATION,
        "does not have",
    ),
    "asks what is no JSON": (
        f"{FIND_WIRE}def parser(text):\n    "
        + forged('{"do":"ask","agent":"logger","arguments":"[NaN]","named":"{}"}')
        + "\n    line.receive()",
        Verdict.PROTOCOL_ERROR,
        "no JSON",
    ),
    "asks too deeply": (
        f"{FIND_WIRE}def parser(text):\n    "
        + forged('{"do":"ask","agent":"logger","arguments":"' + "[" * 20_000 + "]" * 20_000 + '","named":"{}"}')
        + "\n    line.receive()",
        Verdict.PROTOCOL_ERROR,
        "nested too deeply",
    ),
    "answers for the bridge": (
        f"{FIND_WIRE}def parser(text):\n    "
        + forged('{"do":"answer","kind":"text","text":"x"}')
        + "\n    line.receive()",
        Verdict.SANDBOX_VIOLATION,
        "stray answer frame",
    ),
    "answers without content": (
        f"{FIND_WIRE}def parser(text):\n    " + forged('{"do":"returned","kind":"value"}') + "\n    line.receive()",
        Verdict.SANDBOX_VIOLATION,
        "without its content",
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("how", FAILING)
def test_one_that_fails_stops_no_other_and_its_fault_has_its_name(how: str, runner: TrialRunner) -> None:
    parser, verdict, why = FAILING[how]
    recording = run(runner, parser=parser)
    assert recording.verdict is verdict, recording.faults
    assert recording.faults[0].agent == "parser"
    assert recording.faults[0].who == "responder"
    assert recording.faults[0].staff == ""
    assert why in recording.responder_output
    assert "parser gave no answer" in recording.responder_output
    assert recording.end_t >= 3
    log = next(each.log for each in recording.agent_outputs if each.agent == "logger")
    assert log.count("\n") == 3


@pytest.mark.long
def test_a_real_sleep_is_cut_and_the_others_go_on(runner: TrialRunner) -> None:
    recording = run(runner, parser="import os\ndef parser(text): os.read(4, 1)")
    assert recording.verdict is Verdict.STALLED
    assert recording.faults[0].agent == "parser"
    assert replies(recording) == ["none"] * 3


@pytest.mark.parametrize("responder", ["def responder(text): 1 / 0", "import os\ndef responder(text): os._exit(0)"])
def test_the_responders_end_is_no_agents_fault(responder: str, runner: TrialRunner) -> None:
    recording = run(runner, responder)
    assert recording.verdict is Verdict.RESPONDER_ERROR
    assert {fault.agent for fault in recording.faults} == {""}


@pytest.mark.parametrize(
    ("module", "text", "heard"),
    [
        ("parser", "value = logger('a', 'b')\ndef parser(text): return value", "while the agents are being loaded"),
        ("responder", "first = parser('PY::7')\ndef responder(text): return str(first)", "7"),
    ],
)
def test_agents_are_asked_once_all_are_loaded(module: str, text: str, heard: str, runner: TrialRunner) -> None:
    recording = run(runner, text, ONE) if module == "responder" else run(runner, program=ONE, parser=text)
    assert heard in (replies(recording)[0] if module == "responder" else recording.faults[0].message)


BUDGET = 1 << 19
ASKING = '{"do":"ask","agent":"logger","arguments":"[\\"@\\",1]","named":"{}"}'
FLOODS = {
    "questions": ("def agent(text):\n    while True: logger(1, 2)\n", LOGGER),
    "long questions": ("def agent(text):\n    while True: logger('x' * 50_000, 2)\n", LOGGER),
    "long answers": (
        "def agent(text):\n    while True: logger(1, 2)\n",
        "def logger(text, response): return 'x' * 50_000\n",
    ),
    "long errors": (
        "def agent(text):\n    while True:\n        try: logger(1, 2)\n        except RuntimeError: pass\n",
        "def logger(text, response): raise ValueError('x' * 1_900)\n",
    ),
    "refused questions": ("def agent(text): parser(text)\n", LOGGER),
    "numbers that grow": ("def agent(text):\n    while True: logger([1e22] * 5_000, 2)\n", LOGGER),
    "forged questions": (f"{flood(ASKING)}\ndef agent(text): flood()\n", LOGGER),
}
_SLOW = ("forged questions", "long errors", "numbers that grow")
CIRCLE = "def parser(text):\n    while True:\n        try: agent(text)\n        except RuntimeError: pass\n"


@pytest.mark.parametrize("name", [pytest.param(each, marks=[pytest.mark.long] * (each in _SLOW)) for each in FLOODS])
def test_a_flood_between_agents_ends_at_the_budget(
    name: str, runner: TrialRunner, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running, "RESPONDER_LIMITS", ChildLimits(5.0, 128 << 20))
    meter = JobMeter(JobLimits(kept_bytes=BUDGET))
    agent, logger = FLOODS[name]
    recording = run_program(
        runner,
        THREE,
        responder=RESPONDER,
        agents=AGENTS | {"agent": agent, "logger": logger, "parser": CIRCLE},
        output_bytes=1 << 30,
        meter=meter,
    )
    # An agent that reads no answers blocks once its socket is full.
    expected = {Verdict.OUTPUT_LIMIT, *([Verdict.STALLED] if name == "forged questions" else [])}
    assert expected & {fault.verdict for fault in recording.faults}, recording.faults[:2]
    assert len(pickle.dumps(recording)) < 2 * BUDGET


def test_the_questions_of_a_trial_are_counted(runner: TrialRunner, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("responders.agents._MAX_QUESTIONS", 50)
    recording = run(runner, agent="def agent(text):\n    while True: logger(1, 2)\n")
    assert recording.verdict is Verdict.OUTPUT_LIMIT
    assert recording.faults[0].agent == "agent"
    assert len(recording.agent_messages) < 110


SPY = """
import os, signal

def tried(attempt):
    try:
        return str(attempt())
    except BaseException as error:
        return type(error).__name__

def agent(text):
    other = parser(text)
    pid, folder = other["pid"], other["folder"]
    attempts = {
        "its folder": lambda: os.listdir(folder),
        "its file": lambda: open(f"{folder}/secret.txt").read(),
        "the folders": lambda: os.listdir(os.path.dirname(folder)),
        "its memory": lambda: open(f"/proc/{pid}/mem", "rb").read(1),
        "its descriptors": lambda: os.listdir(f"/proc/{pid}/fd"),
        "its wire": lambda: open(f"/proc/{pid}/fd/3"),
        "its end": lambda: os.kill(pid, signal.SIGKILL),
        "its life": lambda: os.kill(pid, 0),
        "its descriptor": lambda: os.pidfd_open(pid),
        "its priority": lambda: os.setpriority(os.PRIO_PROCESS, pid, 19),
        "its processors": lambda: os.sched_setaffinity(pid, {0}),
        "a file left for it": lambda: open("/dev/shm/left", "w"),
        "its text": lambda: __import__("parser"),
    }
    answers = {name: tried(attempt) for name, attempt in attempts.items()}
    answers["descriptors"] = sum(tried(lambda: os.fstat(fd)) != "OSError" for fd in range(64))
    answers["own files"] = sorted(os.listdir("."))
    return answers
"""
SPIED_ON = """
import os
open("secret.txt", "w").write("secret")
def parser(text): return {"pid": os.getpid(), "folder": os.getcwd()}
"""


def test_no_agent_reaches_another(runner: TrialRunner) -> None:
    asking = "def responder(text): return repr(agent(text))"
    recording = run_program(
        runner,
        ONE,
        responder=asking,
        agents=AGENTS | {"agent": SPY, "parser": SPIED_ON},
        files={"given.txt": b"for all"},
    )
    answers = eval(replies(recording)[0])
    assert answers.pop("descriptors") <= 5  # null device on 0 to 2, and the wire's two ends
    assert answers.pop("own files") == ["given.txt"]
    errors = {"PermissionError", "FileNotFoundError", "OSError", "ModuleNotFoundError", "ProcessLookupError"}
    assert answers.items() >= {"its end": "PermissionError", "its text": "ModuleNotFoundError"}.items()
    assert {name for name, what in answers.items() if what not in errors} == set()


def test_no_process_is_started_for_an_assignment_without_agents(
    runner: TrialRunner, monkeypatch: pytest.MonkeyPatch
) -> None:
    spawned: list[str] = []
    spawn = runner._sandboxes.spawn

    def noted(role: ChildRole, *rest: Any, **named: Any) -> Any:
        spawned.append(role)
        return spawn(role, *rest, **named)

    monkeypatch.setattr(runner._sandboxes, "spawn", noted)
    run_program(runner, ONE, responder="def responder(text): return text")
    assert sorted(spawned) == ["responder", "robot"]
    run(runner, program=ONE)
    assert sorted(spawned[2:]) == ["responder"] * 4 + ["robot"]
