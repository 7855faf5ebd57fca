"""Motors of the simulator: single motors, and the tank and steering pairs used in the course."""

from ev3dev2.motor_pairs import MotorSet, MoveSteering, MoveTank
from ev3dev2.single_motor import (
    OUTPUT_A,
    OUTPUT_B,
    OUTPUT_C,
    OUTPUT_D,
    WAIT_RUNNING_TIMEOUT,
    LargeMotor,
    MediumMotor,
    Motor,
)
from ev3dev2.speeds import (
    SpeedDPM,
    SpeedDPS,
    SpeedNativeUnits,
    SpeedPercent,
    SpeedRPM,
    SpeedRPS,
    SpeedValue,
)

__all__ = [
    "OUTPUT_A",
    "OUTPUT_B",
    "OUTPUT_C",
    "OUTPUT_D",
    "WAIT_RUNNING_TIMEOUT",
    "LargeMotor",
    "MediumMotor",
    "Motor",
    "MotorSet",
    "MoveSteering",
    "MoveTank",
    "SpeedDPM",
    "SpeedDPS",
    "SpeedNativeUnits",
    "SpeedPercent",
    "SpeedRPM",
    "SpeedRPS",
    "SpeedValue",
]
