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

from armwright.kinematics.arms.arm_arrays import MAX_JOINTS, Motions, Precision, TargetKind
from armwright.kinematics.arms.ik_math import ik_math, kernel
from armwright.kinematics.arms.lane_math import lane_math
from armwright.kinematics.arms.pose_math import pose_math
from armwright.kinematics.ik.normal_equations import normal_equations
from armwright.kinematics.ik.static_torque import static_torque_kernel


@cache
def ik_kernels(precision: Precision, lanes: int, motions: Motions, kind: TargetKind) -> SimpleNamespace:
    """Return the kernels that solve `lanes` targets per thread in this precision, for these motions and targets."""
    base, chain = lane_math(precision, lanes), ik_math(precision, lanes, motions)
    rotations, equations = pose_math(precision, lanes), normal_equations(precision, lanes)
    real, Lane, Wide, Arms = base.real, base.Lane, base.Wide, chain.Arms
    at_least, select, scaled, dot, vector_of = base.at_least, base.select, base.scaled, base.dot, base.vector_of
    at_base, advance, limit = chain.at_base, chain.advance, chain.limit
    linear_column, angular_column = chain.linear_column, chain.angular_column
    tool_frame, error_rotation = rotations.tool_frame, rotations.error_rotation
    Square, Rows, pose_step = equations.Square, equations.Rows, equations.pose_step
    shortened, point_step = equations.shortened, equations.point_step
    Joints = wp.types.matrix(shape=(MAX_JOINTS, lanes), dtype=real)  # row j is joint j
    Vectors = wp.types.matrix(shape=(3 * MAX_JOINTS, lanes), dtype=real)  # three rows for each joint
    pose, coupled, one, infinity = kind == "pose", motions == "coupled", real(1.0), real(1e30)

    @kernel
    def solve_ik(
        arms: Arms, targets: wp.array2d(dtype=Lane), updates: int, q_last: wp.array3d(dtype=Lane),
        h_last: wp.array3d(dtype=Lane), q_kept: wp.array3d(dtype=Lane),
    ):  # fmt: skip
        """Inverse kinematics of an arm at a group of targets.

        Arrays over joints live in registers and stack; passing, and so copying, them takes three times as long.
        """
        arm, group = wp.tid()
        if wp.static(pose):
            has_axis, has_frame, metres_per_radian = targets[group, 13], targets[group, 14], targets[group, 15]
            counted = wp.matrix_from_rows(has_axis, has_axis, has_frame)  # angles of the tool
            unused = wp.matrix_from_rows(Lane(one) - has_axis, Lane(one) - has_axis, Lane(one) - has_frame)
        q, kept, weight, pull = Joints(), Joints(), Joints(), Joints()
        limit_n, limit_d = Joints(), Joints()  # H of the update before, n / d: fractions compare without division
        linear = Vectors()  # joint axes, then the position's columns of J
        angular = Vectors()  # joint positions, then the angles' columns of J
        for j in range(arms.dof):
            q[j] = q_last[arm, group, j]
            kept[j] = q[j]
            limit_n[j] = h_last[arm, group, j]
            limit_d[j] = Lane(one)
        nearest = Lane(infinity)
        for _ in range(updates):
            p, x, y, z = at_base(arms.base[arm])
            for j in range(arms.dof):
                axis, place, p, x, y, z = advance(
                    arms.motion[arm, j], arms.axis[arm, j], arms.offset[arm, j], q[j], p, x, y, z
                )
                for i in range(3):
                    linear[3 * j + i] = axis[i]
                    angular[3 * j + i] = place[i]

            # The posture nearest to the target is kept, the earliest of equals.
            error = vector_of(targets, group, 0) - p
            square = dot(error, error)
            far = square
            if wp.static(pose):
                s, t, f = tool_frame(arms.tool_axis[arm], arms.tool_side[arm], x, y, z)
                angle, rotation = error_rotation(s, t, f, targets, group)
                off = wp.cw_mul(metres_per_radian, angle)
                far = square + wp.cw_mul(off, off)
            nearer = Lane(one) - at_least(far, nearest)
            nearest = wp.min(nearest, far)
            # dx, shortened; the pull y is taken out of dx, because J# dx + (I - J# J) y = y + J# (dx - J y).
            dx = shortened(error, square)
            if wp.static(pose):
                turn = wp.cw_mul(counted, rotation)
                jjt, jwjt, column, weighted = Square(), Square(), Rows(), Rows()
            if wp.static(coupled):  # J C; columns of joints that follow others stay 0
                shared, shared_turn = Vectors(), Vectors()
                for j in range(arms.dof):
                    leader, factor = int(arms.couplings[arm, j][0]), arms.couplings[arm, j][1]
                    axis = wp.matrix_from_rows(linear[3 * j], linear[3 * j + 1], linear[3 * j + 2])
                    place = wp.matrix_from_rows(angular[3 * j], angular[3 * j + 1], angular[3 * j + 2])
                    moved = linear_column(arms.motion[arm, j], axis, p - place)
                    if wp.static(pose):
                        turned = wp.cw_mul(counted, angular_column(arms.motion[arm, j], axis, s, t, f))
                    for i in range(3):
                        shared[3 * leader + i] += factor * moved[i]
                        if wp.static(pose):
                            shared_turn[3 * leader + i] += factor * turned[i]
            # The same of points alone, for which separate variables take a tenth less time.
            a11, a21, a22, a31, a32, a33 = Wide(), Wide(), Wide(), Wide(), Wide(), Wide()
            b11, b21, b22, b31, b32, b33 = Wide(), Wide(), Wide(), Wide(), Wide(), Wide()
            for j in range(arms.dof):
                kept[j] = select(nearer, q[j], kept[j])
                motion = arms.motion[arm, j]
                n, d, w, y_j = limit(motion, arms.lower[arm, j], arms.upper[arm, j], q[j], limit_n[j], limit_d[j])
                limit_n[j] = n
                limit_d[j] = d
                weight[j] = w
                pull[j] = y_j
                axis = wp.matrix_from_rows(linear[3 * j], linear[3 * j + 1], linear[3 * j + 2])
                place = wp.matrix_from_rows(angular[3 * j], angular[3 * j + 1], angular[3 * j + 2])
                moved = linear_column(motion, axis, p - place)
                if wp.static(pose):
                    turned = wp.cw_mul(counted, angular_column(motion, axis, s, t, f))
                if wp.static(coupled):
                    moved = wp.matrix_from_rows(shared[3 * j], shared[3 * j + 1], shared[3 * j + 2])
                    turned = wp.matrix_from_rows(shared_turn[3 * j], shared_turn[3 * j + 1], shared_turn[3 * j + 2])
                dx -= scaled(y_j, moved)
                for i in range(3):
                    linear[3 * j + i] = moved[i]
                if wp.static(pose):
                    turn -= scaled(y_j, turned)
                    for i in range(3):
                        angular[3 * j + i] = turned[i]
                        column[i] = Wide(moved[i])
                        column[i + 3] = Wide(turned[i])
                    for i in range(6):
                        weighted[i] = wp.cw_mul(Wide(w), column[i])
                        for k in range(i):
                            jjt[6 * i + k] += wp.cw_mul(column[i], column[k])
                            jwjt[6 * i + k] += wp.cw_mul(weighted[i], column[k])
                        jjt[7 * i] += wp.cw_mul(column[i], column[i])
                        jwjt[7 * i] += wp.cw_mul(weighted[i], column[i])
                else:
                    c1, c2, c3 = Wide(moved[0]), Wide(moved[1]), Wide(moved[2])
                    w1, w2, w3 = wp.cw_mul(Wide(w), c1), wp.cw_mul(Wide(w), c2), wp.cw_mul(Wide(w), c3)
                    a11 += wp.cw_mul(c1, c1)
                    a21 += wp.cw_mul(c2, c1)
                    a22 += wp.cw_mul(c2, c2)
                    a31 += wp.cw_mul(c3, c1)
                    a32 += wp.cw_mul(c3, c2)
                    a33 += wp.cw_mul(c3, c3)
                    b11 += wp.cw_mul(c1, w1)
                    b21 += wp.cw_mul(c2, w1)
                    b22 += wp.cw_mul(c2, w2)
                    b31 += wp.cw_mul(c3, w1)
                    b32 += wp.cw_mul(c3, w2)
                    b33 += wp.cw_mul(c3, w3)
            if wp.static(pose):
                along, about = pose_step(jjt, jwjt, dx, turn, unused)
            else:
                along = point_step(a11, a21, a22, a31, a32, a33, b11, b21, b22, b31, b32, b33, dx)
            for j in range(arms.dof):
                step = dot(wp.matrix_from_rows(linear[3 * j], linear[3 * j + 1], linear[3 * j + 2]), along)
                if wp.static(pose):
                    step += dot(wp.matrix_from_rows(angular[3 * j], angular[3 * j + 1], angular[3 * j + 2]), about)
                to = q[j] + pull[j] + wp.cw_mul(weight[j], step)
                q[j] = wp.min(wp.max(to, Lane(arms.lower[arm, j])), Lane(arms.upper[arm, j]))
            if wp.static(coupled):
                for j in range(arms.dof):
                    follow = arms.couplings[arm, j]  # leader, factor, offset
                    q[j] = follow[1] * q[int(follow[0])] + Lane(follow[2])

        for j in range(arms.dof):
            q_last[arm, group, j] = q[j]
            h_last[arm, group, j] = wp.cw_div(limit_n[j], limit_d[j])
            q_kept[arm, group, j] = kept[j]

    torque = static_torque_kernel(precision, lanes, motions, kind)
    return SimpleNamespace(Lane=Lane, Arms=Arms, solve_ik=solve_ik, static_torque=torque)
