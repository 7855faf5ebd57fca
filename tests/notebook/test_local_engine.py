"""The engine on this machine: the responder runs in the notebook, the robot in a robomark command."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from command import robomark
from notebook_builder import document
from processes import COMMAND, alive, until
from robomark_notebook import local_engine
from robomark_notebook.engine import EngineError, MagicCall, Question
from robomark_notebook.local_engine import LocalEngine, find_command
from submissions.assignment.examples import locate_examples

PROGRAM = """
import time
import ev3dev2_glue as glue
print("Colour: 12.5")
print("image_data left")
print("PY::one")
tank_drive.on_for_seconds(20, 30, 0.5)
print("PY::" + str(glue.pyState()["messages"]))
time.sleep(0.5)
print(glue.pyState()["messages"])
"""
RESPONDER = "def responder(text):\n    return 'JSON::[\"' + text[4:7] + '\"]'\n"
FLAGS = "-b Loop -N 20 -M 10 -L"
ENDLESS = "import time\nprint('PY::go')\nwhile True:\n    pass\n"


def call(body: str | None, flags: str = f"{FLAGS} -R", name: str = "sim_magic_preloaded") -> MagicCall:
    return MagicCall(3, name, flags, body)


def answer(question: Question) -> str:
    return f'JSON::["{question.text[4:7]}"]'


@pytest.fixture(scope="module")
def engine() -> Iterator[LocalEngine]:
    one = LocalEngine(COMMAND)
    yield one
    one.close()


def test_a_run_has_the_hash_of_robomark_run_with_the_same_answers(engine: LocalEngine, tmp_path: Path) -> None:
    program, responder = tmp_path / "robot.py", tmp_path / "responder.py"
    program.write_text(f"%%sim_magic_preloaded {FLAGS}\n{PROGRAM}")
    responder.write_text(RESPONDER)
    shown = robomark("run", program, "--responder", responder, "--seed", "7", "--json")
    expected: dict[str, Any] = json.loads(shown.stdout)["run"]
    engine.seed = 7
    result = engine.call_magic(call(PROGRAM), None, answer)
    engine.seed = 0
    run = result.run
    assert run is not None
    assert (run.sha256, run.verdict) == (expected["sha256"], "finished")
    assert '(answer) JSON::["one"]' in [text for _, text in run.lines]
    assert run.data[0][:2] == ("Colour", 12.5)
    assert run.images[0].startswith("left ")
    assert run.replay["format"] == "robomark replay"
    json.dumps(dict(result.page))


def test_the_responder_has_the_state_of_the_notebook(engine: LocalEngine) -> None:
    questions: list[Question] = []

    def counting(question: Question) -> str:
        questions.append(question)
        return f"number {len(questions)}"

    result = engine.call_magic(call(PROGRAM), None, counting)
    assert [each.text for each in questions] == ["PY::one", "PY::[]"]
    assert (questions[0].data[0][0], len(questions[0].images)) == ("Colour", 1)
    assert result.run is not None
    assert "(answer) number 2" in [text for _, text in result.run.lines]


def test_the_page_is_kept_between_magics(engine: LocalEngine) -> None:
    drive = "tank_drive.on_for_rotations(30, 30, 1)\n"
    first = engine.call_magic(call(drive, "-b Loop -x 300 -y 400 -a 0"), None, answer)
    assert first.run is None
    second = engine.call_magic(call(None, "-R", "sim_magic"), first.page, answer)
    third = engine.call_magic(call(None, "-R", "sim_magic"), second.page, answer)
    assert second.run is not None
    assert third.run is not None
    assert first.page["x"] < second.page["x"] < third.page["x"]
    assert "nothing was run" in engine.call_magic(call("", "-b Loop --none"), None, answer).notes[0]


def test_a_fault_has_its_cell_and_line(engine: LocalEngine) -> None:
    run = engine.call_magic(call("x = 1\nprin(x)\n"), None, answer).run
    assert run is not None
    assert [(each.who, each.place) for each in run.faults] == [("program", "cell 3, line 3")]
    unanswered = engine.call_magic(call("print('PY::1')\nimport time\ntime.sleep(1)"), None, lambda _: None).run
    assert unanswered is not None
    assert (unanswered.verdict, unanswered.faults[0].who) == ("protocol_error", "responder")


def test_an_interrupted_responder_ends_the_run_and_the_next_one_works(engine: LocalEngine) -> None:
    def interrupted(_: Question) -> str:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        engine.call_magic(call(PROGRAM), None, interrupted)
    assert engine.call_magic(call(PROGRAM), None, answer).run is not None


def test_a_responder_cannot_start_another_run(engine: LocalEngine) -> None:
    def nested(_: Question) -> str:
        with pytest.raises(EngineError, match="waiting for an answer"):
            engine.call_magic(call(PROGRAM), None, answer)
        return "ok"

    assert engine.call_magic(call(PROGRAM), None, nested).run is not None


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_an_engine_that_is_killed_in_the_middle_is_one_sentence_and_starts_again(
    engine: LocalEngine, number: signal.Signals
) -> None:
    def killing(_: Question) -> str:
        assert engine._process is not None
        os.kill(engine._process._process.pid, number)
        return "ok"

    with pytest.raises(EngineError, match=r"^The robomark command ended: .*\. Run the cell again"):
        engine.call_magic(call(PROGRAM), None, killing)
    assert engine.call_magic(call(PROGRAM), None, answer).run is not None


def test_the_engine_ends_with_its_notebook_in_the_middle_of_a_run() -> None:
    one = LocalEngine(COMMAND)
    pids: list[int] = []

    def leaving(_: Question) -> str:
        assert one._process is not None
        process = one._process._process
        pids.append(process.pid)
        assert process.stdin is not None
        process.stdin.write(b'{"id":1,"do":"answer","text":"go"}\n')
        process.stdin.close()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        one.call_magic(call(ENDLESS), None, leaving)
    one.close()
    until(lambda: not alive(pids[0]), "it still runs")


def test_a_page_from_elsewhere_is_refused(engine: LocalEngine) -> None:
    with pytest.raises(EngineError, match=r"^The notebook's request is not valid \(magic\.page"):
        engine.call_magic(call(PROGRAM), {"background": "Loop"}, answer)


def test_an_answer_without_bound_is_refused(engine: LocalEngine) -> None:
    run = engine.call_magic(call(PROGRAM), None, lambda _: "x" * 100_000).run
    assert run is not None
    assert "an answer of 100000 characters" in run.faults[0].message
    with pytest.raises(EngineError, match="the most is 60,000"):
        engine.call_magic(call(PROGRAM), None, lambda _: "x" * (5 << 20))


def test_a_notebook_is_checked_in_the_visible_scenarios(engine: LocalEngine, tmp_path: Path) -> None:
    example = locate_examples("echo-responder") / "reference"
    cells = [
        (example / "responder.py").read_text() + "\nroboSim.pyresponder = responder",
        "%%sim_magic_preloaded -R\n" + (example / "robot.py").read_text(),
    ]
    right = json.dumps(document(cells)).encode()
    check = engine.check("echo-responder", "ada.ipynb", right, {})
    assert (check.marks, [each.passed for each in check.criteria]) == (check.out_of, [True] * len(check.criteria))
    assert check.replay is not None
    wrong = json.dumps(document([cells[0], "%%sim_magic_preloaded -R\nprin(1)\n"])).encode()
    failed = engine.check("echo-responder", "ada.ipynb", wrong, {"notes.txt": b"1"})
    assert "prin" in failed.happened
    assert failed.marks == "0"
    assert failed.next_steps


def test_an_assignment_can_be_a_folder_and_mistakes_are_one_sentence(
    engine: LocalEngine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = robomark("assignments", "new", tmp_path / "my-task")
    assert made.returncode == 0, made.stderr
    monkeypatch.chdir(tmp_path)
    notebook = json.dumps(document(["%%sim_magic_preloaded -R\nprint(1)\n"])).encode()
    assert engine.check("my-task", "ada.ipynb", notebook, {}).criteria
    with pytest.raises(EngineError, match=r"^There is no assignment 'echo'"):
        engine.check("echo", "ada.ipynb", notebook, {})
    with pytest.raises(EngineError, match=r"^ada\.ipynb"):
        engine.check("my-task", "ada.ipynb", b"{", {})
    with pytest.raises(EngineError, match="Only a server"):
        engine.submit("my-task", "ada.ipynb", notebook, {})


def test_a_command_that_is_missing_or_something_else_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(EngineError, match=r"^The robomark command ended: with status 1\."):
        LocalEngine([sys.executable, "-c", "raise SystemExit(1)"]).call_magic(call(PROGRAM), None, answer)
    with pytest.raises(EngineError, match="printed something that is not an event"):
        LocalEngine([sys.executable, "-c", "print('hello')"]).call_magic(call(PROGRAM), None, answer)
    with pytest.raises(EngineError, match="another release"):
        LocalEngine([sys.executable, "-c", "print('{}')"]).call_magic(call(PROGRAM), None, answer)
    with pytest.raises(EngineError, match="cannot be started"):
        LocalEngine([str(tmp_path / "robomark")])
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    monkeypatch.delenv(local_engine.COMMAND_VARIABLE, raising=False)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "robomark").touch(0o755)
    monkeypatch.setenv("PATH", "bin::.")
    with pytest.raises(EngineError, match="There is no robomark command"):
        find_command()
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    assert find_command() == (str(tmp_path / "bin" / "robomark"),)
