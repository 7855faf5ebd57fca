"""Every call of the brick with extreme numbers ends as a program error or at the time limit.

None of them may be mistaken for a forged frame, which is a sandbox violation.
"""

from __future__ import annotations

import pytest

from running import run_program
from service.grading.trial_runner import TrialRunner
from sim.recording import Verdict

_NUMBERS = (
    "3.4e8",
    "1e18",
    "1e300",
    "1.7e308",
    "10**400",
    "float('inf')",
    "-float('inf')",
    "float('nan')",
    "-1",
    "-1e20",
)
_CALLS = (
    "time.sleep(@)",
    "tank_drive.on(@, 10)",
    "tank_drive.on_for_seconds(10, 10, @)",
    "tank_drive.on_for_degrees(10, 20, @)",
    "tank_drive.on_for_degrees(@, SpeedDPS(@), 90)",
    "tank_drive.on_for_rotations(10, 10, @)",
    "tank_turn.on(@, 10)",
    "tank_turn.on(10, @)",
    "tank_turn.on_for_seconds(10, 10, @)",
    "tank_turn.on_for_degrees(10, 10, @)",
    "tank_turn.on_for_rotations(10, 10, @)",
    *(f"tank_drive.on({unit}(@), {unit}(@))" for unit in ("SpeedPercent", "SpeedNativeUnits", "SpeedRPS", "SpeedDPM")),
    "tank_drive.on(SpeedPercent(10) * @, 10)",
    "MOTOR.on(@)",
    "MOTOR.on_for_seconds(10, @)",
    "MOTOR.on_for_degrees(10, @)",
    "MOTOR.on_for_rotations(10, @)",
    "MOTOR.on_to_position(10, @)",
    "MOTOR.run_forever(speed_sp=@)",
    "MOTOR.run_timed(speed_sp=100, time_sp=@)",
    "MOTOR.run_to_rel_pos(speed_sp=100, position_sp=@)",
    "MOTOR.run_to_abs_pos(speed_sp=100, position_sp=@)",
    "MOTOR.run_direct(duty_cycle_sp=@)",
    "MOTOR.position = @",
    "MOTOR.polarity = @",
    "MOTOR.polarity = 'x' * 100_000",
    *(f"MOTOR.on(10)\nMOTOR.{wait}timeout=@)" for wait in ("wait_until_not_moving(", "wait_while('running', ")),
    *(f"MOTOR.wait_until({state!r}, timeout=@)" for state in ("running", "stalled")),
    "Sound().set_volume(@)",
    "Sound().speak('a', volume=@)",
)


#: Two calls of each object and unit take the same way through our code; the second ones are long tests.
_LONG = (
    *("tank_drive.on_for_rotations", "tank_drive.on(SpeedRPS", "tank_drive.on(SpeedDPM"),
    *("tank_turn.on(", "tank_turn.on_for_seconds", "tank_turn.on_for_degrees"),
    *("MOTOR.on_for_degrees", "MOTOR.on_for_rotations", "MOTOR.run_direct", "MOTOR.run_to_abs_pos"),
    *("MOTOR.wait_until('stalled'", "tank_drive.on_for_degrees(10"),
)


@pytest.mark.long
@pytest.mark.parametrize(
    "call", [pytest.param(call, marks=[pytest.mark.long] * call.startswith(_LONG)) for call in _CALLS]
)
def test_an_extreme_number_is_no_violation(call: str, runner: TrialRunner) -> None:
    for number in _NUMBERS:
        statement = call.replace("MOTOR", "tank_drive.left_motor").replace("@", number)
        program = f"import time\n{statement}\ntime.sleep(0.1)\nprint(tank_drive.left_motor.position)"
        recording = run_program(runner, program, seconds=0.5)
        ends = (Verdict.FINISHED, Verdict.TIME_LIMIT, Verdict.PROGRAM_ERROR)
        assert recording.verdict in ends, (number, recording.faults)
        assert {fault.who for fault in recording.faults} <= {"program"}, (number, recording.faults)


@pytest.mark.parametrize(
    "statement",
    [
        "time.sleep(1e9)",
        "time.sleep(1e300)",
        "tank_drive.left_motor.wait_until('running', timeout=1e18)",
        "tank_drive.left_motor.wait_until('running', timeout=float('inf'))",
        "tank_drive.on_for_seconds(10, 10, float('inf'))",
    ],
)
def test_a_wait_without_an_end_ends_at_the_time_limit(statement: str, runner: TrialRunner) -> None:
    assert run_program(runner, f"import time\n{statement}", seconds=0.5).verdict is Verdict.TIME_LIMIT


@pytest.mark.parametrize("timeout", ["0", "-1", "-float('inf')"])
def test_a_time_out_below_zero_passes_as_one_of_zero_does(timeout: str, runner: TrialRunner) -> None:
    program = f"tank_drive.left_motor.wait_until('running', timeout={timeout})\nsay(str(get_clock()))"
    assert [line.text for line in run_program(runner, program).spoken] == ["0"]
