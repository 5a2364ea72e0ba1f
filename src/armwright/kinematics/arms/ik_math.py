"""Warp functions that all kernels of inverse kinematics share.

`ik_math` makes variants: in single or double precision, and with some lanes or one. A lane is one target of an arm.
What differs between lanes is arithmetic, never a branch: a condition is a mask of zeros and ones. The joints of an arm
are the same in all lanes, so they may branch, in functions that return at once. Prismatic joints cost an eighth of the
time, so arms of revolute joints alone have a variant.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

import math
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, MAX_JOINTS, PRISMATIC, Motions, Precision

# At -O2, Warp's default, LLVM leaves more of the lanes scalar: 43,000 designs/s on a core rather than 58,000.
OPTIONS = {"cpu_compiler_flags": "-march=native -O3"}

# A Warp kernel in a module of its own: the fewer its callers, the more willingly LLVM inlines a function.
kernel = partial(wp.kernel, enable_backward=False, module="unique", module_options=OPTIONS)


@dataclass(frozen=True)
class IkMath:
    """Types and functions of one variant."""

    real: Any  # the number type
    Vector3: Any
    Lane: Any  # a vector of one number for each lane
    Wide: Any  # likewise in float64
    Joints: Any  # a matrix whose row j is joint j in all lanes
    Vectors: Any  # a matrix whose row i is component i in all lanes
    Frame: Any  # likewise: components of the local axes x, y and z in the world, then of the place
    Arms: Any  # `ArmArrays` on the device, a Warp struct
    roots: Any
    at_least: Any
    select: Any
    advance: Any
    column: Any
    limit: Any
    damping: Any
    norm_squared: Any


@cache
def ik_math(precision: Precision, lanes: int, motions: Motions) -> IkMath:
    """Return the variant for a precision, a number of lanes and what the joints of the arms do.

    One long function on purpose: what Warp compiles takes its types and constants from the function around it.
    """
    real, Vector3 = {"float32": (wp.float32, wp.vec3f), "float64": (wp.float64, wp.vec3d)}[precision]
    Lane = wp.types.vector(length=lanes, dtype=real)
    Wide = wp.types.vector(length=lanes, dtype=wp.float64)
    Joints = wp.types.matrix(shape=(MAX_JOINTS, lanes), dtype=real)
    Vectors = wp.types.matrix(shape=(3, lanes), dtype=real)
    Frame = wp.types.matrix(shape=(12, lanes), dtype=real)

    zero, one, two = real(0.0), real(1.0), real(2.0)
    least_manipulability = real(0.1)  # below it the update is damped
    full_damping = real(0.001)
    angle_margin = real(math.radians(1.0))  # from the limits, keeps the limit gradient finite
    travel_margin = real(1e-3)  # [m]
    centring_gain = real(0.01)

    @wp.struct
    class Arms:
        dof: int
        base: wp.array(dtype=Vector3)  # (N,)
        motion: wp.array2d(dtype=int)  # (N, D)
        lower: wp.array2d(dtype=real)  # (N, D)
        upper: wp.array2d(dtype=real)  # (N, D)
        offset: wp.array2d(dtype=Vector3)  # (N, D)
        com: wp.array2d(dtype=Vector3)  # (N, D)
        mass: wp.array2d(dtype=real)  # (N, D)
        tool_axis: wp.array(dtype=Vector3)  # (N,)
        tool_side: wp.array(dtype=Vector3)  # (N,)
        payload_center: wp.array(dtype=Vector3)  # (N,)

    @wp.func
    def roots(x: Lane):
        """Return square roots."""
        result = Lane()
        for i in range(lanes):
            result[i] = wp.sqrt(x[i])
        return result

    @wp.func
    def at_least(a: Lane, b: Lane):
        """Return 1 where a >= b, else 0."""
        return real(0.5) * (wp.sign(a - b) + Lane(one))

    @wp.func
    def select(mask: Lane, a: Lane, b: Lane):
        """Return a where the mask is 1, b where it is 0, both to the bit."""
        return wp.cw_mul(mask, a) + wp.cw_mul(Lane(one) - mask, b)

    @wp.func
    def library_sine_cosine(angle: Lane):
        """Return sine and cosine, to the last bits."""
        s, c = Lane(), Lane()
        for i in range(lanes):
            s[i] = wp.sin(angle[i])
            c[i] = wp.cos(angle[i])
        return s, c

    @wp.func
    def polynomial_sine_cosine(angle: Lane):
        """Return sine and cosine for |angle| <= 2π, to 1e-6: polynomials for a quarter of the angle, doubled twice.

        The coefficients interpolate (sin h / h - 1) / h² and (cos h - 1 + h²/2) / h⁴ at Chebyshev's nodes of
        |h| <= π/2; they are within 3e-8.
        """
        h = 0.25 * angle
        x = wp.cw_mul(h, h)
        s = 2.634756392e-06 * x - Lane(1.982273949e-04)
        s = wp.cw_mul(s, x) + Lane(8.333242135e-03)
        s = wp.cw_mul(s, x) - Lane(1.666666596e-01)
        s = wp.cw_mul(s, wp.cw_mul(x, h)) + h
        c = -2.654606581e-07 * x + Lane(2.478608244e-05)
        c = wp.cw_mul(c, x) - Lane(1.388881255e-03)
        c = wp.cw_mul(c, x) + Lane(4.166666608e-02)
        c = wp.cw_mul(c, x) - Lane(0.5)
        c = wp.cw_mul(c, x) + Lane(1.0)
        s2 = 2.0 * wp.cw_mul(s, c)
        c2 = Lane(1.0) - 2.0 * wp.cw_mul(s, s)
        return 2.0 * wp.cw_mul(s2, c2), Lane(1.0) - 2.0 * wp.cw_mul(s2, s2)

    # float32 needs no more than the polynomials, which take a small part of the library's time.
    sine_cosine = polynomial_sine_cosine if precision == "float32" else library_sine_cosine

    @wp.func
    def rotate_revolute(motion: int, x: Lane, y: Lane, z: Lane, s: Lane, c: Lane):
        """Return one world component of the frame's axes x, y, z after a joint; last, of the axis of that joint."""
        if motion == 0:
            return x, wp.cw_mul(c, y) + wp.cw_mul(s, z), wp.cw_mul(c, z) - wp.cw_mul(s, y), x
        if motion == 1:
            return wp.cw_mul(c, x) - wp.cw_mul(s, z), y, wp.cw_mul(c, z) + wp.cw_mul(s, x), y
        return wp.cw_mul(c, x) + wp.cw_mul(s, y), wp.cw_mul(c, y) - wp.cw_mul(s, x), z, z

    @wp.func
    def rotate_any(motion: int, x: Lane, y: Lane, z: Lane, s: Lane, c: Lane):
        """Return the same for all joints; the axis of a fixed joint is arbitrary."""
        if motion < PRISMATIC:
            return rotate_revolute(motion, x, y, z, s, c)
        if motion == PRISMATIC:
            return x, y, z, x
        if motion == PRISMATIC + 1:
            return x, y, z, y
        return x, y, z, z

    @wp.func
    def translate_revolute(motion: int, place: Lane, displacement: Lane, axis: Lane):
        """Return one component of a joint's place: a prismatic joint is displaced along its axis."""
        return place

    @wp.func
    def translate_any(motion: int, place: Lane, displacement: Lane, axis: Lane):
        if motion < PRISMATIC or motion == FIXED:
            return place
        return place + wp.cw_mul(displacement, axis)

    @wp.func
    def column_revolute(motion: int, ax: Lane, ay: Lane, az: Lane, ry: Lane, rz: Lane):
        """Return the first component of a column of J, of a joint with this axis and the tip at r."""
        return wp.cw_mul(ay, rz) - wp.cw_mul(az, ry)

    @wp.func
    def column_any(motion: int, ax: Lane, ay: Lane, az: Lane, ry: Lane, rz: Lane):
        if motion < PRISMATIC:
            return wp.cw_mul(ay, rz) - wp.cw_mul(az, ry)
        if motion < FIXED:
            return ax
        return Lane(zero)

    @wp.func
    def margin_revolute(motion: int):
        """Return the distance from a limit within which the limit gradient H is constant."""
        return angle_margin

    @wp.func
    def margin_any(motion: int):
        if motion < PRISMATIC:
            return angle_margin
        return travel_margin

    rotate, translate, column, margin = {
        "revolute": (rotate_revolute, translate_revolute, column_revolute, margin_revolute),
        "any": (rotate_any, translate_any, column_any, margin_any),
    }[motions]

    @wp.func
    def advance(
        motion: int, offset: Vector3, q: Lane,
        xx: Lane, xy: Lane, xz: Lane, yx: Lane, yy: Lane, yz: Lane, zx: Lane, zy: Lane, zz: Lane,
        px: Lane, py: Lane, pz: Lane,
    ):  # fmt: skip
        """Forward kinematics of a joint: return the frame after it, its axis, its place, and the next joint's place.

        xx, xy, xz: the local x axis in the world, and so on. px, py, pz: the place before the joint moves.
        """
        s, c = sine_cosine(q)
        xx, yx, zx, ax = rotate(motion, xx, yx, zx, s, c)
        xy, yy, zy, ay = rotate(motion, xy, yy, zy, s, c)
        xz, yz, zz, az = rotate(motion, xz, yz, zz, s, c)
        ox = translate(motion, px, q, ax)
        oy = translate(motion, py, q, ay)
        oz = translate(motion, pz, q, az)
        px = ox + (offset[0] * xx + offset[1] * yx + offset[2] * zx)
        py = oy + (offset[0] * xy + offset[1] * yy + offset[2] * zy)
        pz = oz + (offset[0] * xz + offset[1] * yz + offset[2] * zz)
        return xx, xy, xz, yx, yy, yz, zx, zy, zz, ax, ay, az, ox, oy, oz, px, py, pz

    @wp.func
    def limit(motion: int, lower: real, upper: real, q: Lane, n_before: Lane, d_before: Lane):
        """Return the limit gradient H = n / d of a joint, its weight w and its pull y to mid-range.

        n_before, d_before: H of the update before. Fractions compare without division.
        """
        half = real(0.5) * (upper - lower)
        away = q - Lane(real(0.5) * (lower + upper))
        keep = margin(motion)
        inside = wp.min(wp.max(away, Lane(keep - half)), Lane(half - keep))
        room = Lane(half * half) - wp.cw_mul(inside, inside)
        n, d = (two * half * half) * wp.abs(inside), wp.cw_mul(room, room)
        rises = at_least(wp.cw_mul(n, d_before), wp.cw_mul(n_before, d))
        w = wp.cw_div(d, d + wp.cw_mul(rises, n))  # 1 / (1 + H) where H rises, else 1
        share = (one / half) * away
        y = -centring_gain * wp.cw_mul(w, wp.cw_mul(share, wp.abs(share)))
        return n, d, w, y

    @wp.func
    def damping(det_jjt: Lane):
        """Return k: 0 where the manipulability sqrt(det J Jᵀ) is large enough."""
        manipulability = roots(wp.max(det_jjt, Lane(zero)))
        lack = wp.max(Lane(zero), Lane(one) - (one / least_manipulability) * manipulability)
        return full_damping * wp.cw_mul(lack, lack)

    @wp.func
    def norm_squared(x: Lane, y: Lane, z: Lane):
        """Return the square of a vector's length."""
        return wp.cw_mul(x, x) + wp.cw_mul(y, y) + wp.cw_mul(z, z)

    return IkMath(
        real, Vector3, Lane, Wide, Joints, Vectors, Frame, Arms,
        roots, at_least, select, advance, column, limit, damping, norm_squared,
    )  # fmt: skip
