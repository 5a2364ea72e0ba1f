"""Warp functions of the signed distance of points and segments from solids, in the frame of the solid.

docs/method.md §13 defines the distances.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import Precision
from armwright.kinematics.arms.frame_math import frame_math
from armwright.tasks.obstacles import SHAPES

HALVINGS = 20  # of a link, in the search for its point nearest to a solid: to 1e-6 of its length
BOX, SPHERE, CYLINDER, GROUND, MESH = map(SHAPES.index, ("box", "sphere", "cylinder", "ground", "mesh"))


@cache
def solid_math(precision: Precision) -> SimpleNamespace:
    """Return the functions in this precision."""
    base = frame_math(precision)
    real, Vector3, Matrix3 = base.real, base.Vector3, base.Matrix3
    Vector4 = wp.types.vector(length=4, dtype=real)
    zero, half = real(0.0), real(0.5)
    tiny = real(1e-30)

    @wp.struct
    class Solids:
        """O obstacles in the world, or tool and payload in the tip frame."""

        shape: wp.array(dtype=int)  # (O,)
        centre: wp.array(dtype=Vector3)  # (O,) [m]
        into: wp.array(dtype=Matrix3)  # (O,) rotation into the solid's frame
        half: wp.array(dtype=Vector3)  # (O,) half sides or radii [m]
        corners: wp.array2d(dtype=Vector3)  # (O, P) of the hull of a mesh, in its frame [m]; some repeatedly
        planes: wp.array2d(dtype=Vector4)  # (O, F) likewise of its faces, as of `Hull`

    @wp.func
    def signed_distance(shape: int, p: Vector3, size: Vector3):
        """Return the distance from a surface in its own frame; inside, minus the depth. A mesh counts as its box."""
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
        """Return a number above 0 if the signed distance rises from p along v, below 0 if it falls."""
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
        """Return the least signed distance on the segment from p to p + v by bisection: it is convex there."""
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

    @wp.func
    def lower_bound(shape: int, p: Vector3, v: Vector3, size: Vector3, enough: real):
        """Return a lower bound of the least signed distance on the segment from p to p + v; one of `enough` will do.

        Distance changes by no more than the path length, and rises with each coordinate, except from the ground.
        """
        bound = signed_distance(shape, p + half * v, size) - half * wp.length(v)
        if shape == wp.static(GROUND) or bound >= enough:
            return bound
        low, high = wp.min(p, p + v), wp.max(p, p + v)
        return wp.max(bound, signed_distance(shape, wp.max(low, wp.min(high, Vector3(zero, zero, zero))), size))

    @wp.func
    def from_link(shape: int, size: Vector3, p: Vector3, v: Vector3, radius: real, enough: real):
        """Return the distance of a solid from a link with the axis from p to p + v, or a lower bound above `enough`."""
        bound = lower_bound(shape, p, v, size, enough + radius)
        if bound < enough + radius:
            bound = along_segment(shape, p, v, size)
        return bound - radius

    return SimpleNamespace(
        Solids=Solids, signed_distance=signed_distance, along_segment=along_segment, lower_bound=lower_bound,
        from_link=from_link,
    )  # fmt: skip
