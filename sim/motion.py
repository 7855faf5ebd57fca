"""Motion of the robot when its wheels turn: the course's equations, with or without solid walls.

``drive.py`` computes the wheel speeds, ``rigid_wheels.py`` the alternative motion with rigid-body wheels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Protocol

from sim.bullet import Client, pb
from sim.camera import HEIGHT, WIDTH
from sim.robot import Robot
from sim.trigonometry import sincos

Rectangle = tuple[float, float, float, float]  # x, y of the lower left corner, width, height

WALL = 100.0  # thickness, mm; only the inner face matters
_METRE = 0.001
_TICK = 1 / 30
#: Tolerance (mm, radians) between Bullet and the equations for a free body; rounding differences are far smaller.
_UNTOUCHED = 1e-4


class Motion(Protocol):
    """Tick-by-tick motion of a robot; (x, y) is the middle of its axle in mm, the heading is in radians."""

    def place(self, x: float, y: float, heading: float) -> None:
        """Start at a pose."""
        ...

    def close(self) -> None:
        """Release resources."""
        ...

    def compute_move(self, x: float, y: float, heading: float, left: float, right: float) -> tuple[float, float, float]:
        """Return the new x and y and the turn in radians; ``left`` and ``right`` are the wheels' travel in mm."""
        ...


@dataclass(frozen=True, slots=True)
class Physics:
    """Use of Bullet in addition to cameras and rays: contact with walls and obstacles, and the wheels."""

    solid: bool = False
    drive: Literal["course", "wheels"] = "course"


#: Physics of the original: the equations move the robot and nothing stops it.
COURSE_PHYSICS = Physics()


class FreeMotion:
    """The original's explicit Euler step with the heading before the tick (robolab section 3), without collisions."""

    def __init__(self, robot: Robot) -> None:
        self._spacing = robot.wheel_spacing

    def close(self) -> None:
        """Do nothing; there are no resources."""

    def place(self, x: float, y: float, heading: float) -> None:
        """Do nothing; no state is kept between ticks."""

    def compute_move(self, x: float, y: float, heading: float, left: float, right: float) -> tuple[float, float, float]:
        """Return the new x and y in mm and the turn in radians, computed by the equations alone."""
        if left == 0.0 and right == 0.0:
            return x, y, 0.0
        sine, cosine = sincos(heading)
        distance = (left + right) / 2
        return x + distance * cosine, y + distance * sine, (right - left) / self._spacing


class SolidMotion:
    """Free motion until the body would touch a wall or an obstacle; Bullet then computes contact and wheel slip.

    Each tick depends only on its arguments. Bullet's state is restored before each tick, so that cached contacts cannot
    cause differences between workers.
    """

    def __init__(self, robot: Robot, obstacles: tuple[Rectangle, ...], partner: Partner | None = None) -> None:
        self._free_motion = FreeMotion(robot)
        self._reach = robot.reach
        self._partner = partner
        self._boxes = (*build_walls().values(), *obstacles)
        self._client = Client()
        client = self._client.id
        for box in self._boxes:
            add_block(box, self._client)
        self._partners_body = add_body(partner.robot, self._client, 0) if partner is not None else -1
        self._body = add_body(robot, self._client, 1)
        pb.changeDynamics(
            self._body,
            -1,
            linearDamping=0,
            angularDamping=0,
            restitution=0,
            lateralFriction=0.3,
            physicsClientId=client,
        )
        # Measured at twenty positions: at full speed the body penetrates a wall by at most 0.7 mm with 16 steps a tick,
        # and by 3.4 mm with 4.
        pb.setPhysicsEngineParameter(
            fixedTimeStep=_TICK,
            numSubSteps=16,
            numSolverIterations=10,
            deterministicOverlappingPairs=1,
            physicsClientId=client,
        )
        self._state = pb.saveState(physicsClientId=client)

    def close(self) -> None:
        """Disconnect from Bullet."""
        self._client.close()

    def place(self, x: float, y: float, heading: float) -> None:
        """Do nothing; no state is kept between ticks."""

    def compute_move(self, x: float, y: float, heading: float, left: float, right: float) -> tuple[float, float, float]:
        """Return the new x and y in mm and the turn in radians. Bullet is used only near walls and obstacles."""
        new_x, new_y, rotation = self._free_motion.compute_move(x, y, heading, left, right)
        contact_distance = self._reach + math.hypot(new_x - x, new_y - y)
        partner = self._partner
        if all(measure_gap(box, x, y) > contact_distance for box in self._boxes) and (
            partner is None or partner.measure_gap(x, y) > contact_distance
        ):
            return new_x, new_y, rotation
        client = self._client.id
        pb.restoreState(self._state, physicsClientId=client)
        if partner is not None:
            place_body(self._partners_body, partner.x, partner.y, partner.heading, self._client)
        place_body(self._body, x, y, heading, self._client)
        pb.resetBaseVelocity(
            self._body,
            ((new_x - x) * _METRE / _TICK, (new_y - y) * _METRE / _TICK, 0),
            (0, 0, rotation / _TICK),
            physicsClientId=client,
        )
        pb.stepSimulation(physicsClientId=client)
        (bullet_x, bullet_y, _), turn = pb.getBasePositionAndOrientation(self._body, physicsClientId=client)
        bullet_x, bullet_y, bullet_turn = bullet_x / _METRE, bullet_y / _METRE, compute_turn(heading, turn)
        # A contact may begin and end within the tick. Therefore the result is compared, not the remaining contacts.
        is_free = (
            math.hypot(bullet_x - new_x, bullet_y - new_y) < _UNTOUCHED and abs(bullet_turn - rotation) < _UNTOUCHED
        )
        return (new_x, new_y, rotation) if is_free else (round(bullet_x, 6), round(bullet_y, 6), round(bullet_turn, 9))


