"""Warp kernels for targets with an axis or an orientation of the tool.

The targets of a thread may be of all kinds. The system has six rows: three for the position, then the remaining
rotation about the tool's own x, y and z. A row that a target does not need is zero in J and one on the diagonal, so it
neither moves a joint nor changes a determinant. The rest is as in position_kernels.py, with the same sources.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from dataclasses import replace
from functools import cache

import warp as wp

from armwright.kinematics.arm_arrays import Motions, Precision
from armwright.kinematics.ik_math import ik_math, kernel
from armwright.kinematics.pose_math import pose_math
from armwright.kinematics.position_kernels import Kernels, position_kernels


@cache
def pose_kernels(precision: Precision, lanes: int, motions: Motions) -> Kernels:
    """Return the variant of `position_kernels` for targets with an axis or an orientation."""
    base, pose = ik_math(precision, lanes, motions), pose_math(precision, lanes, motions)
    real, Vector3, Lane, Wide, Joints, Arms = base.real, base.Vector3, base.Lane, base.Wide, base.Joints, base.Arms
    roots, at_least, select, norm_squared = base.roots, base.at_least, base.select, base.norm_squared
    advance, column, limit, damping = base.advance, base.column, base.limit, base.damping
    dot, angular, error_rotation = pose.dot, pose.angular, pose.error_rotation
    factor_6x6, solve_6x6 = pose.factor_6x6, pose.solve_6x6

    zero, one, infinity = real(0.0), real(1.0), real(1e30)
    max_step = real(0.1)  # [m] of the error that one update tries to close

    @kernel
    def solve_ik(
        arms: Arms,
        tool_axis: wp.array(dtype=Vector3),
        tool_side: wp.array(dtype=Vector3),
        targets: wp.array2d(dtype=Lane),
        updates: int,
        q_last: wp.array3d(dtype=Lane),
        h_last: wp.array3d(dtype=Lane),
        q_kept: wp.array3d(dtype=Lane),
    ):
        """Inverse kinematics of an arm at a group of targets.

        tool_axis, tool_side: (N,) the tool's z and x in the last local frame, unit vectors at right angles.
        targets: (G, 16): the point [m], the payload [kg], which is not read, the x, y and z of the tool at the target,
        1 if its z counts, 1 if its x counts too, and the metres that a radian of angle error counts as.
        q_last, h_last, q_kept: as in the kernel for points; kept are the angles with the least
        distance² + (angle error in metres)².
        """
        arm, group = wp.tid()
        base = arms.base[arm]
        axis, side = tool_axis[arm], tool_side[arm]
        has_axis, has_frame, metres_per_radian = targets[group, 13], targets[group, 14], targets[group, 15]
        no_xy, no_z = Wide(Lane(one) - has_axis), Wide(Lane(one) - has_frame)
        q, kept = Joints(), Joints()
        limit_n, limit_d = Joints(), Joints()  # H of the update before, n / d: fractions compare without division
        ux, uy, uz = Joints(), Joints(), Joints()  # joint axes, then the position's columns of J
        vx, vy, vz = Joints(), Joints(), Joints()  # joint positions, then the angles' columns of J
        weight, pull = Joints(), Joints()
        for j in range(arms.dof):
            q[j] = q_last[arm, group, j]
            kept[j] = q[j]
            limit_n[j] = h_last[arm, group, j]
            limit_d[j] = Lane(one)
        nearest = Lane(infinity)
        for _ in range(updates):
            # Forward kinematics. xx, xy, xz: the local x axis in the world, and so on.
            xx, xy, xz = Lane(one), Lane(zero), Lane(zero)
            yx, yy, yz = Lane(zero), Lane(one), Lane(zero)
            zx, zy, zz = Lane(zero), Lane(zero), Lane(one)
            px, py, pz = Lane(base[0]), Lane(base[1]), Lane(base[2])
            for j in range(arms.dof):
                xx, xy, xz, yx, yy, yz, zx, zy, zz, ax, ay, az, ox, oy, oz, px, py, pz = advance(
                    arms.motion[arm, j], arms.offset[arm, j], q[j], xx, xy, xz, yx, yy, yz, zx, zy, zz, px, py, pz
                )  # fmt: skip
                ux[j] = ax
                vx[j] = ox
                uy[j] = ay
                vy[j] = oy
                uz[j] = az
                vz[j] = oz

            sx, sy, sz, tx, ty, tz, fx, fy, fz, angle, rotation_x, rotation_y, rotation_z = error_rotation(
                axis, side, group, targets, xx, xy, xz, yx, yy, yz, zx, zy, zz
            )

            # The posture nearest to the target is kept, the earliest of equals.
            ex = targets[group, 0] - px
            ey = targets[group, 1] - py
            ez = targets[group, 2] - pz
            square = norm_squared(ex, ey, ez)
            off = wp.cw_mul(metres_per_radian, angle)
            far = square + wp.cw_mul(off, off)
            nearer = Lane(one) - at_least(far, nearest)
            nearest = wp.min(nearest, far)
            for j in range(arms.dof):
                kept[j] = select(nearer, q[j], kept[j])

            # dx, shortened; J Jᵀ as a.., J W Jᵀ as b..; the pull y is taken out of dx, because
            # J# dx + (I - J# J) y = y + J# (dx - J y).
            shorten = wp.cw_div(Lane(max_step), wp.max(roots(square), Lane(max_step)))
            d1 = wp.cw_mul(ex, shorten)
            d2 = wp.cw_mul(ey, shorten)
            d3 = wp.cw_mul(ez, shorten)
            d4 = wp.cw_mul(has_axis, rotation_x)
            d5 = wp.cw_mul(has_axis, rotation_y)
            d6 = wp.cw_mul(has_frame, rotation_z)
            a11 = Wide()
            a21, a22 = Wide(), Wide()
            a31, a32, a33 = Wide(), Wide(), Wide()
            a41, a42, a43, a44 = Wide(), Wide(), Wide(), Wide()
            a51, a52, a53, a54, a55 = Wide(), Wide(), Wide(), Wide(), Wide()
            a61, a62, a63, a64, a65, a66 = Wide(), Wide(), Wide(), Wide(), Wide(), Wide()
            b11 = Wide()
            b21, b22 = Wide(), Wide()
            b31, b32, b33 = Wide(), Wide(), Wide()
            b41, b42, b43, b44 = Wide(), Wide(), Wide(), Wide()
            b51, b52, b53, b54, b55 = Wide(), Wide(), Wide(), Wide(), Wide()
            b61, b62, b63, b64, b65, b66 = Wide(), Wide(), Wide(), Wide(), Wide(), Wide()
            for j in range(arms.dof):
                motion = arms.motion[arm, j]
                n, d, w, y = limit(motion, arms.lower[arm, j], arms.upper[arm, j], q[j], limit_n[j], limit_d[j])
                limit_n[j] = n
                limit_d[j] = d

                ax, ay, az = ux[j], uy[j], uz[j]
                rx = px - vx[j]
                ry = py - vy[j]
                rz = pz - vz[j]
                jx = column(motion, ax, ay, az, ry, rz)
                jy = column(motion, ay, az, ax, rz, rx)
                jz = column(motion, az, ax, ay, rx, ry)
                gx = wp.cw_mul(has_axis, angular(motion, dot(sx, sy, sz, ax, ay, az)))
                gy = wp.cw_mul(has_axis, angular(motion, dot(tx, ty, tz, ax, ay, az)))
                gz = wp.cw_mul(has_frame, angular(motion, dot(fx, fy, fz, ax, ay, az)))
                d1 -= wp.cw_mul(jx, y)
                d2 -= wp.cw_mul(jy, y)
                d3 -= wp.cw_mul(jz, y)
                d4 -= wp.cw_mul(gx, y)
                d5 -= wp.cw_mul(gy, y)
                d6 -= wp.cw_mul(gz, y)
                ux[j] = jx
                uy[j] = jy
                uz[j] = jz
                vx[j] = gx
                vy[j] = gy
                vz[j] = gz
                weight[j] = w
                pull[j] = y

                c1, c2, c3, c4, c5, c6 = Wide(jx), Wide(jy), Wide(jz), Wide(gx), Wide(gy), Wide(gz)
                ww = Wide(w)
                w1, w2, w3 = wp.cw_mul(ww, c1), wp.cw_mul(ww, c2), wp.cw_mul(ww, c3)
                w4, w5, w6 = wp.cw_mul(ww, c4), wp.cw_mul(ww, c5), wp.cw_mul(ww, c6)
                a11 += wp.cw_mul(c1, c1)
                a21 += wp.cw_mul(c2, c1)
                a22 += wp.cw_mul(c2, c2)
                a31 += wp.cw_mul(c3, c1)
                a32 += wp.cw_mul(c3, c2)
                a33 += wp.cw_mul(c3, c3)
                a41 += wp.cw_mul(c4, c1)
                a42 += wp.cw_mul(c4, c2)
                a43 += wp.cw_mul(c4, c3)
                a44 += wp.cw_mul(c4, c4)
                a51 += wp.cw_mul(c5, c1)
                a52 += wp.cw_mul(c5, c2)
                a53 += wp.cw_mul(c5, c3)
                a54 += wp.cw_mul(c5, c4)
                a55 += wp.cw_mul(c5, c5)
                a61 += wp.cw_mul(c6, c1)
                a62 += wp.cw_mul(c6, c2)
                a63 += wp.cw_mul(c6, c3)
                a64 += wp.cw_mul(c6, c4)
                a65 += wp.cw_mul(c6, c5)
                a66 += wp.cw_mul(c6, c6)
                b11 += wp.cw_mul(w1, c1)
                b21 += wp.cw_mul(w2, c1)
                b22 += wp.cw_mul(w2, c2)
                b31 += wp.cw_mul(w3, c1)
                b32 += wp.cw_mul(w3, c2)
                b33 += wp.cw_mul(w3, c3)
                b41 += wp.cw_mul(w4, c1)
                b42 += wp.cw_mul(w4, c2)
                b43 += wp.cw_mul(w4, c3)
                b44 += wp.cw_mul(w4, c4)
                b51 += wp.cw_mul(w5, c1)
                b52 += wp.cw_mul(w5, c2)
                b53 += wp.cw_mul(w5, c3)
                b54 += wp.cw_mul(w5, c4)
                b55 += wp.cw_mul(w5, c5)
                b61 += wp.cw_mul(w6, c1)
                b62 += wp.cw_mul(w6, c2)
                b63 += wp.cw_mul(w6, c3)
                b64 += wp.cw_mul(w6, c4)
                b65 += wp.cw_mul(w6, c5)
                b66 += wp.cw_mul(w6, c6)

            (
                _m21, _m31, _m32, _m41, _m42, _m43, _m51, _m52, _m53, _m54, _m61, _m62, _m63, _m64, _m65,
                p1, p2, p3, p4, p5, p6,
            ) = factor_6x6(
                a11,
                a21, a22,
                a31, a32, a33,
                a41, a42, a43, a44 + no_xy,
                a51, a52, a53, a54, a55 + no_xy,
                a61, a62, a63, a64, a65, a66 + no_z,
            )  # fmt: skip
            det = wp.cw_mul(wp.cw_mul(wp.cw_mul(p1, p2), wp.cw_mul(p3, p4)), wp.cw_mul(p5, p6))
            k = Wide(damping(Lane(det)))
            (
                l21, l31, l32, l41, l42, l43, l51, l52, l53, l54, l61, l62, l63, l64, l65, p1, p2, p3, p4, p5, p6,
            ) = factor_6x6(
                b11 + k,
                b21, b22 + k,
                b31, b32, b33 + k,
                b41, b42, b43, b44 + k + no_xy,
                b51, b52, b53, b54, b55 + k + no_xy,
                b61, b62, b63, b64, b65, b66 + k + no_z,
            )  # fmt: skip
            s1, s2, s3, s4, s5, s6 = solve_6x6(
                l21, l31, l32, l41, l42, l43, l51, l52, l53, l54, l61, l62, l63, l64, l65, p1, p2, p3, p4, p5, p6,
                Wide(d1), Wide(d2), Wide(d3), Wide(d4), Wide(d5), Wide(d6),
            )  # fmt: skip
            for j in range(arms.dof):
                step = wp.cw_mul(ux[j], s1) + wp.cw_mul(uy[j], s2) + wp.cw_mul(uz[j], s3)
                step += wp.cw_mul(vx[j], s4) + wp.cw_mul(vy[j], s5) + wp.cw_mul(vz[j], s6)
                moved = q[j] + pull[j] + wp.cw_mul(weight[j], step)
                q[j] = wp.min(wp.max(moved, Lane(arms.lower[arm, j])), Lane(arms.upper[arm, j]))

        for j in range(arms.dof):
            q_last[arm, group, j] = q[j]
            h_last[arm, group, j] = wp.cw_div(limit_n[j], limit_d[j])
            q_kept[arm, group, j] = kept[j]

    @wp.func
    def pose_error(
        arms: Arms,
        axis: Vector3,
        side: Vector3,
        arm: int,
        group: int,
        targets: wp.array2d(dtype=Lane),
        q: wp.array3d(dtype=Lane),
    ):
        """Return distance² + (angle error in metres)² at angles q (N, G, D), and the angle error [rad]."""
        base = arms.base[arm]
        xx, xy, xz = Lane(one), Lane(zero), Lane(zero)
        yx, yy, yz = Lane(zero), Lane(one), Lane(zero)
        zx, zy, zz = Lane(zero), Lane(zero), Lane(one)
        px, py, pz = Lane(base[0]), Lane(base[1]), Lane(base[2])
        for j in range(arms.dof):
            xx, xy, xz, yx, yy, yz, zx, zy, zz, _ax, _ay, _az, _ox, _oy, _oz, px, py, pz = advance(
                arms.motion[arm, j], arms.offset[arm, j], q[arm, group, j],
                xx, xy, xz, yx, yy, yz, zx, zy, zz, px, py, pz,
            )  # fmt: skip
        _sx, _sy, _sz, _tx, _ty, _tz, _fx, _fy, _fz, angle, _x, _y, _z = error_rotation(
            axis, side, group, targets, xx, xy, xz, yx, yy, yz, zx, zy, zz
        )
        off = wp.cw_mul(targets[group, 15], angle)
        distance = norm_squared(targets[group, 0] - px, targets[group, 1] - py, targets[group, 2] - pz)
        return distance + wp.cw_mul(off, off), angle

    @kernel
    def keep_pose(
        arms: Arms,
        tool_axis: wp.array(dtype=Vector3),
        tool_side: wp.array(dtype=Vector3),
        targets: wp.array2d(dtype=Lane),
        q_last: wp.array3d(dtype=Lane),
        q_kept: wp.array3d(dtype=Lane),
        angle_error: wp.array3d(dtype=Lane),
    ):
        """Keep the last posture if it is nearer, and return the angle error of the tool.

        angle_error: (N, G, 1) [rad]; 0 for a point.
        """
        arm, group = wp.tid()
        axis, side = tool_axis[arm], tool_side[arm]
        last, last_angle = pose_error(arms, axis, side, arm, group, targets, q_last)
        kept, kept_angle = pose_error(arms, axis, side, arm, group, targets, q_kept)
        is_kept = at_least(last, kept)
        angle_error[arm, group, 0] = select(is_kept, kept_angle, last_angle)
        for j in range(arms.dof):
            q_kept[arm, group, j] = select(is_kept, q_kept[arm, group, j], q_last[arm, group, j])

    return replace(position_kernels(precision, lanes, motions), solve_ik=solve_ik, keep_pose=keep_pose)
