"""A child learns nothing about the folders above its own, which contain other trials."""

from __future__ import annotations

import pytest

from running import run_program
from service.grading.trial_runner import TrialRunner

_ASK = """
import os
def responder(text):
    try:
        return str(os.stat({path!r}).st_ino)
    except OSError as error:
        return type(error).__name__
"""


@pytest.mark.parametrize(("path", "exists"), [("..", False), ("../", False), (".", True), ("../..", False)])
def test_a_folder_above_its_own_has_no_dates(path: str, exists: bool, runner: TrialRunner) -> None:
    if "doorkeeper" not in run_program(runner, "pass").sandbox:
        pytest.skip("no doorkeeper on this machine")
    recording = run_program(runner, 'import time\nprint("PY::0")\ntime.sleep(1)\n', responder=_ASK.format(path=path))
    answers = [message.text for message in recording.messages if message.sender == "responder"]
    assert [answer.isdigit() for answer in answers] == [exists], answers
