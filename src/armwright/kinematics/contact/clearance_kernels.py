"""Warp kernels of clearance: distances of the parts of arms from each other, from obstacles and from the column.

A link is a capsule: all points within its radius of its axis, a segment. A thread takes one arm along one span of
samples, pair by pair. docs/method.md §13 defines the distances.
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


@cache
def clearance_kernels(precision: Precision) -> SimpleNamespace:
    """Return the kernels in this precision, for N arms with D links at T samples in G spans, and O obstacles."""
    base, solid, spans = frame_math(precision), solid_math(precision), span_math(precision)
    body, link = body_math(precision), link_math(precision)
    real, Vector3, Matrix3, advance = base.real, base.Vector3, base.Matrix3, base.advance
    Posed, Search, Solids, reach_of = spans.Posed, spans.Search, solid.Solids, spans.reach_of
    links_from_arm, links_from_obstacles = link.from_arm, link.from_obstacles
    body_from_arm, body_from_obstacles = body.from_arm, body.from_obstacles
    zero, one = real(0.0), real(1.0)

    @kernel
    def pose(arms: Posed, at_tip: Solids):
        """Compute start and end of links, middle of bodies and rotations into their frames, by forward kinematics.

        at_tip: tool and payload.
        """
        arm, t = wp.tid()
        x, y, z = Vector3(one, zero, zero), Vector3(zero, one, zero), Vector3(zero, zero, one)
        p = arms.base[arm]
        dof = arms.motion.shape[1]
        for j in range(dof):
            if arms.shape[arm, j] >= 0:
                c = arms.centre[arm, j]
                arms.middle[arm, t, j] = p + c[0] * x + c[1] * y + c[2] * z
                if arms.body_axis[arm, j] == 0:
                    arms.into[arm, t, j] = wp.matrix_from_rows(y, z, x)
                elif arms.body_axis[arm, j] == 1:
                    arms.into[arm, t, j] = wp.matrix_from_rows(z, x, y)
                else:
                    arms.into[arm, t, j] = wp.matrix_from_rows(x, y, z)
            _axis, place, p, x, y, z = advance(
                arms.motion[arm, j], arms.axis[arm, j], arms.offset[arm, j], arms.q[arm, t, j], p, x, y, z
            )
            arms.starts[arm, t, j] = place
            arms.ends[arm, t, j] = p
        arms.middle[arm, t, dof] = arms.base[arm] - Vector3(zero, zero, arms.half[arm, dof][2])
        arms.into[arm, t, dof] = wp.identity(n=3, dtype=real)
        tip = arms.tip[arm]
        p += tip[0] * x + tip[1] * y + tip[2] * z
        into = arms.tip_into[arm] * wp.matrix_from_rows(x, y, z)
        for k in range(at_tip.shape.shape[0]):
            arms.middle[arm, t, dof + 1 + k] = p + wp.transpose(into) * at_tip.centre[k]
            arms.into[arm, t, dof + 1 + k] = at_tip.into[k] * into

    @wp.func(inline=True)
    def run_end(arms: wp.ref[Posed], i: int, t: int, end: int):
        """Return the first sample from t to `end` at which body i is not there."""
        if i < arms.unloaded:
            return end
        for sample in range(t, end):
            if arms.carries[sample] == 0:
                return sample
        return end

    @kernel
    def measure(
        arms: Posed, solids: Solids, first: wp.array(dtype=int), omitted: wp.array2d(dtype=int), most: real,
        clearance: wp.array4d(dtype=real), worst: wp.array3d(dtype=int),
    ):  # fmt: skip
        """Find clearances (2, 2, N, G) and their samples (2, N, G) as `path_clearances` does."""
        arm, span = wp.tid()
        start, end = int(first[span]), int(first[span + 1])
        if omitted[arm, span] != 0:
            end = start
        own = Search()
        own.first = start
        own.end = end
        own.nearest = most
        own.at = start
        reach = reach_of(arms, arm, start, end)
        free = own
        links_from_arm(arms, reach, arm, own)
        links_from_obstacles(arms, reach, solids, arm, free)
        n_bodies = arms.shape.shape[1]
        for i in range(n_bodies + 1):
            for loaded in range(2):
                if i == wp.where(loaded == 1, n_bodies, arms.unloaded):
                    clearance[0, loaded, arm, span] = own.nearest
                    clearance[1, loaded, arm, span] = free.nearest
                    worst[loaded, arm, span] = wp.where(own.nearest <= free.nearest, own.at, free.at)
            if i < n_bodies:
                t = int(start)
                while t < end and arms.shape[arm, i] >= 0:
                    own.first = t
                    own.end = run_end(arms, i, t, end)
                    free.first = t
                    free.end = own.end
                    if own.end > t:
                        body_from_arm(arms, reach, arm, i, own)
                        if i != arms.motion.shape[1]:  # the column stands where it may
                            body_from_obstacles(arms, reach, solids, arm, i, free)
                    t = wp.max(own.end, t + 1)

    return SimpleNamespace(
        real=real, Vector3=Vector3, Matrix3=Matrix3, Posed=Posed, Solids=Solids, pose=pose, measure=measure
    )
