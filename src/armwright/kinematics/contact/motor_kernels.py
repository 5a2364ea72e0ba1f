"""Warp kernels of clearance for the bodies of actuators, tool and payload: from each other and everything else.

A thread takes one arm at one target, and branches: bounds exclude distant pairs. docs/method.md §13 defines the
distances and which pairs count.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, Precision
from armwright.kinematics.arms.frame_math import frame_math
from armwright.kinematics.arms.ik_math import kernel
from armwright.kinematics.contact.convex_math import convex_math
from armwright.kinematics.contact.solid_math import CYLINDER, solid_math


@cache
def motor_kernels(precision: Precision) -> SimpleNamespace:
    """Return the kernels in this precision, for N arms with D joints at T targets, and O obstacles."""
    base, solid, convex = frame_math(precision), solid_math(precision), convex_math(precision)
    real, Vector3, Matrix3 = base.real, base.Vector3, base.Matrix3
    Posed, Motors, Solids = solid.Posed, solid.Motors, solid.Solids
    advance, signed_distance, nearer_link = base.advance, solid.signed_distance, solid.nearer_link
    separation, from_obstacle = convex.separation, convex.from_obstacle
    zero, one = real(0.0), real(1.0)

    @kernel
    def motor_frames(
        arms: Posed, axis: wp.array2d(dtype=int), centre: wp.array2d(dtype=Vector3), tip: wp.array(dtype=Vector3),
        tip_into: wp.array(dtype=Matrix3), at_tip: Solids, motors: Motors,
    ):  # fmt: skip
        """Compute the middle of each body, and the rotation into its frame, by forward kinematics.

        axis, centre [m]: (N, D), as of `MotorBodies`.  tip, tip_into: (N,) of the tip frame in that of the last link
        [m].  at_tip: tool and payload.
        """
        arm, target = wp.tid()
        x, y, z = Vector3(one, zero, zero), Vector3(zero, one, zero), Vector3(zero, zero, one)
        p = arms.base[arm]
        for j in range(arms.motion.shape[1]):
            if motors.shape[arm, j] >= 0:
                c = centre[arm, j]
                motors.middle[arm, target, j] = p + c[0] * x + c[1] * y + c[2] * z
                if axis[arm, j] == 0:
                    motors.into[arm, target, j] = wp.matrix_from_rows(y, z, x)
                elif axis[arm, j] == 1:
                    motors.into[arm, target, j] = wp.matrix_from_rows(z, x, y)
                else:
                    motors.into[arm, target, j] = wp.matrix_from_rows(x, y, z)
            _axis, _place, p, x, y, z = advance(
                arms.motion[arm, j], arms.axis[arm, j], arms.offset[arm, j], arms.q[arm, target, j], p, x, y, z
            )
        t = tip[arm]
        p += t[0] * x + t[1] * y + t[2] * z
        into = tip_into[arm] * wp.matrix_from_rows(x, y, z)
        for k in range(at_tip.shape.shape[0]):
            motors.middle[arm, target, arms.motion.shape[1] + k] = p + wp.transpose(into) * at_tip.centre[k]
            motors.into[arm, target, arms.motion.shape[1] + k] = at_tip.into[k] * into

    @kernel
    def self_clearance(arms: Posed, motors: Motors, clearance: wp.array2d(dtype=real)):
        """Lower (N, T) clearances to the distance of a body from other bodies and from links that it does not join.

        Tool and payload are parts of the last link: they count from what is not next to it, and not from each other.
        """
        arm, target = wp.tid()
        dof = arms.motion.shape[1]
        nearest = clearance[arm, target]
        for i in range(motors.count[target]):
            kind = motors.shape[arm, i]
            if kind >= 0:
                size, place, frame = motors.half[arm, i], motors.middle[arm, target, i], motors.into[arm, target, i]
                links_between = int(0)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
                for k in range(i, dof):
                    r = arms.radius[arm, k]
                    if r > zero:
                        if links_between > 0:
                            start, end = arms.starts[arm, target, k], arms.ends[arm, target, k]
                            nearest = nearer_link(
                                nearest, kind, size, frame * (start - place), frame * (end - start), r
                            )
                        links_between += 1
                for j in range(i + 1, motors.count[target]):
                    other = motors.shape[arm, j]
                    if other >= 0 and (j < dof or links_between > 1):
                        d = motors.middle[arm, target, j] - place
                        other_size = motors.half[arm, j]
                        if wp.length(d) - wp.length(size) - wp.length(other_size) < nearest:
                            between = motors.into[arm, target, j] * wp.transpose(frame)
                            d = frame * d
                            found = separation(d, kind, size, between, other, other_size, Solids(), 0, nearest)
                            nearest = wp.min(nearest, found)
                links_before = int(0)  # noqa: RUF046, UP018
                n_joints = int(0)  # noqa: RUF046, UP018
                reach = real(0.0)  # [m] along the arm, from the end of link k to tool and payload
                for back in range(wp.min(i, dof)):
                    k = wp.min(i, dof) - 1 - back
                    r = arms.radius[arm, k]
                    if r > zero:
                        first, last = arms.starts[arm, target, k], arms.ends[arm, target, k]
                        # A link whose round end reaches up to the tool always touches it.
                        if links_before > 0 and n_joints > 0 and (i < dof or reach > r):
                            d = frame * (first - place)
                            nearest = nearer_link(nearest, kind, size, d, frame * (last - first), r)
                        reach += wp.length(last - first)
                        links_before += 1
                    if arms.motion[arm, k] < wp.static(FIXED):
                        n_joints += 1
        clearance[arm, target] = nearest

    @kernel
    def obstacle_clearance(arms: Posed, motors: Motors, solids: Solids, clearance: wp.array2d(dtype=real)):
        """Lower (N, T) clearances to the distance of a body from an obstacle."""
        arm, target = wp.tid()
        dof = arms.motion.shape[1]
        nearest = clearance[arm, target]
        is_at_rest = int(1)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
        for j in range(motors.count[target]):
            kind = motors.shape[arm, j]
            if kind >= 0:
                place, box, frame = motors.middle[arm, target, j], motors.half[arm, j], motors.into[arm, target, j]
                for o in range(solids.shape.shape[0]):
                    # A body at rest is always close to what the arm is mounted on, tool and payload to what they may
                    # touch: only overlaps count, and only what is deeper than allowed.
                    allowed, counts = zero, nearest
                    if j >= dof and motors.allowed[target, o] >= zero:
                        allowed = motors.allowed[target, o]
                        counts = wp.min(nearest, zero)
                    if is_at_rest == 1:
                        counts = wp.min(nearest, zero)
                    counts -= allowed
                    at = -(solids.into[o] * (solids.centre[o] - place))
                    if signed_distance(solids.shape[o], at, solids.half[o]) - wp.length(box) < counts:
                        found = from_obstacle(place, kind, box, frame, solids, o, counts)
                        if found < counts:
                            nearest = found + allowed
            if j < dof and arms.motion[arm, j] < wp.static(FIXED):
                is_at_rest = 0
        clearance[arm, target] = nearest

    @kernel
    def column_clearance(
        arms: Posed, motors: Motors, column: wp.array(dtype=Vector3), clearance: wp.array2d(dtype=real)
    ):
        """Lower (N, T) clearances to the distance of a column from bodies of actuators that move."""
        arm, target = wp.tid()
        size = column[arm]
        if size[2] > zero:
            centre = arms.base[arm] - Vector3(zero, zero, size[2])
            nearest = clearance[arm, target]
            is_at_rest = int(1)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
            for j in range(motors.count[target]):
                kind = motors.shape[arm, j]
                if kind >= 0 and is_at_rest == 0:
                    d = motors.middle[arm, target, j] - centre
                    box = motors.half[arm, j]
                    if signed_distance(wp.static(CYLINDER), d, size) - wp.length(box) < nearest:
                        frame = motors.into[arm, target, j]
                        found = separation(d, wp.static(CYLINDER), size, frame, kind, box, Solids(), 0, nearest)
                        nearest = wp.min(nearest, found)
                if j < arms.motion.shape[1] and arms.motion[arm, j] < wp.static(FIXED):
                    is_at_rest = 0
            clearance[arm, target] = nearest

    return SimpleNamespace(
        Matrix3=Matrix3, Motors=Motors, Solids=Solids,
        motor_frames=motor_frames, self_clearance=self_clearance, obstacle_clearance=obstacle_clearance,
        column_clearance=column_clearance,
    )  # fmt: skip
