"""Warp kernels for targets that are points: inverse kinematics and static torque.

Each thread solves one arm for as many targets as there are lanes, one in each lane of a vector, so the vector
instructions of a CPU solve eight targets at a time. A GPU has its own threads for that and uses one lane.

docs/method.md §2 states the equations. Their sources, by symbol:

    e, clip     shortened error, joint limits                         jskeus and scikit-robot
    J           position Jacobian, column u x r of a revolute joint   Whitney 1969
    m           manipulability sqrt(det J Jᵀ)                         Yoshikawa 1985
    k           damping near singularities                            Nakamura & Hanafusa 1986
    H           gradient of the joint-limit criterion                 Chan & Dubey 1995, after Zghal et al. 1990
    w           weights 1 / (1 + H) of joints that near a limit       Chan & Dubey 1995
    J#          damped weighted least-norm inverse                    Chan & Dubey 1995
    y           null-space pull to mid-range                          Liégeois 1977, as in Sugiura et al. 2007

T. F. Chan, R. V. Dubey: A weighted least-norm solution based scheme for avoiding joint limits for redundant joint
manipulators, IEEE Trans. Robotics and Automation 11(2), 286-292, 1995. A. Liégeois: Automatic supervisory control of
the configuration and behavior of multibody mechanisms, IEEE Trans. SMC 7(12), 1977. Y. Nakamura, H. Hanafusa: Inverse
kinematic solutions with singularity robustness for robot manipulator control, ASME J. DSMC 108(3), 1986. H. Sugiura et
al.: Real-time self collision avoidance for humanoids by means of nullspace criteria and task intervals, Humanoids 2007.
D. E. Whitney: Resolved motion rate control of manipulators and human prostheses, IEEE Trans. MMS 10(2), 1969.
T. Yoshikawa: Manipulability of robotic mechanisms, Int. J. Robotics Research 4(2), 1985. H. Zghal, R. V. Dubey,
J. A. Euler: Efficient gradient projection optimization for manipulators with multiple degrees of redundancy, ICRA 1990.

Angles, positions and torques have the precision of the variant. The 3 x 3 system is float64 in every variant: its
matrix squares the condition of the Jacobian, and weights near the joint limits (down to 2.5e-4 at ±2.4 rad) add to it.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from armwright.kinematics.arm_arrays import FIXED, PRISMATIC, Motions, Precision
from armwright.kinematics.ik_math import ik_math, kernel
from armwright.robot.arm import GRAVITY


@dataclass(frozen=True)
class Kernels:
    """One variant of the kernels. Each compiles when it is first loaded, and is cached on disk."""

    Lane: Any  # a vector of one number per lane
    Arms: Any  # `ArmArrays` on the device, a Warp struct
    solve_ik: Any
    static_torque: Any  # best posture, its tip and its torque
    keep_pose: Any = None  # for pose targets, before `static_torque`: best posture, its angle error


@cache
def position_kernels(precision: Precision, lanes: int, motions: Motions) -> Kernels:
    """Return the kernels that solve `lanes` targets per thread in this precision, for arms with these joint motions.

    One long function on purpose: code that Warp compiles takes its types and constants from the enclosing function.
    T targets form G groups: target g x lanes + i is in lane i of group g; the last target fills its group.
    """
    base = ik_math(precision, lanes, motions)
    real, Lane, Wide, Joints, Arms = base.real, base.Lane, base.Wide, base.Joints, base.Arms
    roots, at_least, select, norm_squared = base.roots, base.at_least, base.select, base.norm_squared
    advance, column, limit, damping = base.advance, base.column, base.limit, base.damping

    zero, one, gravity, infinity = real(0.0), real(1.0), real(GRAVITY), real(1e30)
    one_wide = wp.float64(1.0)
    max_step = real(0.1)  # [m] of the error that one update tries to close

    @wp.func
    def determinant(xx: Wide, xy: Wide, xz: Wide, yy: Wide, yz: Wide, zz: Wide):
        """Return the determinant of a symmetric 3 x 3 matrix."""
        return (
            wp.cw_mul(xx, wp.cw_mul(yy, zz) - wp.cw_mul(yz, yz))
            - wp.cw_mul(xy, wp.cw_mul(xy, zz) - wp.cw_mul(yz, xz))
            + wp.cw_mul(xz, wp.cw_mul(xy, yz) - wp.cw_mul(yy, xz))
        )

    @wp.func
    def solve_3x3(xx: Wide, xy: Wide, xz: Wide, yy: Wide, yz: Wide, zz: Wide, x: Wide, y: Wide, z: Wide):
        """Return the solution of a symmetric 3 x 3 system by its adjugate."""
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

    @kernel
    def solve_ik(
        arms: Arms,
        targets: wp.array2d(dtype=Lane),
        updates: int,
        q_last: wp.array3d(dtype=Lane),
        h_last: wp.array3d(dtype=Lane),
        q_kept: wp.array3d(dtype=Lane),
    ):
        """Inverse kinematics of an arm at a group of targets.

        targets: (G, 4) [m], last the payload [kg], which is not read.
        q_last: (N, G, D), the initial angles, then those after the last update [rad].
        h_last: (N, G, D), the limit gradients H before the first, then of the last update.
        q_kept: (N, G, D), the angles nearest to the target of all but the last.

        One long function on purpose: the arrays over joints live in its registers and stack; passing them to
        functions copies them, which made a prototype three times slower.
        """
        arm, group = wp.tid()
        base = arms.base[arm]
        q, kept = Joints(), Joints()
        limit_n, limit_d = Joints(), Joints()  # H of the update before, n / d: fractions compare without division
        ux, uy, uz = Joints(), Joints(), Joints()  # joint axes, then the columns of the Jacobian J
        place_x, place_y, place_z = Joints(), Joints(), Joints()  # joint positions
        weight, pull = Joints(), Joints()
        for j in range(arms.dof):
            q[j] = q_last[arm, group, j]
            kept[j] = q[j]
            limit_n[j] = h_last[arm, group, j]
            limit_d[j] = Lane(one)
        nearest = Lane(infinity)
        for _ in range(updates):
            # Forward kinematics. xx, xy, xz: the local x axis in the world, and so on.
            xx, xy, xz = Lane(one), Lane(zero), Lane(zero)
            yx, yy, yz = Lane(zero), Lane(one), Lane(zero)
            zx, zy, zz = Lane(zero), Lane(zero), Lane(one)
            px, py, pz = Lane(base[0]), Lane(base[1]), Lane(base[2])
            for j in range(arms.dof):
                xx, xy, xz, yx, yy, yz, zx, zy, zz, ax, ay, az, ox, oy, oz, px, py, pz = advance(
                    arms.motion[arm, j], arms.offset[arm, j], q[j], xx, xy, xz, yx, yy, yz, zx, zy, zz, px, py, pz
                )  # fmt: skip
                ux[j] = ax
                place_x[j] = ox
                uy[j] = ay
                place_y[j] = oy
                uz[j] = az
                place_z[j] = oz

            # The posture nearest to the target is kept, the earliest of equals.
            ex = targets[group, 0] - px
            ey = targets[group, 1] - py
            ez = targets[group, 2] - pz
            square = norm_squared(ex, ey, ez)
            nearer = Lane(one) - at_least(square, nearest)
            nearest = wp.min(nearest, square)
            for j in range(arms.dof):
                kept[j] = select(nearer, q[j], kept[j])

            # dx, shortened; J Jᵀ as a.., J W Jᵀ as b..; the pull y is taken out of dx, because
            # J# dx + (I - J# J) y = y + J# (dx - J y).
            shorten = wp.cw_div(Lane(max_step), wp.max(roots(square), Lane(max_step)))
            dx = wp.cw_mul(ex, shorten)
            dy = wp.cw_mul(ey, shorten)
            dz = wp.cw_mul(ez, shorten)
            axx, axy, axz, ayy, ayz, azz = Wide(), Wide(), Wide(), Wide(), Wide(), Wide()
            bxx, bxy, bxz, byy, byz, bzz = Wide(), Wide(), Wide(), Wide(), Wide(), Wide()
            for j in range(arms.dof):
                motion = arms.motion[arm, j]
                n, d, w, y = limit(motion, arms.lower[arm, j], arms.upper[arm, j], q[j], limit_n[j], limit_d[j])
                limit_n[j] = n
                limit_d[j] = d

                rx = px - place_x[j]
                ry = py - place_y[j]
                rz = pz - place_z[j]
                jx = column(motion, ux[j], uy[j], uz[j], ry, rz)
                jy = column(motion, uy[j], uz[j], ux[j], rz, rx)
                jz = column(motion, uz[j], ux[j], uy[j], rx, ry)
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
            vx, vy, vz = solve_3x3(bxx + k, bxy, bxz, byy + k, byz, bzz + k, Wide(dx), Wide(dy), Wide(dz))
            for j in range(arms.dof):
                step = wp.cw_mul(ux[j], vx) + wp.cw_mul(uy[j], vy) + wp.cw_mul(uz[j], vz)
                moved = q[j] + pull[j] + wp.cw_mul(weight[j], step)
                q[j] = wp.min(wp.max(moved, Lane(arms.lower[arm, j])), Lane(arms.upper[arm, j]))

        for j in range(arms.dof):
            q_last[arm, group, j] = q[j]
            h_last[arm, group, j] = wp.cw_div(limit_n[j], limit_d[j])
            q_kept[arm, group, j] = kept[j]

    @wp.func
    def tip(arms: Arms, arm: int, group: int, q: wp.array3d(dtype=Lane)):
        """Return the tip's position at angles q (N, G, D)."""
        base = arms.base[arm]
        xx, xy, xz = Lane(one), Lane(zero), Lane(zero)
        yx, yy, yz = Lane(zero), Lane(one), Lane(zero)
        zx, zy, zz = Lane(zero), Lane(zero), Lane(one)
        px, py, pz = Lane(base[0]), Lane(base[1]), Lane(base[2])
        for j in range(arms.dof):
            xx, xy, xz, yx, yy, yz, zx, zy, zz, _ax, _ay, _az, _ox, _oy, _oz, px, py, pz = advance(
                arms.motion[arm, j], arms.offset[arm, j], q[arm, group, j],
                xx, xy, xz, yx, yy, yz, zx, zy, zz, px, py, pz,
            )  # fmt: skip
        return px, py, pz

    @wp.func
    def load(motion: int, ax: Lane, ay: Lane, az: Lane, lever_x: Lane, lever_y: Lane, mass: Lane):
        """Return the derivative of mass times height by a joint with this axis."""
        if motion < PRISMATIC:
            return wp.cw_mul(ax, lever_y) - wp.cw_mul(ay, lever_x)
        if motion < FIXED:
            return wp.cw_mul(mass, az)
        return Lane(zero)

    @kernel
    def static_torque(
        arms: Arms,
        targets: wp.array2d(dtype=Lane),
        q_last: wp.array3d(dtype=Lane),
        q_kept: wp.array3d(dtype=Lane),
        reached: wp.array3d(dtype=Lane),
        torque: wp.array3d(dtype=Lane),
    ):
        """Keep the last posture if it is nearer, and compute its tip position and its torque against gravity.

        targets: (G, 4) [m], last the payload at the tip [kg].  q_last, q_kept: (N, G, D) [rad] or [m].
        reached: (N, G, 3) [m].
        torque: (N, G, D), +dV/dq [N m] or [N].
        """
        arm, group = wp.tid()
        tx, ty, tz = targets[group, 0], targets[group, 1], targets[group, 2]
        lx, ly, lz = tip(arms, arm, group, q_last)
        kx, ky, kz = tip(arms, arm, group, q_kept)
        is_kept = at_least(norm_squared(tx - lx, ty - ly, tz - lz), norm_squared(tx - kx, ty - ky, tz - kz))
        reached[arm, group, 0] = select(is_kept, kx, lx)
        reached[arm, group, 1] = select(is_kept, ky, ly)
        reached[arm, group, 2] = select(is_kept, kz, lz)

        base = arms.base[arm]
        ux, uy, uz = Joints(), Joints(), Joints()  # joint axes
        place_x, place_y = Joints(), Joints()  # joint positions
        mx, my = Joints(), Joints()  # mass times position of what joint j carries up to the next
        xx, xy, xz = Lane(one), Lane(zero), Lane(zero)
        yx, yy, yz = Lane(zero), Lane(one), Lane(zero)
        zx, zy, zz = Lane(zero), Lane(zero), Lane(one)
        px, py, pz = Lane(base[0]), Lane(base[1]), Lane(base[2])
        for j in range(arms.dof):
            q = select(is_kept, q_kept[arm, group, j], q_last[arm, group, j])
            q_kept[arm, group, j] = q
            xx, xy, xz, yx, yy, yz, zx, zy, zz, ax, ay, az, ox, oy, _oz, px, py, pz = advance(
                arms.motion[arm, j], arms.offset[arm, j], q, xx, xy, xz, yx, yy, yz, zx, zy, zz, px, py, pz
            )  # fmt: skip
            ux[j] = ax
            uy[j] = ay
            uz[j] = az
            place_x[j] = ox
            place_y[j] = oy
            com = arms.com[arm, j]
            mass = arms.mass[arm, j]
            mx[j] = mass * (ox + com[0] * xx + com[1] * yx + com[2] * zx)
            my[j] = mass * (oy + com[0] * xy + com[1] * yy + com[2] * zy)

        mass_beyond = targets[group, 3]
        beyond_x = wp.cw_mul(mass_beyond, px)  # its mass times position
        beyond_y = wp.cw_mul(mass_beyond, py)
        for step in range(arms.dof):
            j = arms.dof - 1 - step
            mass_beyond += Lane(arms.mass[arm, j])
            beyond_x += mx[j]
            beyond_y += my[j]
            lever_x = beyond_x - wp.cw_mul(mass_beyond, place_x[j])
            lever_y = beyond_y - wp.cw_mul(mass_beyond, place_y[j])
            torque[arm, group, j] = gravity * load(
                arms.motion[arm, j], ux[j], uy[j], uz[j], lever_x, lever_y, mass_beyond
            )

    return Kernels(Lane, Arms, solve_ik, static_torque)
