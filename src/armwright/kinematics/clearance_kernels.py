"""The kernels of clearance: how far the links of posed arms are from each other and from obstacles, in Warp.

A link is a capsule: all points within its radius of its axis, a segment. A thread takes one arm at one target, and
branches: what a link is far from is passed over by a bound. docs/method.md §13 says what is measured.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import warp as wp

from armwright.kinematics.arm_arrays import FIXED, PRISMATIC, Precision
from armwright.tasks.obstacles import SHAPES

_OPTIONS = {"cpu_compiler_flags": "-march=native -O3"}
_kernel = partial(wp.kernel, enable_backward=False, module="unique", module_options=_OPTIONS)

HALVINGS = 20  # of a link, in the search for its point nearest to an obstacle: to 1e-6 of its length
BOX, SPHERE, CYLINDER, GROUND = map(SHAPES.index, ("box", "sphere", "cylinder", "ground"))


@dataclass(frozen=True)
class ClearanceKernels:
    """One variant of the kernels. Each compiles when it is first loaded, and is kept on disk."""

    real: Any
    Vector3: Any
    Matrix3: Any
    place: Any  # where the links are
    part: Any  # how far from each other
    clear: Any  # how far from obstacles


@cache
def clearance_kernels_of(precision: Precision) -> ClearanceKernels:
    """The kernels in this precision. Of N arms with D links at T targets, and of O obstacles."""
    real, Vector3, Matrix3 = {
        "float32": (wp.float32, wp.vec3f, wp.mat33f),
        "float64": (wp.float64, wp.vec3d, wp.mat33d),
    }[precision]
    zero, half, one, two = real(0.0), real(0.5), real(1.0), real(2.0)
    tiny = real(1e-30)
    parallel = real(1e-12)  # square of the sine of an angle that float32 does not tell from 0

    @wp.func
    def slid(motion: int, p: Vector3, way: real, x: Vector3, y: Vector3, z: Vector3):
        """A joint's place: a sliding one has gone its way along its axis."""
        if motion == wp.static(PRISMATIC):
            return p + way * x
        if motion == wp.static(PRISMATIC + 1):
            return p + way * y
        if motion == wp.static(PRISMATIC + 2):
            return p + way * z
        return p

    @wp.func
    def turned(motion: int, x: Vector3, y: Vector3, z: Vector3, s: real, c: real):
        """The frame's axes x, y, z in the world, as a joint with the angle of this sine and cosine turns them."""
        if motion == 0:
            return x, c * y + s * z, c * z - s * y
        if motion == 1:
            return c * x - s * z, y, c * z + s * x
        if motion == 2:
            return c * x + s * y, c * y - s * x, z
        return x, y, z

    @_kernel
    def place(
        base: wp.array(dtype=Vector3),
        motion: wp.array2d(dtype=int),
        offset: wp.array2d(dtype=Vector3),
        q: wp.array3d(dtype=real),
        starts: wp.array3d(dtype=Vector3),
        ends: wp.array3d(dtype=Vector3),
    ):
        """Forward kinematics: where each link's axis starts and ends.

        base: (N,) [m].  motion: (N, D).  offset: (N, D) [m].  q: (N, T, D) [rad] or [m].  starts, ends: (N, T, D) [m].
        """
        arm, target = wp.tid()
        x, y, z = Vector3(one, zero, zero), Vector3(zero, one, zero), Vector3(zero, zero, one)
        p = base[arm]
        for j in range(motion.shape[1]):
            value = q[arm, target, j]
            p = slid(motion[arm, j], p, value, x, y, z)
            x, y, z = turned(motion[arm, j], x, y, z, wp.sin(value), wp.cos(value))
            starts[arm, target, j] = p
            along = offset[arm, j]
            p = p + along[0] * x + along[1] * y + along[2] * z
            ends[arm, target, j] = p

    @wp.func
    def to_segment(p: Vector3, a: Vector3, u: Vector3):
        """The square of a point's distance from the segment from a to a + u."""
        t = wp.clamp(wp.dot(p - a, u) / wp.max(wp.dot(u, u), tiny), zero, one)
        return wp.length_sq(p - a - t * u)

    @wp.func
    def between_segments(a: Vector3, u: Vector3, b: Vector3, v: Vector3):
        """The distance of the segment from a to a + u from the one from b to b + v.

        The nearest points are where one of them ends, or where the line across both meets them. By the cross product
        the latter is well determined for segments that are nearly parallel, too.
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

    @_kernel
    def part(
        motion: wp.array2d(dtype=int),
        starts: wp.array3d(dtype=Vector3),
        ends: wp.array3d(dtype=Vector3),
        radius: wp.array2d(dtype=real),
        clearance: wp.array2d(dtype=real),
    ):
        """The smallest distance of two links of an arm that are not neighbours; a link of radius 0 is not there.

        Nor do links count that are rigidly connected.
        motion: (N, D).  starts, ends: (N, T, D) [m].  radius: (N, D) [m].  clearance: (N, T) [m], which only becomes
        smaller.
        """
        arm, target = wp.tid()
        nearest = clearance[arm, target]
        for i in range(radius.shape[1]):
            r = radius[arm, i]
            a = starts[arm, target, i]
            u = ends[arm, target, i] - a
            long = wp.length(u)
            links_between = int(0)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
            joints = int(0)  # noqa: RUF046, UP018
            between = real(0.0)  # [m] along the arm, from the end of link i to the start of link j
            for j in range(i + 1, radius.shape[1]):
                b = starts[arm, target, j]
                between += wp.length(b - ends[arm, target, j - 1])  # the way of a sliding joint
                if motion[arm, j] < wp.static(FIXED):
                    joints += 1
                v = ends[arm, target, j] - b
                other_long = wp.length(v)
                radii = r + radius[arm, j]
                if r > zero and radius[arm, j] > zero:
                    # Parts of the arm that are nearer to each other along it cannot be apart: they do not count.
                    spared = half * wp.max(two * radii - between, zero)
                    if links_between > 0 and joints > 0 and spared <= wp.min(long, other_long):
                        u_counted = u * (one - spared / wp.max(long, tiny))
                        v_spared = v * (spared / wp.max(other_long, tiny))
                        nearest = wp.min(nearest, between_segments(a, u_counted, b + v_spared, v - v_spared) - radii)
                    links_between += 1
                between += other_long
        clearance[arm, target] = nearest

    @wp.func
    def signed_distance(shape: int, p: Vector3, size: Vector3):
        """From an obstacle's surface, in the obstacle's own frame; within it, minus the depth."""
        if shape == wp.static(GROUND):
            return p[2]
        if shape == wp.static(SPHERE):
            return wp.length(p) - size[0]
        ex, ey, ez = wp.abs(p[0]) - size[0], wp.abs(p[1]) - size[1], wp.abs(p[2]) - size[2]
        if shape == wp.static(CYLINDER):
            ex = wp.sqrt(p[0] * p[0] + p[1] * p[1]) - size[0]
            ey = ex
        within = wp.min(wp.max(ex, wp.max(ey, ez)), zero)
        if shape == wp.static(CYLINDER):
            ey = zero
        return within + wp.length(Vector3(wp.max(ex, zero), wp.max(ey, zero), wp.max(ez, zero)))

    @wp.func
    def rises(shape: int, p: Vector3, v: Vector3, size: Vector3):
        """A number above 0 where the signed distance rises from p along v, below 0 where it falls."""
        if shape == wp.static(GROUND):
            return v[2]
        if shape == wp.static(SPHERE):
            return wp.dot(p, v)
        ex, ey, ez = wp.abs(p[0]) - size[0], wp.abs(p[1]) - size[1], wp.abs(p[2]) - size[2]
        vx, vy, vz = wp.sign(p[0]) * v[0], wp.sign(p[1]) * v[1], wp.sign(p[2]) * v[2]
        if shape == wp.static(CYLINDER):
            across = wp.sqrt(p[0] * p[0] + p[1] * p[1])
            ex = across - size[0]
            ey = ex
            vx = (p[0] * v[0] + p[1] * v[1]) / wp.max(across, tiny)
            vy = zero
        if wp.max(ex, wp.max(ey, ez)) > zero:
            return wp.max(ex, zero) * vx + wp.max(ey, zero) * vy + wp.max(ez, zero) * vz
        if ez >= wp.max(ex, ey):
            return vz
        if shape == wp.static(CYLINDER) or ex >= ey:
            return vx
        return vy

    @wp.func
    def along_segment(shape: int, p: Vector3, v: Vector3, size: Vector3):
        """The least signed distance on the segment from p to p + v: it is convex there, so bisection finds it."""
        if rises(shape, p, v, size) >= zero:
            return signed_distance(shape, p, size)
        if rises(shape, p + v, v, size) <= zero:
            return signed_distance(shape, p + v, size)
        low, high = real(0.0), real(1.0)
        for _ in range(wp.static(HALVINGS)):
            middle = half * (low + high)
            if rises(shape, p + middle * v, v, size) < zero:
                low = middle
            else:
                high = middle
        return signed_distance(shape, p + half * (low + high) * v, size)

    @_kernel
    def clear(
        starts: wp.array3d(dtype=Vector3),
        ends: wp.array3d(dtype=Vector3),
        radius: wp.array2d(dtype=real),
        shape: wp.array(dtype=int),
        centre: wp.array(dtype=Vector3),
        into: wp.array(dtype=Matrix3),
        size: wp.array(dtype=Vector3),
        clearance: wp.array2d(dtype=real),
    ):
        """The smallest distance of a link of an arm from an obstacle; a link of radius 0 is not there.

        starts, ends: (N, T, D) [m].  radius: (N, D) [m].  shape, centre, into (a rotation into the obstacle's frame),
        size (its halves): (O,).  clearance: (N, T) [m], which only becomes smaller.
        """
        arm, target = wp.tid()
        nearest = clearance[arm, target]
        for j in range(radius.shape[1]):
            r = radius[arm, j]
            if r > zero:
                a = starts[arm, target, j]
                along = ends[arm, target, j] - a
                foot = real(0.0)  # the share of the first link where the arm is mounted
                if j == 0:
                    foot = two * r / wp.max(wp.length(along), tiny)
                if foot < one:
                    for o in range(shape.shape[0]):
                        base = into[o] * (a - centre[o])
                        v = into[o] * along
                        p = base + foot * v
                        v = (one - foot) * v
                        # No point of the link is nearer than this, as the distance changes by no more than one moves.
                        bound = signed_distance(shape[o], p + half * v, size[o]) - half * wp.length(v)
                        if bound - r < nearest:
                            apart = along_segment(shape[o], p, v, size[o]) - r
                            stands = j == 0 and signed_distance(shape[o], base, size[o]) <= r
                            # Of what the arm stands on, the first link is not far: only in it.
                            if not stands or apart < zero:
                                nearest = wp.min(nearest, apart)
        clearance[arm, target] = nearest

    return ClearanceKernels(real, Vector3, Matrix3, place, part, clear)
