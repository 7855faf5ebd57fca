"""Hidden trials affect only the marks in a student's report, whatever a submission does in them.

In each attack, the robot's view in a hidden trial decides a reportable detail: a count, a text, a time, a place.
Each is graded in two hidden worlds that differ. The visible worlds and the marks are the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from decimal import Decimal
from typing import Any

import pytest

from builders import echo, grading_request
from report_builders import row_of
from responders.sandbox.meter import JobMeter
from responders.source_file import SourceFile
from service.grading import grader
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.reports.formats.gradescope import render_gradescope
from service.reports.formats.json_output import render_json
from service.reports.formats.moodle import render_moodle_csv
from service.reports.formats.text import render_plain_text
from service.reports.html import render_report_page
from service.reports.plots.grade_plots import draw_all_plots
from service.reports.view import build_gradebook_view, build_student_view
from sim.recording import Pose
from submissions.assignment.definition import Assignment, Parts, Scenario, Training, WorldSpec
from submissions.assignment.limits import Limits
from submissions.assignment.reader import find_assignment
from submissions.assignment.scenario import Sweep
from submissions.criteria import SCHEMAS, Criterion
from submissions.submission import Cell, Notebook, Submission

POSES = tuple(Pose(200.0 + 80 * place, 900.0, 0.0) for place in range(6))

#: Worth no marks, so that marks reveal nothing and the reports must be equal.
CRITERIA: tuple[tuple[str, Mapping[str, Any]], ...] = (
    ("finishes", {}),
    ("prints", {"contains": ["never printed"]}),
    ("says", {"contains": ["never said"]}),
    ("messages", {"contains": ["never sent"]}),
    ("replies", {"contains": ["never answered"]}),
    ("pose", {"x": 2000, "y": 100, "tolerance": 1}),
    ("classification", {"answer": "message.shape", "confidence": "message.confidence", "late": "wrong"}),
    ("robustness", {"along": "light_noise", "answer": "message.shape"}),
    ("image_log", {"left": 400}),
    ("datalog", {"series": "Light_left", "at_least": 400}),
    ("timing", {"between": [50, 60]}),
    ("displacement", {"distance": [1000, 1001]}),
    ("touches_nothing", {}),
)


def criterion(check: str, keys: Mapping[str, Any]) -> Criterion:
    made = SCHEMAS[check].model_validate({"id": check, "title": check, "marks": "0", "check": check, **keys})
    assert isinstance(made, Criterion)
    return made


@pytest.fixture(scope="module")
def hidden_assignment() -> Assignment:
    visible_scenario = Scenario("shown", POSES[:1], seconds=20, sweep=Sweep(light_noise=(8, 64)))
    hidden = replace(visible_scenario, id="hidden", visibility="hidden", poses=POSES[2:4])
    criteria = tuple(criterion(check, keys) for check, keys in CRITERIA)
    world = WorldSpec("Shuffled_Shapes", labels=False, sheet=None)
    return Assignment("a", "A", world, Parts(), (visible_scenario, hidden), criteria, Limits(0.5, 2.0), version="1")


def students(graded: Grade, submission: Submission, plots: Mapping[str, bytes]) -> dict[str, str]:
    """Return everything that a student can read about a grade."""
    view = build_student_view(graded)
    return {
        "report": render_report_page(build_student_view(graded), plots, submission),
        "json": render_json(view),
        "text": render_plain_text(view),
        "gradescope": render_gradescope(build_gradebook_view(graded)),
        "moodle": render_moodle_csv([row_of(graded).apply_view(build_gradebook_view)]),
        "view": repr(view),
    }


def chosen(graded: Grade) -> list[Any]:
    """Return the actions of the submission in hidden trials, without the robot's sensor data."""
    return [
        (
            recording.verdict,
            recording.end_t,
            recording.end,
            [line.text for line in (*recording.printed, *recording.spoken)],
            [
                (m.t, m.sender, m.note, m.delivered, m.text[: 8 if m.sender == "robot" else 999])
                for m in recording.messages
            ],
            [(fault.message, fault.line) for fault in recording.faults],
            [call.argument for call in recording.calls if call.callee == "agent"],
            (len(recording.images), len(recording.image_log), len(recording.touches)),
            (recording.responder_output, recording.responder_log, recording.notes),
        )
        for recording in (trial.recording for trial in graded.trials if trial.visibility == "hidden")
    ]


def told_apart(
    runner: TrialRunner, submission: Submission, hidden_assignment: Assignment, *, draw: bool = False
) -> None:
    first, second = (
        grade(submission, replace(hidden_assignment, secret=secret), runner=runner) for secret in ("one", "two")
    )
    assert [result.marks for result in first.criteria] == [result.marks for result in second.criteria]
    # The hidden trials differ.
    assert chosen(first) != chosen(second)
    pages = [students(graded, submission, draw_all_plots(graded) if draw else {}) for graded in (first, second)]
    assert pages[0] == pages[1]


