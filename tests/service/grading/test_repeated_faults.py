"""Trials that are not run again: their recordings and marks are those of a real run."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from responders.repeated_faults import REPLAY_NOTES
from service.grading.example_check import list_examples
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from sim.recording import Recording, Ticks, Verdict
from submissions.assignment.examples import read_example, read_expected
from submissions.assignment.reader import find_assignment, read_assignment
from submissions.bundle import read_submission

TOML = """
id = "fails"
title = "Fails"
[[scenario]]
id = "one"
poses = [[300, 700, 0], [500, 500, 90]]
trials = 2
seconds = 5
light_noise = 20
motor_noise = 20
[limits]
program_cpu = 0.2
responder_cpu = 0.2
[[criterion]]
title = "Ends"
marks = 1
check = "finishes"
"""
ECHO = "def responder(text):\n    return text\n"
ASKS = 'import time\nprint("PY::hi")\ntime.sleep(1)\nspeed = colorLeft.reflected_light_intensity\n'
BUSY = "def responder(text):\n    while True:\n        pass\n"
#: Statements that read a value derived from the seed, by a name that does not occur in the text.
UNSEEN_NAMES = (
    r'"{0._\x5finit_\x5f._\x5fg\x6cobals_\x5f[re].enum.s\x79s.mod\x75les[uuid]._node}".format(json.JSONDecoder)',
    "'{0.enum.s' 'ys.mod' 'ules[uuid]._node}'.format(json.scanner.re)",
    "('{r.enum.s' 'ys.mod' 'ules[uuid]._node}').format_map({'r': json.scanner.re})",
    "string.Formatter().vformat('{0.enum.s' 'ys.mod' 'ules[uuid]._node}', [json.scanner.re], {})",
    "string.Formatter().get_field('0.enum.s' 'ys', [json.scanner.re], {})",
    "functools.update_wrapper(lambda: 0, json.scanner.re.enum, ['s' 'ys'], [])",
    "functools.wraps(json.scanner.re.enum, ['s' 'ys'], [])(lambda: 0)",
    "print('a\\\nb')",
)
_NO_TICKS = Ticks(*cast(Any, [np.empty(0)] * 9))  # the same object in both


@pytest.fixture(scope="module")
def runs_all() -> Iterator[TrialRunner]:
    with TrialRunner(spares=False) as every:
        yield every


def all_but_ticks(recording: Recording) -> Recording:
    """Return the data to compare beside the ticks' hash chain, without the line where a loop was interrupted."""
    faults = (replace(each, line=None) if each.verdict is Verdict.CPU_LIMIT else each for each in recording.faults)
    notes = (note for note in recording.notes if note not in REPLAY_NOTES.values())
    return replace(recording, faults=tuple(faults), notes=tuple(notes), ticks=_NO_TICKS)


def spared(graded: Grade, role: str) -> list[int]:
    return [number for number, each in enumerate(graded.trials) if REPLAY_NOTES[role] in each.recording.notes]


@pytest.mark.long
@pytest.mark.parametrize(
    ("files", "role", "count"),
    [
        ({"robot.py": "print(wheel)"}, "robot", 2),
        ({"robot.py": "tank_drive.on_for_seconds(30, 30, 1)\nwhile True:\n    x = 1\n    y = 2\n"}, "robot", 2),
        ({"robot.py": "print('PY::hi')\nimport time\ntime.sleep(1)\n1/0\n"}, "robot", 2),
        ({"robot.py": "import helper\nhelper.fail()\n", "helper.py": "def fail():\n    1/0\n"}, "robot", 2),
        # The world's answer differs between trials.
        ({"robot.py": "speed = colorLeft.reflected_light_intensity\n1/0\n"}, "robot", 0),
        # The program may use random numbers.
        ({"robot.py": "import random\nif random.random() < 2:\n    1/0\n"}, "robot", 0),
        ({"robot.py": "import ｒandom\n1/0\n"}, "robot", 0),
        ({"robot.py": "import helper\n1/0\n", "helper.py": "from random import random\n"}, "robot", 0),
        ({"robot.py": "__import__('ran' + 'dom').random()\n1/0\n"}, "robot", 0),
        ({"robot.py": "import \\\n random\n1/0\n"}, "robot", 0),
        *(({"robot.py": f"import functools, json, string\n{unseen}\n1/0\n"}, "robot", 0) for unseen in UNSEEN_NAMES),
        ({"robot.py": ASKS, "responder.py": BUSY}, "responder", 2),
        ({"robot.py": ASKS, "responder.py": "import numpy\n" + BUSY}, "responder", 0),
        ({"robot.py": ASKS, "responder.py": "open('logger.txt', 'w').write('x')\n" + BUSY}, "responder", 0),
        # An error in a responder takes little time, so nothing is spared.
        ({"robot.py": ASKS, "responder.py": "1/0\n"}, "responder", 0),
    ],
)
def test_a_spared_trial_is_what_running_it_gives(
    tmp_path: Path, runner: TrialRunner, runs_all: TrialRunner, files: Mapping[str, str], role: str, count: int
) -> None:
    (tmp_path / "assignment.toml").write_text(TOML)
    assignment = read_assignment(tmp_path)
    (tmp_path / "ada").mkdir()
    for name, text in {"responder.py": ECHO, **files}.items():
        (tmp_path / "ada" / name).write_text(text)
    submission = read_submission(tmp_path / "ada", required_parts=assignment.parts)
    skipping_grade, wanted = (grade(submission, assignment, runner=each) for each in (runner, runs_all))
    assert (len(spared(skipping_grade, role)), len(spared(wanted, role))) == (count, 0)
    for one, other in zip(skipping_grade.trials, wanted.trials, strict=True):
        assert one.recording.sha256 == other.recording.sha256
        assert all_but_ticks(one.recording) == all_but_ticks(other.recording)
    assert [each.marks for each in skipping_grade.criteria] == [each.marks for each in wanted.criteria]
    skip_notes = [note for note in skipping_grade.notes if "the result would be the same" in note]
    assert [f"in {count} of 4 trials" in note for note in skip_notes] == ([True] if count else [])


