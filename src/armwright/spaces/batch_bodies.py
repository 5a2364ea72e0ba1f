"""Bodies of actuators of a batch of designs, by lookup of the bodies that single designs have."""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.kinematics.arms.arm_arrays import FIXED, PRISMATIC
from armwright.kinematics.arms.motor_bodies import body_values, without_bodies
from armwright.robot.arm import AXES
from armwright.robot.motor_body import placed_body
from armwright.spaces.joint_modules import DIRECTIONS, MOUNTS, mounted_body
from armwright.spaces.space_schema import SpaceSchema

Indices = NDArray[np.intp]

_UPRIGHT = tuple(DIRECTIONS).index("+z")  # from the surface that the arm is mounted on to the first joint


def motor_body_values(
    space: SpaceSchema, motor: Indices, plan: Indices, direction: Indices, mount: Indices
) -> dict[str, NDArray[Any]]:
    """Return the bodies of N designs of up to M modules of one joint each, by field of `MotorBodies`, (N, M, 1, ...).

    Args:
        space: The design space, with motor bodies.
        motor: (N, M) index of the actuator of each module.
        plan: (N, M, 1) motion of each joint in the axes of the base.
        direction: (N, M) index of the direction of each link.
        mount: (N,) index of the mount.
    """
    carrier = np.concatenate([np.full((len(direction), 1), _UPRIGHT), direction[:, :-1]], axis=1)
    moves = plan[..., 0] < FIXED
    values = without_bodies(*plan.shape)
    for name, table in _table(space).items():
        found = table[motor, plan[..., 0] % PRISMATIC, carrier, mount[:, None]]
        values[name][moves] = found[moves][:, None]
    return values


@cache
def _table(space: SpaceSchema) -> dict[str, NDArray[Any]]:
    """Return the values of bodies by actuator, local axis of the joint, direction of the link before and mount."""
    shapes = [actuator.shape for actuator in space.arm_actuators]
    values = without_bodies(len(shapes), len(AXES), len(DIRECTIONS), len(MOUNTS))
    for a, shape in enumerate(shapes):
        for i, axis in enumerate(AXES):
            for d, carrier in enumerate(DIRECTIONS.values()):
                for m, mount in enumerate(MOUNTS):
                    if shape is not None and mount in space.mount:
                        body = mounted_body(placed_body(shape, axis, carrier), mount)
                        for name, value in zip(values, body_values(body), strict=True):
                            values[name][a, i, d, m] = value
    return values