SEES = """
import json, time
import ev3dev2_glue as glue
seen = sum(colorLeft.rgb) % 23
"""
TRIES = """try:
    if seen == {}: open('/etc/passwd')
except OSError:
    pass"""
PROGRAMS = {
    "the number of images": "for _ in range(1 + seen):\n    print('IMG_DATA')\n    time.sleep(0.2)",
    "the number of messages": "for _ in range(seen):\n    print('PY::x')\n    time.sleep(0.1)",
    "the text of a message": "print('PY::' + str(seen))\ntime.sleep(1)",
    "the text of an error": "raise ValueError(seen)",
    "the line of an error": "\n".join(f"if seen == {number}: raise ValueError" for number in range(23)),
    "a printed text": "print(seen)",
    "a spoken text": "say(str(seen))",
    "the moment of the end": "time.sleep(seen / 10)",
    "the way that it ends": "import sys\nsys.exit(seen % 2)",
    "running on": "while seen % 2:\n    time.sleep(1)",
    "computing on": "while seen % 2:\n    pass",
    "the place of the end": "tank_drive.on_for_seconds(20, 20, 0.1 * seen)",
    "what it touches": "tank_drive.on_for_seconds(40 * (1 if seen % 2 else -1), 40 * (1 if seen % 2 else -1), 5)",
    "the number of logged images": "for _ in range(seen):\n    print('image_data left')\n    time.sleep(0.1)",
    "logged readings": "for _ in range(seen):\n    print('Light_left:', seen)\n    time.sleep(0.1)",
    "the line of what is refused": "\n".join(TRIES.format(number) for number in range(23)),
    "not waiting for answers": "for _ in range(5):\n    print('IMG_DATA')\n    time.sleep(0.05 * (seen % 3))",
}  # fmt: skip
ANSWERS = "import json\ndef responder(text):\n    return 'JSON::' + json.dumps({'message': {'shape': 'square'}})\n"

LOOKS = """
import json, time
def looked(text):
    return sum(map(int, json.loads(text[10:])["left"].split(","))) % 23 if text.startswith("IMG") else 0
NAMES = ["square", "diamond", "right facing triangle", "left facing triangle"]
def responder(text):
    seen = looked(text)
"""
SENDS = "import time\nfor _ in range(3):\n    print('IMG_DATA')\n    time.sleep(0.5)\n"
RESPONDERS = {
    "which answers are given": "    return 'JSON::' + json.dumps({'message': {'shape': NAMES[seen % 4]}})",
    "how sure it says it is": "    return 'JSON::' + json.dumps({'message': {'shape': 'x', 'confidence': seen / 23}})",
    "answers that cannot be read": "    return 'JSON::' + ('{' if seen % 2 else '{}')",
    "answers that are no text": "    return seen if seen % 2 else 'x'",
    "silence": "    return '' if seen % 2 else None",
    "answers that come late": "    time.sleep(seen / 10)\n    return 'x'",
    "an error": "    raise RuntimeError(NAMES[seen % 4])",
    "what the responder prints": "    print(seen)\n    return 'x'",
    "what the responder writes down": "    open('logger.txt', 'a').write(str(seen))\n    return 'x'",
    "the line of what it is refused": "\n".join(
        f"    {line}" for number in range(23) for line in TRIES.format(number).splitlines()
    ),
    "what its agent is called with": "    return agent(seen)\nagent = str",
}  # fmt: skip

#: One attack of each kind: counts, texts, times, lines, places, answers to images. The others are long tests.
QUICK = {
    "the number of images", "the text of a message", "the line of an error", "running on", "what it touches",
    "which answers are given", "answers that come late",
}  # fmt: skip


def channels(known: Mapping[str, str]) -> list[Any]:
    return [pytest.param(name, marks=() if name in QUICK else pytest.mark.long) for name in known]


@pytest.mark.long
@pytest.mark.parametrize("channel", channels(PROGRAMS))
def test_what_a_program_does_in_hidden_trials_is_not_told(
    runner: TrialRunner, hidden_assignment: Assignment, channel: str
) -> None:
    program = SourceFile("robot.py", f"{SEES}{PROGRAMS[channel]}\n")
    told_apart(runner, Submission("s", program, SourceFile("responder.py", ANSWERS)), hidden_assignment)


@pytest.mark.parametrize("channel", channels(RESPONDERS))
def test_what_a_responder_does_in_hidden_trials_is_not_told(
    runner: TrialRunner, hidden_assignment: Assignment, channel: str
) -> None:
    responder = SourceFile("responder.py", f"{LOOKS}{RESPONDERS[channel]}\n")
    told_apart(runner, Submission("s", SourceFile("robot.py", SENDS), responder), hidden_assignment)


