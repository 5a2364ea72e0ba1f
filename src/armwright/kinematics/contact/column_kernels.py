"""Warp kernels of clearance for the columns below bases: from links, and from the bodies of actuators.

A column is an upright cylinder at rest. A thread takes one arm at one target, and branches: bounds exclude distant
pairs. docs/method.md §13 defines the distances and which pairs count.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, Precision
from armwright.kinematics.arms.frame_math import frame_math
from armwright.kinematics.arms.ik_math import kernel
from armwright.kinematics.contact.convex_math import convex_math
from armwright.kinematics.contact.solid_math import CYLINDER, solid_math


@cache
def column_kernels(precision: Precision) -> SimpleNamespace:
    """Return the kernels in this precision, for N arms with D joints at T targets."""
    base, solids, convex = frame_math(precision), solid_math(precision), convex_math(precision)
    real, Vector3, Matrix3 = base.real, base.Vector3, base.Matrix3
    signed_distance, nearer_link, separation = solids.signed_distance, solids.nearer_link, convex.separation
    zero = real(0.0)

    @kernel
    def link_clearance(
        base: wp.array(dtype=Vector3),
        column: wp.array(dtype=Vector3),
        motion: wp.array2d(dtype=int),
        starts: wp.array3d(dtype=Vector3),
        ends: wp.array3d(dtype=Vector3),
        radius: wp.array2d(dtype=real),
        clearance: wp.array2d(dtype=real),
    ):
        """Compute the smallest distance of a column from links that move, except the first one.

        base: (N,) [m].  column: (N,) radius, radius, half the length [m], 0 without one.  motion: (N, D).  starts,
        ends: (N, T, D) [m].  radius: (N, D) [m], 0 for links to ignore.  clearance: (N, T) [m], lowered to the
        distance.
        """
        arm, target = wp.tid()
        size = column[arm]
        if size[2] > zero:
            middle = base[arm] - Vector3(zero, zero, size[2])
            nearest = clearance[arm, target]
            n_links = int(0)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
            n_joints = int(0)  # noqa: RUF046, UP018
            for j in range(motion.shape[1]):
                if motion[arm, j] < wp.static(FIXED):
                    n_joints += 1
                r = radius[arm, j]
                if r > zero:
                    if n_links > 0 and n_joints > 0:
                        a = starts[arm, target, j]
                        nearest = nearer_link(
                            nearest, wp.static(CYLINDER), size, a - middle, ends[arm, target, j] - a, r
                        )
                    n_links += 1
            clearance[arm, target] = nearest

    @kernel
    def motor_clearance(
        base: wp.array(dtype=Vector3),
        column: wp.array(dtype=Vector3),
        motion: wp.array2d(dtype=int),
        shape: wp.array2d(dtype=int),
        half: wp.array2d(dtype=Vector3),
        middle: wp.array3d(dtype=Vector3),
        into: wp.array3d(dtype=Matrix3),
        clearance: wp.array2d(dtype=real),
    ):
        """Compute the smallest distance of a column from bodies of actuators that move.

        base: (N,) [m].  column: (N,) radius, radius, half the length [m], 0 without one.  motion, shape, half [m]: (N,
        D).  middle [m], into: (N, T, D).  clearance: (N, T) [m], lowered to the distance.
        """
        arm, target = wp.tid()
        size = column[arm]
        if size[2] > zero:
            centre = base[arm] - Vector3(zero, zero, size[2])
            nearest = clearance[arm, target]
            is_at_rest = int(1)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
            for j in range(shape.shape[1]):
                kind = shape[arm, j]
                if kind >= 0 and is_at_rest == 0:
                    d = middle[arm, target, j] - centre
                    box = half[arm, j]
                    if signed_distance(wp.static(CYLINDER), d, size) - wp.length(box) < nearest:
                        found = separation(d, wp.static(CYLINDER), size, into[arm, target, j], kind, box, nearest)
                        nearest = wp.min(nearest, found)
                if motion[arm, j] < wp.static(FIXED):
                    is_at_rest = 0
            clearance[arm, target] = nearest

    return SimpleNamespace(link_clearance=link_clearance, motor_clearance=motor_clearance)
