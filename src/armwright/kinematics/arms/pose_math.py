"""Warp functions for targets with an axis or an orientation: rotations between frames."""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

import math
from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import PRISMATIC, Motions, Precision
from armwright.kinematics.arms.lane_math import lane_math


@cache
def pose_math(precision: Precision, lanes: int, motions: Motions) -> SimpleNamespace:
    """Return the functions for a precision, a number of lanes and joint motions, as in `ik_math`."""
    base = lane_math(precision, lanes)
    real, Vector3, Lane = base.real, base.Vector3, base.Lane
    roots, at_least, select, norm_squared = base.roots, base.at_least, base.select, base.norm_squared

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
    def angular_revolute(motion: int, component: Lane):
        """Return how much a joint rotates about a direction, its axis having this component along it."""
        return component

    @wp.func
    def angular_any(motion: int, component: Lane):
        if motion < PRISMATIC:
            return component
        return Lane(zero)

    angular = {"revolute": angular_revolute, "any": angular_any}[motions]

    @wp.func
    def along(a: Vector3, x: Lane, y: Lane, z: Lane):
        """Return a world component of a vector that is fixed in a frame with these components of its axes."""
        return a[0] * x + a[1] * y + a[2] * z

    @wp.func
    def dot(ax: Lane, ay: Lane, az: Lane, bx: Lane, by: Lane, bz: Lane):
        return wp.cw_mul(ax, bx) + wp.cw_mul(ay, by) + wp.cw_mul(az, bz)

    @wp.func
    def angular_columns(
        motion: int, has_axis: Lane, has_frame: Lane, sx: Lane, sy: Lane, sz: Lane, tx: Lane, ty: Lane, tz: Lane,
        fx: Lane, fy: Lane, fz: Lane, ax: Lane, ay: Lane, az: Lane,
    ):  # fmt: skip
        """Return how much a joint rotates about the tool's own x, y and z, which are s, t and f in the world."""
        return (
            wp.cw_mul(has_axis, angular(motion, dot(sx, sy, sz, ax, ay, az))),
            wp.cw_mul(has_axis, angular(motion, dot(tx, ty, tz, ax, ay, az))),
            wp.cw_mul(has_frame, angular(motion, dot(fx, fy, fz, ax, ay, az))),
        )

    @wp.func
    def larger_row(
        most: Lane, diagonal: Lane, w: Lane, x: Lane, y: Lane, z: Lane, a: Lane, b: Lane, c: Lane, d: Lane
    ):  # fmt: skip
        """Return the larger diagonal, and its row: w, x, y, z of the diagonal `most`, or a, b, c, d."""
        larger = Lane(one) - at_least(most, diagonal)
        return (
            wp.max(most, diagonal),
            select(larger, a, w),
            select(larger, b, x),
            select(larger, c, y),
            select(larger, d, z),
        )

    @wp.func
    def rotation_between(
        xx: Lane, xy: Lane, xz: Lane, yx: Lane, yy: Lane, yz: Lane, zx: Lane, zy: Lane, zz: Lane,
        has_axis: Lane, has_frame: Lane,
    ):  # fmt: skip
        """Return the angle between tool and target [rad], and the shortened rotation vector about the tool's x, y, z.

        xx to zz: the target's axes x, y, z in the frame of the tool, by component (xy: of the target's y along the
        tool's x). has_axis: 1 for targets with an axis or orientation, has_frame: 1 for those with an orientation.

        A quaternion needs no division at half a turn. The axis of half a turn is arbitrary: to reach an axis, the
        rotation is about the tool's own y.
        """
        # 4 q qᵀ of the rotation with these entries: the row with the largest diagonal is q, times a number above 0.
        w, x, y, z = Lane(one) + xx + yy + zz, zy - yz, xz - zx, yx - xy
        wx, wy, wz, xy2, xz2, yz2 = x, y, z, xy + yx, xz + zx, yz + zy
        x2, y2, z2 = Lane(one) + xx - yy - zz, Lane(one) - xx + yy - zz, Lane(one) - xx - yy + zz
        most, w, x, y, z = larger_row(w, x2, w, x, y, z, wx, x2, xy2, xz2)
        most, w, x, y, z = larger_row(most, y2, w, x, y, z, wy, xy2, y2, yz2)
        _most, w, x, y, z = larger_row(most, z2, w, x, y, z, wz, xz2, yz2, z2)
        side = two * at_least(w, Lane(zero)) - Lane(one)  # q and -q are one rotation: the one by half a turn at most

        # The shortest rotation from the tool's z to the target's.
        w = select(has_frame, wp.cw_mul(side, w), wp.max(Lane(one) + zz, Lane(zero)))
        x = select(has_frame, wp.cw_mul(side, x), -yz)
        y = select(has_frame, wp.cw_mul(side, y), xz)
        z = wp.cw_mul(has_frame, wp.cw_mul(side, z))
        opposite = at_least(Lane(nothing), w + wp.abs(x) + wp.abs(y) + wp.abs(z))
        y += opposite

        length = roots(norm_squared(x, y, z))
        angle = wp.cw_mul(has_axis, two * arctangent(length, w))
        share = wp.cw_div(wp.min(angle, Lane(max_rotation)), wp.max(length, Lane(least_length)))
        return angle, wp.cw_mul(share, x), wp.cw_mul(share, y), wp.cw_mul(share, z)

    @wp.func
    def error_rotation(
        axis: Vector3, side: Vector3, group: int, targets: wp.array2d(dtype=Lane),
        xx: Lane, xy: Lane, xz: Lane, yx: Lane, yy: Lane, yz: Lane, zx: Lane, zy: Lane, zz: Lane,
    ):  # fmt: skip
        """Return the axes of the tool in the world, its angle error [rad], and the rotation to the target.

        xx to zz: the last local frame, as in `advance`.
        """
        third = wp.cross(axis, side)
        sx, sy, sz = along(side, xx, yx, zx), along(side, xy, yy, zy), along(side, xz, yz, zz)
        tx, ty, tz = along(third, xx, yx, zx), along(third, xy, yy, zy), along(third, xz, yz, zz)
        fx, fy, fz = along(axis, xx, yx, zx), along(axis, xy, yy, zy), along(axis, xz, yz, zz)
        angle, rx, ry, rz = rotation_between(
            dot(sx, sy, sz, targets[group, 4], targets[group, 5], targets[group, 6]),
            dot(sx, sy, sz, targets[group, 7], targets[group, 8], targets[group, 9]),
            dot(sx, sy, sz, targets[group, 10], targets[group, 11], targets[group, 12]),
            dot(tx, ty, tz, targets[group, 4], targets[group, 5], targets[group, 6]),
            dot(tx, ty, tz, targets[group, 7], targets[group, 8], targets[group, 9]),
            dot(tx, ty, tz, targets[group, 10], targets[group, 11], targets[group, 12]),
            dot(fx, fy, fz, targets[group, 4], targets[group, 5], targets[group, 6]),
            dot(fx, fy, fz, targets[group, 7], targets[group, 8], targets[group, 9]),
            dot(fx, fy, fz, targets[group, 10], targets[group, 11], targets[group, 12]),
            targets[group, 13],
            targets[group, 14],
        )
        return sx, sy, sz, tx, ty, tz, fx, fy, fz, angle, rx, ry, rz

    return SimpleNamespace(angular_columns=angular_columns, error_rotation=error_rotation)
