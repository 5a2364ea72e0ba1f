"""Warp kernels of clearance for the bodies of actuators: from each other, from links, and from obstacles.

A thread takes one arm at one target, and branches: bounds exclude distant pairs. docs/method.md §13 defines the
distances and which pairs count.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, Precision
from armwright.kinematics.arms.frame_math import frame_math
from armwright.kinematics.arms.ik_math import kernel
from armwright.kinematics.contact.convex_math import convex_math
from armwright.kinematics.contact.solid_math import solid_math


@cache
def motor_kernels(precision: Precision) -> SimpleNamespace:
    """Return the kernels in this precision, for N arms with D joints at T targets, and O obstacles."""
    base, solids, convex = frame_math(precision), solid_math(precision), convex_math(precision)
    real, Vector3, Matrix3 = base.real, base.Vector3, base.Matrix3
    advance, signed_distance, nearer_link = base.advance, solids.signed_distance, solids.nearer_link
    separation, from_obstacle = convex.separation, convex.from_obstacle
    zero, one = real(0.0), real(1.0)

    @kernel
    def motor_frames(
        base: wp.array(dtype=Vector3),
        motion: wp.array2d(dtype=int),
        offset: wp.array2d(dtype=Vector3),
        q: wp.array3d(dtype=real),
        shape: wp.array2d(dtype=int),
        axis: wp.array2d(dtype=int),
        centre: wp.array2d(dtype=Vector3),
        middle: wp.array3d(dtype=Vector3),
        into: wp.array3d(dtype=Matrix3),
    ):
        """Compute the middle of each body, and the rotation into its frame, by forward kinematics.

        base: (N,) [m].  motion: (N, D).  offset: (N, D) [m].  q: (N, T, D) [rad] or [m].  shape, axis, centre [m]: (N,
        D).  middle [m], into: (N, T, D).
        """
        arm, target = wp.tid()
        x, y, z = Vector3(one, zero, zero), Vector3(zero, one, zero), Vector3(zero, zero, one)
        p = base[arm]
        for j in range(motion.shape[1]):
            if shape[arm, j] >= 0:
                c = centre[arm, j]
                middle[arm, target, j] = p + c[0] * x + c[1] * y + c[2] * z
                if axis[arm, j] == 0:
                    into[arm, target, j] = wp.matrix_from_rows(y, z, x)
                elif axis[arm, j] == 1:
                    into[arm, target, j] = wp.matrix_from_rows(z, x, y)
                else:
                    into[arm, target, j] = wp.matrix_from_rows(x, y, z)
            _place, p, x, y, z = advance(motion[arm, j], offset[arm, j], q[arm, target, j], p, x, y, z)

    @wp.func
    def from_link(
        nearest: real, shape: int, half: Vector3, middle: Vector3, into: Matrix3, a: Vector3, b: Vector3, radius: real
    ):
        """Return the smaller of a distance and that of a body from a link with the axis from a to b."""
        return nearer_link(nearest, shape, half, into * (a - middle), into * (b - a), radius)

    @kernel
    def self_clearance(
        motion: wp.array2d(dtype=int),
        shape: wp.array2d(dtype=int),
        half: wp.array2d(dtype=Vector3),
        middle: wp.array3d(dtype=Vector3),
        into: wp.array3d(dtype=Matrix3),
        starts: wp.array3d(dtype=Vector3),
        ends: wp.array3d(dtype=Vector3),
        radius: wp.array2d(dtype=real),
        clearance: wp.array2d(dtype=real),
    ):
        """Compute the smallest distance of a body from other bodies and from links that it does not join.

        motion, shape, half [m]: (N, D).  middle [m], into: (N, T, D).  starts, ends: (N, T, D) [m].  radius: (N, D)
        [m], 0 for links to ignore.  clearance: (N, T) [m], lowered to the distance.
        """
        arm, target = wp.tid()
        nearest = clearance[arm, target]
        for i in range(shape.shape[1]):
            kind = shape[arm, i]
            if kind >= 0:
                size, place, frame = half[arm, i], middle[arm, target, i], into[arm, target, i]
                for j in range(i + 1, shape.shape[1]):
                    other = shape[arm, j]
                    if other >= 0:
                        d = middle[arm, target, j] - place
                        other_size = half[arm, j]
                        if wp.length(d) - wp.length(size) - wp.length(other_size) < nearest:
                            between = into[arm, target, j] * wp.transpose(frame)
                            found = separation(frame * d, kind, size, between, other, other_size, nearest)
                            nearest = wp.min(nearest, found)
                links_between = int(0)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
                for k in range(i, shape.shape[1]):
                    r = radius[arm, k]
                    if r > zero:
                        if links_between > 0:
                            nearest = from_link(
                                nearest, kind, size, place, frame, starts[arm, target, k], ends[arm, target, k], r
                            )
                        links_between += 1
                links_before = int(0)  # noqa: RUF046, UP018
                n_joints = int(0)  # noqa: RUF046, UP018
                for back in range(i):
                    k = i - 1 - back
                    r = radius[arm, k]
                    if r > zero:
                        if links_before > 0 and n_joints > 0:
                            nearest = from_link(
                                nearest, kind, size, place, frame, starts[arm, target, k], ends[arm, target, k], r
                            )
                        links_before += 1
                    if motion[arm, k] < wp.static(FIXED):
                        n_joints += 1
        clearance[arm, target] = nearest

    @kernel
    def obstacle_clearance(
        motion: wp.array2d(dtype=int),
        shape: wp.array2d(dtype=int),
        half: wp.array2d(dtype=Vector3),
        middle: wp.array3d(dtype=Vector3),
        into: wp.array3d(dtype=Matrix3),
        solid: wp.array(dtype=int),
        centre: wp.array(dtype=Vector3),
        frame: wp.array(dtype=Matrix3),
        size: wp.array(dtype=Vector3),
        clearance: wp.array2d(dtype=real),
    ):
        """Compute the smallest distance of a body from an obstacle.

        motion, shape, half [m]: (N, D).  middle [m], into: (N, T, D).  solid (its shape), centre, frame (rotation into
        the obstacle's frame), size (half sides or radii): (O,).  clearance: (N, T) [m], lowered to the distance.
        """
        arm, target = wp.tid()
        nearest = clearance[arm, target]
        is_at_rest = int(1)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
        for j in range(shape.shape[1]):
            kind = shape[arm, j]
            if kind >= 0:
                place, box = middle[arm, target, j], half[arm, j]
                for o in range(solid.shape[0]):
                    d = centre[o] - place
                    bound = signed_distance(solid[o], -(frame[o] * d), size[o]) - wp.length(box)
                    if bound < nearest:
                        found = from_obstacle(kind, box, into[arm, target, j], d, solid[o], size[o], frame[o], nearest)
                        # A body at rest is always close to what the arm is mounted on: only overlaps count.
                        if is_at_rest == 0 or found < zero:
                            nearest = wp.min(nearest, found)
            if motion[arm, j] < wp.static(FIXED):
                is_at_rest = 0
        clearance[arm, target] = nearest

    return SimpleNamespace(
        motor_frames=motor_frames, self_clearance=self_clearance, obstacle_clearance=obstacle_clearance
    )
