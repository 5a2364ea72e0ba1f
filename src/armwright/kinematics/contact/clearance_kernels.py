"""Warp kernels of clearance: distances of the links of posed arms from each other, from obstacles and from the column.

A link is a capsule: all points within its radius of its axis, a segment. A thread takes one arm at one target, and
branches: a bound excludes distant obstacles. docs/method.md §13 defines the distances.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, Precision
from armwright.kinematics.arms.frame_math import frame_math
from armwright.kinematics.arms.ik_math import kernel
from armwright.kinematics.contact.convex_math import SEGMENT, convex_math
from armwright.kinematics.contact.solid_math import CYLINDER, MESH, solid_math


@cache
def clearance_kernels(precision: Precision) -> SimpleNamespace:
    """Return the kernels in this precision, for N arms with D links at T targets, and O obstacles."""
    base = frame_math(precision)
    real, Vector3, advance = base.real, base.Vector3, base.advance
    solid, separation = solid_math(precision), convex_math(precision).separation
    Posed, Solids = solid.Posed, solid.Solids
    along_segment, may_be_nearer, nearer_link = solid.along_segment, solid.may_be_nearer, solid.nearer_link
    zero, half, one, two = real(0.0), real(0.5), real(1.0), real(2.0)
    tiny, parallel = real(1e-30), real(1e-12)  # the latter is the square of the sine of an angle that is 0 in float32

    @kernel
    def link_axes(arms: Posed):
        """Compute start and end of the axis of each link by forward kinematics."""
        arm, target = wp.tid()
        x, y, z = Vector3(one, zero, zero), Vector3(zero, one, zero), Vector3(zero, zero, one)
        p = arms.base[arm]
        for j in range(arms.motion.shape[1]):
            _axis, place, p, x, y, z = advance(
                arms.motion[arm, j], arms.axis[arm, j], arms.offset[arm, j], arms.q[arm, target, j], p, x, y, z
            )
            arms.starts[arm, target, j] = place
            arms.ends[arm, target, j] = p

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

    @kernel
    def self_clearance(arms: Posed, clearance: wp.array2d(dtype=real)):
        """Lower (N, T) clearances to the distance between links that are neither neighbours nor rigidly connected."""
        arm, target = wp.tid()
        nearest = clearance[arm, target]
        for i in range(arms.radius.shape[1]):
            r = arms.radius[arm, i]
            a = arms.starts[arm, target, i]
            u = arms.ends[arm, target, i] - a
            length = wp.length(u)
            links_between = int(0)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
            n_joints = int(0)  # noqa: RUF046, UP018
            between = real(0.0)  # [m] along the arm, from the end of link i to the start of link j
            for j in range(i + 1, arms.radius.shape[1]):
                b = arms.starts[arm, target, j]
                between += wp.length(b - arms.ends[arm, target, j - 1])  # displacement of a prismatic joint
                if arms.motion[arm, j] < wp.static(FIXED):
                    n_joints += 1
                v = arms.ends[arm, target, j] - b
                other_length = wp.length(v)
                radii = r + arms.radius[arm, j]
                if r > zero and arms.radius[arm, j] > zero:
                    # Parts of the arm that are this near along it cannot be farther apart, so they are excluded.
                    excluded = half * wp.max(two * radii - between, zero)
                    if links_between > 0 and n_joints > 0 and excluded <= wp.min(length, other_length):
                        u_counted = u * (one - excluded / wp.max(length, tiny))
                        v_excluded = v * (excluded / wp.max(other_length, tiny))
                        nearest = wp.min(
                            nearest, between_segments(a, u_counted, b + v_excluded, v - v_excluded) - radii
                        )
                    links_between += 1
                between += other_length
        clearance[arm, target] = nearest

    @wp.func
    def from_axis(p: Vector3, v: Vector3, solids: Solids, o: int, enough: real):
        """Return the distance of the segment from p to p + v from an obstacle, in the obstacle's frame."""
        h, shape, size = half * v, solids.shape[o], solids.half[o]
        if shape == wp.static(MESH):
            unturned = wp.identity(n=3, dtype=real)
            return separation(-(p + h), wp.static(SEGMENT), h, unturned, shape, size, solids, o, enough)
        return along_segment(shape, p, v, size)

    @kernel
    def obstacle_clearance(arms: Posed, solids: Solids, clearance: wp.array2d(dtype=real)):
        """Lower (N, T) clearances to the distance of a link from an obstacle."""
        arm, target = wp.tid()
        nearest = clearance[arm, target]
        for j in range(arms.radius.shape[1]):
            r = arms.radius[arm, j]
            if r > zero:
                a = arms.starts[arm, target, j]
                along = arms.ends[arm, target, j] - a
                foot = real(0.0)  # share of the first link that is its foot, where the arm is mounted
                if j == 0:
                    foot = two * r / wp.max(wp.length(along), tiny)
                if foot < one:
                    for o in range(solids.shape.shape[0]):
                        base = solids.into[o] * (a - solids.centre[o])
                        v = solids.into[o] * along
                        p = base + foot * v
                        v = (one - foot) * v
                        if may_be_nearer(nearest + r, solids.shape[o], solids.half[o], p, v):
                            distance = from_axis(p, v, solids, o, nearest + r) - r
                            mounted = j == 0 and from_axis(base, Vector3(), solids, o, two * r) <= r
                            # The first link is always close to what the arm is mounted on: only overlaps count.
                            if not mounted or distance < zero:
                                nearest = wp.min(nearest, distance)
        clearance[arm, target] = nearest

    @kernel
    def column_clearance(arms: Posed, column: wp.array(dtype=Vector3), clearance: wp.array2d(dtype=real)):
        """Lower (N, T) clearances to the distance of a column from links that move, except the first one.

        column: (N,) radius, radius, half the length [m], 0 without one.
        """
        arm, target = wp.tid()
        size = column[arm]
        if size[2] > zero:
            middle = arms.base[arm] - Vector3(zero, zero, size[2])
            nearest = clearance[arm, target]
            n_links = int(0)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
            n_joints = int(0)  # noqa: RUF046, UP018
            for j in range(arms.motion.shape[1]):
                if arms.motion[arm, j] < wp.static(FIXED):
                    n_joints += 1
                r = arms.radius[arm, j]
                if r > zero:
                    if n_links > 0 and n_joints > 0:
                        a = arms.starts[arm, target, j]
                        nearest = nearer_link(
                            nearest, wp.static(CYLINDER), size, a - middle, arms.ends[arm, target, j] - a, r
                        )
                    n_links += 1
            clearance[arm, target] = nearest

    return SimpleNamespace(
        real=real, Vector3=Vector3, Posed=Posed, Solids=Solids,
        link_axes=link_axes, self_clearance=self_clearance, obstacle_clearance=obstacle_clearance,
        column_clearance=column_clearance,
    )  # fmt: skip
