"""Walls and obstacles in PyBullet, for ultrasonic rays and contact detection.

``motion.py`` decides whether a contact stops the robot.
"""

from __future__ import annotations

import math

from sim.bullet import Client, pb
from sim.camera import HEIGHT, WIDTH
from sim.motion import (
    FreeMotion,
    Motion,
    Physics,
    Rectangle,
    SolidMotion,
    add_block,
    add_body,
    build_walls,
    measure_gap,
    place_body,
)
from sim.rigid_wheels import RigidWheels
from sim.robot import Robot
from sim.trigonometry import round_half_up, sincos

_METRE = 0.001
_RANGE = 2550.0  # mm
_RAYS = tuple(math.radians(angle) for angle in (0, 7, -7, 14, -14, 21, -21))
_HORIZONTAL, _VERTICAL = 2, 4  # collision groups of edges parallel to x and to y
TOUCH = 0.5  # mm; Bullet keeps a pressed body a fraction of a millimetre away from the wall


class Arena:
    """Walls round the floor and a set of obstacles. A trial does not change an arena."""

    def __init__(self, obstacles: tuple[Rectangle, ...] = ()) -> None:
        self._client = Client()
        self.obstacles = obstacles
        floor: Rectangle = (0, 0, WIDTH, HEIGHT)
        self._edges = {
            _HORIZONTAL: self._add_edges(
                [
                    (x, level, x + width, level)
                    for x, y, width, height in (floor, *obstacles)
                    for level in (y, y + height)
                ],
                _HORIZONTAL,
            ),
            _VERTICAL: self._add_edges(
                [
                    (level, y, level, y + height)
                    for x, y, width, height in (floor, *obstacles)
                    for level in (x, x + width)
                ],
                _VERTICAL,
            ),
        }
        blocks = build_walls() | {f"obstacle {number}": box for number, box in enumerate(obstacles, 1)}
        self._blocks = [(name, box, self._add_block(box)) for name, box in blocks.items()]
        self._bodies: dict[str, int] = {}
        self._motions: dict[tuple[str, Physics], Motion] = {}

    def close(self) -> None:
        """Disconnect from Bullet, and close the motion of every robot."""
        self._client.close()
        for motion in self._motions.values():
            motion.close()

    def place_motion(self, robot: Robot, physics: Physics, x: float, y: float, heading: float) -> Motion:
        """Return the motion of ``robot`` in this arena, placed at this pose; heading in radians.

        The object is reused, so it can serve only one trial at a time.
        """
        key = robot.name, physics
        if key not in self._motions:
            self._motions[key] = self._make_motion(robot, physics)
        self._motions[key].place(x, y, heading)
        return self._motions[key]

    def _make_motion(self, robot: Robot, physics: Physics) -> Motion:
        if physics.drive == "wheels":
            return RigidWheels(robot, (*build_walls().values(), *self.obstacles) if physics.solid else ())
        return SolidMotion(robot, self.obstacles) if physics.solid else FreeMotion(robot)

    def measure_distance(self, x: float, y: float, heading: float, forward: float) -> float:
        """Return the ultrasonic reading in mm, 0..2550, from ``forward`` mm in front of the axle; heading in radians.

        The sensor uses seven rays within 21 degrees. It detects an edge if the edge's direction and the central heading
        (wrapped to one turn) differ by more than 40 and less than 140 degrees (robolab section 4).
        """
        degrees = math.degrees(heading) % 360
        groups = 0
        for direction, group in ((0, _HORIZONTAL), (90, _VERTICAL)):
            incidence = abs(direction - degrees)
            if incidence > 180:
                incidence = 360 - incidence
            if 40 < incidence < 140:
                groups |= group
        if not groups:
            return _RANGE
        return self._measure_nearest_hit(x, y, heading, forward, groups)

    def _measure_nearest_hit(self, x: float, y: float, heading: float, forward: float, groups: int) -> float:
        """Return the distance to the nearest hit of any ray in these collision groups, in whole mm."""
        sine, cosine = sincos(heading)
        start = ((x + cosine * forward) * _METRE, (y + sine * forward) * _METRE, 0.0)
        ends = []
        for angle in _RAYS:
            ray_sine, ray_cosine = sincos(heading + angle)
            reach = _RANGE * _METRE
            ends.append((start[0] + ray_cosine * reach, start[1] + ray_sine * reach, 0.0))
        hits = pb.rayTestBatch([start] * len(ends), ends, collisionFilterMask=groups, physicsClientId=self._client.id)
        nearest = min(hit[2] for hit in hits)
        return min(max(round_half_up(nearest * _RANGE), 0.0), _RANGE)

    def is_blocked_between(self, start: tuple[float, float], end: tuple[float, float]) -> bool:
        """Return whether an edge of the floor or of an obstacle crosses the straight line between two points, mm.

        Walls and obstacles are taller than every sensor, so the height of the ray does not matter.
        """
        ray = [(x * _METRE, y * _METRE, 0.0) for x, y in (start, end)]
        edges = _HORIZONTAL | _VERTICAL
        ((body, *_),) = pb.rayTestBatch(ray[:1], ray[1:], collisionFilterMask=edges, physicsClientId=self._client.id)
        return bool(body >= 0)

    def find_contacts(self, robot: Robot, x: float, y: float, heading: float) -> tuple[str, ...]:
        """Return the names of walls and obstacles that overlap the robot's body or are within half a millimetre."""
        nearby_blocks = [
            (name, block) for name, box, block in self._blocks if measure_gap(box, x, y) <= robot.reach + TOUCH
        ]
        if not nearby_blocks:
            return ()
        body = self._body(robot)
        place_body(body, x, y, heading, self._client)
        return tuple(name for name, block in nearby_blocks if self._is_in_contact(body, block))

    def _is_in_contact(self, body: int, block: int) -> bool:
        return bool(pb.getClosestPoints(body, block, TOUCH * _METRE, physicsClientId=self._client.id))

    def _body(self, robot: Robot) -> int:
        if robot.name not in self._bodies:
            self._bodies[robot.name] = self._assign_collision_group(add_body(robot, self._client, 0), 1)
        return self._bodies[robot.name]

    def _add_block(self, box: Rectangle) -> int:
        return self._assign_collision_group(add_block(box, self._client), 1)

    def _assign_collision_group(self, body: int, group: int, mask: int = 1) -> int:
        pb.setCollisionFilterGroupMask(body, -1, group, mask, physicsClientId=self._client.id)
        return body

    def _add_edges(self, lines: list[Rectangle], group: int) -> int:
        """Add vertical sheets of zero thickness, so that a ray hits the edge itself."""
        vertices: list[list[float]] = []
        indices: list[int] = []
        for x1, y1, x2, y2 in lines:
            first_vertex = len(vertices)
            vertices += [
                [x * _METRE, y * _METRE, z]
                for x, y, z in ((x1, y1, -0.5), (x2, y2, -0.5), (x2, y2, 0.5), (x1, y1, 0.5))
            ]
            indices += [
                first_vertex,
                first_vertex + 1,
                first_vertex + 2,
                first_vertex,
                first_vertex + 2,
                first_vertex + 3,
            ]
        shape = pb.createCollisionShape(
            pb.GEOM_MESH,
            vertices=vertices,
            indices=indices,
            flags=pb.GEOM_FORCE_CONCAVE_TRIMESH,
            physicsClientId=self._client.id,
        )
        body: int = pb.createMultiBody(0, shape, physicsClientId=self._client.id)
        pb.setCollisionFilterGroupMask(body, -1, group, -1, physicsClientId=self._client.id)
        return body
