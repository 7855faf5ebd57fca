"""Robot with rigid-body wheels: Bullet simulates two wheels and a caster with motors and friction.

This is the alternative to the course's equations. ``drive.py`` still computes the requested wheel speeds.
"""

from __future__ import annotations

import math

from sim.bullet import Client, pb
from sim.motion import Partner, Rectangle, add_block, add_body, compute_turn, place_body
from sim.robot import Robot
from sim.trigonometry import sincos

_METRE = 0.001
_STEPS = 4  # per tick
_BODY_KG, _WHEEL_KG = 1.0, 0.05
_TORQUE = 1.0  # N m, enough for a wheel on the floor to reach the requested speed
_LEFT, _RIGHT, _CASTER = 0, 1, 2


class RigidWheels:
    """Two spherical wheels with point contact, and a caster without friction.

    Over 60 s of random driving, this stays within 0.03 % of the path of the equations (spec/pybullet.md section 3a: 120
    Hz, 200 solver iterations). Wide cylinders or fewer iterations do not reach this precision.

    The last digits depend on fused multiply-add. Recordings are therefore the same on all machines with FMA (x86-64),
    but not on machines without it.
    """

    def __init__(self, robot: Robot, blocks: tuple[Rectangle, ...] = (), partner: Partner | None = None) -> None:
        self._radius = robot.wheel_diameter / 2
        self._client = Client()
        client = self._client.id
        pb.setGravity(0, 0, -9.81, physicsClientId=client)
        pb.setPhysicsEngineParameter(
            fixedTimeStep=1 / 30 / _STEPS,
            numSolverIterations=200,
            deterministicOverlappingPairs=1,
            physicsClientId=client,
        )
        ground = pb.createMultiBody(
            0, pb.createCollisionShape(pb.GEOM_PLANE, physicsClientId=client), physicsClientId=client
        )
        pb.changeDynamics(ground, -1, lateralFriction=1, physicsClientId=client)
        for box in blocks:
            add_block(box, self._client)
        self._partner = partner
        self._partners_body = add_body(partner.robot, self._client, 0, 0.1) if partner is not None else -1
        self._body = self._build(robot)
        # Bullet reports the centre of mass, not the middle of the axle.
        self._mass_ahead = robot.back / 6
        self._state = pb.saveState(physicsClientId=client)

    def close(self) -> None:
        """Disconnect from Bullet."""
        self._client.close()

    def place(self, x: float, y: float, heading: float) -> None:
        """Stop at a pose and reset all state."""
        client = self._client.id
        pb.restoreState(self._state, physicsClientId=client)
        half = sincos(heading / 2)
        sine, cosine = sincos(heading)
        position = (x + self._mass_ahead * cosine) * _METRE, (y + self._mass_ahead * sine) * _METRE
        pb.resetBasePositionAndOrientation(
            self._body, (*position, self._radius * _METRE), (0, 0, half[0], half[1]), physicsClientId=client
        )

    def compute_move(self, x: float, y: float, heading: float, left: float, right: float) -> tuple[float, float, float]:
        """Return the new x and y in mm and the turn in radians; ``x`` and ``y`` are the previous position."""
        client = self._client.id
        if self._partner is not None:
            partner = self._partner
            place_body(self._partners_body, partner.x, partner.y, partner.heading, self._client)
        pb.setJointMotorControlArray(
            self._body,
            [_LEFT, _RIGHT],
            pb.VELOCITY_CONTROL,
            targetVelocities=[left / self._radius * 30, right / self._radius * 30],
            forces=[_TORQUE, _TORQUE],
            physicsClientId=client,
        )
        for _ in range(_STEPS):
            pb.stepSimulation(physicsClientId=client)
        (bullet_x, bullet_y, _), turn = pb.getBasePositionAndOrientation(self._body, physicsClientId=client)
        rotation = round(compute_turn(heading, turn), 9)
        sine, cosine = sincos(heading + rotation)
        bullet_x, bullet_y = bullet_x / _METRE - self._mass_ahead * cosine, bullet_y / _METRE - self._mass_ahead * sine
        return round(bullet_x, 6), round(bullet_y, 6), rotation

    def _build(self, robot: Robot) -> int:
        client = self._client.id
        radius, half_spacing = self._radius * _METRE, robot.wheel_spacing / 2 * _METRE
        caster_radius = radius * 0.36
        # The box clears the floor and reaches the height of the obstacles' upper half.
        half_length, half_height = (robot.front - robot.back) / 2 * _METRE, radius / 2
        box = pb.createCollisionShape(
            pb.GEOM_BOX,
            halfExtents=[half_length, robot.half_width * _METRE, half_height],
            collisionFramePosition=[(robot.front + robot.back) / 2 * _METRE, 0, radius],
            physicsClientId=client,
        )
        wheel = pb.createCollisionShape(pb.GEOM_SPHERE, radius=radius, physicsClientId=client)
        ball = pb.createCollisionShape(pb.GEOM_SPHERE, radius=caster_radius, physicsClientId=client)
        # The joint turns about the link's z axis; the link is rotated so that a positive speed rolls forwards.
        axle_orientation = pb.getQuaternionFromEuler([math.pi / 2, 0, 0])
        upright_orientation = (0, 0, 0, 1)
        caster_at = robot.back * 0.75 * _METRE
        body: int = pb.createMultiBody(
            baseMass=_BODY_KG,
            baseCollisionShapeIndex=box,
            basePosition=[0, 0, radius],
            baseInertialFramePosition=[robot.back / 6 * _METRE, 0, 0],
            linkMasses=[_WHEEL_KG, _WHEEL_KG, 0.01],
            linkCollisionShapeIndices=[wheel, wheel, ball],
            linkVisualShapeIndices=[-1, -1, -1],
            linkPositions=[[0, half_spacing, 0], [0, -half_spacing, 0], [caster_at, 0, caster_radius - radius]],
            linkOrientations=[axle_orientation, axle_orientation, upright_orientation],
            linkInertialFramePositions=[[0, 0, 0]] * 3,
            linkInertialFrameOrientations=[upright_orientation] * 3,
            linkParentIndices=[0, 0, 0],
            linkJointTypes=[pb.JOINT_REVOLUTE, pb.JOINT_REVOLUTE, pb.JOINT_FIXED],
            linkJointAxis=[[0, 0, -1], [0, 0, -1], [0, 0, 1]],
            physicsClientId=client,
        )
        for link, friction in ((-1, 0.3), (_LEFT, 1.0), (_RIGHT, 1.0), (_CASTER, 0.0)):
            pb.changeDynamics(
                body,
                link,
                lateralFriction=friction,
                linearDamping=0,
                angularDamping=0,
                jointDamping=0,
                restitution=0,
                physicsClientId=client,
            )
        return body
