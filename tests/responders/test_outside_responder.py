"""A responder outside gives the same run as a responder process with the same answers, and can't do more than one."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from responders.answered_trial import AnsweredRun
from responders.channel import Channel
from responders.conversation import Answer
from responders.outside_responder import OutsideAnswerer, OutsideQuestion, OutsideResponder, Unanswered
from responders.responder_process import LoggedData
from responders.sandbox.inside.frames import can_send_text
from responders.sandbox.meter import JobLimits, JobMeter
from responders.source_file import SourceFile
from responders.trial_spec import ProgramSpec, TrialSpec
from running import PROGRAM_LIMITS, run_program
from service.grading.trial_runner import TrialRunner
from sim.errors import Cancelled
from sim.floors import build_floor
from sim.recording import Fault, Verdict
from sim.robot import get_robot
from sim.world import Noise

CHATTER = """
import time
import ev3dev2_glue as glue
for number in range(4):
    print(f"Colour: {number}.5")
    print("image_data left")
    print(f"PY::{number}")
    print("IMG_DATA")
    tank_drive.on_for_seconds(20, 30, 0.4)
    print(glue.pyState()["messages"])
"""
#: The body of a responder for each kind of answer, and what the same answer is outside.
ANSWERS: dict[str, tuple[str, Callable[[str], str | None]]] = {
    "text": ("return 'heard ' + text[:9]", lambda text: "heard " + text[:9]),
    "JSON": ("return 'JSON::[1.0, \"é\"]'", lambda _: 'JSON::[1.0, "é"]'),
    "malformed": ("return 'JSON::[1,'", lambda _: "JSON::[1,"),
    "lone surrogate": (r"return 'a\ud800b'", lambda _: "a\ud800b"),
    "too long": ("return 'x' * 70_000", lambda _: "x" * 70_000),
    "nothing": ("return None", lambda _: None),
    "too much": ("return 'y' * 60_000", lambda _: "y" * 60_000),
}


def spec_of(program: str, seed: int = 1, output_bytes: int = 1_000_000) -> TrialSpec:
    floor = build_floor("Loop")
    return TrialSpec(
        ProgramSpec(SourceFile("robot.py", program), "preloaded", PROGRAM_LIMITS, output_bytes),
        responder=None,
        collaborative=True,
        floor=floor,
        robot=get_robot("Default_Robot"),
        pose=floor.default_pose,
        noise=Noise(20, 20),
        channel=Channel(),
        seconds=60,
        seed=seed,
        child_seed=seed,
    )


def answered(
    runner: TrialRunner,
    program: str,
    ask: OutsideAnswerer,
    output_bytes: int = 1_000_000,
    meter: JobMeter | None = None,
) -> AnsweredRun:
    return runner.run_answered(spec_of(program, output_bytes=output_bytes), (), ask, meter or JobMeter())


def without_hint(fault: Fault) -> Fault:
    return replace(fault, hint="", message=fault.message.replace("NoneType", "nothing"))


@pytest.mark.parametrize("kind", ANSWERS)
def test_the_run_is_that_of_a_process_with_the_same_answers(runner: TrialRunner, kind: str) -> None:
    body, answer = ANSWERS[kind]
    process = run_program(
        runner,
        CHATTER,
        responder=f"def responder(text):\n    {body}\n",
        background="Loop",
        noise=Noise(20, 20),
        output_bytes=200_000,
    )
    outside = answered(runner, CHATTER, lambda question: answer(question.text), 200_000)
    recording = outside.recording
    assert outside.open_question is None
    assert (recording.sha256, recording.verdict, recording.messages) == (
        process.sha256,
        process.verdict,
        process.messages,
    )
    assert tuple(map(without_hint, recording.faults)) == tuple(map(without_hint, process.faults))
    assert (recording.datalog, recording.image_log, recording.end) == (process.datalog, process.image_log, process.end)


def test_questions_come_in_order_with_what_was_logged_since_the_last(runner: TrialRunner) -> None:
    questions: list[OutsideQuestion] = []

    def ask(question: OutsideQuestion) -> str:
        questions.append(question)
        return "ok"

    answered(runner, CHATTER, ask)
    assert [each.number for each in questions] == list(range(8))
    assert [each.text[:8] for each in questions[::2]] == ["PY::0", "PY::1", "PY::2", "PY::3"]
    assert all(each.text.startswith("IMG_DATA::{") for each in questions[1::2])
    assert [each.logged_data.data[0][1] for each in questions[::2]] == [0.5, 1.5, 2.5, 3.5]
    assert all(len(each.logged_data.images) == 1 for each in questions[::2])
    assert not any(each.logged_data.data or each.logged_data.images for each in questions[1::2])
    assert [each.t for each in questions] == sorted(each.t for each in questions)


def test_a_run_can_end_at_a_question_and_be_repeated_with_its_answer(runner: TrialRunner) -> None:
    """As a server does it, one question after the other."""
    answers: list[str] = []

    def ask(question: OutsideQuestion) -> str:
        if question.number == len(answers):
            raise Unanswered(question)
        return answers[question.number]

    while (run := answered(runner, CHATTER, ask)).open_question is not None:
        assert run.open_question.number == len(answers)
        assert run.recording.messages[-1].sender == "robot"
        assert run.recording.end_t == pytest.approx(run.open_question.t)
        answers.append(f'JSON::"{len(answers)}"')
    live = answered(runner, CHATTER, lambda question: f'JSON::"{question.number}"')
    assert len(answers) == 8
    assert run.recording.sha256 == live.recording.sha256


def test_a_long_wait_for_an_answer_is_not_the_programs(runner: TrialRunner) -> None:
    def ask(_: OutsideQuestion) -> str:
        time.sleep(1.2)  # the first half second asleep is free for each child
        return "at last"

    meter = JobMeter(JobLimits(sleep_seconds=0.1))
    run = answered(runner, 'print("PY::1")\nimport time\ntime.sleep(1)\n', ask, meter=meter)
    assert run.recording.verdict is Verdict.FINISHED
    assert meter.spent.sleep_seconds < 0.1


def test_nobody_is_asked_twice_if_the_run_is_repeated_with_libraries(runner: TrialRunner) -> None:
    asked: list[str] = []
    program = 'print("PY::first")\n__import__("pand" + "as")\nprint("PY::second")\n'

    def ask(question: OutsideQuestion) -> str:
        asked.append(question.text)
        return "ok"

    run = answered(runner, program, ask)
    assert run.recording.verdict is Verdict.FINISHED
    assert asked == ["PY::first", "PY::second"]


def test_an_error_of_the_answerer_ends_the_run_and_is_not_the_programs(runner: TrialRunner) -> None:
    def ask(_: OutsideQuestion) -> str:
        raise Cancelled("the notebook has ended")

    with pytest.raises(Cancelled):
        answered(runner, CHATTER, ask)
    assert answered(runner, CHATTER, lambda _: "ok").recording.verdict is Verdict.FINISHED


@settings(max_examples=50)
@given(st.lists(st.none() | st.text(max_size=20_000) | st.text().map("JSON::".__add__), max_size=6))
def test_any_answers_are_stored_within_the_limits_or_refused(answers: list[str | None]) -> None:
    meter = JobMeter(JobLimits(kept_bytes=100_000))
    responder = OutsideResponder(lambda question: answers[question.number], 30_000, meter)
    results: list[Answer] = [responder.answer("PY::1", 0, number, LoggedData()) for number in range(len(answers))]
    stored = [each.text for each in results if each.text is not None]
    assert sum(len(text.encode()) for text in stored) <= 30_000
    assert all(can_send_text(text) for text in stored)
    assert all(each.fault is not None for each in results if each.text is None and not responder.is_stopped)
