"""Warp functions for the symmetric linear systems of inverse kinematics, in float64."""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import Precision
from armwright.kinematics.arms.lane_math import lane_math


@cache
def small_systems(precision: Precision, lanes: int) -> SimpleNamespace:
    """Return the functions for a precision of the solution and a number of lanes."""
    base = lane_math(precision, lanes)
    real, Lane, Wide, roots = base.real, base.Lane, base.Wide, base.roots
    zero, one = real(0.0), real(1.0)
    ones = Wide(wp.float64(1.0))
    least_manipulability = real(0.1)  # below it the update is damped
    full_damping = real(0.001)

    @wp.func
    def determinant(xx: Wide, xy: Wide, xz: Wide, yy: Wide, yz: Wide, zz: Wide):
        """Return the determinant of a symmetric 3 x 3 matrix."""
        return (
            wp.cw_mul(xx, wp.cw_mul(yy, zz) - wp.cw_mul(yz, yz))
            - wp.cw_mul(xy, wp.cw_mul(xy, zz) - wp.cw_mul(yz, xz))
            + wp.cw_mul(xz, wp.cw_mul(xy, yz) - wp.cw_mul(yy, xz))
        )

    @wp.func
    def solve_3x3(xx: Wide, xy: Wide, xz: Wide, yy: Wide, yz: Wide, zz: Wide, x: Wide, y: Wide, z: Wide):
        """Return the solution of a symmetric 3 x 3 system by its adjugate."""
        cxx = wp.cw_mul(yy, zz) - wp.cw_mul(yz, yz)
        cxy = wp.cw_mul(xz, yz) - wp.cw_mul(xy, zz)
        cxz = wp.cw_mul(xy, yz) - wp.cw_mul(xz, yy)
        cyy = wp.cw_mul(xx, zz) - wp.cw_mul(xz, xz)
        cyz = wp.cw_mul(xy, xz) - wp.cw_mul(xx, yz)
        czz = wp.cw_mul(xx, yy) - wp.cw_mul(xy, xy)
        scale = wp.cw_div(ones, wp.cw_mul(xx, cxx) + wp.cw_mul(xy, cxy) + wp.cw_mul(xz, cxz))
        vx = wp.cw_mul(scale, wp.cw_mul(cxx, x) + wp.cw_mul(cxy, y) + wp.cw_mul(cxz, z))
        vy = wp.cw_mul(scale, wp.cw_mul(cxy, x) + wp.cw_mul(cyy, y) + wp.cw_mul(cyz, z))
        vz = wp.cw_mul(scale, wp.cw_mul(cxz, x) + wp.cw_mul(cyz, y) + wp.cw_mul(czz, z))
        return Lane(vx), Lane(vy), Lane(vz)

    @wp.func
    def damping(det_jjt: Lane):
        """Return k: 0 where the manipulability sqrt(det J Jᵀ) is large enough."""
        manipulability = roots(wp.max(det_jjt, Lane(zero)))
        lack = wp.max(Lane(zero), Lane(one) - (one / least_manipulability) * manipulability)
        return full_damping * wp.cw_mul(lack, lack)

    return SimpleNamespace(determinant=determinant, solve_3x3=solve_3x3, damping=damping)


@cache
def large_systems(precision: Precision, lanes: int) -> SimpleNamespace:
    """Return the functions for a precision of the solution and a number of lanes."""
    base = lane_math(precision, lanes)
    Lane, Wide = base.Lane, base.Wide
    ones, least = Wide(wp.float64(1.0)), Wide(wp.float64(1e-18))

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

    return SimpleNamespace(factor_6x6=factor_6x6, solve_6x6=solve_6x6)
