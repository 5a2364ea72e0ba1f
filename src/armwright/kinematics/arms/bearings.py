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
    offset = np.zeros(shape)
    if arms.actuation is not None:
        offset = np.nan_to_num(arms.actuation.bearing_offset).reshape(shape)
    axial = (force * axis).sum(axis=-1, keepdims=True) * axis
    tilting, lever = moment - (moment * axis).sum(axis=-1, keepdims=True) * axis, offset * np.cross(axis, force)
    turns = (arms.motion < PRISMATIC).reshape(*shape, 1)
    return np.where(turns, np.stack([tilting - lever, tilting + lever, axial, force - axial], axis=-2), 0.0)


def bearing_loads(across: Array) -> Array:
    """Return the (..., 3) tilting moment [N m], axial and radial force [N] of loads (..., 4, 3) from `across_axis`."""
    size = np.linalg.norm(across, axis=-1)
    return np.concatenate([size[..., :2].max(axis=-1, keepdims=True), size[..., 2:]], axis=-1)


def largest_bearing_loads(arms: ArmArrays, wrenches: Array) -> Array:
    """Return the (N, D, 3) largest `bearing_loads` of (N, F, D, 6) forces and moments in the frames of the links.

    There, the axis is one of the frame's: |M ± d a × F|² = |M|² + d² |F|² ± 2 d M·(a × F), of what is across the axis.
    """
    along = np.where((arms.motion < PRISMATIC)[..., None], np.eye(3)[arms.motion % PRISMATIC], 0.0)  # (N, D, 3)
    across = np.where((arms.motion < PRISMATIC)[..., None], 1.0 - along, 0.0)
    force, moment = wrenches[..., :3], wrenches[..., 3:]
    axial, radial = (np.einsum("nfdi,nfdi,ndi->nfd", force, force, part) for part in (along, across))
    tilting = np.einsum("nfdi,nfdi,ndi->nfd", moment, moment, across)
    if arms.actuation is not None and np.nan_to_num(arms.actuation.bearing_offset).any():
        offset = np.nan_to_num(arms.actuation.bearing_offset)[:, None]
        mixed = np.abs((moment * np.cross(along[:, None], force)).sum(axis=-1))
        tilting += offset**2 * radial + 2.0 * offset * mixed
    return np.sqrt(np.stack([each.max(axis=1) for each in (tilting, axial, radial)], axis=-1))


def bearing_limits(drives: Actuation) -> Array:
    """Return the (N, D, 3) largest tilting moment [N m], axial and radial force [N]; NaN where a maker states none."""
    return np.stack([drives.tilting_limit, drives.axial_limit, drives.radial_limit], axis=-1)
