"""The simulator's motors: single ones, and the tank and steering pairs that the course drives with.

Every set point and command goes to the world; nothing is kept here, and nothing moves until the program waits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from brick_link import link, number

OUTPUT_A = "outA"
OUTPUT_B = "outB"
OUTPUT_C = "outC"
OUTPUT_D = "outD"

#: Milliseconds that a blocking pair waits for a motor to begin.
WAIT_RUNNING_TIMEOUT = 100

_POLL = 0.01  # seconds


class SpeedValue:
    """A speed in some unit; ``to_native_units`` gives wheel degrees per second."""

    def __init__(self, value: float, desc: str | None = None) -> None:
        self.value = value
        self.desc = desc

    def to_native_units(self, motor: Motor) -> float:
        raise NotImplementedError

    def __mul__(self, other: float) -> SpeedValue:
        if not isinstance(other, int | float):
            raise TypeError(f"{self} can only be multiplied by an int or float")
        return type(self)(self.value * other)

    __rmul__ = __mul__

    def __lt__(self, other: SpeedValue) -> bool:
        return self.value < other.value

    def __eq__(self, other: object) -> bool:
        return isinstance(other, type(self)) and self.value == other.value

    def __hash__(self) -> int:
        return hash((type(self), self.value))

    def __str__(self) -> str:
        return f"{self.value}"


class SpeedPercent(SpeedValue):
    """Per cent of the greatest speed, -100..100."""

    def __init__(self, percent: float, desc: str | None = None) -> None:
        if not -100 <= percent <= 100:
            raise ValueError(f"{percent} is an invalid percentage, must be between -100 and 100 (inclusive)")
        super().__init__(percent, desc)

    def to_native_units(self, motor: Motor) -> float:
        return self.value / 100 * motor.max_speed


class SpeedNativeUnits(SpeedValue):
    """Wheel degrees per second."""

    def to_native_units(self, motor: Motor) -> float:
        if abs(self.value) > motor.max_speed:
            raise ValueError(f"{self.value} is an invalid speed, the most is {motor.max_speed}")
        return self.value


class _SpeedRate(SpeedValue):
    """A speed as a share of the most that the simulator's own scale knows."""

    _most = ""

    def to_native_units(self, motor: Motor) -> float:
        most = getattr(motor, self._most)
        if abs(self.value) > most:
            raise ValueError(f"invalid {type(self).__name__}: {self.value}, the most is {most}")
        return float(self.value / most * motor.max_speed)


class SpeedRPS(_SpeedRate):
    """Rotations per second; the simulator takes 2 for the most."""

    _most = "max_rps"


class SpeedRPM(_SpeedRate):
    """Rotations per minute; the simulator takes 120 for the most."""

    _most = "max_rpm"


class SpeedDPS(_SpeedRate):
    """Degrees per second; the simulator takes 720 for the most."""

    _most = "max_dps"


class SpeedDPM(_SpeedRate):
    """Degrees per minute; the simulator takes 43200 for the most."""

    _most = "max_dpm"


Speed = float | SpeedValue


