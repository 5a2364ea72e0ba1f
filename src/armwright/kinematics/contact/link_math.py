"""Warp functions of clearance for links: from each other and from obstacles.

docs/method.md §13 defines the distances and which pairs count.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, Precision
from armwright.kinematics.arms.frame_math import frame_math
from armwright.kinematics.contact.convex_math import SEGMENT, convex_math
from armwright.kinematics.contact.solid_math import MESH, solid_math
from armwright.kinematics.contact.span_math import span_math


@cache
def link_math(precision: Precision) -> SimpleNamespace:
    """Return the functions in this precision."""
    base, solid, spans = frame_math(precision), solid_math(precision), span_math(precision)
    real, Vector3, Solids, separation = base.real, base.Vector3, solid.Solids, convex_math(precision).separation
    Posed, Reach, Search, moved, looked = spans.Posed, spans.Reach, spans.Search, spans.moved, spans.looked
    along_segment, lower_bound = solid.along_segment, solid.lower_bound
    zero, half, one, two = real(0.0), real(0.5), real(1.0), real(2.0)
    tiny, parallel = real(1e-30), real(1e-12)  # the latter is the square of the sine of an angle that is 0 in float32

    @wp.func
    def to_segment(p: Vector3, a: Vector3, u: Vector3):
        """Return the squared distance of a point from the segment from a to a + u."""
        t = wp.clamp(wp.dot(p - a, u) / wp.max(wp.dot(u, u), tiny), zero, one)
        return wp.length_sq(p - a - t * u)

    @wp.func
    def between_segments(a: Vector3, u: Vector3, b: Vector3, v: Vector3):
        """Return the distance between the segments from a to a + u and from b to b + v.

        The nearest points are an end of a segment or the feet of the common perpendicular. The cross product
        determines the feet well even if the segments are nearly parallel.
        """
        square = wp.min(
            wp.min(to_segment(a, b, v), to_segment(a + u, b, v)),
            wp.min(to_segment(b, a, u), to_segment(b + v, a, u)),
        )
        n = wp.cross(u, v)
        nn = wp.dot(n, n)
        if nn > parallel * wp.dot(u, u) * wp.dot(v, v):
            w = b - a
            s = wp.clamp(wp.dot(wp.cross(w, v), n) / nn, zero, one)
            t = wp.clamp(wp.dot(wp.cross(w, u), n) / nn, zero, one)
            square = wp.min(square, wp.length_sq(w + t * v - s * u))
        return wp.sqrt(square)

    @wp.func(inline=True)
    def between_links(
        arms: wp.ref[Posed], arm: int, t: int, i: int, j: int, a: Vector3, u: Vector3, b: Vector3, v: Vector3,
        radii: real,
    ):  # fmt: skip
        """Return the distance of the parts that count of links i and j, from a to a + u and from b to b + v.

        It is infinite if nothing counts.
        """
        between = real(0.0)  # [m] along the arm, from the end of link i to the start of link j
        for k in range(i + 1, j + 1):
            start = arms.starts[arm, t, k]
            between += wp.length(start - arms.ends[arm, t, k - 1])  # displacement of a prismatic joint
            if k < j:
                between += wp.length(arms.ends[arm, t, k] - start)
        # Parts of the arm that are this near along it cannot be farther apart, so they are excluded.
        excluded, length, other_length = half * wp.max(two * radii - between, zero), wp.length(u), wp.length(v)
        if excluded > wp.min(length, other_length):
            return real(wp.inf)
        u_counted = u * (one - excluded / wp.max(length, tiny))
        v_excluded = v * (excluded / wp.max(other_length, tiny))
        return between_segments(a, u_counted, b + v_excluded, v - v_excluded) - radii

    @wp.func(inline=True)
    def to_link(
        arms: wp.ref[Posed], reach: wp.ref[Reach], arm: int, i: int, j: int, motion: real, search: wp.ref[Search]
    ):
        """Search for the least distance of link i from link j behind it."""
        radii = arms.radius[arm, i] + arms.radius[arm, j]
        lengths = reach.length[i] + reach.length[j]
        search.t = search.first
        while search.t < search.end:
            t = search.t
            a, b = arms.starts[arm, t, i], arms.starts[arm, t, j]
            u, v = arms.ends[arm, t, i] - a, arms.ends[arm, t, j] - b
            found = wp.length(b - a + half * (v - u)) - half * lengths - radii
            distance = real(found)
            if found < search.nearest:
                distance = between_links(arms, arm, t, i, j, a, u, b, v, radii)
                if distance < wp.inf:  # else less may be excluded at the next sample
                    found = distance
            looked(search, distance, found, motion)

    @wp.func(inline=True)
    def from_arm(arms: wp.ref[Posed], reach: wp.ref[Reach], arm: int, search: wp.ref[Search]):
        """Search for the least distance of two links that are neither neighbours nor rigidly connected."""
        for i in range(arms.motion.shape[1]):
            if arms.radius[arm, i] > zero:
                links_between = int(0)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
                n_joints = int(0)  # noqa: RUF046, UP018
                for j in range(i + 1, arms.motion.shape[1]):
                    if arms.motion[arm, j] < wp.static(FIXED):
                        n_joints += 1
                    if arms.radius[arm, j] > zero:
                        if links_between > 0 and n_joints > 0:
                            to_link(arms, reach, arm, i, j, moved(reach, i + 1, j + 1, zero), search)
                        links_between += 1

    @wp.func
    def from_axis(p: Vector3, v: Vector3, solids: wp.ref[Solids], o: int, enough: real):
        """Return the distance of the segment from p to p + v from an obstacle, in the obstacle's frame."""
        h, shape, size = half * v, solids.shape[o], solids.half[o]
        if shape == wp.static(MESH):
            unturned = wp.identity(n=3, dtype=real)
            return separation(-(p + h), wp.static(SEGMENT), h, unturned, shape, size, solids, o, enough)
        return along_segment(shape, p, v, size)

    @wp.func(inline=True)
    def to_obstacle(
        arms: wp.ref[Posed], solids: wp.ref[Solids], arm: int, j: int, o: int, motion: real, search: wp.ref[Search]
    ):
        """Search for the least distance of link j from an obstacle."""
        r = arms.radius[arm, j]
        search.t = search.first
        while search.t < search.end:
            a = arms.starts[arm, search.t, j]
            along = arms.ends[arm, search.t, j] - a
            foot = real(0.0)  # share of the first link that is its foot, where the arm is mounted
            if j == 0:
                foot = two * r / wp.max(wp.length(along), tiny)
            if foot < one:
                base = solids.into[o] * (a - solids.centre[o])
                v = solids.into[o] * along
                p = base + foot * v
                v = (one - foot) * v
                enough = search.nearest + r
                found = lower_bound(solids.shape[o], p, v, solids.half[o], enough)
                if found < enough:
                    found = from_axis(p, v, solids, o, enough)
                found -= r
                distance = real(found)
                if j == 0 and found >= zero and found < search.nearest:  # noqa: SIM102 (Warp evaluates both anyway)
                    # The first link is always close to what the arm is mounted on: only overlaps count.
                    if from_axis(base, Vector3(), solids, o, two * r) <= r:
                        distance = search.nearest
                looked(search, distance, found, motion)
            else:
                search.t += 1

    @wp.func(inline=True)
    def from_obstacles(
        arms: wp.ref[Posed], reach: wp.ref[Reach], solids: wp.ref[Solids], arm: int, search: wp.ref[Search]
    ):
        """Search for the least distance of a link from an obstacle."""
        for j in range(arms.motion.shape[1]):
            if arms.radius[arm, j] > zero:
                for o in range(solids.shape.shape[0]):
                    to_obstacle(arms, solids, arm, j, o, moved(reach, 0, j + 1, zero), search)

    return SimpleNamespace(from_arm=from_arm, from_obstacles=from_obstacles)
