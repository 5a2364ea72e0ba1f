"""Bodies of the actuators of stacked arms."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.kinematics.arms.rigid_bodies import PerArm
from armwright.robot.arm import AXES, Arm
from armwright.robot.axes import Vector
from armwright.robot.motor_body import MotorBody, shaft_order
from armwright.tasks.obstacles import SHAPES

NO_BODY = -1  # shape of a joint without a motor body


@dataclass(frozen=True)
class MotorBodies(PerArm):
    """Bodies of the actuators of N arms of up to D joints, each fixed to the link before its joint.

    The frame of a body has its z axis along the shaft. Its x and y axes are the next two of the link's frame in cyclic
    order.
    """

    shape: NDArray[np.int32]  # (N, D) index in SHAPES; NO_BODY if there is none
    axis: NDArray[np.int32]  # (N, D) of the shaft in the frame of the link before: 0 to 2
    half: NDArray[np.floating[Any]]  # (N, D, 3) half edges in the body's frame; radius, radius, half the length [m]
    centre: NDArray[np.floating[Any]]  # (N, D, 3) from the joint at displacement 0, in the frame of the link before [m]


def body_values(body: MotorBody) -> tuple[int, int, Vector, Vector]:
    """Return shape, axis, half and centre of a body, as `MotorBodies` has them."""
    length, width, depth = shaft_order(body.axis, body.size)
    return SHAPES.index(body.shape), AXES.index(body.axis), (width / 2, depth / 2, length / 2), body.centre


def without_bodies(*size: int) -> dict[str, NDArray[Any]]:
    """Return the values of joints without bodies, by field of `MotorBodies`."""
    shape, axis = np.full(size, NO_BODY, dtype=np.int32), np.zeros(size, dtype=np.int32)
    return {"shape": shape, "axis": axis, "half": np.zeros((*size, 3)), "centre": np.zeros((*size, 3))}


def stack_bodies(arms: Sequence[Arm], dof: int, precision: Any) -> MotorBodies | None:
    """Return the bodies of the actuators of N arms of at most `dof` joints; None if there are none."""
    if not any(arm.has_motor_bodies for arm in arms):
        return None
    values = without_bodies(len(arms), dof)
    for i, arm in enumerate(arms):
        for j, joint in enumerate(arm.joints):
            if joint.body is not None:
                for field, value in zip(fields(MotorBodies), body_values(joint.body), strict=True):
                    values[field.name][i, j] = value
    return bodies_in(values, precision)


def bodies_in(values: dict[str, NDArray[Any]], precision: Any) -> MotorBodies:
    """Return bodies with the floats in this precision."""
    half, centre = values["half"].astype(precision), values["centre"].astype(precision)
    return MotorBodies(values["shape"].astype(np.int32), values["axis"].astype(np.int32), half, centre)