def _whole(value: float) -> int:
    """The nearest whole number, halves upwards, as the simulator's ``int(round(x))`` gives."""
    return math.floor(value + 0.5)


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
    # Whole-number division in the original: 1050 / 360 is 2 there.
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

    def _tell(self, **fields: float | str) -> None:
        link.tell_later({"do": "motor", "port": self.address, **fields})

    def _see(self, what: str) -> Any:
        return link.ask({"do": "motor_state", "port": self.address})[what]

    def _has(self, state: str) -> bool:
        return state in link.ask({"do": "paid_motor", "port": self.address})["state"]

    @property
    def command(self) -> str:
        raise AttributeError("command can be set, but not read")

    @command.setter
    def command(self, value: str) -> None:
        self._tell(command="" if value == self.COMMAND_STOP else value)

    @property
    def position(self) -> float:
        """Degrees on the encoder."""
        return number(self._see("position"))

    @position.setter
    def position(self, value: float) -> None:
        self._tell(position=int(value))

    @property
    def position_sp(self) -> float:
        return number(self._see("position_sp"))

    @position_sp.setter
    def position_sp(self, value: float) -> None:
        self._tell(position_sp=int(value))

    @property
    def speed(self) -> float:
        """Degrees per second."""
        return number(self._see("speed"))

    @property
    def duty_cycle(self) -> float:
        return self.speed

    @property
    def speed_sp(self) -> float:
        return number(self._see("speed_sp"))

    @speed_sp.setter
    def speed_sp(self, value: float) -> None:
        self._tell(speed_sp=int(value))

    @property
    def duty_cycle_sp(self) -> float:
        return self.speed_sp

    @duty_cycle_sp.setter
    def duty_cycle_sp(self, value: float) -> None:
        self.speed_sp = value

    @property
    def time_sp(self) -> float:
        """The set speed: the original reads the wrong field."""
        return self.speed_sp

    @time_sp.setter
    def time_sp(self, value: float) -> None:
        self._tell(time_sp=float(value))

    @property
    def polarity(self) -> str:
        return str(self._see("polarity"))

    @polarity.setter
    def polarity(self, value: str) -> None:
        self._tell(polarity=str(value))

    @property
    def state(self) -> str:
        """``running`` or nothing."""
        return str(self._see("state"))

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
        return self._has(self.STATE_RUNNING)

    @property
    def is_ramping(self) -> bool:
        return self._has(self.STATE_RAMPING)

    @property
    def is_holding(self) -> bool:
        return self._has(self.STATE_HOLDING)

    @property
    def is_overloaded(self) -> bool:
        return self._has(self.STATE_OVERLOADED)

    @property
    def is_stalled(self) -> bool:
        return self._has(self.STATE_STALLED)

    def _set(self, fields: Mapping[str, Any]) -> None:
        for name, value in fields.items():
            setattr(self, name, value)

    def reset(self, **fields: Any) -> None:
        """Stop. The position stays as it is."""
        self._set(fields)
        self._tell(command="reset")

    def run_direct(self, **fields: Any) -> None:
        """Only the set points; the simulator has no such command."""
        self._set(fields)

    def run_forever(self, **fields: Any) -> None:
        self._set(fields)
        self._tell(command="run-forever")

    def run_timed(self, **fields: Any) -> None:
        self._set(fields)
        self._tell(command="run-timed")

    def run_to_abs_pos(self, **fields: Any) -> None:
        self._set(fields)
        self._tell(command="run-to-abs-pos")

    def run_to_rel_pos(self, **fields: Any) -> None:
        self._set(fields)
        self._tell(command="run-to-rel-pos")

    def stop(self, **fields: Any) -> None:
        self._set(fields)
        self._tell(command="")

    def wait(self, cond: Callable[[str], bool], timeout: float | None = None) -> bool:
        """Look every 10 ms until ``cond(state)`` holds; False once more than ``timeout`` milliseconds have passed."""
        began = link.units
        while not cond(self.state):
            link.wait(_POLL)
            if timeout is not None and link.units - began > timeout * 3000:
                return False
        return True

    def wait_until_not_moving(self, timeout: float | None = None) -> bool:
        return self._until("still", timeout)

    def wait_until(self, s: str, timeout: float | None = None) -> bool:
        if s == self.STATE_RUNNING:
            return self._until(s, timeout)
        return self.wait(lambda state: s in state, timeout)

    def wait_while(self, s: str, timeout: float | None = None) -> bool:
        if s == self.STATE_RUNNING:
            return self._until("still", timeout)
        return self.wait(lambda state: s not in state, timeout)

    def _until(self, state: str, timeout: float | None) -> bool:
        return bool(
            link.ask(
                {
                    "do": "until",
                    "port": self.address,
                    "state": state,
                    "timeout": None if timeout is None else round(timeout * 3000),
                }
            )
        )

    def _exact(self, speed: Speed) -> float:
        """Degrees per second of a SpeedValue, or of a number taken as per cent."""
        if isinstance(speed, SpeedValue):
            return speed.to_native_units(self)
        if not -100 <= speed <= 100:
            raise Exception(f"Invalid Speed Percentage. {speed} is not between -100 and 100")
        return speed / 100 * self.max_speed

    def _native(self, speed: Speed) -> int:
        """Whole degrees per second."""
        return _whole(self._exact(speed))

    def _aim(self, degrees: float, speed: int) -> None:
        """Set points of a relative move; a negative speed turns the way round."""
        self._tell(position_sp=_whole(degrees if speed >= 0 else -degrees), speed_sp=abs(speed))

    def on_for_rotations(self, speed: Speed, rotations: float, brake: bool = True, block: bool = True) -> None:
        self.on_for_degrees(speed, rotations * 360, brake, block)

    def on_for_degrees(self, speed: Speed, degrees: float, brake: bool = True, block: bool = True) -> None:
        self._aim(degrees, self._native(speed))
        self.run_to_rel_pos()
        if block:
            self._block()

    def on_to_position(self, speed: Speed, position: float, brake: bool = True, block: bool = True) -> None:
        self._tell(position_sp=_whole(position), speed_sp=self._native(speed))
        self.run_to_abs_pos()
        if block:
            self._block()

    def on_for_seconds(self, speed: Speed, seconds: float, brake: bool = True, block: bool = True) -> None:
        _not_negative(seconds)
        self._tell(speed_sp=self._native(speed), time_sp=float(seconds))
        self.run_timed()
        if block:
            self._block()

    def on(self, speed: Speed, brake: bool = True, block: bool = False) -> None:
        self._tell(speed_sp=self._native(speed))
        self.run_forever()
        if block:
            self._block()

    def off(self, brake: bool = True) -> None:
        self.stop()

    def _block(self) -> None:
        self.wait_until(self.STATE_RUNNING, WAIT_RUNNING_TIMEOUT)
        self.wait_until_not_moving()


