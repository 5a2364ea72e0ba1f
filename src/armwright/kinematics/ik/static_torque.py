"""Warp kernel of the posture that inverse kinematics keeps, and of its torque against gravity."""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from typing import Any

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, PRISMATIC, Motions, Precision, TargetKind
from armwright.kinematics.arms.ik_math import ik_math, kernel
from armwright.kinematics.arms.lane_math import lane_math
from armwright.kinematics.arms.pose_math import pose_math
from armwright.robot.arm import GRAVITY


@cache
def static_torque_kernel(precision: Precision, lanes: int, motions: Motions, kind: TargetKind) -> Any:
    """Return the kernel of a variant, as `ik_kernels` has them."""
    base, chain = lane_math(precision, lanes), ik_math(precision, lanes, motions)
    real, Lane, Joints, Arms = base.real, base.Lane, chain.Joints, chain.Arms
    at_base, advance = chain.at_base, chain.advance
    at_least, select, norm_squared = base.at_least, base.select, base.norm_squared
    error_rotation = pose_math(precision, lanes, motions).error_rotation
    pose = kind == "pose"
    zero, gravity = real(0.0), real(GRAVITY)

    @wp.func
    def tip_error(arms: Arms, arm: int, group: int, targets: wp.array2d(dtype=Lane), q: wp.array3d(dtype=Lane)):
        """Return distance² + (angle error in metres)² at angles q (N, G, D), and the angle error [rad]."""
        xx, xy, xz, yx, yy, yz, zx, zy, zz, px, py, pz = at_base(arms.base[arm])
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

        targets: as in `ik_kernels`.  q_last, q_kept: (N, G, D) [rad] or [m].  reached: (N, G, 3) [m].
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
        xx, xy, xz, yx, yy, yz, zx, zy, zz, px, py, pz = at_base(arms.base[arm])
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

    return static_torque
