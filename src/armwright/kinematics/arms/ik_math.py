"""Warp functions that all kernels of inverse kinematics share.

The joints of an arm are the same in all lanes, so they may branch, in functions that return at once. Prismatic joints
cost an eighth of the time, so arms of revolute joints alone have a variant, those with other axes than x, y and z, and
those with joints that follow others.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

import math
from functools import cache, partial
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, OBLIQUE, PRISMATIC, Motions, Precision
from armwright.kinematics.arms.lane_math import lane_math

# At -O2, Warp's default, LLVM leaves more of the lanes scalar: 43,000 designs/s on a core rather than 58,000.
OPTIONS = {"cpu_compiler_flags": "-march=native -O3"}

# A Warp kernel in a module of its own: the fewer its callers, the more willingly LLVM inlines a function.
kernel = partial(wp.kernel, enable_backward=False, module="unique", module_options=OPTIONS)


@cache
def ik_math(precision: Precision, lanes: int, motions: Motions) -> SimpleNamespace:
    """Return the variant for a precision, a number of lanes and what the joints of the arms do."""
    base = lane_math(precision, lanes)
    real, Vector3, Lane, Vector = base.real, base.Vector3, base.Lane, base.Vector
    at_least, sine_cosine, scaled = base.at_least, base.sine_cosine, base.scaled
    dot, cross, in_frame = base.dot, base.cross, base.in_frame
    any_motion, oblique = motions != "revolute", motions in ("oblique", "coupled")

    zero, one, two = real(0.0), real(1.0), real(2.0)
    angle_margin = real(math.radians(1.0))  # from the limits, keeps the limit gradient finite
    travel_margin = real(1e-3)  # [m]
    centring_gain = real(0.01)

    @wp.struct
    class Arms:  # `ArmArrays` on the device
        dof: int
        base: wp.array(dtype=Vector3)  # (N,)
        motion: wp.array2d(dtype=int)  # (N, D)
        axis: wp.array2d(dtype=Vector3)  # (N, D)
        lower: wp.array2d(dtype=real)  # (N, D)
        upper: wp.array2d(dtype=real)  # (N, D)
        offset: wp.array2d(dtype=Vector3)  # (N, D)
        com: wp.array2d(dtype=Vector3)  # (N, D)
        mass: wp.array2d(dtype=real)  # (N, D)
        tool_axis: wp.array(dtype=Vector3)  # (N,)
        tool_side: wp.array(dtype=Vector3)  # (N,)
        payload_center: wp.array(dtype=Vector3)  # (N,)
        couplings: wp.array2d(dtype=Vector3)  # (N, D), empty unless motions are coupled

    @wp.func
    def rotate(motion: int, axis: Vector3, x: Vector, y: Vector, z: Vector, s: Lane, c: Lane):
        """Return the frame's axes after a joint and, last, the axis of that joint, as `frame_math` does."""
        if wp.static(any_motion):  # noqa: SIM102 (Warp leaves out what is static alone)
            if motion >= PRISMATIC:
                return x, y, z, in_frame(axis, x, y, z)
        if wp.static(oblique):  # noqa: SIM102
            if motion == OBLIQUE:
                a = in_frame(axis, x, y, z)
                along = scaled(Lane(one) - c, a)
                turned_x = scaled(c, x) + scaled(s, axis[2] * y - axis[1] * z) + axis[0] * along
                turned_y = scaled(c, y) + scaled(s, axis[0] * z - axis[2] * x) + axis[1] * along
                return turned_x, turned_y, cross(turned_x, turned_y), a
        if motion == 0:
            return x, scaled(c, y) + scaled(s, z), scaled(c, z) - scaled(s, y), x
        if motion == 1:
            return scaled(c, x) - scaled(s, z), y, scaled(c, z) + scaled(s, x), y
        return scaled(c, x) + scaled(s, y), scaled(c, y) - scaled(s, x), z, z

    @wp.func
    def translate(motion: int, place: Vector, displacement: Lane, axis: Vector):
        """Return the place of a joint: a prismatic joint is displaced along its axis."""
        if wp.static(any_motion):  # noqa: SIM102
            if motion >= PRISMATIC and motion < FIXED:
                return place + scaled(displacement, axis)
        return place

    @wp.func
    def linear_column(motion: int, axis: Vector, r: Vector):
        """Return how a joint moves the tip, which is at r from it."""
        if wp.static(any_motion):
            if motion == FIXED:
                return Vector()
            if motion >= PRISMATIC:
                return axis
        return cross(axis, r)

    @wp.func
    def angular_column(motion: int, axis: Vector, s: Vector, t: Vector, f: Vector):
        """Return how much a joint rotates the tool about its own x, y and z, which are s, t and f in the world."""
        if wp.static(any_motion) and motion >= PRISMATIC:
            return Vector()
        return wp.matrix_from_rows(dot(s, axis), dot(t, axis), dot(f, axis))

    @wp.func
    def margin(motion: int):
        """Return the distance from a limit within which the limit gradient H is constant."""
        if wp.static(any_motion):  # noqa: SIM102
            if motion >= PRISMATIC:
                return travel_margin
        return angle_margin

    @wp.func
    def at_base(base: Vector3):
        """Return place and frame of the base, as `advance` takes them."""
        none, unit = Lane(zero), Lane(one)
        return (
            wp.matrix_from_rows(Lane(base[0]), Lane(base[1]), Lane(base[2])),
            wp.matrix_from_rows(unit, none, none),
            wp.matrix_from_rows(none, unit, none),
            wp.matrix_from_rows(none, none, unit),
        )

    @wp.func
    def advance(motion: int, local: Vector3, offset: Vector3, q: Lane, p: Vector, x: Vector, y: Vector, z: Vector):
        """Return the axis of a joint at a value [rad] or [m], its place, that of the next joint, and the frame between.

        local: axis of the joint in the frame before it.  p: where it is at 0.  x, y, z: the frame before it.
        """
        s, c = sine_cosine(q)
        x, y, z, axis = rotate(motion, local, x, y, z, s, c)
        place = translate(motion, p, q, axis)
        return axis, place, place + in_frame(offset, x, y, z), x, y, z

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

    return SimpleNamespace(
        Arms=Arms, at_base=at_base, advance=advance, linear_column=linear_column, angular_column=angular_column,
        limit=limit,
    )  # fmt: skip
