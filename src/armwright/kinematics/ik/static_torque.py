"""Warp kernel of the posture that inverse kinematics keeps, and of its torques against gravity.

Arrays are those of `ik_kernels`.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, MAX_JOINTS, PRISMATIC, Motions, Precision, TargetKind
from armwright.kinematics.arms.ik_math import ik_math, kernel
from armwright.kinematics.arms.lane_math import lane_math
from armwright.kinematics.arms.pose_math import pose_math
from armwright.robot.arm import GRAVITY


@cache
def static_torque_kernel(precision: Precision, lanes: int, motions: Motions, kind: TargetKind) -> wp.Kernel:
    """Return the kernel for `lanes` targets per thread in this precision, for these motions and targets."""
    base, chain, rotations = (
        lane_math(precision, lanes),
        ik_math(precision, lanes, motions),
        pose_math(precision, lanes),
    )
    real, Lane, Vector, Arms = base.real, base.Lane, base.Vector, chain.Arms
    at_least, select, scaled = base.at_least, base.select, base.scaled
    dot, in_frame, vector_of = base.dot, base.in_frame, base.vector_of
    at_base, advance = chain.at_base, chain.advance
    tool_frame, error_rotation = rotations.tool_frame, rotations.error_rotation
    pose, zero, gravity = kind == "pose", real(0.0), real(GRAVITY)

    @wp.func
    def tip_error(arms: Arms, arm: int, group: int, targets: wp.array2d(dtype=Lane), q: wp.array3d(dtype=Lane)):
        """Return distance² + (angle error in metres)² at angles q (N, G, D), and the angle error [rad]."""
        p, x, y, z = at_base(arms.base[arm])
        for j in range(arms.dof):
            _axis, _place, p, x, y, z = advance(
                arms.motion[arm, j], arms.axis[arm, j], arms.offset[arm, j], q[arm, group, j], p, x, y, z
            )
        error = vector_of(targets, group, 0) - p
        square = dot(error, error)
        if wp.static(pose):
            s, t, f = tool_frame(arms.tool_axis[arm], arms.tool_side[arm], x, y, z)
            angle, _rotation = error_rotation(s, t, f, targets, group)
            off = wp.cw_mul(targets[group, 15], angle)
            return square + wp.cw_mul(off, off), angle
        return square, Lane(zero)

    @wp.func
    def gravity_load(motion: int, axis: Vector, lever: Vector, mass: Lane):
        """Return the derivative of mass times height by a joint with this axis."""
        if motion < PRISMATIC:
            return wp.cw_mul(axis[0], lever[1]) - wp.cw_mul(axis[1], lever[0])
        if motion < FIXED:
            return wp.cw_mul(mass, axis[2])
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

        q_last, q_kept: (N, G, D) [rad] or [m].  reached: (N, G, 3) [m].
        torque: (N, G, D), +dV/dq [N m] or [N].  angle_error: (N, G, 1) [rad], 0 for points.
        """
        arm, group = wp.tid()
        last, last_angle = tip_error(arms, arm, group, targets, q_last)
        kept, kept_angle = tip_error(arms, arm, group, targets, q_kept)
        is_kept = at_least(last, kept)
        angle_error[arm, group, 0] = select(is_kept, kept_angle, last_angle)

        axes, places = wp.zeros(MAX_JOINTS, dtype=Vector), wp.zeros(MAX_JOINTS, dtype=Vector)
        moments = wp.zeros(MAX_JOINTS, dtype=Vector)  # mass times position of what joint j carries up to the next
        p, x, y, z = at_base(arms.base[arm])
        for j in range(arms.dof):
            q = select(is_kept, q_kept[arm, group, j], q_last[arm, group, j])
            q_kept[arm, group, j] = q
            axis, place, p, x, y, z = advance(
                arms.motion[arm, j], arms.axis[arm, j], arms.offset[arm, j], q, p, x, y, z
            )
            axes[j] = axis
            places[j] = place
            com = arms.com[arm, j]
            moments[j] = arms.mass[arm, j] * (place + com[0] * x + com[1] * y + com[2] * z)
        for i in range(3):
            reached[arm, group, i] = p[i]

        mass_beyond = targets[group, 3]
        beyond = scaled(mass_beyond, p + in_frame(arms.payload_center[arm], x, y, z))  # mass times position
        for step in range(arms.dof):
            j = arms.dof - 1 - step
            mass_beyond += Lane(arms.mass[arm, j])
            beyond += moments[j]
            lever = beyond - scaled(mass_beyond, places[j])
            torque[arm, group, j] = gravity * gravity_load(arms.motion[arm, j], axes[j], lever, mass_beyond)

    return static_torque
