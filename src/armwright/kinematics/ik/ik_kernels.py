"""Warp kernels of inverse kinematics.

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

There are N arms of up to D joints. T targets form G groups: target g x lanes + i is in lane i of group g, and the last
target fills its group. Arrays of the kernels, in lanes:

    targets     (G, 4) the point [m] and the payload [kg]; (G, 16) for poses, followed by the x, y and z of the tool at
                the target, 1 if its z counts, 1 if its x counts too, and the metres per radian of error
    q_last      (N, G, D) the initial angles, then those after the last update [rad] or [m]
    h_last      (N, G, D) the limit gradients H before the first, then of the last update
    q_kept      (N, G, D) the angles of all but the last with the least distance² + (angle error in metres)²

Angles, positions and torques have the precision of the variant. The system is float64 in every variant: its matrix
squares the condition of the Jacobian, and weights near the joint limits (down to 2.5e-4 at ±2.4 rad) add to it.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import Motions, Precision, TargetKind
from armwright.kinematics.arms.ik_math import ik_math, kernel
from armwright.kinematics.arms.lane_math import lane_math
from armwright.kinematics.arms.pose_math import pose_math
from armwright.kinematics.ik.normal_equations import normal_equations
from armwright.kinematics.ik.static_torque import static_torque_kernel


@cache
def ik_kernels(precision: Precision, lanes: int, motions: Motions, kind: TargetKind) -> SimpleNamespace:
    """Return the kernels that solve `lanes` targets per thread in this precision, for these motions and targets."""
    base, chain = lane_math(precision, lanes), ik_math(precision, lanes, motions)
    rotations, equations = pose_math(precision, lanes, motions), normal_equations(precision, lanes)
    real, Lane, Wide, Joints, Arms = base.real, base.Lane, base.Wide, chain.Joints, chain.Arms
    at_least, select, norm_squared = base.at_least, base.select, base.norm_squared
    at_base, advance, columns, limit = chain.at_base, chain.advance, chain.columns, chain.limit
    angular_columns, error_rotation = rotations.angular_columns, rotations.error_rotation
    shortened, no_rows, pose_step = equations.shortened, equations.no_rows, equations.pose_step
    add_linear, add_angular, point_step = equations.add_linear, equations.add_angular, equations.point_step
    static_torque = static_torque_kernel(precision, lanes, motions, kind)
    pose, one, infinity = kind == "pose", real(1.0), real(1e30)

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

        The arrays over joints live in its registers and stack. Passing them to functions copies them, which made a
        prototype three times slower.
        """
        arm, group = wp.tid()
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
            xx, xy, xz, yx, yy, yz, zx, zy, zz, px, py, pz = at_base(arms.base[arm])
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

            # dx, shortened; the pull y is taken out of dx, because J# dx + (I - J# J) y = y + J# (dx - J y).
            d1, d2, d3 = shortened(ex, ey, ez, square)
            a11, a21, a22, a31, a32, a33 = Wide(), Wide(), Wide(), Wide(), Wide(), Wide()
            b11, b21, b22, b31, b32, b33 = Wide(), Wide(), Wide(), Wide(), Wide(), Wide()
            if wp.static(pose):
                d4, d5 = wp.cw_mul(has_axis, rotation_x), wp.cw_mul(has_axis, rotation_y)
                d6 = wp.cw_mul(has_frame, rotation_z)
                a41, a42, a43, a44, a51, a52, a53, a54, a55, a61, a62, a63, a64, a65, a66 = no_rows()
                b41, b42, b43, b44, b51, b52, b53, b54, b55, b61, b62, b63, b64, b65, b66 = no_rows()
            for j in range(arms.dof):
                motion = arms.motion[arm, j]
                n, d, w, y = limit(motion, arms.lower[arm, j], arms.upper[arm, j], q[j], limit_n[j], limit_d[j])
                limit_n[j] = n
                limit_d[j] = d
                ax, ay, az = ux[j], uy[j], uz[j]
                jx, jy, jz = columns(motion, ax, ay, az, px - vx[j], py - vy[j], pz - vz[j])
                d1 -= wp.cw_mul(jx, y)
                d2 -= wp.cw_mul(jy, y)
                d3 -= wp.cw_mul(jz, y)
                ux[j] = jx
                uy[j] = jy
                uz[j] = jz
                weight[j] = w
                pull[j] = y
                ww, c1, c2, c3 = Wide(w), Wide(jx), Wide(jy), Wide(jz)
                w1, w2, w3 = wp.cw_mul(ww, c1), wp.cw_mul(ww, c2), wp.cw_mul(ww, c3)
                a11, a21, a22, a31, a32, a33 = add_linear(c1, c2, c3, c1, c2, c3, a11, a21, a22, a31, a32, a33)
                if wp.static(pose):
                    b11, b21, b22, b31, b32, b33 = add_linear(w1, w2, w3, c1, c2, c3, b11, b21, b22, b31, b32, b33)
                    gx, gy, gz = angular_columns(
                        motion, has_axis, has_frame, sx, sy, sz, tx, ty, tz, fx, fy, fz, ax, ay, az
                    )
                    d4 -= wp.cw_mul(gx, y)
                    d5 -= wp.cw_mul(gy, y)
                    d6 -= wp.cw_mul(gz, y)
                    vx[j] = gx
                    vy[j] = gy
                    vz[j] = gz
                    c4, c5, c6 = Wide(gx), Wide(gy), Wide(gz)
                    w4, w5, w6 = wp.cw_mul(ww, c4), wp.cw_mul(ww, c5), wp.cw_mul(ww, c6)
                    a41, a42, a43, a44, a51, a52, a53, a54, a55, a61, a62, a63, a64, a65, a66 = add_angular(
                        c4, c5, c6, c1, c2, c3, c4, c5, c6,
                        a41, a42, a43, a44, a51, a52, a53, a54, a55, a61, a62, a63, a64, a65, a66,
                    )  # fmt: skip
                    b41, b42, b43, b44, b51, b52, b53, b54, b55, b61, b62, b63, b64, b65, b66 = add_angular(
                        w4, w5, w6, c1, c2, c3, c4, c5, c6,
                        b41, b42, b43, b44, b51, b52, b53, b54, b55, b61, b62, b63, b64, b65, b66,
                    )  # fmt: skip
                else:
                    b11, b21, b22, b31, b32, b33 = add_linear(c1, c2, c3, w1, w2, w3, b11, b21, b22, b31, b32, b33)

            if wp.static(pose):
                s1, s2, s3, s4, s5, s6 = pose_step(
                    a11, a21, a22, a31, a32, a33, a41, a42, a43, a44, a51, a52, a53, a54, a55,
                    a61, a62, a63, a64, a65, a66,
                    b11, b21, b22, b31, b32, b33, b41, b42, b43, b44, b51, b52, b53, b54, b55,
                    b61, b62, b63, b64, b65, b66,
                    no_xy, no_z, Wide(d1), Wide(d2), Wide(d3), Wide(d4), Wide(d5), Wide(d6),
                )  # fmt: skip
            else:
                s1, s2, s3 = point_step(
                    a11, a21, a22, a31, a32, a33, b11, b21, b22, b31, b32, b33, Wide(d1), Wide(d2), Wide(d3)
                )
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

    return SimpleNamespace(Lane=Lane, Arms=Arms, solve_ik=solve_ik, static_torque=static_torque)