def _turns_of(seconds: float) -> int:
    """Return the number of iterations of an empty loop, outside of any function, that take this long here."""
    loop = compile("for _ in range(10_000): pass", "loop", "exec")
    turns, began = 0, time.process_time()
    while time.process_time() - began < seconds:
        exec(loop, {})
        turns += 10_000
    return turns


@pytest.mark.parametrize(
    "program",
    [
        # The loop ends just after its limit. On a faster machine, or in another trial, it would end before.
        "for _ in range(TURNS): pass\nsay('done')\n",
        # The output comes just before the limit. In another trial it would come too late.
        "for _ in range(FEWER_TURNS): pass\nsay('done')\nwhile True: pass\n",
    ],
)
def test_near_its_limit_every_trial_is_run(program: str, tmp_path: Path, runner: TrialRunner) -> None:
    (tmp_path / "assignment.toml").write_text(TOML)
    assignment = read_assignment(tmp_path)
    (tmp_path / "ada").mkdir()
    text = program.replace("FEWER_TURNS", str(_turns_of(0.16))).replace("TURNS", str(_turns_of(0.24)))
    (tmp_path / "ada" / "robot.py").write_text(text)
    (tmp_path / "ada" / "responder.py").write_text(ECHO)
    assert (
        spared(
            grade(read_submission(tmp_path / "ada", required_parts=assignment.parts), assignment, runner=runner),
            "robot",
        )
        == []
    )


def test_how_many_hidden_trials_were_spared_is_not_told(tmp_path: Path, runner: TrialRunner) -> None:
    hidden = 'seconds = 5\n[[scenario]]\nid = "two"\nvisibility = "hidden"\nposes = [[300, 700, 0], [400, 700, 0]]\n'
    (tmp_path / "assignment.toml").write_text(TOML.replace("seconds = 5\n", hidden + "seconds = 5\n"))
    assignment = read_assignment(tmp_path)
    (tmp_path / "ada").mkdir()
    (tmp_path / "ada" / "robot.py").write_text("print(wheel)")
    (tmp_path / "ada" / "responder.py").write_text(ECHO)
    graded = grade(read_submission(tmp_path / "ada", required_parts=assignment.parts), assignment, runner=runner)
    assert len(spared(graded, "robot")) == len(graded.trials) - 2
    visible = [each for each in graded.trials if each.visibility == "visible"]
    assert any(f"in {len(visible) - 2} of {len(visible)} trials" in note for note in graded.notes)


def _faulty() -> list[tuple[str, str]]:
    catalogue = Path(find_assignment.__code__.co_filename).parents[1] / "catalogue"
    names = sorted(path.name for path in catalogue.iterdir() if (path / "assignment.toml").is_file())
    return [
        (name, example)
        for name in names
        for example in list_examples(name)
        if (wanted := read_expected(name).examples.get(example)) is not None and wanted.verdict is not Verdict.FINISHED
    ]


@pytest.mark.long
@pytest.mark.parametrize(("name", "example"), _faulty())
def test_faulty_examples_get_the_same_with_every_trial_run(
    runner: TrialRunner, runs_all: TrialRunner, name: str, example: str
) -> None:
    assignment = find_assignment(name)
    submission = read_example(name, example)
    skipping_grade, wanted = (grade(submission, assignment, runner=each) for each in (runner, runs_all))
    assert [(each.id, each.marks) for each in skipping_grade.criteria] == [
        (each.id, each.marks) for each in wanted.criteria
    ]
    assert [each.verdict for each in skipping_grade.trials] == [each.verdict for each in wanted.trials]
    pairs = zip(skipping_grade.trials, wanted.trials, strict=True)
    assert all(one.recording.sha256 == other.recording.sha256 for one, other in pairs)
