"""Warp functions for targets with an axis or an orientation: rotations between frames and the 6 x 6 system."""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from armwright.kinematics.arm_arrays import PRISMATIC, Motions, Precision
from armwright.kinematics.ik_math import ik_math


@dataclass(frozen=True)
class PoseMath:
    """Functions of one variant."""

    dot: Any
    angular: Any
    error_rotation: Any
    factor_6x6: Any
    solve_6x6: Any


@cache
def pose_math(precision: Precision, lanes: int, motions: Motions) -> PoseMath:
    """Return the functions for a precision, a number of lanes and joint motions, as in `ik_math`."""
    base = ik_math(precision, lanes, motions)
    real, Vector3, Lane, Wide = base.real, base.Vector3, base.Lane, base.Wide
    roots, at_least, select, norm_squared = base.roots, base.at_least, base.select, base.norm_squared

    zero, one, two = real(0.0), real(1.0), real(2.0)
    max_rotation = real(0.5)  # [rad] of the error that one update tries to close
    least_length, nothing = real(1e-30), real(1e-12)
    quarter = real(math.pi / 2)
    ones, least = Wide(wp.float64(1.0)), Wide(wp.float64(1e-18))

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
    def rotation_between(
        xx: Lane,
        xy: Lane,
        xz: Lane,
        yx: Lane,
        yy: Lane,
        yz: Lane,
        zx: Lane,
        zy: Lane,
        zz: Lane,
        has_axis: Lane,
        has_frame: Lane,
    ):
        """Return the angle between tool and target [rad], and the shortened rotation vector about the tool's x, y, z.

        xx to zz: the target's axes x, y, z in the frame of the tool, by component (xy: of the target's y along the
        tool's x). has_axis: 1 for targets with an axis or orientation, has_frame: 1 for those with an orientation.

        A quaternion needs no division at half a turn. The axis of half a turn is arbitrary: to reach an axis, the
        rotation is about the tool's own y.
        """
        # 4 q qᵀ of the rotation with these entries: the row with the largest diagonal is q, times a number above 0.
        w, x, y, z = Lane(one) + xx + yy + zz, zy - yz, xz - zx, yx - xy
        most = w
        xs = Lane(one) + xx - yy - zz
        larger = Lane(one) - at_least(most, xs)
        w, x, y, z = (
            select(larger, zy - yz, w), select(larger, xs, x), select(larger, xy + yx, y), select(larger, xz + zx, z)
        )  # fmt: skip
        most = wp.max(most, xs)
        ys = Lane(one) - xx + yy - zz
        larger = Lane(one) - at_least(most, ys)
        w, x, y, z = (
            select(larger, xz - zx, w), select(larger, xy + yx, x), select(larger, ys, y), select(larger, yz + zy, z)
        )  # fmt: skip
        most = wp.max(most, ys)
        zs = Lane(one) - xx - yy + zz
        larger = Lane(one) - at_least(most, zs)
        w, x, y, z = (
            select(larger, yx - xy, w), select(larger, xz + zx, x), select(larger, yz + zy, y), select(larger, zs, z)
        )  # fmt: skip
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

    @wp.func
    def factor_6x6(
        a11: Wide,
        a21: Wide, a22: Wide,
        a31: Wide, a32: Wide, a33: Wide,
        a41: Wide, a42: Wide, a43: Wide, a44: Wide,
        a51: Wide, a52: Wide, a53: Wide, a54: Wide, a55: Wide,
        a61: Wide, a62: Wide, a63: Wide, a64: Wide, a65: Wide, a66: Wide,
    ):  # fmt: skip
        """Factor a symmetric 6 x 6 matrix, given by its lower triangle, as L D Lᵀ: L below its diagonal, then D."""
        d1 = wp.max(a11, least)
        i1 = wp.cw_div(ones, d1)
        l21 = wp.cw_mul(a21, i1)
        l31 = wp.cw_mul(a31, i1)
        l41 = wp.cw_mul(a41, i1)
        l51 = wp.cw_mul(a51, i1)
        l61 = wp.cw_mul(a61, i1)
        a22 -= wp.cw_mul(l21, a21)
        a32 -= wp.cw_mul(l31, a21)
        a33 -= wp.cw_mul(l31, a31)
        a42 -= wp.cw_mul(l41, a21)
        a43 -= wp.cw_mul(l41, a31)
        a44 -= wp.cw_mul(l41, a41)
        a52 -= wp.cw_mul(l51, a21)
        a53 -= wp.cw_mul(l51, a31)
        a54 -= wp.cw_mul(l51, a41)
        a55 -= wp.cw_mul(l51, a51)
        a62 -= wp.cw_mul(l61, a21)
        a63 -= wp.cw_mul(l61, a31)
        a64 -= wp.cw_mul(l61, a41)
        a65 -= wp.cw_mul(l61, a51)
        a66 -= wp.cw_mul(l61, a61)
        d2 = wp.max(a22, least)
        i2 = wp.cw_div(ones, d2)
        l32 = wp.cw_mul(a32, i2)
        l42 = wp.cw_mul(a42, i2)
        l52 = wp.cw_mul(a52, i2)
        l62 = wp.cw_mul(a62, i2)
        a33 -= wp.cw_mul(l32, a32)
        a43 -= wp.cw_mul(l42, a32)
        a44 -= wp.cw_mul(l42, a42)
        a53 -= wp.cw_mul(l52, a32)
        a54 -= wp.cw_mul(l52, a42)
        a55 -= wp.cw_mul(l52, a52)
        a63 -= wp.cw_mul(l62, a32)
        a64 -= wp.cw_mul(l62, a42)
        a65 -= wp.cw_mul(l62, a52)
        a66 -= wp.cw_mul(l62, a62)
        d3 = wp.max(a33, least)
        i3 = wp.cw_div(ones, d3)
        l43 = wp.cw_mul(a43, i3)
        l53 = wp.cw_mul(a53, i3)
        l63 = wp.cw_mul(a63, i3)
        a44 -= wp.cw_mul(l43, a43)
        a54 -= wp.cw_mul(l53, a43)
        a55 -= wp.cw_mul(l53, a53)
        a64 -= wp.cw_mul(l63, a43)
        a65 -= wp.cw_mul(l63, a53)
        a66 -= wp.cw_mul(l63, a63)
        d4 = wp.max(a44, least)
        i4 = wp.cw_div(ones, d4)
        l54 = wp.cw_mul(a54, i4)
        l64 = wp.cw_mul(a64, i4)
        a55 -= wp.cw_mul(l54, a54)
        a65 -= wp.cw_mul(l64, a54)
        a66 -= wp.cw_mul(l64, a64)
        d5 = wp.max(a55, least)
        i5 = wp.cw_div(ones, d5)
        l65 = wp.cw_mul(a65, i5)
        a66 -= wp.cw_mul(l65, a65)
        d6 = wp.max(a66, least)
        return (
            l21,
            l31, l32,
            l41, l42, l43,
            l51, l52, l53, l54,
            l61, l62, l63, l64, l65,
            d1, d2, d3, d4, d5, d6,
        )  # fmt: skip

    @wp.func
    def solve_6x6(
        l21: Wide,
        l31: Wide, l32: Wide,
        l41: Wide, l42: Wide, l43: Wide,
        l51: Wide, l52: Wide, l53: Wide, l54: Wide,
        l61: Wide, l62: Wide, l63: Wide, l64: Wide, l65: Wide,
        d1: Wide, d2: Wide, d3: Wide, d4: Wide, d5: Wide, d6: Wide,
        x1: Wide, x2: Wide, x3: Wide, x4: Wide, x5: Wide, x6: Wide,
    ):  # fmt: skip
        """Solve the factored system."""
        x2 -= wp.cw_mul(l21, x1)
        x3 -= wp.cw_mul(l31, x1)
        x3 -= wp.cw_mul(l32, x2)
        x4 -= wp.cw_mul(l41, x1)
        x4 -= wp.cw_mul(l42, x2)
        x4 -= wp.cw_mul(l43, x3)
        x5 -= wp.cw_mul(l51, x1)
        x5 -= wp.cw_mul(l52, x2)
        x5 -= wp.cw_mul(l53, x3)
        x5 -= wp.cw_mul(l54, x4)
        x6 -= wp.cw_mul(l61, x1)
        x6 -= wp.cw_mul(l62, x2)
        x6 -= wp.cw_mul(l63, x3)
        x6 -= wp.cw_mul(l64, x4)
        x6 -= wp.cw_mul(l65, x5)
        x1 = wp.cw_div(x1, d1)
        x2 = wp.cw_div(x2, d2)
        x3 = wp.cw_div(x3, d3)
        x4 = wp.cw_div(x4, d4)
        x5 = wp.cw_div(x5, d5)
        x6 = wp.cw_div(x6, d6)
        x5 -= wp.cw_mul(l65, x6)
        x4 -= wp.cw_mul(l64, x6)
        x4 -= wp.cw_mul(l54, x5)
        x3 -= wp.cw_mul(l63, x6)
        x3 -= wp.cw_mul(l53, x5)
        x3 -= wp.cw_mul(l43, x4)
        x2 -= wp.cw_mul(l62, x6)
        x2 -= wp.cw_mul(l52, x5)
        x2 -= wp.cw_mul(l42, x4)
        x2 -= wp.cw_mul(l32, x3)
        x1 -= wp.cw_mul(l61, x6)
        x1 -= wp.cw_mul(l51, x5)
        x1 -= wp.cw_mul(l41, x4)
        x1 -= wp.cw_mul(l31, x3)
        x1 -= wp.cw_mul(l21, x2)
        return Lane(x1), Lane(x2), Lane(x3), Lane(x4), Lane(x5), Lane(x6)

    return PoseMath(dot, angular, error_rotation, factor_6x6, solve_6x6)
