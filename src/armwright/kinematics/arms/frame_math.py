"""Warp functions of forward kinematics for one posture per thread."""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import PRISMATIC, Precision


@cache
def frame_math(precision: Precision) -> SimpleNamespace:
    """Return the functions in this precision."""
    real, Vector3, Matrix3 = {
        "float32": (wp.float32, wp.vec3f, wp.mat33f),
        "float64": (wp.float64, wp.vec3d, wp.mat33d),
    }[precision]

    @wp.func
    def translate(motion: int, p: Vector3, displacement: real, x: Vector3, y: Vector3, z: Vector3):
        """Return the position of a joint: a prismatic joint is displaced along its axis."""
        if motion == wp.static(PRISMATIC):
            return p + displacement * x
        if motion == wp.static(PRISMATIC + 1):
            return p + displacement * y
        if motion == wp.static(PRISMATIC + 2):
            return p + displacement * z
        return p

    @wp.func
    def rotate(motion: int, x: Vector3, y: Vector3, z: Vector3, s: real, c: real):
        """Return the axes x, y, z of the frame after a joint whose angle has this sine and cosine."""
        if motion == 0:
            return x, c * y + s * z, c * z - s * y
        if motion == 1:
            return c * x - s * z, y, c * z + s * x
        if motion == 2:
            return c * x + s * y, c * y - s * x, z
        return x, y, z

    @wp.func
    def advance(motion: int, offset: Vector3, q: real, p: Vector3, x: Vector3, y: Vector3, z: Vector3):
        """Return the position of a joint at a value [rad] or [m], that of the next joint, and the frame between them.

        p: where the joint is at 0.  x, y, z: the frame before it.
        """
        place = translate(motion, p, q, x, y, z)
        x, y, z = rotate(motion, x, y, z, wp.sin(q), wp.cos(q))
        return place, place + offset[0] * x + offset[1] * y + offset[2] * z, x, y, z

    @wp.func
    def axis_of(motion: int, x: Vector3, y: Vector3, z: Vector3):
        """Return the axis of a joint in the world; 0 for a fixed joint."""
        if motion == 0 or motion == wp.static(PRISMATIC):
            return x
        if motion == 1 or motion == wp.static(PRISMATIC + 1):
            return y
        if motion == 2 or motion == wp.static(PRISMATIC + 2):
            return z
        return Vector3()

    return SimpleNamespace(real=real, Vector3=Vector3, Matrix3=Matrix3, advance=advance, axis_of=axis_of)
