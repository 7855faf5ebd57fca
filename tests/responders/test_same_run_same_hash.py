"""The same submission, assignment and seed give the same chain on any machine, at any time and load."""

from __future__ import annotations

import os
import random
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from models import load_weights
from paths import HELPERS
from responders.channel import Channel
from running import run_program
from service.grading.trial_runner import TrialRunner
from sim.motion import Physics
from sim.recording import Pose, Verdict
from sim.world import Noise
from submissions.assignment.examples import locate_examples

FOLLOWER = """
while True:
    turn = (colorLeft.reflected_light_intensity - 128) * 0.15
    colorRight.reflected_light_intensity
    tank_drive.on(25 - turn, 25 + turn)
"""
SHOW_AND_TELL = """
import random, time
import ev3dev2_glue as glue
for i in range(20):
    print("IMG_DATA")
    time.sleep(random.uniform(0.2, 0.6))
    print(time.time(), len(glue.pyState()["messages"]))
"""
WANDERER = """
import random
import ev3dev2_glue as glue
while True:
    print("PY::" + str(ultrasonic.distance_centimeters))
    tank_drive.on_for_seconds(random.randint(10, 50), 30, random.uniform(0.1, 1))
    print(len(glue.pyState()["messages"]))
"""
COUNT = """
import random, time
for number in range(20):
    print(f"PY::{number} {random.random()}")
    time.sleep(random.uniform(0.2, 0.6))
"""
AGENTS = {
    "agent": "import uuid\ndef agent(text): return [parser(text), uuid.uuid4().hex]",
    "logger": "seen = []\ndef logger(entry):\n    seen.append(entry)\n    return len(seen)",
    "parser": """
import random, time
def parser(text):
    time.sleep(random.uniform(0, 0.05))
    return [text, random.random(), time.time()]
""",
}
ASKING = """
import random
def responder(text):
    answer = agent(text)
    return f"{answer} {logger(answer)} {random.random()}"
"""
RESPONDER = locate_examples("shape-recognition") / "seed" / "responder.py"


CALL_ROUND = """
import time
import ev3dev2_glue as glue
tank_turn.on(-100, 10)
for i in range(40):
    print("PY::" + str(i))
    time.sleep(0.3)
    print(glue.pyState()["messages"])
"""
ANSWER = "def responder(text):\n    return 'JSON::[\"' + text + '\"]'\n"
INFRARED = Channel(0.2, 0.3, 0.1, 0.1, 0.1, 0.2, "infrared", (1500.0, 571.0), 600.0, 120.0)


def chain(name: str, runner: TrialRunner) -> str:
    """Return the hash of one run: a 60 s follower, 20 images, an infrared link, three agents, or two robots.

    The two robots collide, use one responder, and draw their own random numbers.
    """
    if name == "pair":
        recording = run_program(
            runner,
            WANDERER,
            Pose(400, 500, 0),
            second=WANDERER,
            noise=Noise(10, 20),
            responder="def responder(text):\n    return f'JSON::[{sender}, \"{text}\"]'",
            channel=Channel(jitter=0.1, loss=0.1),
            physics=Physics(solid=True),
            seconds=20,
        )
        assert recording.partner is not None
        assert {recording.verdict, recording.partner.verdict} == {Verdict.TIME_LIMIT}
        assert recording.touches
        return f"{recording.sha256}{recording.partner.sha256}"
    if name == "follower":
        recording = run_program(runner, FOLLOWER, Pose(320, 500, 90), background="Loop", noise=Noise(10, 20))
        assert recording.verdict is Verdict.TIME_LIMIT, recording.faults
        assert len(recording.ticks) == 1800
    elif name == "agents":
        recording = run_program(runner, COUNT, responder=ASKING, agents=AGENTS)
        assert recording.verdict is Verdict.FINISHED
        assert len(recording.agent_messages) == 120
    elif name == "infrared":
        start = Pose(1100, 571, 0)
        recording = run_program(runner, CALL_ROUND, start, noise=Noise(motor=20), responder=ANSWER, channel=INFRARED)
        assert {message.lost for message in recording.messages} >= {"", "chance", "facing away"}
        assert any(message.arrived_as for message in recording.messages)
    else:
        recording = run_program(
            runner,
            SHOW_AND_TELL,
            Pose(520, 900, 0),
            background="Simple_Shapes",
            noise=Noise(light=10),
            responder=RESPONDER.read_text(),
            files={"mlp_shapes_14x14.joblib": load_weights("shapes")},
        )
        assert recording.verdict is Verdict.FINISHED
        assert sum(message.sender == "responder" for message in recording.messages) == 20
    return recording.sha256


RUNS = ("follower", "talk", "infrared", "agents", "pair")
WITH_TESTS = os.environ | {"PYTHONPATH": os.pathsep.join([str(HELPERS), str(Path(__file__).parent)])}
ELSEWHERE = textwrap.dedent("""
    import sys
    from service.grading.trial_runner import TrialRunner
    from test_same_run_same_hash import chain
    with TrialRunner() as runner:
        for name in sys.argv[1:]:
            print(name, chain(name, runner), flush=True)
""")


@pytest.mark.long
def test_four_processes_in_shuffled_order_beside_a_busy_core(runner: TrialRunner) -> None:
    local_chains = {name: chain(name, runner) for name in RUNS}
    busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        for number in range(2):
            pair = []
            for half in range(2):
                names = list(RUNS)
                random.Random(number * 2 + half).shuffle(names)
                command = [sys.executable, "-c", ELSEWHERE, *names]
                pair.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=WITH_TESTS))
            for process in pair:
                output, _ = process.communicate(timeout=300)
                assert process.returncode == 0
                assert dict(line.split() for line in output.splitlines()) == local_chains
    finally:
        busy.kill()
        busy.wait()


def test_another_seed_gives_another_run(runner: TrialRunner) -> None:
    hashes = {
        run_program(runner, "tank_drive.on_for_seconds(50, 50, 1)", noise=Noise(motor=20), seed=seed).sha256
        for seed in (1, 2, 3)
    }
    assert len(hashes) == 3


@pytest.mark.parametrize("extra", ["colorRight.rgb", "random.random()", "print(gyro.rate)"])
def test_looking_more_often_or_switching_a_noise_on_disturbs_no_other_chance(runner: TrialRunner, extra: str) -> None:
    program = "import random\ntank_drive.on(30, 40)\nfor i in range(20):\n    {}\n    time.sleep(0.1)\n"
    plain = run_program(runner, "import time\n" + program.format("pass"), noise=Noise(motor=30))
    other = run_program(runner, "import time\n" + program.format(extra), noise=Noise(light=40, motor=30))
    count = min(len(plain.ticks), len(other.ticks))
    assert count >= 59
    assert plain.ticks.x[:count].tolist() == other.ticks.x[:count].tolist()
    assert plain.ticks.heading[:count].tolist() == other.ticks.heading[:count].tolist()
