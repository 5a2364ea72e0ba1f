"""The kernels: forward kinematics, inverse kinematics and gravity torque, in Warp.

One source, from which `kernels_of` makes variants: in single or in double precision, and with some lanes or one. Each
thread solves one arm for as many targets as there are lanes, one in each lane of a vector, so that a CPU's vector
instructions do the work of eight; a GPU has its own threads for that, and takes one lane. What differs between lanes
is arithmetic, never a branch: a condition is a mask of zeros and ones. The axes of an arm are the same in all lanes,
so they may branch: in functions that return at once. That joints may slide, too, costs an eighth of all time, so arms
that only turn have a variant of their own.

The equations are those of docs/method.md; the inverse kinematics is the solver of Chan & Dubey (1995) and
Sugiura et al. (2007). Angles, positions and torques are of the variant's precision. The 3 x 3 system is float64 in
every variant: its matrix squares the condition of the Jacobian, and weights near the joint limits (down to 2.5e-4 at
±2.4 rad) make it worse still.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import warp as wp

from armwright.arm import GRAVITY
from armwright.kinematics.arm_arrays import FIXED, MAX_JOINTS, PRISMATIC, Motions, Precision

# At -O2, Warp's default, LLVM leaves more of the lanes scalar: 43,000 designs/s on a core rather than 58,000.
OPTIONS = {"cpu_compiler_flags": "-march=native -O3"}

# A Warp kernel in a module of its own: the fewer its callers, the more willingly LLVM inlines a function.
_kernel = partial(wp.kernel, enable_backward=False, module="unique", module_options=OPTIONS)


@dataclass(frozen=True)
class Kernels:
    """One variant of the kernels. Each compiles when it is first loaded, and is kept on disk."""

    lanes: int
    real: Any  # the number type
    Lane: Any  # the vector of a number for each lane
    Arms: Any  # `ArmArrays` on the device, a Warp struct
    descend: Any  # the inverse kinematics
    hold: Any  # the posture kept, its tip and its torque
    parts: Mapping[str, Any]  # types and functions that other kernels are made of, too
    settle: Any = None  # before `hold`, for targets that say which way the tool points: the posture kept, its angle off


@cache
def kernels_of(precision: Precision, lanes: int, motions: Motions) -> Kernels:
    """The kernels that solve `lanes` targets a thread in this precision, for arms whose joints move so.

    One long function on purpose: what Warp compiles takes its types and constants from the function around it.
    T targets stand in G groups: target g x lanes + i in lane i of group g, and the last one fills up its group.
    """
    real, Vector3 = {"float32": (wp.float32, wp.vec3f), "float64": (wp.float64, wp.vec3d)}[precision]
    Lane = wp.types.vector(length=lanes, dtype=real)
    Wide = wp.types.vector(length=lanes, dtype=wp.float64)
    Joints = wp.types.matrix(shape=(MAX_JOINTS, lanes), dtype=real)  # row j: joint j in all lanes

    zero, one, two, gravity = real(0.0), real(1.0), real(2.0), real(GRAVITY)
    one_wide = wp.float64(1.0)
    longest_step = real(0.1)  # [m] of the error that one update tries to close
    least_manipulability = real(0.1)  # below it the update is damped
    full_damping = real(0.001)
    turn_margin = real(math.radians(1.0))  # keeps the limit gradient finite
    slide_margin = real(1e-3)  # [m]
    centring_gain = real(0.01)
    largest = real(1e30)

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

    @wp.func
    def roots(x: Lane):
        """Square roots."""
        result = Lane()
        for i in range(lanes):
            result[i] = wp.sqrt(x[i])
        return result

    @wp.func
    def at_least(a: Lane, b: Lane):
        """1 where a >= b, else 0."""
        return real(0.5) * (wp.sign(a - b) + Lane(one))

    @wp.func
    def chosen(mask: Lane, a: Lane, b: Lane):
        """a where the mask is 1, b where it is 0, both to the bit."""
        return wp.cw_mul(mask, a) + wp.cw_mul(Lane(one) - mask, b)

    @wp.func
    def library_sine_cosine(angle: Lane):
        """Sine and cosine, to the last bits."""
        s, c = Lane(), Lane()
        for i in range(lanes):
            s[i] = wp.sin(angle[i])
            c[i] = wp.cos(angle[i])
        return s, c

    @wp.func
    def polynomial_sine_cosine(angle: Lane):
        """Sine and cosine for |angle| <= 2π, to 1e-6: polynomials for a quarter of the angle, doubled twice.

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

    # Polynomials for all lanes at once are what float32 needs, and a small part of the time of the library's.
    sine_cosine = polynomial_sine_cosine if precision == "float32" else library_sine_cosine

    @wp.func
    def turned_by_turning(motion: int, x: Lane, y: Lane, z: Lane, s: Lane, c: Lane):
        """One world component of the frame's axes x, y, z, moved by a joint; last, of the axis of that joint."""
        if motion == 0:
            return x, wp.cw_mul(c, y) + wp.cw_mul(s, z), wp.cw_mul(c, z) - wp.cw_mul(s, y), x
        if motion == 1:
            return wp.cw_mul(c, x) - wp.cw_mul(s, z), y, wp.cw_mul(c, z) + wp.cw_mul(s, x), y
        return wp.cw_mul(c, x) + wp.cw_mul(s, y), wp.cw_mul(c, y) - wp.cw_mul(s, x), z, z

    @wp.func
    def turned_by_any(motion: int, x: Lane, y: Lane, z: Lane, s: Lane, c: Lane):
        """The same for joints that slide or do not move, too; the axis of a fixed one means nothing."""
        if motion < PRISMATIC:
            return turned_by_turning(motion, x, y, z, s, c)
        if motion == PRISMATIC:
            return x, y, z, x
        if motion == PRISMATIC + 1:
            return x, y, z, y
        return x, y, z, z

    @wp.func
    def slid_by_turning(motion: int, place: Lane, way: Lane, axis: Lane):
        """One component of a joint's place: a sliding one has gone its way along its axis."""
        return place

    @wp.func
    def slid_by_any(motion: int, place: Lane, way: Lane, axis: Lane):
        if motion < PRISMATIC or motion == FIXED:
            return place
        return place + wp.cw_mul(way, axis)

    @wp.func
    def column_of_turning(motion: int, ax: Lane, ay: Lane, az: Lane, ry: Lane, rz: Lane):
        """The first component of a column of J, of a joint with this axis and the tip at r; the others likewise."""
        return wp.cw_mul(ay, rz) - wp.cw_mul(az, ry)

    @wp.func
    def column_of_any(motion: int, ax: Lane, ay: Lane, az: Lane, ry: Lane, rz: Lane):
        if motion < PRISMATIC:
            return wp.cw_mul(ay, rz) - wp.cw_mul(az, ry)
        if motion < FIXED:
            return ax
        return Lane(zero)

    @wp.func
    def margin_of_turning(motion: int):
        """From where on the limit gradient H grows no more, before the limit."""
        return turn_margin

    @wp.func
    def margin_of_any(motion: int):
        if motion < PRISMATIC:
            return turn_margin
        return slide_margin

    @wp.func
    def load(motion: int, ax: Lane, ay: Lane, az: Lane, lever_x: Lane, lever_y: Lane, mass: Lane):
        """The derivative of mass times height by a joint with this axis."""
        if motion < PRISMATIC:
            return wp.cw_mul(ax, lever_y) - wp.cw_mul(ay, lever_x)
        if motion < FIXED:
            return wp.cw_mul(mass, az)
        return Lane(zero)

    turned, slid, column_of, margin_of = {
        "revolute": (turned_by_turning, slid_by_turning, column_of_turning, margin_of_turning),
        "any": (turned_by_any, slid_by_any, column_of_any, margin_of_any),
    }[motions]

    @wp.func
    def determinant(xx: Wide, xy: Wide, xz: Wide, yy: Wide, yz: Wide, zz: Wide):
        """Of a symmetric 3 x 3 matrix."""
        return (
            wp.cw_mul(xx, wp.cw_mul(yy, zz) - wp.cw_mul(yz, yz))
            - wp.cw_mul(xy, wp.cw_mul(xy, zz) - wp.cw_mul(yz, xz))
            + wp.cw_mul(xz, wp.cw_mul(xy, yz) - wp.cw_mul(yy, xz))
        )

    @wp.func
    def damping(det_jjt: Lane):
        """k: 0 where the manipulability sqrt(det J Jᵀ) is large enough."""
        manipulability = roots(wp.max(det_jjt, Lane(zero)))
        lack = wp.max(Lane(zero), Lane(one) - (one / least_manipulability) * manipulability)
        return full_damping * wp.cw_mul(lack, lack)

    @wp.func
    def solved(xx: Wide, xy: Wide, xz: Wide, yy: Wide, yz: Wide, zz: Wide, x: Wide, y: Wide, z: Wide):
        """The solution of a symmetric 3 x 3 system by its adjugate."""
        cxx = wp.cw_mul(yy, zz) - wp.cw_mul(yz, yz)
        cxy = wp.cw_mul(xz, yz) - wp.cw_mul(xy, zz)
        cxz = wp.cw_mul(xy, yz) - wp.cw_mul(xz, yy)
        cyy = wp.cw_mul(xx, zz) - wp.cw_mul(xz, xz)
        cyz = wp.cw_mul(xy, xz) - wp.cw_mul(xx, yz)
        czz = wp.cw_mul(xx, yy) - wp.cw_mul(xy, xy)
        scale = wp.cw_div(Wide(one_wide), wp.cw_mul(xx, cxx) + wp.cw_mul(xy, cxy) + wp.cw_mul(xz, cxz))
        vx = wp.cw_mul(scale, wp.cw_mul(cxx, x) + wp.cw_mul(cxy, y) + wp.cw_mul(cxz, z))
        vy = wp.cw_mul(scale, wp.cw_mul(cxy, x) + wp.cw_mul(cyy, y) + wp.cw_mul(cyz, z))
        vz = wp.cw_mul(scale, wp.cw_mul(cxz, x) + wp.cw_mul(cyz, y) + wp.cw_mul(czz, z))
        return Lane(vx), Lane(vy), Lane(vz)

    @wp.func
    def square_of(x: Lane, y: Lane, z: Lane):
        """The square of a vector's length."""
        return wp.cw_mul(x, x) + wp.cw_mul(y, y) + wp.cw_mul(z, z)

    @wp.func
    def limit_fraction(away: Lane, half: real, margin: real):
        """H as a fraction n / d, for joints `away` from the middle of a range of half width `half` [rad] or [m]."""
        inside = wp.min(wp.max(away, Lane(margin - half)), Lane(half - margin))
        room = Lane(half * half) - wp.cw_mul(inside, inside)
        return (two * half * half) * wp.abs(inside), wp.cw_mul(room, room)

    @_kernel
    def descend(
        arms: Arms,
        targets: wp.array2d(dtype=Lane),
        updates: int,
        q_last: wp.array3d(dtype=Lane),
        h_last: wp.array3d(dtype=Lane),
        q_kept: wp.array3d(dtype=Lane),
    ):
        """Inverse kinematics of an arm at a group of targets.

        targets: (G, 4) [m], last the payload [kg], which is not read.
        q_last: (N, G, D), the start's angles, then those after the last update [rad].
        h_last: (N, G, D), the limit gradients H before the first, then of the last update.
        q_kept: (N, G, D), the angles nearest to the target of all but the last.

        One long function on purpose: the arrays over joints live in its registers and stack, and handing them to
        functions copies them, which made a prototype three times slower.
        """
        arm, group = wp.tid()
        base = arms.base[arm]
        q, kept = Joints(), Joints()
        limit_n, limit_d = Joints(), Joints()  # H of the update before, n / d: fractions compare without division
        ux, uy, uz = Joints(), Joints(), Joints()  # joint axes, then the columns of the Jacobian J
        ox, oy, oz = Joints(), Joints(), Joints()  # joint positions
        weight, pull = Joints(), Joints()
        for j in range(arms.dof):
            q[j] = q_last[arm, group, j]
            kept[j] = q[j]
            limit_n[j] = h_last[arm, group, j]
            limit_d[j] = Lane(one)
        nearest = Lane(largest)
        for _ in range(updates):
            # Forward kinematics. xx, xy, xz: the local x axis in the world, and so on.
            xx, xy, xz = Lane(one), Lane(zero), Lane(zero)
            yx, yy, yz = Lane(zero), Lane(one), Lane(zero)
            zx, zy, zz = Lane(zero), Lane(zero), Lane(one)
            px, py, pz = Lane(base[0]), Lane(base[1]), Lane(base[2])
            for j in range(arms.dof):
                motion = arms.motion[arm, j]
                s, c = sine_cosine(q[j])
                xx, yx, zx, ax = turned(motion, xx, yx, zx, s, c)
                xy, yy, zy, ay = turned(motion, xy, yy, zy, s, c)
                xz, yz, zz, az = turned(motion, xz, yz, zz, s, c)
                px = slid(motion, px, q[j], ax)
                py = slid(motion, py, q[j], ay)
                pz = slid(motion, pz, q[j], az)
                ux[j] = ax
                uy[j] = ay
                uz[j] = az
                ox[j] = px
                oy[j] = py
                oz[j] = pz
                offset = arms.offset[arm, j]
                px += offset[0] * xx + offset[1] * yx + offset[2] * zx
                py += offset[0] * xy + offset[1] * yy + offset[2] * zy
                pz += offset[0] * xz + offset[1] * yz + offset[2] * zz

            # The posture nearest to the target is kept, the earliest of equals.
            ex = targets[group, 0] - px
            ey = targets[group, 1] - py
            ez = targets[group, 2] - pz
            square = square_of(ex, ey, ez)
            nearer = Lane(one) - at_least(square, nearest)
            nearest = wp.min(nearest, square)
            for j in range(arms.dof):
                kept[j] = chosen(nearer, q[j], kept[j])

            # dx, shortened; J Jᵀ as a.., J W Jᵀ as b..; the pull y is taken out of dx, because
            # J# dx + (I - J# J) y = y + J# (dx - J y).
            shorten = wp.cw_div(Lane(longest_step), wp.max(roots(square), Lane(longest_step)))
            dx = wp.cw_mul(ex, shorten)
            dy = wp.cw_mul(ey, shorten)
            dz = wp.cw_mul(ez, shorten)
            axx, axy, axz, ayy, ayz, azz = Wide(), Wide(), Wide(), Wide(), Wide(), Wide()
            bxx, bxy, bxz, byy, byz, bzz = Wide(), Wide(), Wide(), Wide(), Wide(), Wide()
            for j in range(arms.dof):
                motion = arms.motion[arm, j]
                lower = arms.lower[arm, j]
                upper = arms.upper[arm, j]
                half = real(0.5) * (upper - lower)
                away = q[j] - Lane(real(0.5) * (lower + upper))
                n, d = limit_fraction(away, half, margin_of(motion))
                rises = at_least(wp.cw_mul(n, limit_d[j]), wp.cw_mul(limit_n[j], d))
                w = wp.cw_div(d, d + wp.cw_mul(rises, n))  # 1 / (1 + H) where H rises, else 1
                limit_n[j] = n
                limit_d[j] = d
                share = (one / half) * away
                y = -centring_gain * wp.cw_mul(w, wp.cw_mul(share, wp.abs(share)))

                rx = px - ox[j]
                ry = py - oy[j]
                rz = pz - oz[j]
                jx = column_of(motion, ux[j], uy[j], uz[j], ry, rz)
                jy = column_of(motion, uy[j], uz[j], ux[j], rz, rx)
                jz = column_of(motion, uz[j], ux[j], uy[j], rx, ry)
                dx -= wp.cw_mul(jx, y)
                dy -= wp.cw_mul(jy, y)
                dz -= wp.cw_mul(jz, y)
                ux[j] = jx
                uy[j] = jy
                uz[j] = jz
                weight[j] = w
                pull[j] = y

                jxw, jyw, jzw = Wide(jx), Wide(jy), Wide(jz)
                ww = Wide(w)
                wx = wp.cw_mul(ww, jxw)
                wy = wp.cw_mul(ww, jyw)
                wz = wp.cw_mul(ww, jzw)
                axx += wp.cw_mul(jxw, jxw)
                axy += wp.cw_mul(jxw, jyw)
                axz += wp.cw_mul(jxw, jzw)
                ayy += wp.cw_mul(jyw, jyw)
                ayz += wp.cw_mul(jyw, jzw)
                azz += wp.cw_mul(jzw, jzw)
                bxx += wp.cw_mul(wx, jxw)
                bxy += wp.cw_mul(wx, jyw)
                bxz += wp.cw_mul(wx, jzw)
                byy += wp.cw_mul(wy, jyw)
                byz += wp.cw_mul(wy, jzw)
                bzz += wp.cw_mul(wz, jzw)

            k = Wide(damping(Lane(determinant(axx, axy, axz, ayy, ayz, azz))))
            vx, vy, vz = solved(bxx + k, bxy, bxz, byy + k, byz, bzz + k, Wide(dx), Wide(dy), Wide(dz))
            for j in range(arms.dof):
                column = wp.cw_mul(ux[j], vx) + wp.cw_mul(uy[j], vy) + wp.cw_mul(uz[j], vz)
                moved = q[j] + pull[j] + wp.cw_mul(weight[j], column)
                q[j] = wp.min(wp.max(moved, Lane(arms.lower[arm, j])), Lane(arms.upper[arm, j]))

        for j in range(arms.dof):
            q_last[arm, group, j] = q[j]
            h_last[arm, group, j] = wp.cw_div(limit_n[j], limit_d[j])
            q_kept[arm, group, j] = kept[j]

    @wp.func
    def tip(arms: Arms, arm: int, group: int, q: wp.array3d(dtype=Lane)):
        """The tip's position at angles q (N, G, D)."""
        base = arms.base[arm]
        xx, xy, xz = Lane(one), Lane(zero), Lane(zero)
        yx, yy, yz = Lane(zero), Lane(one), Lane(zero)
        zx, zy, zz = Lane(zero), Lane(zero), Lane(one)
        px, py, pz = Lane(base[0]), Lane(base[1]), Lane(base[2])
        for j in range(arms.dof):
            motion = arms.motion[arm, j]
            s, c = sine_cosine(q[arm, group, j])
            xx, yx, zx, ax = turned(motion, xx, yx, zx, s, c)
            xy, yy, zy, ay = turned(motion, xy, yy, zy, s, c)
            xz, yz, zz, az = turned(motion, xz, yz, zz, s, c)
            px = slid(motion, px, q[arm, group, j], ax)
            py = slid(motion, py, q[arm, group, j], ay)
            pz = slid(motion, pz, q[arm, group, j], az)
            offset = arms.offset[arm, j]
            px += offset[0] * xx + offset[1] * yx + offset[2] * zx
            py += offset[0] * xy + offset[1] * yy + offset[2] * zy
            pz += offset[0] * xz + offset[1] * yz + offset[2] * zz
        return px, py, pz

    @_kernel
    def hold(
        arms: Arms,
        targets: wp.array2d(dtype=Lane),
        q_last: wp.array3d(dtype=Lane),
        q_kept: wp.array3d(dtype=Lane),
        reached: wp.array3d(dtype=Lane),
        torque: wp.array3d(dtype=Lane),
    ):
        """Keeps the last posture where it is nearer, and says where the tip is and what holds it against gravity.

        targets: (G, 4) [m], last the payload at the tip [kg].  q_last, q_kept: (N, G, D) [rad] or [m].
        reached: (N, G, 3) [m].
        torque: (N, G, D), +dV/dq [N m] or [N].
        """
        arm, group = wp.tid()
        tx, ty, tz = targets[group, 0], targets[group, 1], targets[group, 2]
        lx, ly, lz = tip(arms, arm, group, q_last)
        kx, ky, kz = tip(arms, arm, group, q_kept)
        farther = at_least(square_of(tx - lx, ty - ly, tz - lz), square_of(tx - kx, ty - ky, tz - kz))
        reached[arm, group, 0] = chosen(farther, kx, lx)
        reached[arm, group, 1] = chosen(farther, ky, ly)
        reached[arm, group, 2] = chosen(farther, kz, lz)

        base = arms.base[arm]
        ux, uy, uz = Joints(), Joints(), Joints()  # joint axes
        ox, oy = Joints(), Joints()  # joint positions
        mx, my = Joints(), Joints()  # mass times position of what joint j carries up to the next
        xx, xy, xz = Lane(one), Lane(zero), Lane(zero)
        yx, yy, yz = Lane(zero), Lane(one), Lane(zero)
        zx, zy, zz = Lane(zero), Lane(zero), Lane(one)
        px, py = Lane(base[0]), Lane(base[1])
        for j in range(arms.dof):
            q = chosen(farther, q_kept[arm, group, j], q_last[arm, group, j])
            q_kept[arm, group, j] = q
            motion = arms.motion[arm, j]
            s, c = sine_cosine(q)
            xx, yx, zx, ax = turned(motion, xx, yx, zx, s, c)
            xy, yy, zy, ay = turned(motion, xy, yy, zy, s, c)
            xz, yz, zz, az = turned(motion, xz, yz, zz, s, c)
            px = slid(motion, px, q, ax)
            py = slid(motion, py, q, ay)
            ux[j] = ax
            uy[j] = ay
            uz[j] = az
            ox[j] = px
            oy[j] = py
            com = arms.com[arm, j]
            mass = arms.mass[arm, j]
            mx[j] = mass * (px + com[0] * xx + com[1] * yx + com[2] * zx)
            my[j] = mass * (py + com[0] * xy + com[1] * yy + com[2] * zy)
            offset = arms.offset[arm, j]
            px += offset[0] * xx + offset[1] * yx + offset[2] * zx
            py += offset[0] * xy + offset[1] * yy + offset[2] * zy

        mass_beyond = targets[group, 3]
        beyond_x = wp.cw_mul(mass_beyond, px)  # its mass times position
        beyond_y = wp.cw_mul(mass_beyond, py)
        for step in range(arms.dof):
            j = arms.dof - 1 - step
            mass_beyond += Lane(arms.mass[arm, j])
            beyond_x += mx[j]
            beyond_y += my[j]
            lever_x = beyond_x - wp.cw_mul(mass_beyond, ox[j])
            lever_y = beyond_y - wp.cw_mul(mass_beyond, oy[j])
            torque[arm, group, j] = gravity * load(
                arms.motion[arm, j], ux[j], uy[j], uz[j], lever_x, lever_y, mass_beyond
            )

    parts = {
        "Wide": Wide, "Joints": Joints, "roots": roots, "at_least": at_least, "chosen": chosen, "damping": damping,
        "sine_cosine": sine_cosine, "turned": turned, "slid": slid, "column_of": column_of, "margin_of": margin_of,
        "square_of": square_of, "limit_fraction": limit_fraction,
    }  # fmt: skip
    return Kernels(lanes, real, Lane, Arms, descend, hold, parts)
