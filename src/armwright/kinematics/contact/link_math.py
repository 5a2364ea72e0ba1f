"""Warp functions of clearance along a span of postures: of links from each other.

A link is a capsule: all points within its radius of its axis, a segment. docs/method.md §13 defines the distances.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, PRISMATIC, Precision
from armwright.kinematics.arms.frame_math import frame_math
from armwright.kinematics.contact.solid_math import solid_math
from armwright.kinematics.contact.span_math import span_math


@cache
def link_math(precision: Precision) -> SimpleNamespace:
    """Return the function in this precision. It returns the lower of a clearance and theirs, and the posture."""
    base, solid, span = frame_math(precision), solid_math(precision), span_math(precision)
    real, Vector3 = base.real, base.Vector3
    Posed, Steps, travel, ahead = solid.Posed, span.Steps, span.travel, span.ahead
    zero, half, one, two = real(0.0), real(0.5), real(1.0), real(2.0)
    far, tiny = real(1e9), real(1e-30)
    parallel = real(1e-12)  # square of the sine of an angle that is 0 in float32

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

    @wp.func
    def along_arm(arms: Posed, arm: int, t: int, i: int, j: int):
        """Return the way along the arm from the end of link i to the start of link j [m]."""
        way = real(0.0)
        for k in range(i + 1, j + 1):
            if k > i + 1:
                way += wp.length(arms.ends[arm, t, k - 1] - arms.starts[arm, t, k - 1])
            way += wp.length(arms.starts[arm, t, k] - arms.ends[arm, t, k - 1])  # displacement of a prismatic joint
        return way

    @wp.func
    def link_distance(arms: Posed, arm: int, t: int, i: int, j: int):
        """Return the distance of two links without the parts that cannot be apart; a large one if nothing is left."""
        a, b = arms.starts[arm, t, i], arms.starts[arm, t, j]
        u, v = arms.ends[arm, t, i] - a, arms.ends[arm, t, j] - b
        radii = arms.radius[arm, i] + arms.radius[arm, j]
        length, other_length = wp.length(u), wp.length(v)
        # Parts of the arm that are this near along it cannot be farther apart, so they are excluded.
        excluded = half * wp.max(two * radii - along_arm(arms, arm, t, i, j), zero)
        if excluded > wp.min(length, other_length):
            return far
        counted = u * (one - excluded / wp.max(length, tiny))
        left_out = v * (excluded / wp.max(other_length, tiny))
        return between_segments(a, counted, b + left_out, v - left_out) - radii

    @wp.func
    def links_apart(arms: Posed, arm: int, first: int, end: int, steps: Steps, nearest: real, at: int):
        """Clearance of links that are neither neighbours nor rigidly connected."""
        for i in range(arms.radius.shape[1]):
            links_between = int(0)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
            n_joints = int(0)  # noqa: RUF046, UP018
            slides = bool(False)  # noqa: UP018
            for j in range(i + 1, arms.radius.shape[1]):
                if arms.motion[arm, j] < wp.static(FIXED):
                    n_joints += 1
                    slides = slides or arms.motion[arm, j] >= wp.static(PRISMATIC)
                if arms.radius[arm, i] > zero and arms.radius[arm, j] > zero:
                    if links_between > 0 and n_joints > 0:
                        way = real(0.0)
                        if end > first + 1:
                            way = travel(arms, arm, steps, i + 1, j + 1, arms.radius[arm, j])
                        t = int(first)
                        while t < end:
                            found = link_distance(arms, arm, t, i, j)
                            if found < nearest:
                                nearest, at = found, t
                            # What is excluded changes with displacements.
                            t += wp.where(slides, 1, ahead(found - nearest, way))
                    links_between += 1
        return nearest, at

    return SimpleNamespace(links_apart=links_apart)
