"""Groups of motors: motor sets, tank drive (one speed per side) and steering drive."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from brick_link import link
from ev3dev2.single_motor import LargeMotor, Motor, check_not_negative
from ev3dev2.speeds import Speed, round_to_whole


class MotorSet:
    """Motors by port. Creating a set stops its motors."""

    def __init__(self, motor_specs: Mapping[str, type[Motor]], desc: str | None = None) -> None:
        self.motors = {port: kind(port) for port, kind in motor_specs.items()}
        self.desc = desc
        for motor in self.motors.values():
            motor.reset()

    def _select_motors(self, motors: Iterable[Motor] | None) -> Iterable[Motor]:
        return self.motors.values() if motors is None else motors

    def off(self, motors: Iterable[Motor] | None = None, brake: bool = True) -> None:
        for motor in self._select_motors(motors):
            motor.stop()

    def stop(self, motors: Iterable[Motor] | None = None, brake: bool = True) -> None:
        self.off(motors, brake)


class MoveTank(MotorSet):
    """Two motors with separate speeds."""

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
        """Turn the faster wheel by ``degrees`` and the other in proportion."""
        left, right = self._convert_speeds(left_speed, right_speed)
        self._move_degrees(left, right, degrees, block)

    def on_for_rotations(
        self, left_speed: Speed, right_speed: Speed, rotations: float, brake: bool = True, block: bool = True
    ) -> None:
        self.on_for_degrees(left_speed, right_speed, rotations * 360, brake, block)

    def on_for_seconds(
        self, left_speed: Speed, right_speed: Speed, seconds: float, brake: bool = True, block: bool = True
    ) -> None:
        left, right = self._convert_speeds(left_speed, right_speed)
        self._move_seconds(left, right, seconds, block)

    def on(self, left_speed: Speed, right_speed: Speed) -> None:
        left, right = self._convert_speeds(left_speed, right_speed)
        self._move(left, right)

    def _convert_speeds(self, left: Speed, right: Speed) -> tuple[int, int]:
        return self.left_motor._to_native_speed(left), self.right_motor._to_native_speed(right)

    def _move_degrees(self, left: int, right: int, degrees: float, block: bool) -> None:
        if degrees == 0 or (left == 0 and right == 0):
            left_degrees = right_degrees = degrees
        elif abs(left) > abs(right):
            left_degrees, right_degrees = degrees, abs(right / left * degrees)
        else:
            left_degrees, right_degrees = abs(left / right * degrees), degrees
        self.left_motor._set_relative_target(left_degrees, left)
        self.right_motor._set_relative_target(right_degrees, right)
        self.left_motor.run_to_rel_pos()
        self.right_motor.run_to_rel_pos()
        if block:
            self._wait_until_done()

    def _move_seconds(self, left: int, right: int, seconds: float, block: bool) -> None:
        check_not_negative(seconds)
        self.left_motor._set_motor(speed_sp=left, time_sp=float(seconds), command="run-timed")
        self.right_motor._set_motor(speed_sp=right, time_sp=float(seconds), command="run-timed")
        if block:
            self._wait_until_done()

    def _move(self, left: int, right: int) -> None:
        link.run_forever(self.left_motor.address, left)
        link.run_forever(self.right_motor.address, right)

    def _wait_until_done(self) -> None:
        # The motors are started one after the other, as in the original. The second motor has often stopped before the
        # wait for its start begins, so that the wait times out.
        self.left_motor._wait_until_done()
        self.right_motor._wait_until_done()


class MoveSteering(MoveTank):
    """Two motors with a speed and a steering: 0 straight ahead, 100 on the spot to the right, -100 to the left."""

    def get_speed_steering(self, steering: float, speed: Speed) -> tuple[int, int]:
        """Return whole degrees per second for the left and the right wheel."""
        if not -100 <= steering <= 100:
            raise ValueError(f"{steering} is an invalid steering, must be between -100 and 100 (inclusive)")
        # As in the original, each wheel's speed is rounded after the steering is applied.
        outer = self.left_motor._to_degrees_per_second(speed)
        inner = outer * (50 - abs(steering)) / 50
        left, right = (outer, inner) if steering >= 0 else (inner, outer)
        return round_to_whole(left), round_to_whole(right)

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
