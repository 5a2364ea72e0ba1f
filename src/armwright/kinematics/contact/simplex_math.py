"""Warp functions of the point of a simplex that is nearest to the origin (Ericson 2005, section 5.1)."""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import Precision
from armwright.kinematics.arms.frame_math import frame_math


@cache
def simplex_math(precision: Precision) -> SimpleNamespace:
    """Return the functions in this precision."""
    base = frame_math(precision)
    real, Vector3 = base.real, base.Vector3
    Simplex = wp.types.matrix(shape=(4, 3), dtype=real)
    zero, one = real(0.0), real(1.0)
    least = real(1e-30)  # square of a length that may be divided by
    flat = real(1e-10)  # relative volume of a tetrahedron that counts as flat

    @wp.func
    def on_segment(a: Vector3, b: Vector3):
        """Return the nearest point of a segment, and which ends it lies between: 1 for a, 2 for b, 3 for both."""
        u = b - a
        t = -wp.dot(a, u) / wp.max(wp.dot(u, u), least)
        if t <= zero:
            return a, 1
        if t >= one:
            return b, 2
        return a + t * u, 3

    @wp.func
    def on_triangle(a: Vector3, b: Vector3, c: Vector3):
        """Return the nearest point of a triangle, and the sum of 1 for a, 2 for b, 4 for c of those it lies between."""
        u, v = b - a, c - a
        n = wp.cross(u, v)
        nn = wp.dot(n, n)
        if nn > flat * wp.dot(u, u) * wp.dot(v, v):
            # Barycentric coordinates of the projection of the origin.
            beta = wp.dot(wp.cross(-a, v), n)
            gamma = wp.dot(wp.cross(u, -a), n)
            if beta >= zero and gamma >= zero and beta + gamma <= nn:
                return (wp.dot(a, n) / nn) * n, 7
        p, mask = on_segment(a, b)
        q, kept = on_segment(a, c)
        if wp.length_sq(q) < wp.length_sq(p):
            p = q
            mask = wp.where(kept == 1, 1, wp.where(kept == 2, 4, 5))
        q, kept = on_segment(b, c)
        if wp.length_sq(q) < wp.length_sq(p):
            p = q
            mask = 2 * kept
        return p, mask

    @wp.func
    def is_outside(a: Vector3, b: Vector3, c: Vector3, e: Vector3):
        """Return whether the origin is on the other side of the face a, b, c than e, or the tetrahedron is flat."""
        n = wp.cross(b - a, c - a)
        height = wp.dot(e - a, n)
        if height * height <= flat * wp.dot(n, n) * wp.dot(e - a, e - a):
            return True
        return -wp.dot(a, n) * height < zero

    @wp.func
    def on_tetrahedron(s: Simplex):
        """Return the nearest point of a tetrahedron, and the sum of 1, 2, 4, 8 for the corners it lies between."""
        p, mask = Vector3(zero, zero, zero), 15
        best = real(1.0e30)
        for face in range(4):  # the one without this corner
            i, j, k = wp.where(face == 0, 1, 0), wp.where(face < 2, 2, 1), wp.where(face == 3, 2, 3)
            if is_outside(s[i], s[j], s[k], s[face]):
                q, kept = on_triangle(s[i], s[j], s[k])
                if wp.length_sq(q) < best:
                    best = wp.length_sq(q)
                    p = q
                    mask = (kept & 1) * (1 << i) + ((kept >> 1) & 1) * (1 << j) + ((kept >> 2) & 1) * (1 << k)
        return p, mask

    @wp.func
    def nearest_point(s: Simplex, size: int):
        """Return the nearest point of the first corners, the corners it lies between, and their number."""
        p, mask = s[0], 1
        if size == 2:
            p, mask = on_segment(s[0], s[1])
        if size == 3:
            p, mask = on_triangle(s[0], s[1], s[2])
        if size == 4:
            p, mask = on_tetrahedron(s)
        kept = int(0)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
        for i in range(4):
            if (mask >> i) & 1:
                s[kept] = s[i]
                kept += 1
        return p, s, kept

    return SimpleNamespace(Simplex=Simplex, nearest_point=nearest_point)
