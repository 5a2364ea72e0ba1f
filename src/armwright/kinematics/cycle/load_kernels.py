"""Warp kernels of what motions require at instants, by their torque terms at samples, in float64.

A thread takes one motion of an arm. Terms are interpolated between samples; along a path that is driven backwards s has
the opposite sense: gravity and drag stay what they are, what is in proportion to q_s changes its sign.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import PRISMATIC
from armwright.kinematics.arms.ik_math import kernel


@cache
def load_kernels() -> SimpleNamespace:
    """Return the kernels."""
    real, Vector3 = wp.float64, wp.vec3d
    Wrench = wp.types.vector(length=6, dtype=real)
    one = real(1.0)

    @wp.struct
    class Picks:
        """Samples and instants, as of `instants.Picks`."""

        source: wp.array2d(dtype=int)  # (N, M) motion whose path each one takes
        start: wp.array(dtype=int)  # (M,)
        low: wp.array2d(dtype=int)  # (M, F)
        high: wp.array2d(dtype=int)  # (M, F)
        share: wp.array2d(dtype=real)  # (M, F)
        rate: wp.array(dtype=real)  # (F,)
        change: wp.array(dtype=real)  # (F,)
        way: wp.array(dtype=real)  # (M,)
        carried: wp.array(dtype=real)  # (M,) share of the payload that is carried

    @wp.func
    def mixed(values: wp.array4d(dtype=real), arm: int, low: int, high: int, row: int, j: int, share: real):
        """Return a term between two samples."""
        return (one - share) * values[arm, low, row, j] + share * values[arm, high, row, j]

    @kernel
    def motion_loads(
        picks: Picks, terms: wp.array4d(dtype=real), states: wp.array4d(dtype=real), more: real,
        gravity: wp.array4d(dtype=real), inertial: wp.array4d(dtype=real), velocity: wp.array4d(dtype=real),
        acceleration: wp.array4d(dtype=real), heavy_gravity: wp.array4d(dtype=real),
        heavy_inertial: wp.array4d(dtype=real),
    ):  # fmt: skip
        """Compute the fields of `MotionLoad` (N, M, F, D), and two of them with a share `more` of the payload on top.

        terms: (N, P, 6, D) of `dynamics_kernels`.  states: (N, P, 2, D) first and second derivative of the joint values
        by s [rad] or [m].
        """
        arm, motion = wp.tid()
        start, way, carried = picks.start[picks.source[arm, motion]], picks.way[motion], picks.carried[motion]
        for f in range(picks.rate.shape[0]):
            low, high, share = start + picks.low[motion, f], start + picks.high[motion, f], picks.share[motion, f]
            rate, change = picks.rate[f], picks.change[f]
            square, turned = rate * rate, way * change
            for j in range(terms.shape[3]):
                hold = carried * mixed(terms, arm, low, high, 3, j, share)
                move = mixed(terms, arm, low, high, 4, j, share) * square
                move = carried * (move + mixed(terms, arm, low, high, 5, j, share) * turned)
                own_move = mixed(terms, arm, low, high, 1, j, share) * square
                own_move += mixed(terms, arm, low, high, 2, j, share) * turned
                gravity[arm, motion, f, j] = mixed(terms, arm, low, high, 0, j, share) + hold
                inertial[arm, motion, f, j] = own_move + move
                heavy_gravity[arm, motion, f, j] = gravity[arm, motion, f, j] + more * hold
                heavy_inertial[arm, motion, f, j] = own_move + move + more * move
                q_s = mixed(states, arm, low, high, 0, j, share)
                velocity[arm, motion, f, j] = way * q_s * rate
                acceleration[arm, motion, f, j] = mixed(states, arm, low, high, 1, j, share) * square + q_s * turned

    @wp.func
    def total_wrench(
        terms: wp.array4d(dtype=Wrench), arm: int, sample: int, j: int, carried: real, square: real, turned: real
    ):  # fmt: skip
        """Return the wrench of a joint at s'² and s'', of which the latter has the sense of the path."""
        own = terms[arm, sample, 0, j] + square * terms[arm, sample, 1, j] + turned * terms[arm, sample, 2, j]
        payload = terms[arm, sample, 3, j] + square * terms[arm, sample, 4, j] + turned * terms[arm, sample, 5, j]
        return own + carried * payload

    @kernel
    def bearing_loads(
        picks: Picks, durations: wp.array2d(dtype=real), motion: wp.array2d(dtype=int),
        axis: wp.array2d(dtype=Vector3), offset: wp.array2d(dtype=real), wrenches: wp.array4d(dtype=Wrench),
        largest: wp.array4d(dtype=real),
    ):  # fmt: skip
        """Find the largest loads across the axes of joints that turn, as of `bearings.py`.

        durations: (N, M) [s].  offset: (N, D) of the bearings [m].  wrenches: (N, P, 6, D) of `dynamics_kernels`.
        largest: (N, M, D, 3) tilting moment [N m], axial and radial force [N].
        """
        arm, path = wp.tid()
        start, duration, carried = picks.start[picks.source[arm, path]], durations[arm, path], picks.carried[path]
        for j in range(motion.shape[1]):
            tilting, axial, radial = real(0.0), real(0.0), real(0.0)
            if motion[arm, j] < wp.static(PRISMATIC):
                a = axis[arm, j]
                for f in range(picks.rate.shape[0]):
                    low, high, after = start + picks.low[path, f], start + picks.high[path, f], picks.share[path, f]
                    square = picks.rate[f] * picks.rate[f] / (duration * duration)
                    turned = picks.way[path] * picks.change[f] / (duration * duration)
                    total = (one - after) * total_wrench(wrenches, arm, low, j, carried, square, turned)
                    total += after * total_wrench(wrenches, arm, high, j, carried, square, turned)
                    force, moment = Vector3(total[0], total[1], total[2]), Vector3(total[3], total[4], total[5])
                    along = wp.dot(force, a)
                    force -= along * a
                    moment -= wp.dot(moment, a) * a
                    lever = offset[arm, j] * wp.cross(a, force)
                    axial, radial = wp.max(axial, wp.abs(along)), wp.max(radial, wp.length(force))
                    tilting = wp.max(tilting, wp.max(wp.length(moment - lever), wp.length(moment + lever)))
            largest[arm, path, j, 0] = tilting
            largest[arm, path, j, 1] = axial
            largest[arm, path, j, 2] = radial

    return SimpleNamespace(real=real, Picks=Picks, motion_loads=motion_loads, bearing_loads=bearing_loads)
