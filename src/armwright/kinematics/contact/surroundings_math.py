"""Warp functions of clearance along a span of postures: of links and bodies from obstacles and from the column.

Bounds exclude distant obstacles. docs/method.md §13 defines the distances and which pairs count.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, Precision
from armwright.kinematics.arms.frame_math import frame_math
from armwright.kinematics.contact.convex_math import SEGMENT, convex_math
from armwright.kinematics.contact.solid_math import CYLINDER, MESH, solid_math
from armwright.kinematics.contact.span_math import span_math


@cache
def surroundings_math(precision: Precision) -> SimpleNamespace:
    """Return the functions in this precision. Each returns the lower of a clearance and its own, and the posture."""
    base, solid, span = frame_math(precision), solid_math(precision), span_math(precision)
    convex = convex_math(precision)
    real, Vector3 = base.real, base.Vector3
    Posed, Motors, Solids, Steps = solid.Posed, solid.Motors, solid.Solids, span.Steps
    along_segment, segment_bound, from_link = solid.along_segment, solid.segment_bound, solid.from_link
    signed_distance, separation, from_obstacle = solid.signed_distance, convex.separation, convex.from_obstacle
    extent, travel, ahead = span.extent, span.travel, span.ahead
    zero, half, one, two, tiny = real(0.0), real(0.5), real(1.0), real(2.0), real(1e-30)

    @wp.func
    def from_axis(p: Vector3, v: Vector3, solids: Solids, o: int, enough: real):
        """Return the distance of the segment from p to p + v from an obstacle, in the obstacle's frame."""
        h, shape, size = half * v, solids.shape[o], solids.half[o]
        if shape == wp.static(MESH):
            unturned = wp.identity(n=3, dtype=real)
            return separation(-(p + h), wp.static(SEGMENT), h, unturned, shape, size, solids, o, enough)
        return along_segment(shape, p, v, size)

    @wp.func
    def links_from_obstacles(
        arms: Posed, solids: Solids, arm: int, first: int, end: int, steps: Steps, nearest: real, at: int
    ):
        """Clearance of links from obstacles."""
        for j in range(arms.radius.shape[1]):
            r = arms.radius[arm, j]
            foot, way = real(0.0), real(0.0)  # share of the first link that is its foot, where the arm is mounted
            if j == 0:
                foot = two * r / wp.max(wp.length(arms.ends[arm, first, j] - arms.starts[arm, first, j]), tiny)
            if r > zero and foot < one:
                if end > first + 1:
                    way = travel(arms, arm, steps, 0, j + 1, r)
                for o in range(solids.shape.shape[0]):
                    t = int(first)
                    while t < end:
                        a = arms.starts[arm, t, j]
                        base = solids.into[o] * (a - solids.centre[o])
                        v = solids.into[o] * (arms.ends[arm, t, j] - a)
                        p = base + foot * v
                        v = (one - foot) * v
                        found = segment_bound(solids.shape[o], solids.half[o], p, v) - r
                        if found < nearest:
                            found = from_axis(p, v, solids, o, nearest + r) - r
                            mounted = j == 0 and from_axis(base, Vector3(), solids, o, two * r) <= r
                            # The first link is always close to what the arm is mounted on: only overlaps count.
                            if found < nearest and (not mounted or found < zero):
                                nearest, at = found, t
                        t += ahead(found - nearest, way)
        return nearest, at

    @wp.func
    def body_from_obstacles(
        arms: Posed, motors: Motors, solids: Solids, arm: int, j: int, first: int, end: int, steps: Steps,
        nearest: real, at: int,
    ):  # fmt: skip
        """Clearance of a body from obstacles.

        A body at rest is always close to what the arm is mounted on, tool and payload to what they may touch: only
        overlaps count, and only what is deeper than allowed.
        """
        dof, kind, box, way = arms.motion.shape[1], motors.shape[arm, j], motors.half[arm, j], real(0.0)
        is_at_rest = bool(True)  # noqa: UP018 (Warp's way to declare what changes in a loop)
        for k in range(wp.min(j, dof)):
            is_at_rest = is_at_rest and arms.motion[arm, k] >= wp.static(FIXED)
        if end > first + 1:
            way = travel(arms, arm, steps, 0, wp.min(j, dof), extent(arms, motors, arm, first, j))
        for o in range(solids.shape.shape[0]):
            t = int(first)
            while t < end:
                allowed, counts = zero, nearest
                if j >= dof and motors.allowed[t, o] >= zero:
                    allowed = motors.allowed[t, o]
                    counts = wp.min(nearest, zero)
                if is_at_rest:
                    counts = wp.min(nearest, zero)
                counts -= allowed
                place = motors.middle[arm, t, j]
                offset = -(solids.into[o] * (solids.centre[o] - place))
                found = signed_distance(solids.shape[o], offset, solids.half[o]) - wp.length(box)
                if found < counts:
                    found = from_obstacle(place, kind, box, motors.into[arm, t, j], solids, o, counts)
                    if found < counts:
                        nearest, at = found + allowed, t
                t += ahead(found - nearest, way)
        return nearest, at

    @wp.func
    def links_from_column(
        arms: Posed, size: Vector3, arm: int, first: int, end: int, steps: Steps, nearest: real, at: int
    ):
        """Clearance of a column from links that move, except the first one."""
        middle = arms.base[arm] - Vector3(zero, zero, size[2])
        n_links = int(0)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
        n_joints = int(0)  # noqa: RUF046, UP018
        for j in range(arms.motion.shape[1]):
            if arms.motion[arm, j] < wp.static(FIXED):
                n_joints += 1
            r = arms.radius[arm, j]
            if r > zero:
                if n_links > 0 and n_joints > 0:
                    way = real(0.0)
                    if end > first + 1:
                        way = travel(arms, arm, steps, 0, j + 1, r)
                    t = int(first)
                    while t < end:
                        a = arms.starts[arm, t, j]
                        along = arms.ends[arm, t, j] - a
                        found = from_link(wp.static(CYLINDER), size, a - middle, along, r, nearest)
                        if found < nearest:
                            nearest, at = found, t
                        t += ahead(found - nearest, way)
                n_links += 1
        return nearest, at

    @wp.func
    def body_from_column(
        arms: Posed, motors: Motors, size: Vector3, arm: int, j: int, first: int, end: int, steps: Steps,
        nearest: real, at: int,
    ):  # fmt: skip
        """Clearance of a column from a body that moves."""
        dof, kind, box, way = arms.motion.shape[1], motors.shape[arm, j], motors.half[arm, j], real(0.0)
        moves = bool(False)  # noqa: UP018 (Warp's way to declare what changes in a loop)
        for k in range(wp.min(j, dof)):
            moves = moves or arms.motion[arm, k] < wp.static(FIXED)
        if end > first + 1:
            way = travel(arms, arm, steps, 0, wp.min(j, dof), extent(arms, motors, arm, first, j))
        t = int(first)
        while moves and t < end:
            d = motors.middle[arm, t, j] - arms.base[arm] + Vector3(zero, zero, size[2])
            found = signed_distance(wp.static(CYLINDER), d, size) - wp.length(box)
            if found < nearest:
                frame = motors.into[arm, t, j]
                found = separation(d, wp.static(CYLINDER), size, frame, kind, box, Solids(), 0, nearest)
                if found < nearest:
                    nearest, at = found, t
            t += ahead(found - nearest, way)
        return nearest, at

    return SimpleNamespace(
        links_from_obstacles=links_from_obstacles, links_from_column=links_from_column,
        body_from_obstacles=body_from_obstacles, body_from_column=body_from_column,
    )  # fmt: skip
