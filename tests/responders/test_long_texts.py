"""Texts too long for the wire are cut in every call. No program gets a violation for a long sentence."""

from __future__ import annotations

import pytest

from running import run_program
from service.grading.trial_runner import TrialRunner
from sim.recording import Recording, Verdict

ECHO = "def responder(text): return text\n"
#: Texts of about 66,000 bytes and more on the wire, where a character takes 1, 6 or 12 bytes.
TEXTS = ("'x' * 66_000", "'\\x00' * 12_000", "'é' * 12_000", "'\\U0001f600' * 6_000", "'\\ud800' * 12_000")
#: Each call of a robot program that takes a text, and the verdict of the trial.
PROGRAM_CALLS = {
    "say(TEXT)": Verdict.FINISHED,
    "from ev3dev2.sound import Sound\nSound().speak(TEXT, play_type=1)": Verdict.FINISHED,
    "print(TEXT)": Verdict.FINISHED,
    "print('PY::' + TEXT)": Verdict.FINISHED,
    "import sys\nsys.stderr.write(TEXT)": Verdict.FINISHED,
    "import warnings\nwarnings.warn(TEXT)": Verdict.FINISHED,
    "tank_drive.left_motor.polarity = TEXT": Verdict.FINISHED,
    "tank_drive.left_motor.command = TEXT": Verdict.PROGRAM_ERROR,
    "open(TEXT)": Verdict.PROGRAM_ERROR,
    "raise ValueError(TEXT)": Verdict.PROGRAM_ERROR,
    "raise SystemExit(TEXT)": Verdict.PROGRAM_ERROR,
    "raise type(TEXT, (Exception,), {})(TEXT)": Verdict.PROGRAM_ERROR,
    "__import__(TEXT)": Verdict.PROGRAM_ERROR,
}
#: The same for a responder, without verdicts (an answer is never cut).
RESPONDER_CALLS = (
    "print(TEXT)",
    "return TEXT",
    "return type(TEXT, (), {})()",
    "raise ValueError(TEXT)",
    "raise type(TEXT, (Exception,), {})(TEXT)",
)


def _verdicts(recording: Recording) -> set[Verdict]:
    return {fault.verdict for fault in recording.faults} or {recording.verdict}


@pytest.mark.parametrize("text", TEXTS)
@pytest.mark.parametrize("call", PROGRAM_CALLS)
def test_a_robot_program_sends_it(call: str, text: str, runner: TrialRunner) -> None:
    recording = run_program(runner, call.replace("TEXT", f"({text})"), responder=ECHO, seconds=2)
    assert _verdicts(recording) == {PROGRAM_CALLS[call]}


@pytest.mark.parametrize("text", TEXTS)
@pytest.mark.parametrize("call", RESPONDER_CALLS)
def test_a_responder_sends_it(call: str, text: str, runner: TrialRunner) -> None:
    responder = f"def responder(text):\n    {call.replace('TEXT', f'({text})')}\n"
    recording = run_program(runner, "print('PY::x')\ntime.sleep(1)", responder=f"import time\n{responder}", seconds=2)
    assert Verdict.SANDBOX_VIOLATION not in _verdicts(recording)


def test_what_is_cut_says_so_and_what_fits_is_whole(runner: TrialRunner) -> None:
    recording = run_program(runner, "say('é' * 10_000)\nsay('é' * 12_000)\nprint('x' * 60_000)", seconds=2)
    whole, cut = (line.text for line in recording.spoken)
    assert whole == "é" * 10_000
    assert cut.startswith("é" * 10_000)
    assert cut.endswith("… (12000 characters)")
    assert recording.printed[-1].text == "x" * 60_000
