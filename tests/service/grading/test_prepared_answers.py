"""A table of answers made at home is worth no marks: the installation that marks has other worlds and random numbers.

Each attack is a submission that looks up values that a spy recorded on other installations. The tests also show that
it succeeds in the worlds where the table was made.
"""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from typing import Any

import numpy as np
import pytest

from responders.source_file import SourceFile
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.judging.label_patches import convert_to_grey
from service.grading.trial_runner import TrialRunner
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import locate_examples
from submissions.assignment.reader import find_assignment
from submissions.seeds import PUBLIC_SECRET, Secret
from submissions.submission import Submission

MARKING = Secret("of the installation where marks are given")
HOMES = (PUBLIC_SECRET, Secret("of the home of a student"))

#: All values that may distinguish a trial before its first image, and the robot's position.
TELLTALE = """
import os, random, secrets, uuid
import numpy
told = {
    "random": random.random(), "numpy": float(numpy.random.random()), "system": os.urandom(8).hex(),
    "secrets": secrets.token_hex(8), "node": uuid.getnode(), "uuid": uuid.uuid4().hex,
    "shuffled": random.sample(range(99), 9),
}
"""
STANDS = """
import json, time
import ev3dev2_glue as glue
{telltale}
told["place"] = [round(ultrasonic.distance_centimeters, 1), gyro.angle]
print("PY::" + json.dumps(told))
time.sleep(0.3)
print("IMG_DATA")
time.sleep(0.5)
if glue.pyState()["messages"]:
    say("It is " + str(glue.pyState()["messages"][-1]["message"]["shape"]))
"""
DRIVES = """
import json, time
{telltale}
tank_drive.on(5, 5)
for step in range(100):
    told["place"] = round(tank_drive.left_motor.position)
    told["step"] = step
    print("PY::" + json.dumps(told))
    print("IMG_DATA")
    time.sleep(0.2)
tank_drive.off()
"""
RESPONDER = """
import base64, hashlib, json, zlib
{telltale}
TABLE = json.loads(zlib.decompress(base64.b64decode({table!r})))
heard = {}

def responder(text):
    global heard
    if text.startswith("PY::"):
        heard = json.loads(text[4:])
        return "noted"
    left = json.loads(text[10:])["left"]
    keys = {"image": hashlib.sha256(left.encode()).hexdigest()}
    keys |= {"mine " + kind: value for kind, value in told.items()}
    keys |= {"its " + kind: value for kind, value in heard.items()}
    keys = {kind: json.dumps(value) for kind, value in keys.items()}
    print(json.dumps(keys))
    hits = [TABLE[kind][key] for kind, key in keys.items() if key in TABLE.get(kind, {})]
    answer = hits[0] if hits else None
    return "JSON::" + json.dumps({"message": {"shape": answer, "digit": answer}})
"""

Table = dict[str, dict[str, str]]


def grading_request(program: str, table: Mapping[str, Mapping[str, str]], name: str) -> Submission:
    packed = base64.b64encode(zlib.compress(json.dumps(table).encode())).decode()
    # Robot programs cannot import numpy.
    own = TELLTALE.replace("import numpy\n", "").replace('"numpy": float(numpy.random.random()), ', "")
    responder = RESPONDER.replace("{telltale}", TELLTALE).replace("{table!r}", repr(packed))
    return Submission(
        name,
        SourceFile("robot.py", program.replace("{telltale}", own)),
        SourceFile("responder.py", f"# {name}\n{responder}"),
    )


def marked(name: str) -> Assignment:
    """Return the assignment with only its hidden scenarios and their marked criteria."""
    assignment = find_assignment(name)
    hidden = [scenario for scenario in assignment.scenarios if scenario.visibility == "hidden"]
    ids = {scenario.id for scenario in hidden}
    wanted = [each for each in assignment.criteria if set(each.scenarios) & ids and each.marks]
    return replace(assignment, scenarios=tuple(hidden), criteria=tuple(wanted))


