"""An arena with another robot in it: ultrasonic rays meet its body, this robot's body touches it, and may be stopped.

What the other one does is not decided here; it is where it was last placed. Light sensors look at the floor alone.
"""

from __future__ import annotations

from sim.arena import TOUCH, Arena
from sim.motion import FreeMotion, Motion, Partner, Physics, Rectangle, SolidMotion, add_body, place_body, walls
from sim.rigid_wheels import RigidWheels
from sim.robot import Robot

_PARTNER = 8  # collision group


class SharedArena(Arena):
    """The arena as one of two robots has it; each has one of its own."""

    def __init__(self, obstacles: tuple[Rectangle, ...], partner: Robot, name: str) -> None:
        """``name`` is what the partner is called where it is touched."""
        super().__init__(obstacles)
        self._partner = Partner(partner)
        self._name = name
        self._partners_body = self._group(add_body(partner, self._client, 0), _PARTNER, -1)

    def place_partner(self, x: float, y: float, heading: float) -> None:
        """The other robot stands there from now on: mm and radians."""
        partner = self._partner
        partner.x, partner.y, partner.heading = x, y, heading
        place_body(self._partners_body, x, y, heading, self._client)

    def distance(self, x: float, y: float, heading: float, forward: float) -> float:
        """As in an arena, but that another robot is heard wherever it is met: it has no smooth sides."""
        nearest = super().distance(x, y, heading, forward)
        if self._partner.gap(x, y) > nearest + forward:
            return nearest
        return min(nearest, self._nearest_hit(x, y, heading, forward, _PARTNER))

    def touching(self, robot: Robot, x: float, y: float, heading: float) -> tuple[str, ...]:
        """As in an arena, and the partner's name where the bodies meet."""
        touched = super().touching(robot, x, y, heading)
        if self._partner.gap(x, y) > robot.reach + TOUCH:
            return touched
        body = self._body(robot)
        place_body(body, x, y, heading, self._client)
        return (*touched, self._name) if self._meet(body, self._partners_body) else touched

    def _make_motion(self, robot: Robot, physics: Physics) -> Motion:
        if physics.drive == "wheels":
            blocks = (*walls().values(), *self.obstacles) if physics.solid else ()
            return RigidWheels(robot, blocks, self._partner if physics.solid else None)
        return SolidMotion(robot, self.obstacles, self._partner) if physics.solid else FreeMotion(robot)
