"""Warp functions for targets with an axis or an orientation: rotations between frames."""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

import math
from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import Precision
from armwright.kinematics.arms.lane_math import lane_math


@cache
def pose_math(precision: Precision, lanes: int) -> SimpleNamespace:
    """Return the variant for a precision and a number of lanes."""
    base = lane_math(precision, lanes)
    real, Vector3, Lane, Vector = base.real, base.Vector3, base.Lane, base.Vector
    roots, at_least, select = base.roots, base.at_least, base.select
    scaled, dot, in_frame, vector_of = base.scaled, base.dot, base.in_frame, base.vector_of
    Quaternion = wp.types.matrix(shape=(4, lanes), dtype=real)

    zero, one, two = real(0.0), real(1.0), real(2.0)
    max_rotation = real(0.5)  # [rad] of the error that one update tries to close
    least_length, nothing = real(1e-30), real(1e-12)
    quarter = real(math.pi / 2)

    @wp.func
    def library_arctangent(y: Lane, x: Lane):
        """Return the angle of (x, y), both at least 0 and not both 0, to the last bits."""
        angle = Lane()
        for i in range(lanes):
            angle[i] = wp.atan2(y[i], x[i])
        return angle

    @wp.func
    def polynomial_arctangent(y: Lane, x: Lane):
        """Return that angle to 2e-7: a polynomial in t² interpolates atan(t) / t at Chebyshev's nodes of [0, 1]."""
        t = wp.cw_div(wp.min(y, x), wp.max(y, x))
        u = wp.cw_mul(t, t)
        a = 2.766283501e-03 * u - Lane(1.573124912e-02)
        a = wp.cw_mul(a, u) + Lane(4.213762358e-02)
        a = wp.cw_mul(a, u) - Lane(7.456854825e-02)
        a = wp.cw_mul(a, u) + Lane(1.061837064e-01)
        a = wp.cw_mul(a, u) - Lane(1.419779779e-01)
        a = wp.cw_mul(a, u) + Lane(1.999187203e-01)
        a = wp.cw_mul(a, u) - Lane(3.333303671e-01)
        a = wp.cw_mul(a, u) + Lane(9.999999818e-01)
        a = wp.cw_mul(a, t)
        return select(at_least(y, x), Lane(quarter) - a, a)

    arctangent = polynomial_arctangent if precision == "float32" else library_arctangent

    @wp.func
    def larger_row(most: Lane, q: Quaternion, diagonal: Lane, w: Lane, x: Lane, y: Lane, z: Lane):
        """Return the larger diagonal, and its row: q of the diagonal `most`, or w, x, y, z."""
        larger = Lane(one) - at_least(most, diagonal)
        return wp.max(most, diagonal), wp.matrix_from_rows(
            select(larger, w, q[0]), select(larger, x, q[1]), select(larger, y, q[2]), select(larger, z, q[3])
        )

    @wp.func
    def tool_frame(axis: Vector3, side: Vector3, x: Vector, y: Vector, z: Vector):
        """Return the axes of the tool in the world; x, y, z: the last local frame."""
        return in_frame(side, x, y, z), in_frame(wp.cross(axis, side), x, y, z), in_frame(axis, x, y, z)

    @wp.func
    def error_rotation(s: Vector, t: Vector, f: Vector, targets: wp.array2d(dtype=Lane), group: int):
        """Return the angle between the tool s, t, f and its target [rad], and the shortened rotation vector to it.

        The rotation vector is about the tool's own x, y and z. A quaternion needs no division at half a turn. The axis
        of half a turn is arbitrary: to reach an axis, the rotation is about the tool's own y.
        """
        u, v, n = vector_of(targets, group, 4), vector_of(targets, group, 7), vector_of(targets, group, 10)
        has_axis, has_frame = targets[group, 13], targets[group, 14]
        # xy: of the target's y along the tool's x, and so on
        xx, xy, xz = dot(s, u), dot(s, v), dot(s, n)
        yx, yy, yz = dot(t, u), dot(t, v), dot(t, n)
        zx, zy, zz = dot(f, u), dot(f, v), dot(f, n)

        # 4 q qᵀ of the rotation with these entries: the row with the largest diagonal is q, times a number above 0.
        w2, wx, wy, wz = Lane(one) + xx + yy + zz, zy - yz, xz - zx, yx - xy
        x2, y2, z2 = Lane(one) + xx - yy - zz, Lane(one) - xx + yy - zz, Lane(one) - xx - yy + zz
        xy2, xz2, yz2 = xy + yx, xz + zx, yz + zy
        most, q = larger_row(w2, wp.matrix_from_rows(w2, wx, wy, wz), x2, wx, x2, xy2, xz2)
        most, q = larger_row(most, q, y2, wy, xy2, y2, yz2)
        _most, q = larger_row(most, q, z2, wz, xz2, yz2, z2)
        side = two * at_least(q[0], Lane(zero)) - Lane(one)  # q and -q are one rotation: the one by half a turn at most

        # The shortest rotation from the tool's z to the target's.
        w = select(has_frame, wp.cw_mul(side, q[0]), wp.max(Lane(one) + zz, Lane(zero)))
        x = select(has_frame, wp.cw_mul(side, q[1]), -yz)
        y = select(has_frame, wp.cw_mul(side, q[2]), xz)
        z = wp.cw_mul(has_frame, wp.cw_mul(side, q[3]))
        opposite = at_least(Lane(nothing), w + wp.abs(x) + wp.abs(y) + wp.abs(z))
        rotation = wp.matrix_from_rows(x, y + opposite, z)

        length = roots(dot(rotation, rotation))
        angle = wp.cw_mul(has_axis, two * arctangent(length, w))
        share = wp.cw_div(wp.min(angle, Lane(max_rotation)), wp.max(length, Lane(least_length)))
        return angle, scaled(share, rotation)

    return SimpleNamespace(tool_frame=tool_frame, error_rotation=error_rotation)
