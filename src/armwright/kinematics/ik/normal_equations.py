"""Warp functions of the normal equations of one update, in float64: J Jᵀ and J W Jᵀ, and their solution.

Of symmetric matrices the lower triangles count. Warp unrolls loops over constants, and over `wp.static` of the counters
of such loops; a loop that it does not unroll doubles the time of a solution.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import Precision
from armwright.kinematics.arms.lane_math import lane_math


@cache
def normal_equations(precision: Precision, lanes: int) -> SimpleNamespace:
    """Return the variant for a precision of the solution and a number of lanes."""
    base = lane_math(precision, lanes)
    real, Lane, Wide, Vector = base.real, base.Lane, base.Wide, base.Vector
    roots, scaled = base.roots, base.scaled
    Square = wp.types.matrix(shape=(36, lanes), dtype=wp.float64)  # row 6 i + k is the entry (i, k) of 6 x 6
    Rows = wp.types.matrix(shape=(6, lanes), dtype=wp.float64)

    zero, one = real(0.0), real(1.0)
    ones, least = Wide(wp.float64(1.0)), Wide(wp.float64(1e-18))
    max_step = real(0.1)  # [m] of the error that one update tries to close
    least_manipulability = real(0.1)  # below it the update is damped
    full_damping = real(0.001)

    @wp.func
    def shortened(error: Vector, square: Lane):
        """Return the part of an error that one update tries to close; square: of its length."""
        return scaled(wp.cw_div(Lane(max_step), wp.max(roots(square), Lane(max_step))), error)

    @wp.func
    def damping(det: Wide):
        """Return k: 0 where the manipulability, the root of the determinant of J Jᵀ, is large enough."""
        manipulability = roots(wp.max(Lane(det), Lane(zero)))
        lack = wp.max(Lane(zero), Lane(one) - (one / least_manipulability) * manipulability)
        return Wide(full_damping * wp.cw_mul(lack, lack))

    @wp.func
    def determinant(xx: Wide, xy: Wide, yy: Wide, xz: Wide, yz: Wide, zz: Wide):
        """Return the determinant of a symmetric 3 x 3 matrix."""
        return (
            wp.cw_mul(xx, wp.cw_mul(yy, zz) - wp.cw_mul(yz, yz))
            - wp.cw_mul(xy, wp.cw_mul(xy, zz) - wp.cw_mul(yz, xz))
            + wp.cw_mul(xz, wp.cw_mul(xy, yz) - wp.cw_mul(yy, xz))
        )

    @wp.func
    def point_step(
        a11: Wide, a21: Wide, a22: Wide, a31: Wide, a32: Wide, a33: Wide,
        xx: Wide, xy: Wide, yy: Wide, xz: Wide, yz: Wide, zz: Wide, d: Vector,
    ):  # fmt: skip
        """Return (J W Jᵀ + k)⁻¹ d with the damping k, by the adjugate."""
        k = damping(determinant(a11, a21, a22, a31, a32, a33))
        xx += k
        yy += k
        zz += k
        x, y, z = Wide(d[0]), Wide(d[1]), Wide(d[2])
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
        return wp.matrix_from_rows(Lane(vx), Lane(vy), Lane(vz))

    @wp.func
    def factored(a: Square):
        """Return a 6 x 6 matrix as L D Lᵀ: L below the diagonal, D on it, D Lᵀ above."""
        inverse = Rows()  # of D
        for i in range(6):
            for m in range(i):
                for k in range(m):
                    a[6 * i + m] -= wp.cw_mul(a[6 * i + k], a[6 * k + m])
                a[6 * m + i] = a[6 * i + m]
                a[6 * i + m] = wp.cw_mul(a[6 * i + m], inverse[m])
            for k in range(i):
                a[7 * i] -= wp.cw_mul(a[6 * i + k], a[6 * k + i])
            a[7 * i] = wp.max(a[7 * i], least)
            inverse[i] = wp.cw_div(ones, a[7 * i])
        return a

    @wp.func
    def pose_step(jjt: Square, jwjt: Square, linear: Vector, angular: Vector, unused: Vector):
        """Return the same of six rows, as two vectors; unused: 1 for rows of rotation that a target does not need."""
        for i in range(3):
            jjt[7 * (i + 3)] += Wide(unused[i])
        ldl = factored(jjt)
        k = damping(
            wp.cw_mul(wp.cw_mul(wp.cw_mul(ldl[0], ldl[7]), wp.cw_mul(ldl[14], ldl[21])), wp.cw_mul(ldl[28], ldl[35]))
        )
        x = Rows()
        for i in range(6):
            jwjt[7 * i] += k
        for i in range(3):
            jwjt[7 * (i + 3)] += Wide(unused[i])
            x[i] = Wide(linear[i])
            x[i + 3] = Wide(angular[i])
        ldl = factored(jwjt)
        for i in range(6):
            for m in range(i):
                x[i] -= wp.cw_mul(ldl[6 * i + m], x[m])
        for i in range(6):
            x[i] = wp.cw_div(x[i], ldl[7 * i])
        for m in range(5, 0, -1):
            for i in range(m):
                x[i] -= wp.cw_mul(ldl[6 * m + i], x[m])
        return (
            wp.matrix_from_rows(Lane(x[0]), Lane(x[1]), Lane(x[2])),
            wp.matrix_from_rows(Lane(x[3]), Lane(x[4]), Lane(x[5])),
        )

    return SimpleNamespace(Square=Square, Rows=Rows, shortened=shortened, point_step=point_step, pose_step=pose_step)
