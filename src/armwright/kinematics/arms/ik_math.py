"""Warp functions that all kernels of inverse kinematics share.

The joints of an arm are the same in all lanes, so they may branch, in functions that return at once. Prismatic joints
cost an eighth of the time, so arms of revolute joints alone have a variant.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

import math
from functools import cache, partial
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, MAX_JOINTS, PRISMATIC, Motions, Precision
from armwright.kinematics.arms.lane_math import lane_math

# At -O2, Warp's default, LLVM leaves more of the lanes scalar: 43,000 designs/s on a core rather than 58,000.
OPTIONS = {"cpu_compiler_flags": "-march=native -O3"}

# A Warp kernel in a module of its own: the fewer its callers, the more willingly LLVM inlines a function.
kernel = partial(wp.kernel, enable_backward=False, module="unique", module_options=OPTIONS)


@cache
def ik_math(precision: Precision, lanes: int, motions: Motions) -> SimpleNamespace:
    """Return the variant for a precision, a number of lanes and what the joints of the arms do."""
    base = lane_math(precision, lanes)
    real, Vector3, Lane = base.real, base.Vector3, base.Lane
    at_least, sine_cosine = base.at_least, base.sine_cosine
    Joints = wp.types.matrix(shape=(MAX_JOINTS, lanes), dtype=real)  # row j is joint j in all lanes

    zero, one, two = real(0.0), real(1.0), real(2.0)
    angle_margin = real(math.radians(1.0))  # from the limits, keeps the limit gradient finite
    travel_margin = real(1e-3)  # [m]
    centring_gain = real(0.01)

    @wp.struct
    class Arms:  # `ArmArrays` on the device
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
        """Return the first component of a column of J."""
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
    def at_base(base: Vector3):
        """Return frame and place of the base, as `advance` takes them."""
        return (
            Lane(one), Lane(zero), Lane(zero), Lane(zero), Lane(one), Lane(zero), Lane(zero), Lane(zero), Lane(one),
            Lane(base[0]), Lane(base[1]), Lane(base[2]),
        )  # fmt: skip

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
    def columns(motion: int, ax: Lane, ay: Lane, az: Lane, rx: Lane, ry: Lane, rz: Lane):
        """Return a column of J, of a joint with this axis and the tip at r."""
        return (
            column(motion, ax, ay, az, ry, rz),
            column(motion, ay, az, ax, rz, rx),
            column(motion, az, ax, ay, rx, ry),
        )

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

    return SimpleNamespace(Joints=Joints, Arms=Arms, at_base=at_base, advance=advance, columns=columns, limit=limit)
