"""A single motor. Set points and commands go to the world; the motor moves only when the program waits."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from brick_link import MAX_UNITS, link, to_plain_number
from ev3dev2.speeds import Speed, SpeedValue, round_to_whole

OUTPUT_A = "outA"
OUTPUT_B = "outB"
OUTPUT_C = "outC"
OUTPUT_D = "outD"

#: Maximum time in milliseconds that a blocking call waits for the motor to start.
WAIT_RUNNING_TIMEOUT = 100

_POLL = 0.01  # seconds


class Motor:
    COMMAND_RUN_FOREVER = "run-forever"
    COMMAND_RUN_TO_ABS_POS = "run-to-abs-pos"
    COMMAND_RUN_TO_REL_POS = "run-to-rel-pos"
    COMMAND_RUN_TIMED = "run-timed"
    COMMAND_RUN_DIRECT = "run-direct"
    COMMAND_STOP = "stop"
    COMMAND_RESET = "reset"
    ENCODER_POLARITY_NORMAL = "normal"
    ENCODER_POLARITY_INVERSED = "inversed"
    POLARITY_NORMAL = "normal"
    POLARITY_INVERSED = "inversed"
    STATE_RUNNING = "running"
    STATE_RAMPING = "ramping"
    STATE_HOLDING = "holding"
    STATE_OVERLOADED = "overloaded"
    STATE_STALLED = "stalled"
    STOP_ACTION_COAST = "coast"
    STOP_ACTION_BRAKE = "brake"
    STOP_ACTION_HOLD = "hold"

    max_speed = 1050
    count_per_rot = 360
    # The original uses integer division: 1050 / 360 gives 2.
    max_rps = 2
    max_rpm = 120
    max_dps = 720
    max_dpm = 43200
    ramp_up_sp = 1
    ramp_down_sp = 1
    position_p = position_i = position_d = 1
    speed_p = speed_i = speed_d = 1

    def __init__(self, address: str | None = None, **_: Any) -> None:
        if address not in (OUTPUT_B, OUTPUT_C):
            raise TypeError(f"No motor connected to {'null' if address is None else address}")
        self.address = address
        self._stop_action: str | None = None

    def _set_motor(self, **fields: Any) -> None:
        link.set_motor(self.address, **fields)

    def _read_state(self, what: str) -> Any:
        return link.ask({"do": "motor_state", "port": self.address})[what]

    def _has_state(self, state: str) -> bool:
        return state in link.ask({"do": "paid_motor", "port": self.address})["state"]

    @property
    def command(self) -> str:
        raise AttributeError("command can be set, but not read")

    @command.setter
    def command(self, value: str) -> None:
        self._set_motor(command="" if value == self.COMMAND_STOP else value)

    @property
    def position(self) -> float:
        """Degrees on the encoder."""
        return to_plain_number(self._read_state("position"))

    @position.setter
    def position(self, value: float) -> None:
        self._set_motor(position=int(value))

    @property
    def position_sp(self) -> float:
        return to_plain_number(self._read_state("position_sp"))

    @position_sp.setter
    def position_sp(self, value: float) -> None:
        self._set_motor(position_sp=int(value))

    @property
    def speed(self) -> float:
        """Degrees per second."""
        return to_plain_number(self._read_state("speed"))

    @property
    def duty_cycle(self) -> float:
        return self.speed

    @property
    def speed_sp(self) -> float:
        return to_plain_number(self._read_state("speed_sp"))

    @speed_sp.setter
    def speed_sp(self, value: float) -> None:
        self._set_motor(speed_sp=int(value))

    @property
    def duty_cycle_sp(self) -> float:
        return self.speed_sp

    @duty_cycle_sp.setter
    def duty_cycle_sp(self, value: float) -> None:
        self.speed_sp = value

    @property
    def time_sp(self) -> float:
        """The set speed. The original reads the wrong field."""
        return self.speed_sp

    @time_sp.setter
    def time_sp(self, value: float) -> None:
        self._set_motor(time_sp=float(value))

    @property
    def polarity(self) -> str:
        return str(self._read_state("polarity"))

    @polarity.setter
    def polarity(self, value: str) -> None:
        self._set_motor(polarity=str(value))

    @property
    def state(self) -> str:
        """``running`` or nothing."""
        return str(self._read_state("state"))

    @property
    def stop_action(self) -> str:
        if self._stop_action is None:
            raise AttributeError("stop_action has not been set")
        return self._stop_action

    @stop_action.setter
    def stop_action(self, value: str) -> None:
        self._stop_action = value

    @property
    def is_running(self) -> bool:
        return self._has_state(self.STATE_RUNNING)

    @property
    def is_ramping(self) -> bool:
        return self._has_state(self.STATE_RAMPING)

    @property
    def is_holding(self) -> bool:
        return self._has_state(self.STATE_HOLDING)

    @property
    def is_overloaded(self) -> bool:
        return self._has_state(self.STATE_OVERLOADED)

    @property
    def is_stalled(self) -> bool:
        return self._has_state(self.STATE_STALLED)

    def _set(self, fields: Mapping[str, Any]) -> None:
        for name, value in fields.items():
            setattr(self, name, value)

    def reset(self, **fields: Any) -> None:
        """Stop the motor. Its position does not change."""
        self._set(fields)
        self._set_motor(command="reset")

    def run_direct(self, **fields: Any) -> None:
        """Apply only the set points; the simulator does not have this command."""
        self._set(fields)

    def run_forever(self, **fields: Any) -> None:
        self._set(fields)
        self._set_motor(command="run-forever")

    def run_timed(self, **fields: Any) -> None:
        self._set(fields)
        self._set_motor(command="run-timed")

    def run_to_abs_pos(self, **fields: Any) -> None:
        self._set(fields)
        self._set_motor(command="run-to-abs-pos")

    def run_to_rel_pos(self, **fields: Any) -> None:
        self._set(fields)
        self._set_motor(command="run-to-rel-pos")

    def stop(self, **fields: Any) -> None:
        self._set(fields)
        self._set_motor(command="")

    def wait(self, cond: Callable[[str], bool], timeout: float | None = None) -> bool:
        """Poll every 10 ms until ``cond(state)`` is true. Return False after ``timeout`` milliseconds."""
        start = link.units
        while not cond(self.state):
            link.wait(_POLL)
            if timeout is not None and link.units - start > timeout * 3000:
                return False
        return True

    def wait_until_not_moving(self, timeout: float | None = None) -> bool:
        return self._wait_for_state("still", timeout)

    def wait_until(self, s: str, timeout: float | None = None) -> bool:
        if s == self.STATE_RUNNING:
            return self._wait_for_state(s, timeout)
        return self.wait(lambda state: s in state, timeout)

    def wait_while(self, s: str, timeout: float | None = None) -> bool:
        if s == self.STATE_RUNNING:
            return self._wait_for_state("still", timeout)
        return self.wait(lambda state: s not in state, timeout)

    def _wait_for_state(self, state: str, timeout: float | None) -> bool:
        return bool(
            link.ask(
                {
                    "do": "until",
                    "port": self.address,
                    "state": state,
                    # A negative time-out has expired at the first poll, like a time-out of zero.
                    "timeout": None if timeout is None else round(min(max(timeout * 3000, 0), MAX_UNITS)),
                }
            )
        )

    def _to_degrees_per_second(self, speed: Speed) -> float:
        """Return degrees per second for a SpeedValue, or for a number in per cent."""
        if isinstance(speed, SpeedValue):
            return speed.to_native_units(self)
        if not -100 <= speed <= 100:
            raise Exception(f"Invalid Speed Percentage. {speed} is not between -100 and 100")
        return speed / 100 * self.max_speed

    def _to_native_speed(self, speed: Speed) -> int:
        """Return whole degrees per second."""
        return round_to_whole(self._to_degrees_per_second(speed))

    def _set_relative_target(self, degrees: float, speed: int) -> None:
        """Set the target of a relative move; a negative speed reverses the direction."""
        self._set_motor(position_sp=round_to_whole(degrees if speed >= 0 else -degrees), speed_sp=abs(speed))

    def on_for_rotations(self, speed: Speed, rotations: float, brake: bool = True, block: bool = True) -> None:
        self.on_for_degrees(speed, rotations * 360, brake, block)

    def on_for_degrees(self, speed: Speed, degrees: float, brake: bool = True, block: bool = True) -> None:
        self._set_relative_target(degrees, self._to_native_speed(speed))
        self.run_to_rel_pos()
        if block:
            self._wait_until_done()

    def on_to_position(self, speed: Speed, position: float, brake: bool = True, block: bool = True) -> None:
        self._set_motor(position_sp=round_to_whole(position), speed_sp=self._to_native_speed(speed))
        self.run_to_abs_pos()
        if block:
            self._wait_until_done()

    def on_for_seconds(self, speed: Speed, seconds: float, brake: bool = True, block: bool = True) -> None:
        check_not_negative(seconds)
        self._set_motor(speed_sp=self._to_native_speed(speed), time_sp=float(seconds))
        self.run_timed()
        if block:
            self._wait_until_done()

    def on(self, speed: Speed, brake: bool = True, block: bool = False) -> None:
        self._set_motor(speed_sp=self._to_native_speed(speed))
        self.run_forever()
        if block:
            self._wait_until_done()

    def off(self, brake: bool = True) -> None:
        self.stop()

    def _wait_until_done(self) -> None:
        self.wait_until(self.STATE_RUNNING, WAIT_RUNNING_TIMEOUT)
        self.wait_until_not_moving()


class LargeMotor(Motor):
    """Large motor; all motors of the simulator are the same."""


class MediumMotor(Motor):
    """Medium motor; all motors of the simulator are the same."""


def check_not_negative(seconds: float) -> None:
    if seconds < 0:
        raise ValueError(f"seconds is negative ({seconds})")
