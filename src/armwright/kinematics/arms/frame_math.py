"""Warp functions of forward kinematics for one posture per thread."""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, OBLIQUE, PRISMATIC, Precision


@cache
def frame_math(precision: Precision) -> SimpleNamespace:
    """Return the functions in this precision."""
    real, Vector3, Matrix3 = {
        "float32": (wp.float32, wp.vec3f, wp.mat33f),
        "float64": (wp.float64, wp.vec3d, wp.mat33d),
    }[precision]

    one = real(1.0)

    @wp.func
    def in_frame(v: Vector3, x: Vector3, y: Vector3, z: Vector3):
        """Return the world components of a vector that is fixed in a frame."""
        return v[0] * x + v[1] * y + v[2] * z

    @wp.func
    def rotate(motion: int, local: Vector3, axis: Vector3, x: Vector3, y: Vector3, z: Vector3, s: real, c: real):
        """Return the axes x, y, z of the frame after a joint whose angle has this sine and cosine.

        About an axis a that is none of these, by Rodrigues' formula: x' = c x + s a × x + (1 - c) (a·x) a.
        """
        if motion < wp.static(OBLIQUE):
            s *= local[motion]  # -1 for the opposite of x, y or z
        if motion == 0:
            return x, c * y + s * z, c * z - s * y
        if motion == 1:
            return c * x - s * z, y, c * z + s * x
        if motion == 2:
            return c * x + s * y, c * y - s * x, z
        if motion == wp.static(OBLIQUE):
            turned_x = c * x + s * wp.cross(axis, x) + ((one - c) * local[0]) * axis
            turned_y = c * y + s * wp.cross(axis, y) + ((one - c) * local[1]) * axis
            return turned_x, turned_y, wp.cross(turned_x, turned_y)
        return x, y, z

    @wp.func
    def advance(motion: int, local: Vector3, offset: Vector3, q: real, p: Vector3, x: Vector3, y: Vector3, z: Vector3):
        """Return the axis of a joint at a value [rad] or [m], its place, that of the next joint, and the frame between.

        local: axis of the joint in the frame before it.  p: where it is at 0.  x, y, z: the frame before it.
        """
        axis, place = in_frame(local, x, y, z), p
        if motion >= wp.static(PRISMATIC) and motion < wp.static(FIXED):
            place = p + q * axis
        x, y, z = rotate(motion, local, axis, x, y, z, wp.sin(q), wp.cos(q))
        return axis, place, place + offset[0] * x + offset[1] * y + offset[2] * z, x, y, z

    return SimpleNamespace(real=real, Vector3=Vector3, Matrix3=Matrix3, in_frame=in_frame, advance=advance)
