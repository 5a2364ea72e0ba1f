"""Warp kernel of the largest loads across the axes of joints along motions, in float64."""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import PRISMATIC
from armwright.kinematics.arms.frame_math import frame_math
from armwright.kinematics.arms.ik_math import kernel


@cache
def bearing_kernels() -> SimpleNamespace:
    """Return the kernel."""
    base = frame_math("float64")
    real, Vector3 = base.real, base.Vector3
    Wrench = wp.types.vector(length=6, dtype=real)
    one = real(1.0)

    @wp.func
    def total_wrench(terms: wp.array4d(dtype=Wrench), arm: int, sample: int, j: int, s: real, ss: real):
        """Return the wrench of a joint at s' and s''."""
        return terms[arm, sample, 0, j] + s * s * terms[arm, sample, 1, j] + ss * terms[arm, sample, 2, j]

    @kernel
    def bearing_loads(
        before: wp.array2d(dtype=int), share: wp.array2d(dtype=real), rate: wp.array(dtype=real),
        change: wp.array(dtype=real), durations: wp.array2d(dtype=real), motion: wp.array2d(dtype=int),
        axis: wp.array2d(dtype=Vector3), offset: wp.array2d(dtype=real), wrenches: wp.array4d(dtype=Wrench),
        largest: wp.array4d(dtype=real),
    ):  # fmt: skip
        """Find the largest loads across the axes of joints that turn, as of `bearings.py`.

        before, share: (M, F) sample before each instant of each motion, and share of the way to the next.  rate,
        change: (F,) s_τ and s_ττ.  durations: (N, M) [s].  offset: (N, D) of the bearings [m].  wrenches: (N, S, 3, D)
        of `dynamics_kernels`.  largest: (N, M, D, 3) tilting moment [N m], axial and radial force [N].
        """
        arm, path = wp.tid()
        for j in range(motion.shape[1]):
            tilting, axial, radial = real(0.0), real(0.0), real(0.0)
            if motion[arm, j] < wp.static(PRISMATIC):
                a = axis[arm, j]
                for f in range(rate.shape[0]):
                    sample, after = before[path, f], share[path, f]
                    s, ss = rate[f] / durations[arm, path], change[f] / (durations[arm, path] * durations[arm, path])
                    total = (one - after) * total_wrench(wrenches, arm, sample, j, s, ss)
                    total += after * total_wrench(wrenches, arm, sample + 1, j, s, ss)
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

    return SimpleNamespace(real=real, bearing_loads=bearing_loads)
