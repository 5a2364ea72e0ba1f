"""Warp functions of the normal equations of one update, with J Jᵀ as a.. and J W Jᵀ as b.., by their lower triangles.

All are unrolled by hand, as in `linear_systems`.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import Precision
from armwright.kinematics.arms.lane_math import lane_math
from armwright.kinematics.ik.linear_systems import large_systems, small_systems


@cache
def normal_equations(precision: Precision, lanes: int) -> SimpleNamespace:
    """Return the functions for a precision of the solution and a number of lanes."""
    base, small, large = lane_math(precision, lanes), small_systems(precision, lanes), large_systems(precision, lanes)
    Lane, Wide, roots = base.Lane, base.Wide, base.roots
    determinant, solve_3x3, damping = small.determinant, small.solve_3x3, small.damping
    factor_6x6, solve_6x6 = large.factor_6x6, large.solve_6x6

    max_step = base.real(0.1)  # [m] of the error that one update tries to close

    @wp.func
    def shortened(x: Lane, y: Lane, z: Lane, square: Lane):
        """Return the part of an error that one update tries to close; square: of its length."""
        shorten = wp.cw_div(Lane(max_step), wp.max(roots(square), Lane(max_step)))
        return wp.cw_mul(x, shorten), wp.cw_mul(y, shorten), wp.cw_mul(z, shorten)

    @wp.func
    def no_rows():
        """Return the last three rows of an empty sum."""
        return (
            Wide(), Wide(), Wide(), Wide(), Wide(), Wide(), Wide(), Wide(), Wide(), Wide(), Wide(), Wide(), Wide(),
            Wide(), Wide(),
        )  # fmt: skip

    @wp.func
    def add_linear(
        l1: Wide, l2: Wide, l3: Wide, c1: Wide, c2: Wide, c3: Wide,
        m11: Wide, m21: Wide, m22: Wide, m31: Wide, m32: Wide, m33: Wide,
    ):  # fmt: skip
        """Return the first three rows of a sum with a joint's l cᵀ added."""
        return (
            m11 + wp.cw_mul(l1, c1),
            m21 + wp.cw_mul(l2, c1),
            m22 + wp.cw_mul(l2, c2),
            m31 + wp.cw_mul(l3, c1),
            m32 + wp.cw_mul(l3, c2),
            m33 + wp.cw_mul(l3, c3),
        )

    @wp.func
    def add_angular(
        l4: Wide, l5: Wide, l6: Wide, c1: Wide, c2: Wide, c3: Wide, c4: Wide, c5: Wide, c6: Wide,
        m41: Wide, m42: Wide, m43: Wide, m44: Wide,
        m51: Wide, m52: Wide, m53: Wide, m54: Wide, m55: Wide,
        m61: Wide, m62: Wide, m63: Wide, m64: Wide, m65: Wide, m66: Wide,
    ):  # fmt: skip
        """Return the last three rows of a sum with a joint's l cᵀ added."""
        return (
            m41 + wp.cw_mul(l4, c1),
            m42 + wp.cw_mul(l4, c2),
            m43 + wp.cw_mul(l4, c3),
            m44 + wp.cw_mul(l4, c4),
            m51 + wp.cw_mul(l5, c1),
            m52 + wp.cw_mul(l5, c2),
            m53 + wp.cw_mul(l5, c3),
            m54 + wp.cw_mul(l5, c4),
            m55 + wp.cw_mul(l5, c5),
            m61 + wp.cw_mul(l6, c1),
            m62 + wp.cw_mul(l6, c2),
            m63 + wp.cw_mul(l6, c3),
            m64 + wp.cw_mul(l6, c4),
            m65 + wp.cw_mul(l6, c5),
            m66 + wp.cw_mul(l6, c6),
        )

    @wp.func
    def point_step(
        a11: Wide, a21: Wide, a22: Wide, a31: Wide, a32: Wide, a33: Wide,
        b11: Wide, b21: Wide, b22: Wide, b31: Wide, b32: Wide, b33: Wide,
        d1: Wide, d2: Wide, d3: Wide,
    ):  # fmt: skip
        """Return (J W Jᵀ + k)⁻¹ d, with the damping k."""
        k = Wide(damping(Lane(determinant(a11, a21, a31, a22, a32, a33))))
        return solve_3x3(b11 + k, b21, b31, b22 + k, b32, b33 + k, d1, d2, d3)

    @wp.func
    def pose_step(
        a11: Wide,
        a21: Wide, a22: Wide,
        a31: Wide, a32: Wide, a33: Wide,
        a41: Wide, a42: Wide, a43: Wide, a44: Wide,
        a51: Wide, a52: Wide, a53: Wide, a54: Wide, a55: Wide,
        a61: Wide, a62: Wide, a63: Wide, a64: Wide, a65: Wide, a66: Wide,
        b11: Wide,
        b21: Wide, b22: Wide,
        b31: Wide, b32: Wide, b33: Wide,
        b41: Wide, b42: Wide, b43: Wide, b44: Wide,
        b51: Wide, b52: Wide, b53: Wide, b54: Wide, b55: Wide,
        b61: Wide, b62: Wide, b63: Wide, b64: Wide, b65: Wide, b66: Wide,
        no_xy: Wide, no_z: Wide, d1: Wide, d2: Wide, d3: Wide, d4: Wide, d5: Wide, d6: Wide,
    ):  # fmt: skip
        """Return the same of six rows; no_xy, no_z: 1 for the rows of rotation that a target does not need, else 0."""
        (
            _m21, _m31, _m32, _m41, _m42, _m43, _m51, _m52, _m53, _m54, _m61, _m62, _m63, _m64, _m65,
            p1, p2, p3, p4, p5, p6,
        ) = factor_6x6(
            a11, a21, a22, a31, a32, a33,
            a41, a42, a43, a44 + no_xy, a51, a52, a53, a54, a55 + no_xy, a61, a62, a63, a64, a65, a66 + no_z,
        )  # fmt: skip
        det = wp.cw_mul(wp.cw_mul(wp.cw_mul(p1, p2), wp.cw_mul(p3, p4)), wp.cw_mul(p5, p6))
        k = Wide(damping(Lane(det)))
        l21, l31, l32, l41, l42, l43, l51, l52, l53, l54, l61, l62, l63, l64, l65, p1, p2, p3, p4, p5, p6 = factor_6x6(
            b11 + k, b21, b22 + k, b31, b32, b33 + k, b41, b42, b43, b44 + k + no_xy,
            b51, b52, b53, b54, b55 + k + no_xy, b61, b62, b63, b64, b65, b66 + k + no_z,
        )  # fmt: skip
        return solve_6x6(
            l21, l31, l32, l41, l42, l43, l51, l52, l53, l54, l61, l62, l63, l64, l65, p1, p2, p3, p4, p5, p6,
            d1, d2, d3, d4, d5, d6,
        )  # fmt: skip

    return SimpleNamespace(
        shortened=shortened,
        no_rows=no_rows,
        add_linear=add_linear,
        add_angular=add_angular,
        point_step=point_step,
        pose_step=pose_step,
    )