class LargeMotor(Motor):
    """The simulator's motors are all alike."""


class MediumMotor(Motor):
    """The simulator's motors are all alike."""


def _not_negative(seconds: float) -> None:
    if seconds < 0:
        raise ValueError(f"seconds is negative ({seconds})")


class MotorSet:
    """Motors by port. Making one stops them."""

    def __init__(self, motor_specs: Mapping[str, type[Motor]], desc: str | None = None) -> None:
        self.motors = {port: kind(port) for port, kind in motor_specs.items()}
        self.desc = desc
        for motor in self.motors.values():
            motor.reset()

    def _chosen(self, motors: Iterable[Motor] | None) -> Iterable[Motor]:
        return self.motors.values() if motors is None else motors

    def off(self, motors: Iterable[Motor] | None = None, brake: bool = True) -> None:
        for motor in self._chosen(motors):
            motor.stop()

    def stop(self, motors: Iterable[Motor] | None = None, brake: bool = True) -> None:
        self.off(motors, brake)


class MoveTank(MotorSet):
    """Two motors with a speed each."""

    def __init__(
        self,
        left_motor_port: str,
        right_motor_port: str,
        desc: str | None = None,
        motor_class: type[Motor] = LargeMotor,
    ) -> None:
        super().__init__({left_motor_port: motor_class, right_motor_port: motor_class}, desc)
        self.left_motor = self.motors[left_motor_port]
        self.right_motor = self.motors[right_motor_port]
        self.max_speed = self.left_motor.max_speed

    def on_for_degrees(
        self, left_speed: Speed, right_speed: Speed, degrees: float, brake: bool = True, block: bool = True
    ) -> None:
        """The faster wheel turns ``degrees``, the other in proportion."""
        left, right = self._speeds(left_speed, right_speed)
        self._move_degrees(left, right, degrees, block)

    def on_for_rotations(
        self, left_speed: Speed, right_speed: Speed, rotations: float, brake: bool = True, block: bool = True
    ) -> None:
        self.on_for_degrees(left_speed, right_speed, rotations * 360, brake, block)

    def on_for_seconds(
        self, left_speed: Speed, right_speed: Speed, seconds: float, brake: bool = True, block: bool = True
    ) -> None:
        left, right = self._speeds(left_speed, right_speed)
        self._move_seconds(left, right, seconds, block)

    def on(self, left_speed: Speed, right_speed: Speed) -> None:
        left, right = self._speeds(left_speed, right_speed)
        self._move(left, right)

    def _speeds(self, left: Speed, right: Speed) -> tuple[int, int]:
        return self.left_motor._native(left), self.right_motor._native(right)

    def _move_degrees(self, left: int, right: int, degrees: float, block: bool) -> None:
        if degrees == 0 or (left == 0 and right == 0):
            left_degrees = right_degrees = degrees
        elif abs(left) > abs(right):
            left_degrees, right_degrees = degrees, abs(right / left * degrees)
        else:
            left_degrees, right_degrees = abs(left / right * degrees), degrees
        self.left_motor._aim(left_degrees, left)
        self.right_motor._aim(right_degrees, right)
        self.left_motor.run_to_rel_pos()
        self.right_motor.run_to_rel_pos()
        if block:
            self._block()

    def _move_seconds(self, left: int, right: int, seconds: float, block: bool) -> None:
        _not_negative(seconds)
        self.left_motor._tell(speed_sp=left, time_sp=float(seconds), command="run-timed")
        self.right_motor._tell(speed_sp=right, time_sp=float(seconds), command="run-timed")
        if block:
            self._block()

    def _move(self, left: int, right: int) -> None:
        self.left_motor._tell(speed_sp=left, command="run-forever")
        self.right_motor._tell(speed_sp=right, command="run-forever")

    def _block(self) -> None:
        # One motor after the other, as in the original: the second has often stopped by then, and the
        # wait for it to begin runs into its time-out.
        self.left_motor._block()
        self.right_motor._block()


