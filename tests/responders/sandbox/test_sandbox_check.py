"""Before a machine accepts student code, it checks whether its sandbox is effective."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from battery import run_text
from responders.sandbox import bubblewrap
from responders.sandbox.inside.battery import ATTEMPTS
from responders.sandbox.isolation import Isolation
from responders.sandbox.manager import Sandboxes
from responders.sandbox.running_child import ChildLimits
from running import run_program
from service.grading.trial_runner import TrialRunner


@pytest.mark.parametrize("role", ["robot", "responder", "responder with libraries"])
def test_every_attempt_is_refused_here(role: str) -> None:
    with Sandboxes() as sandboxes:
        report = sandboxes.check_isolation(role)  # type: ignore[arg-type]
    assert re.fullmatch(
        r"Landlock \d+, seccomp, doorkeeper, (own user, )?(bubblewrap, )?(fixed addresses, )?process limits, "
        r"policy [0-9a-f]{8} \(battery .*\)",
        report,
    )
    assert f"{len(ATTEMPTS)} of {len(ATTEMPTS)} refused" in report


def test_the_battery_notices_a_layer_that_does_not_stand() -> None:
    with Sandboxes(Isolation(seccomp=False)) as sandboxes:
        report = sandboxes.check_isolation()
    refused = re.search(r"(\d+) of (\d+) refused", report)
    assert refused is not None
    assert int(refused[1]) < int(refused[2])


def test_each_recording_says_what_stood(runner: TrialRunner) -> None:
    assert run_program(runner, "pass").sandbox == runner.check_sandbox().partition(" (battery")[0]


def test_bubblewrap_is_used_where_it_works_and_done_without_where_not(monkeypatch: pytest.MonkeyPatch) -> None:
    with Sandboxes() as sandboxes:
        works = sandboxes.check_bubblewrap() is None
        assert ("bubblewrap" in sandboxes.check_isolation()) == works
        assert (_number_of_the_zygote(sandboxes) == 2) == works
    for program, reason in ((None, "not installed"), ("/bin/false", "status 1"), ("/bin/true", "cannot be seen")):
        monkeypatch.setattr(bubblewrap, "_PROGRAM", program)
        with Sandboxes() as sandboxes:
            assert reason in str(sandboxes.check_bubblewrap())
            assert "bubblewrap" not in sandboxes.check_isolation()
            assert _number_of_the_zygote(sandboxes) != 2


def test_addresses_are_as_fixed_in_bubblewrap_as_without_it() -> None:
    def has_fixed_addresses(isolation: Isolation) -> bool:
        with Sandboxes(isolation) as sandboxes:
            return "fixed addresses" in sandboxes.check_isolation()

    assert has_fixed_addresses(Isolation()) == has_fixed_addresses(Isolation(bubblewrap=False))


def _number_of_the_zygote(sandboxes: Sandboxes) -> int:
    """Return the process id that the child sees: in a new namespace 2, after the doorkeeper."""
    with sandboxes.open_private_folder() as folder:
        output, stop = run_text(sandboxes, "robot", "import os; print(os.getppid())", folder)
    assert stop is None
    return int(output[0])


@pytest.mark.long
def test_a_trial_is_the_same_inside_bubblewrap_and_out() -> None:
    program = "from random import random\nfor _ in range(3): print(f'PY::{random()}')"
    responder = "import os, numpy as np\ndef responder(text): return f'{np.random.rand()} {sorted(os.environ)}'"
    with TrialRunner() as inside, TrialRunner(Sandboxes(Isolation(bubblewrap=False))) as outside:
        one, other = (run_program(runner, program, responder=responder) for runner in (inside, outside))
    assert one.sha256 == other.sha256
    assert [message.text for message in one.messages] == [message.text for message in other.messages]


def test_a_child_gets_a_private_folder_and_no_other(tmp_path: Path) -> None:
    with Sandboxes() as sandboxes, pytest.raises(ValueError, match="private"):
        sandboxes.spawn("robot", ChildLimits(1.0, 1 << 20), tmp_path)


def test_a_folder_of_folders_that_was_tidied_away_is_made_again() -> None:
    with Sandboxes() as sandboxes:
        for _ in range(2):
            with sandboxes.open_private_folder() as folder:
                assert run_text(sandboxes, "robot", "open('x', 'w'); print('ok')", folder) == (["ok"], None)
            shutil.rmtree(folder.parent)