def looked_up(graded: Grade) -> Iterator[tuple[dict[str, str], str | None]]:
    """Yield the keys that the responder saw with each image, and the label of the image."""
    for trial in graded.trials:
        lines = [line for line in trial.recording.responder_output.splitlines() if line.startswith("{")]
        for line, image in zip(lines, trial.recording.images, strict=True):
            yield json.loads(line), image.truth


def table_of(grades: Sequence[Grade]) -> Table:
    """Return the table that a student writes at home, where the tool reports the label of each image."""
    table: Table = {}
    for graded in grades:
        for keys, truth in looked_up(graded):
            if truth is None:
                continue
            for kind, key in keys.items():
                table.setdefault(kind, {})[key] = truth
    return table


ATTACKED = {
    "digits-on-a-sheet": STANDS,
    "shape-at-random": STANDS,
    "rules-without-a-network": STANDS,
    "shapes-off-centre": STANDS,
    "shapes-on-the-move": DRIVES,
}


@pytest.mark.long
@pytest.mark.parametrize("name", ATTACKED)
def test_a_table_made_at_home_earns_nothing(runner: TrialRunner, name: str) -> None:
    assignment, program = marked(name), ATTACKED[name]
    offered = sum(criterion.marks for criterion in assignment.criteria)
    assert offered >= 8
    at_home = [grade(grading_request(program, {}, "spy"), assignment, secret=home, runner=runner) for home in HOMES]
    table = table_of(at_home)
    assert len(table["image"]) >= 20

    # In the original world, images reveal everything. Random numbers would too, if they did not depend on the
    # submission.
    seen = grading_request(program, {"image": table["image"]}, "table of images")
    assert grade(seen, assignment, secret=HOMES[1], runner=runner).marks == offered
    chances = {kind: entries for kind, entries in table.items() if kind != "image" and "place" not in kind}
    chances.pop("its step", None)
    assert len(chances) == 13
    by_chance = grading_request(program, chances, "table of chance")
    assert grade(by_chance, assignment, secret=HOMES[1], runner=runner).marks == 0

    # In the marked world, no image and no random number occurs again.
    everything = grade(
        grading_request(program, {**chances, "image": table["image"]}, "both"),
        assignment,
        secret=MARKING,
        runner=runner,
    )
    hits = [kind for keys, _ in looked_up(everything) for kind, key in keys.items() if key in table[kind]]
    assert {kind for kind in hits if "place" not in kind and kind != "its step"} == set()
    assert everything.marks == 0
    # A position predicts no more than a guess does.
    places = {kind: entries for kind, entries in table.items() if kind in ("its place", "its step")}
    assert (
        grade(grading_request(program, places, "table of places"), assignment, secret=MARKING, runner=runner).marks
        <= offered / 3
    )


TRAINS = """
import base64, json, zlib
import numpy
TABLE = json.loads(zlib.decompress(base64.b64decode({table!r})))

class Model:
    def predict(self, rows):
        return [TABLE.get(str(numpy.round(row * 255).astype(int).tolist()), "unknown") for row in rows]

def train(images, labels):
    return Model()
"""


@pytest.mark.long
def test_a_table_made_at_home_is_no_model(runner: TrialRunner) -> None:
    assignment = find_assignment("train-a-recogniser")
    marking = tuple(criterion for criterion in assignment.criteria if criterion.marks)
    # Nothing is learnt from the collected data.
    collected, _, *hidden = assignment.scenarios
    assignment = replace(assignment, criteria=marking, scenarios=(replace(collected, trials=1), *hidden))
    table = {}
    for trial in grade(_model({}), assignment, secret=HOMES[1], runner=runner).trials:
        for image in trial.recording.images:
            row = convert_to_grey(image, focus=True).astype(float).ravel()
            table[str(np.round(row / max(1.0, row.max()) * 255).astype(int).tolist())] = str(image.truth)
    assert grade(_model(table), assignment, secret=HOMES[1], runner=runner).marks == assignment.max_marks
    assert grade(_model(table), assignment, secret=MARKING, runner=runner).marks == 0


