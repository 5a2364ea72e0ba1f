"""Warp functions of the signed distance of a body, a box or a cylinder, from another one or from an obstacle.

The separation of two convex bodies along a unit vector n is the least n·b - n·a of their points a and b. Its maximum
over all n is the signed distance: the distance of bodies that are apart, minus the depth of bodies that overlap
(Ericson, Real-Time Collision Detection, 2005, section 9.3). So the separation along any n is a lower bound.

The candidates are those of separating axes: three axes of each body and their nine cross products, where the axes of a
cylinder are its own and those towards and across the other body. For boxes that overlap, one of them gives the depth
(Gottschalk et al., SIGGRAPH 1996). If bodies are apart, the algorithm of Gilbert, Johnson & Keerthi (IEEE J. Robotics
and Automation 4, 1988) finds the maximum. For the convex hull of a mesh, the candidates are the normals of its faces.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import Precision
from armwright.kinematics.arms.frame_math import frame_math
from armwright.kinematics.contact.simplex_math import simplex_math
from armwright.kinematics.contact.solid_math import BOX, CYLINDER, GROUND, MESH, SPHERE, solid_math

ITERATIONS = 40  # of the search for the nearest points; boxes take about 5, cylinders about 15
ACCURACY = 1e-5  # [m] below the distance at most
SEGMENT = -2  # shape of the axis of a link; its `half` is half the way from its start to its end


@cache
def _axis_math(precision: Precision) -> SimpleNamespace:
    """Return the functions of separating axes in this precision."""
    base, Solids = frame_math(precision), solid_math(precision).Solids
    real, Vector3, Matrix3 = base.real, base.Vector3, base.Matrix3
    zero, one = real(0.0), real(1.0)
    tiny = real(1e-12)  # square of a length that counts as 0

    @wp.func
    def extent(shape: int, half: Vector3, n: Vector3):
        """Return how far a body reaches from its middle along n."""
        if shape == wp.static(SEGMENT):
            return wp.abs(wp.dot(n, half))
        x, y = wp.abs(n[0]) * half[0], wp.abs(n[1]) * half[1]
        if shape == wp.static(CYLINDER):
            x = half[0] * wp.sqrt(n[0] * n[0] + n[1] * n[1])
            y = zero
        return x + y + wp.abs(n[2]) * half[2]

    @wp.func
    def side_axis(shape: int, d: Vector3):
        """Return the first axis across the shaft: of a cylinder towards the point d."""
        if shape == wp.static(CYLINDER):
            across = wp.sqrt(d[0] * d[0] + d[1] * d[1])
            if across > real(1e-6):
                return Vector3(d[0] / across, d[1] / across, zero)
        return Vector3(one, zero, zero)

    @wp.func
    def along(n: Vector3, d: Vector3, shape: int, half: Vector3, into: Matrix3, other: int, other_half: Vector3):
        """Return the separation along a vector that needs no unit length; -1e30 for one that is too short."""
        square = wp.length_sq(n)
        if square < tiny:
            return real(-1.0e30)
        reach = extent(shape, half, n) + extent(other, other_half, into * n)
        return (wp.abs(wp.dot(n, d)) - reach) / wp.sqrt(square)

    @wp.func
    def best_axis(
        d: Vector3, shape: int, half: Vector3, into: Matrix3, other: int, other_half: Vector3, enough: real
    ):  # fmt: skip
        """Return the candidate with the largest separation, as a vector towards the other body, and its separation.

        The cross products count only if no axis separates the bodies enough.
        """
        z = Vector3(zero, zero, one)
        x = side_axis(shape, d)
        own = wp.matrix_from_rows(x, wp.cross(z, x), z)
        u = side_axis(other, -(into * d))
        back = wp.transpose(into)
        its = wp.matrix_from_rows(back * u, back * wp.cross(z, u), back * z)
        n, best = z, real(-1.0e30)
        for i in range(15):
            if i < 6 or best < enough:
                m = own[i % 3]
                if i > 2:
                    m = its[i % 3]
                if i > 5:
                    m = wp.cross(own[i % 3], its[i / 3 - 2])
                found = along(m, d, shape, half, into, other, other_half)
                if found > best:
                    n, best = m, found
        if wp.dot(n, d) < zero:
            n = -n
        return n, best

    @wp.func
    def best_face(d: Vector3, shape: int, half: Vector3, into: Matrix3, solids: Solids, o: int):
        """Return `best_axis` of a body and the convex hull of mesh o."""
        n, best = Vector3(), real(-1.0e30)
        for i in range(solids.planes.shape[1]):
            plane = solids.planes[o, i]
            m = wp.transpose(into) * Vector3(plane[0], plane[1], plane[2])
            found = -wp.dot(m, d) - plane[3] - extent(shape, half, m)
            if found > best:
                n, best = -m, found
        return n, best

    return SimpleNamespace(extent=extent, best_axis=best_axis, best_face=best_face)


@cache
def convex_math(precision: Precision) -> SimpleNamespace:
    """Return the functions in this precision."""
    base, axes = frame_math(precision), _axis_math(precision)
    simplex, solid = simplex_math(precision), solid_math(precision)
    extent, best_axis, best_face = axes.extent, axes.best_axis, axes.best_face
    Solids, signed_distance = solid.Solids, solid.signed_distance
    real, Vector3, Matrix3 = base.real, base.Vector3, base.Matrix3
    Simplex, nearest_point = simplex.Simplex, simplex.nearest_point
    zero, one = real(0.0), real(1.0)
    tiny = real(1e-12)  # square of a sine that counts as 0
    accuracy = real(ACCURACY)

    @wp.func
    def support(shape: int, half: Vector3, n: Vector3):
        """Return the point of a body that is farthest along n, in the body's frame."""
        p = Vector3(wp.where(n[0] >= zero, half[0], -half[0]), wp.where(n[1] >= zero, half[1], -half[1]), zero)
        if shape == wp.static(CYLINDER):
            across = wp.sqrt(n[0] * n[0] + n[1] * n[1])
            scale = half[0] / wp.max(across, tiny)
            p = Vector3(scale * n[0], scale * n[1], zero)
        p[2] = wp.where(n[2] >= zero, half[2], -half[2])
        if shape == wp.static(SEGMENT):
            p = wp.where(wp.dot(n, half) >= zero, half, -half)
        return p

    @wp.func
    def farthest(shape: int, half: Vector3, corners: wp.array2d(dtype=Vector3), o: int, n: Vector3):
        """Return the point of a body, or the corner of mesh o, that is farthest along n, in its frame."""
        if shape != wp.static(MESH):
            return support(shape, half, n)
        p = corners[o, 0]
        for i in range(1, corners.shape[1]):
            if wp.dot(corners[o, i] - p, n) > zero:
                p = corners[o, i]
        return p

    @wp.func
    def separation(
        d: Vector3, shape: int, half: Vector3, into: Matrix3, other: int, other_half: Vector3, solids: Solids, o: int,
        enough: real,
    ):  # fmt: skip
        """Return the signed distance of two bodies, in the frame of the first one.

        d: middle of the other body.  into: rotation into the other body's frame.  o: index of the other body if it is a
        mesh.  enough: a lower bound of this size ends the search.
        """
        n, bound = Vector3(), real(0.0)
        if other == wp.static(MESH):
            n, bound = best_face(d, shape, half, into, solids, o)
        else:
            n, bound = best_axis(d, shape, half, into, other, other_half, enough)
        # If one is no box, no candidate may separate bodies that are apart.
        boxes = shape == wp.static(BOX) and other == wp.static(BOX)
        if bound >= enough or (boxes and bound <= zero):
            return bound
        back = wp.transpose(into)
        v = d + back * farthest(other, other_half, solids.corners, o, into * -n) - support(shape, half, n)
        s = Simplex()
        s[0] = v
        size = int(1)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
        distance = wp.length(v)
        for _ in range(wp.static(ITERATIONS)):
            if distance < accuracy:
                break
            w = d + back * farthest(other, other_half, solids.corners, o, into * -v) - support(shape, half, v)
            bound = wp.max(bound, wp.dot(v, w) / distance)
            if bound > distance - accuracy or bound >= enough:
                break
            s[size] = w
            size += 1
            v, s, size = nearest_point(s, size)
            nearer = wp.length(v)
            if size == 4:
                break
            distance = nearer
        return bound

    @wp.func
    def from_obstacle(place: Vector3, kind: int, half: Vector3, into: Matrix3, solids: Solids, o: int, enough: real):
        """Return the distance of a body from obstacle o; its middle in the world, and the rotation into its frame."""
        d, shape, frame = solids.centre[o] - place, solids.shape[o], solids.into[o]
        if shape == wp.static(GROUND):
            up = wp.transpose(frame) * Vector3(zero, zero, one)
            return -wp.dot(d, up) - extent(kind, half, into * up)
        if shape == wp.static(SPHERE):
            return signed_distance(kind, into * d, half) - solids.half[o][0]
        turn = frame * wp.transpose(into)
        return separation(into * d, kind, half, turn, shape, solids.half[o], solids, o, enough)

    return SimpleNamespace(separation=separation, from_obstacle=from_obstacle)
