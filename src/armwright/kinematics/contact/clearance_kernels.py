"""Warp kernel of clearance along spans of postures: of an arm from itself, from obstacles and from its column.

A thread takes one arm along one span, poses it, and then compares pair by pair, over the postures that count.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import Precision
from armwright.kinematics.arms.frame_math import frame_math
from armwright.kinematics.arms.ik_math import kernel
from armwright.kinematics.contact.body_math import body_math
from armwright.kinematics.contact.link_math import link_math
from armwright.kinematics.contact.solid_math import solid_math
from armwright.kinematics.contact.span_math import span_math
from armwright.kinematics.contact.surroundings_math import surroundings_math


@cache
def clearance_kernels(precision: Precision) -> SimpleNamespace:
    """Return the kernel in this precision, for N arms with D links and K bodies in T postures, and O obstacles."""
    base, solid, around = frame_math(precision), solid_math(precision), surroundings_math(precision)
    real, Vector3, Matrix3, advance = base.real, base.Vector3, base.Matrix3, base.advance
    Posed, Motors, Solids = solid.Posed, solid.Motors, solid.Solids
    largest_steps, links_apart = span_math(precision).largest_steps, link_math(precision).links_apart
    body_from_links, body_from_bodies = body_math(precision).body_from_links, body_math(precision).body_from_bodies
    links_from_obstacles, links_from_column = around.links_from_obstacles, around.links_from_column
    body_from_obstacles, body_from_column = around.body_from_obstacles, around.body_from_column
    zero, one = real(0.0), real(1.0)

    @wp.func
    def pose(arms: Posed, motors: Motors, at_tip: Solids, arm: int, t: int):
        """Compute start and end of the axis of each link, and middle and frame of each body, by forward kinematics."""
        dof = arms.motion.shape[1]
        x, y, z = Vector3(one, zero, zero), Vector3(zero, one, zero), Vector3(zero, zero, one)
        p = arms.base[arm]
        for j in range(dof):
            if motors.shape.shape[1] > 0 and motors.shape[arm, j] >= 0:
                c = motors.centre[arm, j]
                motors.middle[arm, t, j] = p + c[0] * x + c[1] * y + c[2] * z
                if motors.axis[arm, j] == 0:
                    motors.into[arm, t, j] = wp.matrix_from_rows(y, z, x)
                elif motors.axis[arm, j] == 1:
                    motors.into[arm, t, j] = wp.matrix_from_rows(z, x, y)
                else:
                    motors.into[arm, t, j] = wp.matrix_from_rows(x, y, z)
            _axis, place, p, x, y, z = advance(
                arms.motion[arm, j], arms.axis[arm, j], arms.offset[arm, j], arms.q[arm, t, j], p, x, y, z
            )
            arms.starts[arm, t, j] = place
            arms.ends[arm, t, j] = p
        if at_tip.shape.shape[0] > 0:
            tip = motors.tip[arm]
            p += tip[0] * x + tip[1] * y + tip[2] * z
            into = motors.tip_into[arm] * wp.matrix_from_rows(x, y, z)
            for k in range(at_tip.shape.shape[0]):
                motors.middle[arm, t, dof + k] = p + wp.transpose(into) * at_tip.centre[k]
                motors.into[arm, t, dof + k] = at_tip.into[k] * into

    @kernel
    def measure(
        arms: Posed, motors: Motors, at_tip: Solids, solids: Solids, columns: wp.array(dtype=Vector3), most: real,
        least: wp.array3d(dtype=real), at: wp.array3d(dtype=int),
    ):  # fmt: skip
        """Measure the least clearance in each span, at most `most`, and the posture where it is.

        least [m], at: (N, G, 4) from the arm itself without and with the payload, then from obstacles likewise.
        columns: (N,) radius, radius, half the length [m], 0 without one; (0,) if none has one.
        """
        arm, span = wp.tid()
        first, end, n_bodies = arms.first[span], arms.first[span + 1], motors.shape.shape[1]
        own, free, own_at, free_at = real(most), real(most), int(first), int(first)
        if not arms.left_out[arm, span]:
            steps = largest_steps(arms, arm, first, end)
            for t in range(first, end):
                pose(arms, motors, at_tip, arm, t)
            own, own_at = links_apart(arms, arm, first, end, steps, own, own_at)
            free, free_at = links_from_obstacles(arms, solids, arm, first, end, steps, free, free_at)
            column = Vector3()
            if columns.shape[0] > 0:
                column = columns[arm]
            if column[2] > zero:
                own, own_at = links_from_column(arms, column, arm, first, end, steps, own, own_at)
            for i in range(n_bodies):
                if i == motors.n_lasting:
                    least[arm, span, 0] = own
                    least[arm, span, 2] = free
                    at[arm, span, 0] = own_at
                    at[arm, span, 2] = free_at
                    for j in range(motors.n_lasting):
                        if motors.shape[arm, j] >= 0:
                            own, own_at = body_from_bodies(
                                arms, motors, arm, j, i, n_bodies, first, end, steps, own, own_at
                            )
                if motors.shape[arm, i] >= 0:
                    own, own_at = body_from_links(arms, motors, arm, i, first, end, steps, own, own_at)
                    own, own_at = body_from_bodies(
                        arms, motors, arm, i, i + 1, motors.n_lasting, first, end, steps, own, own_at
                    )
                    free, free_at = body_from_obstacles(arms, motors, solids, arm, i, first, end, steps, free, free_at)
                    if column[2] > zero:
                        own, own_at = body_from_column(arms, motors, column, arm, i, first, end, steps, own, own_at)
        for k in range(2):
            if k == 1 or arms.left_out[arm, span] or motors.n_lasting == n_bodies:
                least[arm, span, k] = own
                least[arm, span, 2 + k] = free
                at[arm, span, k] = own_at
                at[arm, span, 2 + k] = free_at

    return SimpleNamespace(
        real=real, Vector3=Vector3, Matrix3=Matrix3, Posed=Posed, Motors=Motors, Solids=Solids, measure=measure
    )