@dataclass(slots=True)
class Partner:
    """The other robot on the floor and its current pose, mm and radians. This motion does not move it."""

    robot: Robot
    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0

    def measure_gap(self, x: float, y: float) -> float:
        """Return the lower bound of the distance from a point to its body in mm, for any heading."""
        return math.hypot(x - self.x, y - self.y) - self.robot.reach


def compute_turn(heading: float, quaternion: tuple[float, float, float, float]) -> float:
    """Return the angle from ``heading`` to the yaw of a quaternion (x, y, z, w) in radians, between -pi and pi."""
    x, y, z, w = quaternion
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return (yaw - heading + math.pi) % (2 * math.pi) - math.pi


def build_walls() -> dict[str, Rectangle]:
    """Return the four walls round the floor by name."""
    return {
        "left wall": (-WALL, -WALL, WALL, HEIGHT + 2 * WALL),
        "right wall": (WIDTH, -WALL, WALL, HEIGHT + 2 * WALL),
        "bottom wall": (-WALL, -WALL, WIDTH + 2 * WALL, WALL),
        "top wall": (-WALL, HEIGHT, WIDTH + 2 * WALL, WALL),
    }


def add_block(box: Rectangle, client: Client) -> int:
    """Add a static block to a client's world and return its Bullet id."""
    x, y, width, height = (value * _METRE for value in box)
    shape = pb.createCollisionShape(pb.GEOM_BOX, halfExtents=[width / 2, height / 2, 0.1], physicsClientId=client.id)
    body: int = pb.createMultiBody(0, shape, basePosition=[x + width / 2, y + height / 2, 0], physicsClientId=client.id)
    return body


def add_body(robot: Robot, client: Client, mass: float, half_height: float = 0.03) -> int:
    """Add a robot's body, a box, to a client's world and return its Bullet id. A body without mass does not move."""
    length = robot.front - robot.back
    shape = pb.createCollisionShape(
        pb.GEOM_BOX,
        halfExtents=[length / 2 * _METRE, robot.half_width * _METRE, half_height],
        collisionFramePosition=[(robot.front + robot.back) / 2 * _METRE, 0, 0],
        physicsClientId=client.id,
    )
    body: int = pb.createMultiBody(mass, shape, physicsClientId=client.id)
    return body


def place_body(body: int, x: float, y: float, heading: float, client: Client) -> None:
    """Move a body so that the middle of its axle is at (x, y) mm; heading in radians."""
    half = sincos(heading / 2)
    pb.resetBasePositionAndOrientation(
        body, (x * _METRE, y * _METRE, 0), (0, 0, half[0], half[1]), physicsClientId=client.id
    )


def measure_gap(box: Rectangle, x: float, y: float) -> float:
    """Return the distance from a point to a rectangle in mm."""
    left, bottom, width, height = box
    return math.hypot(max(left - x, 0, x - left - width), max(bottom - y, 0, y - bottom - height))
