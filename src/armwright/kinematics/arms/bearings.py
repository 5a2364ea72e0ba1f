"""Loads across the axes of joints that turn, which the output bearings of their motors carry.

With the force F and the moment M about the joint that a joint passes on, the unit vector a along its axis, and the
bearing at the distance d from the joint along the axis, they are

    axial force F·a,   radial force F - (F·a) a,   tilting moment M - (M·a) a ± d a × F

A joint is halfway along the shaft of its motor. On which side of it the output is, is not modelled, so the larger
tilting moment counts. The rail of a slide carries what crosses it, not the motor.
"""

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.actuation import Actuation
from armwright.kinematics.arms.arm_arrays import PRISMATIC, ArmArrays


def across_axis(arms: ArmArrays, axis: Array, force: Array, moment: Array) -> Array:
    """Return (N, ..., D, 4, 3): tilting moment for both sides, axial and radial force [N m], [N]; linear in the load.

    axis: unit vectors along the axes.  force, moment: of the joints [N], about the joints [N m]; all (N, ..., D, 3) in
    any frames.
    """
    shape = len(arms), *(1,) * (force.ndim - 3), arms.dof, 1
    offset = bearing_offsets(arms).reshape(shape)
    axial = (force * axis).sum(axis=-1, keepdims=True) * axis
    tilting, lever = moment - (moment * axis).sum(axis=-1, keepdims=True) * axis, offset * np.cross(axis, force)
    turns = (arms.motion < PRISMATIC).reshape(*shape, 1)
    return np.where(turns, np.stack([tilting - lever, tilting + lever, axial, force - axial], axis=-2), 0.0)


def bearing_loads(across: Array) -> Array:
    """Return the (..., 3) tilting moment [N m], axial and radial force [N] of loads (..., 4, 3) from `across_axis`."""
    size = np.linalg.norm(across, axis=-1)
    return np.concatenate([size[..., :2].max(axis=-1, keepdims=True), size[..., 2:]], axis=-1)


def bearing_offsets(arms: ArmArrays) -> Array:
    """Return the (N, D) distances of the bearings from the joints along their axes [m]; 0 where they are unknown."""
    return np.zeros(arms.motion.shape) if arms.actuation is None else np.nan_to_num(arms.actuation.bearing_offset)


def bearing_limits(drives: Actuation) -> Array:
    """Return the (N, D, 3) largest tilting moment [N m], axial and radial force [N]; NaN where a maker states none."""
    return np.stack([drives.tilting_limit, drives.axial_limit, drives.radial_limit], axis=-1)