def _model(table: Mapping[str, str]) -> Submission:
    packed = base64.b64encode(zlib.compress(json.dumps(table).encode())).decode()
    return Submission("s", None, SourceFile("responder.py", TRAINS.replace("{table!r}", repr(packed))))


SHOWS = """
import os, random, uuid
print("PY::", random.random(), os.urandom(4).hex(), uuid.getnode())
print("NUMBER", os.getpid())
"""
ECHO = "import random\ndef responder(text): return str(random.random())\n"


def _collect_speech(graded: Grade) -> list[Any]:
    return [[message.text for message in trial.recording.messages] for trial in graded.trials]


def _numbers(graded: Grade) -> list[int]:
    """Return the trials in the order in which their processes were started."""
    numbers = [
        next(int(line.text.split()[1]) for line in trial.recording.printed if line.text.startswith("NUMBER"))
        for trial in graded.trials
    ]
    return sorted(range(len(numbers)), key=numbers.__getitem__)


@pytest.fixture(scope="module")
def noisy() -> Assignment:
    assignment = find_assignment("shape-at-random")
    few = tuple(replace(scenario, trials=5) for scenario in assignment.scenarios)
    return replace(assignment, criteria=assignment.criteria[:1], scenarios=few)


def submission(comment: str) -> Submission:
    return Submission("s", SourceFile("robot.py", f"# {comment}{SHOWS}"), SourceFile("responder.py", ECHO))


def test_chance_and_the_order_of_trials_are_each_submissions_own(noisy: Assignment) -> None:
    with TrialRunner() as runner:
        one, other = (grade(submission(text), noisy, secret=MARKING, runner=runner) for text in ("one", "other"))
    assert [trial.seed for trial in one.trials] == [trial.seed for trial in other.trials]
    assert _numbers(one) != _numbers(other)
    visible_count = len([trial for trial in one.trials if trial.visibility == "visible"])
    for order in (_numbers(one), _numbers(other)):
        assert sorted(order[:visible_count]) == list(range(visible_count)) != order[:visible_count]
        assert sorted(order[visible_count:]) == list(range(visible_count, len(one.trials))) != order[visible_count:]
    spoken = {text for graded in (one, other) for texts in _collect_speech(graded) for text in texts}
    assert len(spoken) == 2 * len(_collect_speech(one)) * len(_collect_speech(one)[0])


def test_the_same_submission_and_secret_give_the_same_recordings(runner: TrialRunner, noisy: Assignment) -> None:
    assignment = replace(noisy, scenarios=(replace(noisy.scenarios[0], trials=3),))
    quiet = Submission(
        "s", SourceFile("robot.py", SHOWS.replace('print("NUMBER", os.getpid())', "")), SourceFile("responder.py", ECHO)
    )
    chains = [
        [
            trial.recording.sha256
            for trial in grade(replace(quiet, student=who), assignment, secret=secret, runner=runner).trials
        ]
        for who, secret in (("ada", MARKING), ("bob", MARKING), ("ada", HOMES[1]))
    ]
    assert chains[0] == chains[1] != chains[2]


def test_a_table_of_truths_follows_the_order_in_which_the_secret_shuffles(runner: TrialRunner) -> None:
    """Judging uses the start place of the real run, whatever the secret is."""
    assignment = find_assignment("black-or-grey")
    shuffled = replace(
        assignment, scenarios=tuple(replace(scenario, choose="shuffled") for scenario in assignment.scenarios)
    )
    program = (locate_examples("black-or-grey") / "reference" / "robot.py").read_text()
    reference = Submission("s", SourceFile("robot.py", program))
    orders = set()
    for secret in (PUBLIC_SECRET, MARKING, *HOMES[1:]):
        graded = grade(reference, shuffled, secret=secret, runner=runner)
        assert graded.marks == Decimal(8)
        orders.add(tuple(trial.place for trial in graded.trials))
    assert len(orders) == 3
