"""The kernels for targets that say which way the tool points, too: of an axis, or of its whole orientation.

A thread's targets may be of all kinds side by side. The system has six rows: three of the position, then the angles
still to be turned about the tool's own x, y and z. A row that a target does not ask for is zero in J and one on the
diagonal, so it neither moves a joint nor changes a determinant. All else is as in kernels.py, whose functions serve
here, too.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

import math
from dataclasses import replace
from functools import cache, partial

import warp as wp

from armwright.kinematics.arm_arrays import PRISMATIC, Motions, Precision
from armwright.kinematics.kernels import OPTIONS, Kernels, kernels_of

WANTED = 16  # numbers that describe a target: see `descend`

_kernel = partial(wp.kernel, enable_backward=False, module="unique", module_options=OPTIONS)


@cache
def pose_kernels_of(precision: Precision, lanes: int, motions: Motions) -> Kernels:
    """The variant of `kernels_of` for targets with an axis or an orientation."""
    plain = kernels_of(precision, lanes, motions)
    real, Lane, Arms, parts = plain.real, plain.Lane, plain.Arms, plain.parts
    Vector3 = {"float32": wp.vec3f, "float64": wp.vec3d}[precision]
    Wide, Joints = parts["Wide"], parts["Joints"]
    roots, at_least, chosen, damping = parts["roots"], parts["at_least"], parts["chosen"], parts["damping"]
    sine_cosine, turned, slid = parts["sine_cosine"], parts["turned"], parts["slid"]
    column_of, margin_of = parts["column_of"], parts["margin_of"]
    square_of, limit_fraction = parts["square_of"], parts["limit_fraction"]

    zero, one, two = real(0.0), real(1.0), real(2.0)
    longest_step = real(0.1)  # [m] of the error that one update tries to close
    longest_turn = real(0.5)  # [rad], the same
    centring_gain = real(0.01)
    largest, least_length = real(1e30), real(1e-30)
    nothing = real(1e-12)
    quarter = real(math.pi / 2)
    ones, least = Wide(wp.float64(1.0)), Wide(wp.float64(1e-18))

    @wp.func
    def library_arctangent(y: Lane, x: Lane):
        """The angle of (x, y), both at least 0 and not both 0, to the last bits."""
        angle = Lane()
        for i in range(lanes):
            angle[i] = wp.atan2(y[i], x[i])
        return angle

    @wp.func
    def polynomial_arctangent(y: Lane, x: Lane):
        """The same to 2e-7: a polynomial in t² for atan(t) / t, 0 <= t <= 1, that interpolates at Chebyshev's nodes."""
        t = wp.cw_div(wp.min(y, x), wp.max(y, x))
        u = wp.cw_mul(t, t)
        a = 2.766283501e-03 * u - Lane(1.573124912e-02)
        a = wp.cw_mul(a, u) + Lane(4.213762358e-02)
        a = wp.cw_mul(a, u) - Lane(7.456854825e-02)
        a = wp.cw_mul(a, u) + Lane(1.061837064e-01)
        a = wp.cw_mul(a, u) - Lane(1.419779779e-01)
        a = wp.cw_mul(a, u) + Lane(1.999187203e-01)
        a = wp.cw_mul(a, u) - Lane(3.333303671e-01)
        a = wp.cw_mul(a, u) + Lane(9.999999818e-01)
        a = wp.cw_mul(a, t)
        return chosen(at_least(y, x), Lane(quarter) - a, a)

    arctangent = polynomial_arctangent if precision == "float32" else library_arctangent

    @wp.func
    def turn_of_turning(motion: int, along: Lane):
        """By how much a joint turns about a direction that its axis has this component along."""
        return along

    @wp.func
    def turn_of_any(motion: int, along: Lane):
        if motion < PRISMATIC:
            return along
        return Lane(zero)

    turn_of = {"revolute": turn_of_turning, "any": turn_of_any}[motions]

    @wp.func
    def along(a: Vector3, x: Lane, y: Lane, z: Lane):
        """One world component of a vector that is fixed in a frame with these components of its axes."""
        return a[0] * x + a[1] * y + a[2] * z

    @wp.func
    def dot(ax: Lane, ay: Lane, az: Lane, bx: Lane, by: Lane, bz: Lane):
        return wp.cw_mul(ax, bx) + wp.cw_mul(ay, by) + wp.cw_mul(az, bz)

    @wp.func
    def turn_between(
        xx: Lane,
        xy: Lane,
        xz: Lane,
        yx: Lane,
        yy: Lane,
        yz: Lane,
        zx: Lane,
        zy: Lane,
        zz: Lane,
        asks: Lane,
        whole: Lane,
    ):
        """How far the tool is turned from a target [rad], and the way there about its own x, y, z, shortened.

        xx to zz: the target's axes x, y, z seen from the tool, component by component (xy: of the target's y along the
        tool's x). asks: 1 where a target asks for an angle, whole: 1 where for its whole orientation, not an axis.

        By way of a quaternion, which needs no division where the way is half a turn. Of such a turn the way is not
        determined: for an axis it is about the tool's own y.
        """
        # 4 q qᵀ of the rotation with these entries: the row with the largest diagonal is q, times a number above 0.
        w, x, y, z = Lane(one) + xx + yy + zz, zy - yz, xz - zx, yx - xy
        most = w
        xs = Lane(one) + xx - yy - zz
        larger = Lane(one) - at_least(most, xs)
        w, x, y, z = (
            chosen(larger, zy - yz, w), chosen(larger, xs, x), chosen(larger, xy + yx, y), chosen(larger, xz + zx, z)
        )  # fmt: skip
        most = wp.max(most, xs)
        ys = Lane(one) - xx + yy - zz
        larger = Lane(one) - at_least(most, ys)
        w, x, y, z = (
            chosen(larger, xz - zx, w), chosen(larger, xy + yx, x), chosen(larger, ys, y), chosen(larger, yz + zy, z)
        )  # fmt: skip
        most = wp.max(most, ys)
        zs = Lane(one) - xx - yy + zz
        larger = Lane(one) - at_least(most, zs)
        w, x, y, z = (
            chosen(larger, yx - xy, w), chosen(larger, xz + zx, x), chosen(larger, yz + zy, y), chosen(larger, zs, z)
        )  # fmt: skip
        side = two * at_least(w, Lane(zero)) - Lane(one)  # q and -q are one rotation: the one by half a turn at most

        # The shortest turn from the tool's z to the target's.
        w = chosen(whole, wp.cw_mul(side, w), wp.max(Lane(one) + zz, Lane(zero)))
        x = chosen(whole, wp.cw_mul(side, x), -yz)
        y = chosen(whole, wp.cw_mul(side, y), xz)
        z = wp.cw_mul(whole, wp.cw_mul(side, z))
        opposite = at_least(Lane(nothing), w + wp.abs(x) + wp.abs(y) + wp.abs(z))
        y += opposite

        length = roots(square_of(x, y, z))
        angle = wp.cw_mul(asks, two * arctangent(length, w))
        share = wp.cw_div(wp.min(angle, Lane(longest_turn)), wp.max(length, Lane(least_length)))
        return angle, wp.cw_mul(share, x), wp.cw_mul(share, y), wp.cw_mul(share, z)

    @wp.func
    def factored(
        a11: Wide,
        a21: Wide, a22: Wide,
        a31: Wide, a32: Wide, a33: Wide,
        a41: Wide, a42: Wide, a43: Wide, a44: Wide,
        a51: Wide, a52: Wide, a53: Wide, a54: Wide, a55: Wide,
        a61: Wide, a62: Wide, a63: Wide, a64: Wide, a65: Wide, a66: Wide,
    ):  # fmt: skip
        """A symmetric 6 x 6 matrix, by its lower triangle, as L D Lᵀ: L below its diagonal, then D."""
        d1 = wp.max(a11, least)
        i1 = wp.cw_div(ones, d1)
        l21 = wp.cw_mul(a21, i1)
        l31 = wp.cw_mul(a31, i1)
        l41 = wp.cw_mul(a41, i1)
        l51 = wp.cw_mul(a51, i1)
        l61 = wp.cw_mul(a61, i1)
        a22 -= wp.cw_mul(l21, a21)
        a32 -= wp.cw_mul(l31, a21)
        a33 -= wp.cw_mul(l31, a31)
        a42 -= wp.cw_mul(l41, a21)
        a43 -= wp.cw_mul(l41, a31)
        a44 -= wp.cw_mul(l41, a41)
        a52 -= wp.cw_mul(l51, a21)
        a53 -= wp.cw_mul(l51, a31)
        a54 -= wp.cw_mul(l51, a41)
        a55 -= wp.cw_mul(l51, a51)
        a62 -= wp.cw_mul(l61, a21)
        a63 -= wp.cw_mul(l61, a31)
        a64 -= wp.cw_mul(l61, a41)
        a65 -= wp.cw_mul(l61, a51)
        a66 -= wp.cw_mul(l61, a61)
        d2 = wp.max(a22, least)
        i2 = wp.cw_div(ones, d2)
        l32 = wp.cw_mul(a32, i2)
        l42 = wp.cw_mul(a42, i2)
        l52 = wp.cw_mul(a52, i2)
        l62 = wp.cw_mul(a62, i2)
        a33 -= wp.cw_mul(l32, a32)
        a43 -= wp.cw_mul(l42, a32)
        a44 -= wp.cw_mul(l42, a42)
        a53 -= wp.cw_mul(l52, a32)
        a54 -= wp.cw_mul(l52, a42)
        a55 -= wp.cw_mul(l52, a52)
        a63 -= wp.cw_mul(l62, a32)
        a64 -= wp.cw_mul(l62, a42)
        a65 -= wp.cw_mul(l62, a52)
        a66 -= wp.cw_mul(l62, a62)
        d3 = wp.max(a33, least)
        i3 = wp.cw_div(ones, d3)
        l43 = wp.cw_mul(a43, i3)
        l53 = wp.cw_mul(a53, i3)
        l63 = wp.cw_mul(a63, i3)
        a44 -= wp.cw_mul(l43, a43)
        a54 -= wp.cw_mul(l53, a43)
        a55 -= wp.cw_mul(l53, a53)
        a64 -= wp.cw_mul(l63, a43)
        a65 -= wp.cw_mul(l63, a53)
        a66 -= wp.cw_mul(l63, a63)
        d4 = wp.max(a44, least)
        i4 = wp.cw_div(ones, d4)
        l54 = wp.cw_mul(a54, i4)
        l64 = wp.cw_mul(a64, i4)
        a55 -= wp.cw_mul(l54, a54)
        a65 -= wp.cw_mul(l64, a54)
        a66 -= wp.cw_mul(l64, a64)
        d5 = wp.max(a55, least)
        i5 = wp.cw_div(ones, d5)
        l65 = wp.cw_mul(a65, i5)
        a66 -= wp.cw_mul(l65, a65)
        d6 = wp.max(a66, least)
        return (
            l21,
            l31, l32,
            l41, l42, l43,
            l51, l52, l53, l54,
            l61, l62, l63, l64, l65,
            d1, d2, d3, d4, d5, d6,
        )  # fmt: skip

    @wp.func
    def solved(
        l21: Wide,
        l31: Wide, l32: Wide,
        l41: Wide, l42: Wide, l43: Wide,
        l51: Wide, l52: Wide, l53: Wide, l54: Wide,
        l61: Wide, l62: Wide, l63: Wide, l64: Wide, l65: Wide,
        d1: Wide, d2: Wide, d3: Wide, d4: Wide, d5: Wide, d6: Wide,
        x1: Wide, x2: Wide, x3: Wide, x4: Wide, x5: Wide, x6: Wide,
    ):  # fmt: skip
        """The solution of that system."""
        x2 -= wp.cw_mul(l21, x1)
        x3 -= wp.cw_mul(l31, x1)
        x3 -= wp.cw_mul(l32, x2)
        x4 -= wp.cw_mul(l41, x1)
        x4 -= wp.cw_mul(l42, x2)
        x4 -= wp.cw_mul(l43, x3)
        x5 -= wp.cw_mul(l51, x1)
        x5 -= wp.cw_mul(l52, x2)
        x5 -= wp.cw_mul(l53, x3)
        x5 -= wp.cw_mul(l54, x4)
        x6 -= wp.cw_mul(l61, x1)
        x6 -= wp.cw_mul(l62, x2)
        x6 -= wp.cw_mul(l63, x3)
        x6 -= wp.cw_mul(l64, x4)
        x6 -= wp.cw_mul(l65, x5)
        x1 = wp.cw_div(x1, d1)
        x2 = wp.cw_div(x2, d2)
        x3 = wp.cw_div(x3, d3)
        x4 = wp.cw_div(x4, d4)
        x5 = wp.cw_div(x5, d5)
        x6 = wp.cw_div(x6, d6)
        x5 -= wp.cw_mul(l65, x6)
        x4 -= wp.cw_mul(l64, x6)
        x4 -= wp.cw_mul(l54, x5)
        x3 -= wp.cw_mul(l63, x6)
        x3 -= wp.cw_mul(l53, x5)
        x3 -= wp.cw_mul(l43, x4)
        x2 -= wp.cw_mul(l62, x6)
        x2 -= wp.cw_mul(l52, x5)
        x2 -= wp.cw_mul(l42, x4)
        x2 -= wp.cw_mul(l32, x3)
        x1 -= wp.cw_mul(l61, x6)
        x1 -= wp.cw_mul(l51, x5)
        x1 -= wp.cw_mul(l41, x4)
        x1 -= wp.cw_mul(l31, x3)
        x1 -= wp.cw_mul(l21, x2)
        return Lane(x1), Lane(x2), Lane(x3), Lane(x4), Lane(x5), Lane(x6)

    @_kernel
    def descend(
        arms: Arms,
        tool_axis: wp.array(dtype=Vector3),
        tool_side: wp.array(dtype=Vector3),
        targets: wp.array2d(dtype=Lane),
        updates: int,
        q_last: wp.array3d(dtype=Lane),
        h_last: wp.array3d(dtype=Lane),
        q_kept: wp.array3d(dtype=Lane),
    ):
        """Inverse kinematics of an arm at a group of targets.

        tool_axis, tool_side: (N,) the tool's z and x in the last local frame, unit vectors at right angles.
        targets: (G, 16): the point [m], the payload [kg], which is not read, the x, y and z that the tool should have,
        1 where its z counts, 1 where its x does, too, and what a radian off counts as [m].
        q_last, h_last, q_kept: as of the kernel for points; kept are the angles with the least of
        distance² + (angle off, counted in m)².
        """
        arm, group = wp.tid()
        base = arms.base[arm]
        axis, side = tool_axis[arm], tool_side[arm]
        third = wp.cross(axis, side)
        asks, whole, trade = targets[group, 13], targets[group, 14], targets[group, 15]
        no_xy, no_z = Wide(Lane(one) - asks), Wide(Lane(one) - whole)
        q, kept = Joints(), Joints()
        limit_n, limit_d = Joints(), Joints()  # H of the update before, n / d: fractions compare without division
        ux, uy, uz = Joints(), Joints(), Joints()  # joint axes, then the position's columns of J
        vx, vy, vz = Joints(), Joints(), Joints()  # joint positions, then the angles' columns of J
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
                vx[j] = px
                vy[j] = py
                vz[j] = pz
                offset = arms.offset[arm, j]
                px += offset[0] * xx + offset[1] * yx + offset[2] * zx
                py += offset[0] * xy + offset[1] * yy + offset[2] * zy
                pz += offset[0] * xz + offset[1] * yz + offset[2] * zz

            # The tool's own axes in the world, and the target's seen from them.
            sx, sy, sz = along(side, xx, yx, zx), along(side, xy, yy, zy), along(side, xz, yz, zz)
            tx, ty, tz = along(third, xx, yx, zx), along(third, xy, yy, zy), along(third, xz, yz, zz)
            fx, fy, fz = along(axis, xx, yx, zx), along(axis, xy, yy, zy), along(axis, xz, yz, zz)
            angle, turn_x, turn_y, turn_z = turn_between(
                dot(sx, sy, sz, targets[group, 4], targets[group, 5], targets[group, 6]),
                dot(sx, sy, sz, targets[group, 7], targets[group, 8], targets[group, 9]),
                dot(sx, sy, sz, targets[group, 10], targets[group, 11], targets[group, 12]),
                dot(tx, ty, tz, targets[group, 4], targets[group, 5], targets[group, 6]),
                dot(tx, ty, tz, targets[group, 7], targets[group, 8], targets[group, 9]),
                dot(tx, ty, tz, targets[group, 10], targets[group, 11], targets[group, 12]),
                dot(fx, fy, fz, targets[group, 4], targets[group, 5], targets[group, 6]),
                dot(fx, fy, fz, targets[group, 7], targets[group, 8], targets[group, 9]),
                dot(fx, fy, fz, targets[group, 10], targets[group, 11], targets[group, 12]),
                asks,
                whole,
            )

            # The posture nearest to the target is kept, the earliest of equals.
            ex = targets[group, 0] - px
            ey = targets[group, 1] - py
            ez = targets[group, 2] - pz
            square = square_of(ex, ey, ez)
            off = wp.cw_mul(trade, angle)
            far = square + wp.cw_mul(off, off)
            nearer = Lane(one) - at_least(far, nearest)
            nearest = wp.min(nearest, far)
            for j in range(arms.dof):
                kept[j] = chosen(nearer, q[j], kept[j])

            # dx, shortened; J Jᵀ as a.., J W Jᵀ as b..; the pull y is taken out of dx, because
            # J# dx + (I - J# J) y = y + J# (dx - J y).
            shorten = wp.cw_div(Lane(longest_step), wp.max(roots(square), Lane(longest_step)))
            d1 = wp.cw_mul(ex, shorten)
            d2 = wp.cw_mul(ey, shorten)
            d3 = wp.cw_mul(ez, shorten)
            d4 = wp.cw_mul(asks, turn_x)
            d5 = wp.cw_mul(asks, turn_y)
            d6 = wp.cw_mul(whole, turn_z)
            a11 = Wide()
            a21, a22 = Wide(), Wide()
            a31, a32, a33 = Wide(), Wide(), Wide()
            a41, a42, a43, a44 = Wide(), Wide(), Wide(), Wide()
            a51, a52, a53, a54, a55 = Wide(), Wide(), Wide(), Wide(), Wide()
            a61, a62, a63, a64, a65, a66 = Wide(), Wide(), Wide(), Wide(), Wide(), Wide()
            b11 = Wide()
            b21, b22 = Wide(), Wide()
            b31, b32, b33 = Wide(), Wide(), Wide()
            b41, b42, b43, b44 = Wide(), Wide(), Wide(), Wide()
            b51, b52, b53, b54, b55 = Wide(), Wide(), Wide(), Wide(), Wide()
            b61, b62, b63, b64, b65, b66 = Wide(), Wide(), Wide(), Wide(), Wide(), Wide()
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

                ax, ay, az = ux[j], uy[j], uz[j]
                rx = px - vx[j]
                ry = py - vy[j]
                rz = pz - vz[j]
                jx = column_of(motion, ax, ay, az, ry, rz)
                jy = column_of(motion, ay, az, ax, rz, rx)
                jz = column_of(motion, az, ax, ay, rx, ry)
                gx = wp.cw_mul(asks, turn_of(motion, dot(sx, sy, sz, ax, ay, az)))
                gy = wp.cw_mul(asks, turn_of(motion, dot(tx, ty, tz, ax, ay, az)))
                gz = wp.cw_mul(whole, turn_of(motion, dot(fx, fy, fz, ax, ay, az)))
                d1 -= wp.cw_mul(jx, y)
                d2 -= wp.cw_mul(jy, y)
                d3 -= wp.cw_mul(jz, y)
                d4 -= wp.cw_mul(gx, y)
                d5 -= wp.cw_mul(gy, y)
                d6 -= wp.cw_mul(gz, y)
                ux[j] = jx
                uy[j] = jy
                uz[j] = jz
                vx[j] = gx
                vy[j] = gy
                vz[j] = gz
                weight[j] = w
                pull[j] = y

                c1, c2, c3, c4, c5, c6 = Wide(jx), Wide(jy), Wide(jz), Wide(gx), Wide(gy), Wide(gz)
                ww = Wide(w)
                w1, w2, w3 = wp.cw_mul(ww, c1), wp.cw_mul(ww, c2), wp.cw_mul(ww, c3)
                w4, w5, w6 = wp.cw_mul(ww, c4), wp.cw_mul(ww, c5), wp.cw_mul(ww, c6)
                a11 += wp.cw_mul(c1, c1)
                a21 += wp.cw_mul(c2, c1)
                a22 += wp.cw_mul(c2, c2)
                a31 += wp.cw_mul(c3, c1)
                a32 += wp.cw_mul(c3, c2)
                a33 += wp.cw_mul(c3, c3)
                a41 += wp.cw_mul(c4, c1)
                a42 += wp.cw_mul(c4, c2)
                a43 += wp.cw_mul(c4, c3)
                a44 += wp.cw_mul(c4, c4)
                a51 += wp.cw_mul(c5, c1)
                a52 += wp.cw_mul(c5, c2)
                a53 += wp.cw_mul(c5, c3)
                a54 += wp.cw_mul(c5, c4)
                a55 += wp.cw_mul(c5, c5)
                a61 += wp.cw_mul(c6, c1)
                a62 += wp.cw_mul(c6, c2)
                a63 += wp.cw_mul(c6, c3)
                a64 += wp.cw_mul(c6, c4)
                a65 += wp.cw_mul(c6, c5)
                a66 += wp.cw_mul(c6, c6)
                b11 += wp.cw_mul(w1, c1)
                b21 += wp.cw_mul(w2, c1)
                b22 += wp.cw_mul(w2, c2)
                b31 += wp.cw_mul(w3, c1)
                b32 += wp.cw_mul(w3, c2)
                b33 += wp.cw_mul(w3, c3)
                b41 += wp.cw_mul(w4, c1)
                b42 += wp.cw_mul(w4, c2)
                b43 += wp.cw_mul(w4, c3)
                b44 += wp.cw_mul(w4, c4)
                b51 += wp.cw_mul(w5, c1)
                b52 += wp.cw_mul(w5, c2)
                b53 += wp.cw_mul(w5, c3)
                b54 += wp.cw_mul(w5, c4)
                b55 += wp.cw_mul(w5, c5)
                b61 += wp.cw_mul(w6, c1)
                b62 += wp.cw_mul(w6, c2)
                b63 += wp.cw_mul(w6, c3)
                b64 += wp.cw_mul(w6, c4)
                b65 += wp.cw_mul(w6, c5)
                b66 += wp.cw_mul(w6, c6)

            (
                _m21, _m31, _m32, _m41, _m42, _m43, _m51, _m52, _m53, _m54, _m61, _m62, _m63, _m64, _m65,
                p1, p2, p3, p4, p5, p6,
            ) = factored(
                a11,
                a21, a22,
                a31, a32, a33,
                a41, a42, a43, a44 + no_xy,
                a51, a52, a53, a54, a55 + no_xy,
                a61, a62, a63, a64, a65, a66 + no_z,
            )  # fmt: skip
            det = wp.cw_mul(wp.cw_mul(wp.cw_mul(p1, p2), wp.cw_mul(p3, p4)), wp.cw_mul(p5, p6))
            k = Wide(damping(Lane(det)))
            (
                l21, l31, l32, l41, l42, l43, l51, l52, l53, l54, l61, l62, l63, l64, l65, p1, p2, p3, p4, p5, p6,
            ) = factored(
                b11 + k,
                b21, b22 + k,
                b31, b32, b33 + k,
                b41, b42, b43, b44 + k + no_xy,
                b51, b52, b53, b54, b55 + k + no_xy,
                b61, b62, b63, b64, b65, b66 + k + no_z,
            )  # fmt: skip
            s1, s2, s3, s4, s5, s6 = solved(
                l21, l31, l32, l41, l42, l43, l51, l52, l53, l54, l61, l62, l63, l64, l65, p1, p2, p3, p4, p5, p6,
                Wide(d1), Wide(d2), Wide(d3), Wide(d4), Wide(d5), Wide(d6),
            )  # fmt: skip
            for j in range(arms.dof):
                column = wp.cw_mul(ux[j], s1) + wp.cw_mul(uy[j], s2) + wp.cw_mul(uz[j], s3)
                column += wp.cw_mul(vx[j], s4) + wp.cw_mul(vy[j], s5) + wp.cw_mul(vz[j], s6)
                moved = q[j] + pull[j] + wp.cw_mul(weight[j], column)
                q[j] = wp.min(wp.max(moved, Lane(arms.lower[arm, j])), Lane(arms.upper[arm, j]))

        for j in range(arms.dof):
            q_last[arm, group, j] = q[j]
            h_last[arm, group, j] = wp.cw_div(limit_n[j], limit_d[j])
            q_kept[arm, group, j] = kept[j]

    @wp.func
    def off_target(
        arms: Arms,
        axis: Vector3,
        side: Vector3,
        arm: int,
        group: int,
        targets: wp.array2d(dtype=Lane),
        q: wp.array3d(dtype=Lane),
    ):
        """distance² + (angle off, counted in m)² at angles q (N, G, D), and that angle [rad]."""
        base = arms.base[arm]
        third = wp.cross(axis, side)
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
        sx, sy, sz = along(side, xx, yx, zx), along(side, xy, yy, zy), along(side, xz, yz, zz)
        tx, ty, tz = along(third, xx, yx, zx), along(third, xy, yy, zy), along(third, xz, yz, zz)
        fx, fy, fz = along(axis, xx, yx, zx), along(axis, xy, yy, zy), along(axis, xz, yz, zz)
        angle, _x, _y, _z = turn_between(
            dot(sx, sy, sz, targets[group, 4], targets[group, 5], targets[group, 6]),
            dot(sx, sy, sz, targets[group, 7], targets[group, 8], targets[group, 9]),
            dot(sx, sy, sz, targets[group, 10], targets[group, 11], targets[group, 12]),
            dot(tx, ty, tz, targets[group, 4], targets[group, 5], targets[group, 6]),
            dot(tx, ty, tz, targets[group, 7], targets[group, 8], targets[group, 9]),
            dot(tx, ty, tz, targets[group, 10], targets[group, 11], targets[group, 12]),
            dot(fx, fy, fz, targets[group, 4], targets[group, 5], targets[group, 6]),
            dot(fx, fy, fz, targets[group, 7], targets[group, 8], targets[group, 9]),
            dot(fx, fy, fz, targets[group, 10], targets[group, 11], targets[group, 12]),
            targets[group, 13],
            targets[group, 14],
        )
        off = wp.cw_mul(targets[group, 15], angle)
        square = square_of(targets[group, 0] - px, targets[group, 1] - py, targets[group, 2] - pz)
        return square + wp.cw_mul(off, off), angle

    @_kernel
    def settle(
        arms: Arms,
        tool_axis: wp.array(dtype=Vector3),
        tool_side: wp.array(dtype=Vector3),
        targets: wp.array2d(dtype=Lane),
        q_last: wp.array3d(dtype=Lane),
        q_kept: wp.array3d(dtype=Lane),
        turned_off: wp.array3d(dtype=Lane),
    ):
        """Keeps the last posture where it is nearer, and says by which angle the tool is off.

        turned_off: (N, G, 1) [rad]; 0 for a point.
        """
        arm, group = wp.tid()
        axis, side = tool_axis[arm], tool_side[arm]
        last, last_angle = off_target(arms, axis, side, arm, group, targets, q_last)
        kept, kept_angle = off_target(arms, axis, side, arm, group, targets, q_kept)
        farther = at_least(last, kept)
        turned_off[arm, group, 0] = chosen(farther, kept_angle, last_angle)
        for j in range(arms.dof):
            q_kept[arm, group, j] = chosen(farther, q_kept[arm, group, j], q_last[arm, group, j])

    return replace(plain, descend=descend, settle=settle)
