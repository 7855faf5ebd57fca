"""A machine is asked, before it takes student code, whether its walls hold."""

from __future__ import annotations

import re

import pytest

from responders.sandbox.inside.battery import ATTEMPTS
from responders.sandbox.manager import Sandboxes, Walls
from running import run_program
from service.grading.rig import Rig


@pytest.mark.parametrize("role", ["robot", "responder"])
def test_every_attempt_is_refused_here(role: str) -> None:
    with Sandboxes() as sandboxes:
        said = sandboxes.check(role)  # type: ignore[arg-type]
    assert re.fullmatch(r"Landlock \d+, seccomp, (own user, )?process limits, policy [0-9a-f]{8} \(battery .*\)", said)
    assert f"{len(ATTEMPTS)} of {len(ATTEMPTS)} refused" in said


def test_the_battery_notices_a_wall_that_does_not_stand() -> None:
    with Sandboxes(Walls(landlock=99, seccomp=False)) as sandboxes:
        said = sandboxes.check()
    refused = re.search(r"(\d+) of (\d+) refused", said)
    assert refused is not None
    assert int(refused[1]) < int(refused[2])


def test_each_recording_says_what_stood(rig: Rig) -> None:
    assert run_program(rig, "pass").walls == rig.check_walls().partition(" (battery")[0]