class MoveSteering(MoveTank):
    """Two motors with a speed and a steering: 0 straight on, 100 on the spot to the right, -100 to the left."""

    def get_speed_steering(self, steering: float, speed: Speed) -> tuple[int, int]:
        """Whole degrees per second of the left and the right wheel."""
        if not -100 <= steering <= 100:
            raise ValueError(f"{steering} is an invalid steering, must be between -100 and 100 (inclusive)")
        # Rounded only after the steering, wheel by wheel, as in the original.
        outer = self.left_motor._exact(speed)
        inner = outer * (50 - abs(steering)) / 50
        left, right = (outer, inner) if steering >= 0 else (inner, outer)
        return _whole(left), _whole(right)

    def on_for_degrees(  # type: ignore[override]
        self, steering: float, speed: Speed, degrees: float, brake: bool = True, block: bool = True
    ) -> None:
        left, right = self.get_speed_steering(steering, speed)
        self._move_degrees(left, right, degrees, block)

    def on_for_rotations(  # type: ignore[override]
        self, steering: float, speed: Speed, rotations: float, brake: bool = True, block: bool = True
    ) -> None:
        self.on_for_degrees(steering, speed, rotations * 360, brake, block)

    def on_for_seconds(  # type: ignore[override]
        self, steering: float, speed: Speed, seconds: float, brake: bool = True, block: bool = True
    ) -> None:
        left, right = self.get_speed_steering(steering, speed)
        self._move_seconds(left, right, seconds, block)

    def on(self, steering: float, speed: Speed) -> None:  # type: ignore[override]
        left, right = self.get_speed_steering(steering, speed)
        self._move(left, right)
