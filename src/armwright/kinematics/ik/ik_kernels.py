"""Warp kernels of inverse kinematics and static torque.

Each thread solves one arm for as many targets as there are lanes, one in each lane of a vector, so the vector
instructions of a CPU solve eight targets at a time. A GPU has its own threads for that and uses one lane.

There are kernels for points and for poses, compiled from the same source (`wp.static`). The targets of a thread of the
latter may be of all kinds: points, and poses with an axis or an orientation of the tool. Their system has six rows,
three for the position, then the remaining rotation about the tool's own x, y and z. A row that a target does not need
is zero in J and one on the diagonal, so it neither moves a joint nor changes a determinant.

docs/method.md §2 states the equations. Their sources, by symbol:

    e, clip     shortened error, joint limits                         jskeus and scikit-robot
    J           position Jacobian, column u x r of a revolute joint   Whitney 1969
    m           manipulability sqrt(det J Jᵀ)                         Yoshikawa 1985
    k           damping near singularities                            Nakamura & Hanafusa 1986
    H           gradient of the joint-limit criterion                 Chan & Dubey 1995, after Zghal et al. 1990
    w           weights 1 / (1 + H) of joints that near a limit       Chan & Dubey 1995
    J#          damped weighted least-norm inverse                    Chan & Dubey 1995
    y           null-space pull to mid-range                          Liégeois 1977, as in Sugiura et al. 2007

T. F. Chan, R. V. Dubey: A weighted least-norm solution based scheme for avoiding joint limits for redundant joint
manipulators, IEEE Trans. Robotics and Automation 11(2), 286-292, 1995. A. Liégeois: Automatic supervisory control of
the configuration and behavior of multibody mechanisms, IEEE Trans. SMC 7(12), 1977. Y. Nakamura, H. Hanafusa: Inverse
kinematic solutions with singularity robustness for robot manipulator control, ASME J. DSMC 108(3), 1986. H. Sugiura et
al.: Real-time self collision avoidance for humanoids by means of nullspace criteria and task intervals, Humanoids 2007.
D. E. Whitney: Resolved motion rate control of manipulators and human prostheses, IEEE Trans. MMS 10(2), 1969.
T. Yoshikawa: Manipulability of robotic mechanisms, Int. J. Robotics Research 4(2), 1985. H. Zghal, R. V. Dubey,
J. A. Euler: Efficient gradient projection optimization for manipulators with multiple degrees of redundancy, ICRA 1990.

Angles, positions and torques have the precision of the variant. The system is float64 in every variant: its matrix
squares the condition of the Jacobian, and weights near the joint limits (down to 2.5e-4 at ±2.4 rad) add to it.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, PRISMATIC, Motions, Precision, TargetKind
from armwright.kinematics.arms.ik_math import ik_math, kernel
from armwright.kinematics.arms.pose_math import pose_math
from armwright.kinematics.ik.linear_systems import linear_systems
from armwright.robot.arm import GRAVITY


@dataclass(frozen=True)
class Kernels:
    """One variant of the kernels. Each compiles when it is first loaded, and is cached on disk."""

    Lane: Any  # a vector of one number per lane
    Arms: Any  # `ArmArrays` on the device, a Warp struct
    solve_ik: Any
    static_torque: Any  # and the best posture, its tip and its angle error


@cache
def ik_kernels(precision: Precision, lanes: int, motions: Motions, kind: TargetKind) -> Kernels:
    """Return the kernels that solve `lanes` targets per thread in this precision, for these joint motions and targets.

    One long function on purpose: code that Warp compiles takes its types and constants from the enclosing function.
    T targets form G groups: target g x lanes + i is in lane i of group g; the last target fills its group.
    """
    base = ik_math(precision, lanes, motions)
    real, Lane, Wide, Joints, Arms = base.real, base.Lane, base.Wide, base.Joints, base.Arms
    roots, at_least, select, norm_squared = base.roots, base.at_least, base.select, base.norm_squared
    advance, column, limit, damping = base.advance, base.column, base.limit, base.damping
    rotations, systems = pose_math(precision, lanes, motions), linear_systems(precision, lanes)
    dot, angular, error_rotation = rotations.dot, rotations.angular, rotations.error_rotation
    determinant, solve_3x3 = systems.determinant, systems.solve_3x3
    factor_6x6, solve_6x6 = systems.factor_6x6, systems.solve_6x6
    pose = kind == "pose"

    zero, one, gravity, infinity = real(0.0), real(1.0), real(GRAVITY), real(1e30)
    max_step = real(0.1)  # [m] of the error that one update tries to close

    @kernel
    def solve_ik(
        arms: Arms,
        targets: wp.array2d(dtype=Lane),
        updates: int,
        q_last: wp.array3d(dtype=Lane),
        h_last: wp.array3d(dtype=Lane),
        q_kept: wp.array3d(dtype=Lane),
    ):
        """Inverse kinematics of an arm at a group of targets.

        targets: (G, 4) the point [m] and the payload [kg], which is not read; (G, 16) for poses, followed by the x, y
        and z of the tool at the target, 1 if its z counts, 1 if its x counts too, and the metres per radian of error.
        q_last: (N, G, D), the initial angles, then those after the last update [rad].
        h_last: (N, G, D), the limit gradients H before the first, then of the last update.
        q_kept: (N, G, D), the angles of all but the last with the least distance² + (angle error in metres)².

        One long function on purpose: the arrays over joints live in its registers and stack; passing them to
        functions copies them, which made a prototype three times slower.
        """
        arm, group = wp.tid()
        base = arms.base[arm]
        if wp.static(pose):
            has_axis, has_frame, metres_per_radian = targets[group, 13], targets[group, 14], targets[group, 15]
            axis, side = arms.tool_axis[arm], arms.tool_side[arm]
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

            # The posture nearest to the target is kept, the earliest of equals.
            ex = targets[group, 0] - px
            ey = targets[group, 1] - py
            ez = targets[group, 2] - pz
            square = norm_squared(ex, ey, ez)
            far = square
            if wp.static(pose):
                sx, sy, sz, tx, ty, tz, fx, fy, fz, angle, rotation_x, rotation_y, rotation_z = error_rotation(
                    axis, side, group, targets, xx, xy, xz, yx, yy, yz, zx, zy, zz
                )  # fmt: skip
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
            a11, a21, a22, a31, a32, a33 = Wide(), Wide(), Wide(), Wide(), Wide(), Wide()
            b11, b21, b22, b31, b32, b33 = Wide(), Wide(), Wide(), Wide(), Wide(), Wide()
            if wp.static(pose):
                d4 = wp.cw_mul(has_axis, rotation_x)
                d5 = wp.cw_mul(has_axis, rotation_y)
                d6 = wp.cw_mul(has_frame, rotation_z)
                a41, a42, a43, a44 = Wide(), Wide(), Wide(), Wide()
                a51, a52, a53, a54, a55 = Wide(), Wide(), Wide(), Wide(), Wide()
                a61, a62, a63, a64, a65, a66 = Wide(), Wide(), Wide(), Wide(), Wide(), Wide()
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
                if wp.static(pose):
                    gx = wp.cw_mul(has_axis, angular(motion, dot(sx, sy, sz, ax, ay, az)))
                    gy = wp.cw_mul(has_axis, angular(motion, dot(tx, ty, tz, ax, ay, az)))
                    gz = wp.cw_mul(has_frame, angular(motion, dot(fx, fy, fz, ax, ay, az)))
                d1 -= wp.cw_mul(jx, y)
                d2 -= wp.cw_mul(jy, y)
                d3 -= wp.cw_mul(jz, y)
                ux[j] = jx
                uy[j] = jy
                uz[j] = jz
                weight[j] = w
                pull[j] = y

                ww = Wide(w)
                c1, c2, c3 = Wide(jx), Wide(jy), Wide(jz)
                w1, w2, w3 = wp.cw_mul(ww, c1), wp.cw_mul(ww, c2), wp.cw_mul(ww, c3)
                a11 += wp.cw_mul(c1, c1)
                a21 += wp.cw_mul(c2, c1)
                a22 += wp.cw_mul(c2, c2)
                a31 += wp.cw_mul(c3, c1)
                a32 += wp.cw_mul(c3, c2)
                a33 += wp.cw_mul(c3, c3)
                b11 += wp.cw_mul(w1, c1)
                b22 += wp.cw_mul(w2, c2)
                b33 += wp.cw_mul(w3, c3)
                if wp.static(pose):
                    b21 += wp.cw_mul(w2, c1)
                    b31 += wp.cw_mul(w3, c1)
                    b32 += wp.cw_mul(w3, c2)
                    d4 -= wp.cw_mul(gx, y)
                    d5 -= wp.cw_mul(gy, y)
                    d6 -= wp.cw_mul(gz, y)
                    vx[j] = gx
                    vy[j] = gy
                    vz[j] = gz
                    c4, c5, c6 = Wide(gx), Wide(gy), Wide(gz)
                    w4, w5, w6 = wp.cw_mul(ww, c4), wp.cw_mul(ww, c5), wp.cw_mul(ww, c6)
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
                else:
                    b21 += wp.cw_mul(w1, c2)
                    b31 += wp.cw_mul(w1, c3)
                    b32 += wp.cw_mul(w2, c3)

            if wp.static(pose):
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
            else:
                k = Wide(damping(Lane(determinant(a11, a21, a31, a22, a32, a33))))
                s1, s2, s3 = solve_3x3(b11 + k, b21, b31, b22 + k, b32, b33 + k, Wide(d1), Wide(d2), Wide(d3))
            for j in range(arms.dof):
                step = wp.cw_mul(ux[j], s1) + wp.cw_mul(uy[j], s2) + wp.cw_mul(uz[j], s3)
                if wp.static(pose):
                    step += wp.cw_mul(vx[j], s4) + wp.cw_mul(vy[j], s5) + wp.cw_mul(vz[j], s6)
                moved = q[j] + pull[j] + wp.cw_mul(weight[j], step)
                q[j] = wp.min(wp.max(moved, Lane(arms.lower[arm, j])), Lane(arms.upper[arm, j]))

        for j in range(arms.dof):
            q_last[arm, group, j] = q[j]
            h_last[arm, group, j] = wp.cw_div(limit_n[j], limit_d[j])
            q_kept[arm, group, j] = kept[j]

    @wp.func
    def tip_error(arms: Arms, arm: int, group: int, targets: wp.array2d(dtype=Lane), q: wp.array3d(dtype=Lane)):
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
        square = norm_squared(targets[group, 0] - px, targets[group, 1] - py, targets[group, 2] - pz)
        if wp.static(pose):
            _sx, _sy, _sz, _tx, _ty, _tz, _fx, _fy, _fz, angle, _x, _y, _z = error_rotation(
                arms.tool_axis[arm], arms.tool_side[arm], group, targets, xx, xy, xz, yx, yy, yz, zx, zy, zz
            )  # fmt: skip
            off = wp.cw_mul(targets[group, 15], angle)
            return square + wp.cw_mul(off, off), angle
        return square, Lane(zero)

    @wp.func
    def gravity_load(motion: int, ax: Lane, ay: Lane, az: Lane, lever_x: Lane, lever_y: Lane, mass: Lane):
        """Return the derivative of mass times height by a joint with this axis."""
        if motion < PRISMATIC:
            return wp.cw_mul(ax, lever_y) - wp.cw_mul(ay, lever_x)
        if motion < FIXED:
            return wp.cw_mul(mass, az)
        return Lane(zero)

    @kernel
    def static_torque(
        arms: Arms,
        targets: wp.array2d(dtype=Lane),
        q_last: wp.array3d(dtype=Lane),
        q_kept: wp.array3d(dtype=Lane),
        reached: wp.array3d(dtype=Lane),
        torque: wp.array3d(dtype=Lane),
        angle_error: wp.array3d(dtype=Lane),
    ):
        """Keep the last posture if it is nearer, and compute its tip position and its torque against gravity.

        targets: as in `solve_ik`.  q_last, q_kept: (N, G, D) [rad] or [m].  reached: (N, G, 3) [m].
        torque: (N, G, D), +dV/dq [N m] or [N].  angle_error: (N, G, 1) [rad], 0 for points.
        """
        arm, group = wp.tid()
        last, last_angle = tip_error(arms, arm, group, targets, q_last)
        kept, kept_angle = tip_error(arms, arm, group, targets, q_kept)
        is_kept = at_least(last, kept)
        angle_error[arm, group, 0] = select(is_kept, kept_angle, last_angle)

        ux, uy, uz = Joints(), Joints(), Joints()  # joint axes
        place_x, place_y = Joints(), Joints()  # joint positions
        mx, my = Joints(), Joints()  # mass times position of what joint j carries up to the next
        base = arms.base[arm]
        xx, xy, xz = Lane(one), Lane(zero), Lane(zero)
        yx, yy, yz = Lane(zero), Lane(one), Lane(zero)
        zx, zy, zz = Lane(zero), Lane(zero), Lane(one)
        px, py, pz = Lane(base[0]), Lane(base[1]), Lane(base[2])
        for j in range(arms.dof):
            q = select(is_kept, q_kept[arm, group, j], q_last[arm, group, j])
            q_kept[arm, group, j] = q
            xx, xy, xz, yx, yy, yz, zx, zy, zz, ax, ay, az, ox, oy, _oz, px, py, pz = advance(
                arms.motion[arm, j], arms.offset[arm, j], q, xx, xy, xz, yx, yy, yz, zx, zy, zz, px, py, pz
            )
            ux[j] = ax
            uy[j] = ay
            uz[j] = az
            place_x[j] = ox
            place_y[j] = oy
            com = arms.com[arm, j]
            mass = arms.mass[arm, j]
            mx[j] = mass * (ox + com[0] * xx + com[1] * yx + com[2] * zx)
            my[j] = mass * (oy + com[0] * xy + com[1] * yy + com[2] * zy)
        reached[arm, group, 0] = px
        reached[arm, group, 1] = py
        reached[arm, group, 2] = pz

        mass_beyond = targets[group, 3]
        center = arms.payload_center[arm]
        beyond_x = wp.cw_mul(mass_beyond, px + (center[0] * xx + center[1] * yx + center[2] * zx))  # mass x position
        beyond_y = wp.cw_mul(mass_beyond, py + (center[0] * xy + center[1] * yy + center[2] * zy))
        for step in range(arms.dof):
            j = arms.dof - 1 - step
            mass_beyond += Lane(arms.mass[arm, j])
            beyond_x += mx[j]
            beyond_y += my[j]
            lever_x = beyond_x - wp.cw_mul(mass_beyond, place_x[j])
            lever_y = beyond_y - wp.cw_mul(mass_beyond, place_y[j])
            torque[arm, group, j] = gravity * gravity_load(
                arms.motion[arm, j], ux[j], uy[j], uz[j], lever_x, lever_y, mass_beyond
            )

    return Kernels(Lane, Arms, solve_ik, static_torque)