@pytest.mark.long
def test_plots_for_students_are_of_visible_trials(runner: TrialRunner, hidden_assignment: Assignment) -> None:
    few = replace(
        hidden_assignment, scenarios=tuple(replace(each, poses=each.poses[:1]) for each in hidden_assignment.scenarios)
    )
    responder = SourceFile("responder.py", LOOKS + RESPONDERS["which answers are given"])
    told_apart(runner, Submission("s", SourceFile("robot.py", SENDS), responder), few, draw=True)


CELLS = (
    "import json\nseen = 0\ndef responder(text):\n    global seen\n    if text.startswith('IMG'):\n"
    "        seen = sum(map(int, json.loads(text[10:])['left'].split(','))) % 23\n    return 'x'",
    "%%sim_magic_preloaded -R\nimport time\nprint('IMG_DATA')\ntime.sleep(0.5)",
    "print(seen)",
    "raise ValueError(seen)",
    "get_ipython().system(str(seen))",
    "%sim_robot_state",
)


def test_what_the_cells_after_a_hidden_run_do_is_not_told(runner: TrialRunner, hidden_assignment: Assignment) -> None:
    cells = tuple(Cell(number, source) for number, source in enumerate(CELLS, 1))
    told_apart(runner, Submission("s", notebook=Notebook("work.ipynb", cells)), hidden_assignment)


#: Trained on visible images, then asked about visible and hidden ones in one process.
MODELS = {
    "what the model prints": "print(seen)",
    "what the model raises": "1 / (seen % 2)",
    "what the model calls the images it is shown next": "self.said = str(seen)",
    "computing on": "[0 for _ in iter(lambda: seen % 2, 0)]",
}
MODEL = """
class Model:
    said = "square"
    def predict(self, rows):
        seen = int(rows.sum() * 1000) % 23
        {}
        return [self.said] * len(rows)
def train(images, labels):
    return Model()
"""


@pytest.fixture(scope="module")
def training() -> Assignment:
    assignment = find_assignment("train-a-recogniser")
    scenarios = tuple(replace(scenario, trials=1) for scenario in assignment.scenarios)
    criteria = tuple(each.model_copy(update={"marks": Decimal(0)}) for each in assignment.criteria)
    pooled = criteria[0].model_copy(update={"id": "all", "scenarios": ("practice", "unseen")})
    assert isinstance(assignment.training, Training)
    limits = replace(assignment.limits, responder_cpu=0.5)
    return replace(assignment, scenarios=scenarios, criteria=(*criteria, pooled), limits=limits)


@pytest.mark.long
@pytest.mark.parametrize(
    "channel", [pytest.param(name, marks=[pytest.mark.long] * (number > 0)) for number, name in enumerate(MODELS)]
)
def test_what_a_model_does_with_hidden_images_is_not_told(
    runner: TrialRunner, training: Assignment, channel: str
) -> None:
    model = SourceFile("responder.py", MODEL.replace("{}", MODELS[channel]))
    told_apart(runner, Submission("s", None, model), training)


def _with_hidden(count: int, *, first: bool) -> Assignment:
    """Return the echo assignment with four visible trials, and ``count`` hidden ones before or after them."""
    (own,) = echo().scenarios
    visible_scenario = replace(own, poses=tuple(Pose(x, 800, 0) for x in (100, 150, 200, 250)))
    hidden = tuple(replace(own, id=f"secret-{number}", visibility="hidden") for number in range(count))
    return replace(echo(), scenarios=(*hidden, visible_scenario) if first else (visible_scenario, *hidden))


@pytest.mark.parametrize("seed", range(20))
def test_visible_trials_are_run_in_an_order_of_their_own(seed: int) -> None:
    def order(assignment: Assignment) -> list[int]:
        trials = tuple(assignment.trials())
        run = [trials[number] for number in grader._choose_run_order(trials, seed)]
        assert [trial.scenario.visibility for trial in run[4:]] == ["hidden"] * (len(run) - 4)
        return [trial.index for trial in run[:4]]

    assert order(_with_hidden(1, first=False)) == order(_with_hidden(3, first=True))


def test_visible_trials_may_compute_as_long_however_many_are_hidden(
    runner: TrialRunner, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits: list[float] = []

    class Watched(JobMeter):
        def charge_child(self, cpu_seconds: float, sleep_seconds: float) -> None:
            limits.append(self.limits.cpu_seconds)
            super().charge_child(cpu_seconds, sleep_seconds)

    monkeypatch.setattr(grader, "JobMeter", Watched)
    verdicts = {}
    for count in (1, 3):
        limits.clear()
        graded = grade(grading_request().submission, _with_hidden(count, first=True), runner=runner)
        assert graded.cost is not None
        verdicts[count] = (limits[0], graded.cost.limits.cpu_seconds - limits[0])
    assert verdicts[1][0] == verdicts[3][0]
    assert (verdicts[1][1], verdicts[3][1]) == (1, 3)
