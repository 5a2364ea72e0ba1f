"""Warp functions of clearance for bodies: actuators, column, tool and payload, from each other and everything else.

docs/method.md §13 defines the distances and which pairs count. Bounds exclude distant pairs.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, Precision
from armwright.kinematics.arms.frame_math import frame_math
from armwright.kinematics.contact.convex_math import convex_math
from armwright.kinematics.contact.solid_math import solid_math
from armwright.kinematics.contact.span_math import span_math


@cache
def body_math(precision: Precision) -> SimpleNamespace:
    """Return the functions in this precision; `arm` and `i` are an arm and its body."""
    base, solid, convex, spans = (make(precision) for make in (frame_math, solid_math, convex_math, span_math))
    real, Solids = base.real, solid.Solids
    Posed, Reach, Search, moved, looked = spans.Posed, spans.Reach, spans.Search, spans.moved, spans.looked
    signed_distance, from_link = solid.signed_distance, solid.from_link
    separation, from_obstacle = convex.separation, convex.from_obstacle
    zero, half = real(0.0), real(0.5)

    @wp.func(inline=True)
    def frame_of(arms: wp.ref[Posed], i: int):
        """Return the joint behind the link that the body is fixed to."""
        dof = arms.motion.shape[1]
        return wp.where(i == dof, 0, wp.min(i, dof))

    @wp.func(inline=True)
    def lever_of(arms: wp.ref[Posed], arm: int, i: int, t: int):
        """Return how far the body reaches from the origin of its frame at most [m]."""
        origin, frame = real(1.0) * arms.base[arm], frame_of(arms, i)
        if frame > 0:
            origin = real(1.0) * arms.ends[arm, t, frame - 1]
        return wp.length(arms.middle[arm, t, i] - origin) + wp.length(arms.half[arm, i])

    @wp.func(inline=True)
    def to_link(arms: wp.ref[Posed], arm: int, i: int, k: int, length: real, motion: real, search: wp.ref[Search]):
        """Search for the least distance of the body from link k."""
        size, r = arms.half[arm, i], arms.radius[arm, k]
        reach = wp.length(size) + half * length + r
        search.t = search.first
        while search.t < search.end:
            t = search.t
            place, start, end = arms.middle[arm, t, i], arms.starts[arm, t, k], arms.ends[arm, t, k]
            found = wp.length(half * (start + end) - place) - reach
            if found < search.nearest:
                frame = arms.into[arm, t, i]
                p, v = frame * (start - place), frame * (end - start)
                found = from_link(arms.shape[arm, i], size, p, v, r, search.nearest)
            looked(search, found, found, motion)

    @wp.func(inline=True)
    def to_body(arms: wp.ref[Posed], arm: int, i: int, j: int, motion: real, search: wp.ref[Search]):
        """Search for the least distance of the body from another one."""
        size, other_size = arms.half[arm, i], arms.half[arm, j]
        reach = wp.length(size) + wp.length(other_size)
        search.t = search.first
        while search.t < search.end:
            t = search.t
            d = arms.middle[arm, t, j] - arms.middle[arm, t, i]
            found = wp.length(d) - reach
            if found < search.nearest:
                frame = arms.into[arm, t, i]
                between, kind, other = (
                    arms.into[arm, t, j] * wp.transpose(frame),
                    arms.shape[arm, i],
                    arms.shape[arm, j],
                )
                found = separation(frame * d, kind, size, between, other, other_size, Solids(), 0, search.nearest)
            looked(search, found, found, motion)

    @wp.func(inline=True)
    def from_arm(arms: wp.ref[Posed], reach: wp.ref[Reach], arm: int, i: int, search: wp.ref[Search]):
        """Search for the least distance of the body from links that it does not join, bodies before it and the column.

        Tool and payload are parts of the last link: they count from what is not next to it, and not from each other.
        """
        dof = arms.motion.shape[1]
        frame, lever = frame_of(arms, i), lever_of(arms, arm, i, search.first)
        links_between = int(0)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
        joints_between = int(0)  # noqa: RUF046, UP018
        for k in range(frame, dof):
            if arms.motion[arm, k] < wp.static(FIXED):
                joints_between += 1
            if arms.radius[arm, k] > zero:
                if links_between > 0 and joints_between > 0:
                    to_link(arms, arm, i, k, reach.length[k], moved(reach, frame, k + 1, zero), search)
                links_between += 1
        links_before = int(0)  # noqa: RUF046, UP018
        joints_before = int(0)  # noqa: RUF046, UP018
        length = real(0.0)  # [m] along the arm, from the end of link k to tool and payload
        for back in range(frame):
            k = frame - 1 - back
            r = arms.radius[arm, k]
            if r > zero:
                # A link whose round end reaches up to the tool always touches it.
                if links_before > 0 and joints_before > 0 and (i < dof or length > r):
                    to_link(arms, arm, i, k, reach.length[k], moved(reach, k + 1, frame, lever), search)
                length += wp.length(arms.ends[arm, search.first, k] - arms.starts[arm, search.first, k])
                links_before += 1
            if arms.motion[arm, k] < wp.static(FIXED):
                joints_before += 1
            if arms.shape[arm, k] >= 0 and (i < dof or links_before > 1):
                to_body(arms, arm, k, i, moved(reach, k, frame, lever), search)
        if arms.shape[arm, dof] >= 0 and joints_before > 0:
            to_body(arms, arm, dof, i, moved(reach, 0, frame, lever), search)

    @wp.func(inline=True)
    def from_obstacles(
        arms: wp.ref[Posed], reach: wp.ref[Reach], solids: wp.ref[Solids], arm: int, i: int, search: wp.ref[Search]
    ):
        """Search for the least distance of the body from an obstacle."""
        kind, size, dof = arms.shape[arm, i], arms.half[arm, i], arms.motion.shape[1]
        n_joints = int(0)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
        for j in range(frame_of(arms, i)):
            if arms.motion[arm, j] < wp.static(FIXED):
                n_joints += 1
        motion = moved(reach, 0, frame_of(arms, i), lever_of(arms, arm, i, search.first))
        for o in range(solids.shape.shape[0]):
            search.t = search.first
            while search.t < search.end:
                t = search.t
                # A body at rest is always close to what the arm is mounted on, tool and payload to what they may
                # touch: only overlaps count, and only what is deeper than allowed.
                allowed, counts = zero, real(search.nearest)
                if i >= dof and arms.allowed[t, o] >= zero:
                    allowed = arms.allowed[t, o]
                    counts = wp.min(counts, zero)
                if n_joints == 0:
                    counts = wp.min(counts, zero)
                counts -= allowed
                place = arms.middle[arm, t, i]
                at = -(solids.into[o] * (solids.centre[o] - place))
                found = signed_distance(solids.shape[o], at, solids.half[o]) - wp.length(size)
                if found < counts:
                    found = from_obstacle(place, kind, size, arms.into[arm, t, i], solids, o, counts)
                distance = search.nearest
                if found < counts:
                    distance = found + allowed
                looked(search, distance, found, motion)

    return SimpleNamespace(from_arm=from_arm, from_obstacles=from_obstacles)
