"""Arena with a second robot, which ultrasonic rays detect and the first robot's body can touch.

The second robot is at the pose where it was last placed. Light sensors see only the floor.
"""

from __future__ import annotations

from sim.arena import TOUCH, Arena
from sim.motion import FreeMotion, Motion, Partner, Physics, Rectangle, SolidMotion, add_body, build_walls, place_body
from sim.rigid_wheels import RigidWheels
from sim.robot import Robot

_PARTNER = 8  # collision group


class SharedArena(Arena):
    """The arena from the view of one of two robots. Each robot has its own instance."""

    def __init__(self, obstacles: tuple[Rectangle, ...], partner: Robot, name: str) -> None:
        """Create the arena; ``name`` is the partner's name in touches."""
        super().__init__(obstacles)
        self._partner = Partner(partner)
        self._name = name
        self._partners_body = self._assign_collision_group(add_body(partner, self._client, 0), _PARTNER, -1)

    def place_partner(self, x: float, y: float, heading: float) -> None:
        """Set the pose of the other robot, in mm and radians."""
        partner = self._partner
        partner.x, partner.y, partner.heading = x, y, heading
        place_body(self._partners_body, x, y, heading, self._client)

    def measure_distance(self, x: float, y: float, heading: float, forward: float) -> float:
        """Return the distance as in an arena. The other robot has no smooth sides, so rays detect it at any angle."""
        nearest = super().measure_distance(x, y, heading, forward)
        if self._partner.measure_gap(x, y) > nearest + forward:
            return nearest
        return min(nearest, self._measure_nearest_hit(x, y, heading, forward, _PARTNER))

    def find_contacts(self, robot: Robot, x: float, y: float, heading: float) -> tuple[str, ...]:
        """Return the objects touched as in an arena, and the partner's name if the bodies touch."""
        touched_names = super().find_contacts(robot, x, y, heading)
        if self._partner.measure_gap(x, y) > robot.reach + TOUCH:
            return touched_names
        body = self._body(robot)
        place_body(body, x, y, heading, self._client)
        return (*touched_names, self._name) if self._is_in_contact(body, self._partners_body) else touched_names

    def _make_motion(self, robot: Robot, physics: Physics) -> Motion:
        if physics.drive == "wheels":
            blocks = (*build_walls().values(), *self.obstacles) if physics.solid else ()
            return RigidWheels(robot, blocks, self._partner if physics.solid else None)
        return SolidMotion(robot, self.obstacles, self._partner) if physics.solid else FreeMotion(robot)
