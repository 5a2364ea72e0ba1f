"""Warp kernels of what drives deliver along motions, and of the largest rate that they can follow, in float64.

A thread takes one motion of an arm. Its rate u = 1 / T descends from root to root of the limits of `least_time` that do
not hold, until all hold. No rate that a step passes is allowed, so the order of the limits does not matter.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.ik_math import kernel
from armwright.kinematics.cycle.drive_limits import MAX_RATE, STILL

ALLOWED = 1.0 + 1e-10  # of a limit relative to the peak torque
ROUNDING = 1e-13  # of a sum relative to its terms


@cache
def drive_kernels() -> SimpleNamespace:
    """Return the kernels."""
    real = wp.float64
    zero, one, two = real(0.0), real(1.0), real(2.0)
    allowed, slack, rounding, still = real(ALLOWED), real(ALLOWED - 1.0), real(ROUNDING), real(STILL)

    @wp.struct
    class Load:
        """`MotionLoad` of N arms, M motions, S samples and D joints."""

        gravity: wp.array4d(dtype=real)
        inertial: wp.array4d(dtype=real)
        velocity: wp.array4d(dtype=real)
        acceleration: wp.array4d(dtype=real)

    @wp.struct
    class Drives:
        """Those of `Actuation`."""

        safety_factor: wp.array(dtype=real)  # (N,)
        peak: wp.array2d(dtype=real)  # (N, D) and all below
        no_load_speed: wp.array2d(dtype=real)
        falling_range: wp.array2d(dtype=real)
        rotor_inertia: wp.array2d(dtype=real)
        coulomb: wp.array2d(dtype=real)
        viscous: wp.array2d(dtype=real)
        limit_friction: wp.array2d(dtype=real)

    @wp.func
    def parts(load: Load, drives: Drives, arm: int, motion: int, s: int, j: int):
        """Return a, b and c of the torque a + b / T + c / T² without the friction of the gear, and the direction."""
        velocity, direction = load.velocity[arm, motion, s, j], zero
        if wp.abs(velocity) > still:
            direction = wp.sign(velocity)
        a = load.gravity[arm, motion, s, j] + drives.coulomb[arm, j] * direction
        c = load.inertial[arm, motion, s, j] + drives.rotor_inertia[arm, j] * load.acceleration[arm, motion, s, j]
        return a, drives.viscous[arm, j] * velocity, c, direction

    @wp.func
    def root_below(alpha: real, beta: real, gamma: real, u: real):
        """Return the largest root of α x² + β x + γ below u, -infinite without one; u if it is not positive there.

        Roots are free of cancellation (Press et al. 2007, section 5.6).
        """
        square, linear = alpha * u * u, beta * u
        if square + linear + gamma <= rounding * (wp.abs(square) + wp.abs(linear) + wp.abs(gamma)):
            return u
        found = real(-wp.inf)
        discriminant = beta * beta - real(4.0) * alpha * gamma
        if discriminant >= zero:
            q = -(beta + wp.sign(beta) * wp.sqrt(discriminant)) / two
            if alpha != zero and q / alpha < u:
                found = q / alpha
            if q != zero and gamma / q < u:
                found = wp.max(found, gamma / q)
        return found

    @wp.func
    def lowered(load: Load, drives: Drives, arm: int, motion: int, rate: real):
        """Return the largest rate up to this one [1/s] that the limits allow; -infinite if they allow none.

        NaN if a rating is unknown.
        """
        u, total, before = real(rate), real(0.0), real(wp.inf)
        while u < before and u > zero:
            before = u
            for j in range(drives.peak.shape[1]):
                fastest, gap = drives.no_load_speed[arm, j], drives.falling_range[arm, j]
                level, rise = real(wp.inf), zero  # of the falling line, relative to the range of speeds
                if gap > zero:
                    level = fastest / gap
                    rise = one / gap
                share = drives.safety_factor[arm] / drives.peak[arm, j]
                for s in range(load.gravity.shape[2]):
                    velocity = load.velocity[arm, motion, s, j]
                    if share * wp.abs(load.gravity[arm, motion, s, j]) > one:
                        u = real(-wp.inf)
                    # From here on, the velocity is not negative.
                    speed = wp.abs(velocity)
                    if speed * u > fastest:
                        u = fastest / speed
                    a, b, c, direction = parts(load, drives, arm, motion, s, j)
                    pushing = one + drives.limit_friction[arm, j] * wp.abs(direction)
                    scale = share * pushing * wp.sign(velocity)
                    a *= scale
                    b *= scale
                    c *= scale
                    total += a + b + c + speed + gap
                    torque = a + (b + c * u) * u
                    if torque > allowed:
                        u = root_below(c, b, a - one, u)
                    elif -torque > allowed * pushing:
                        u = root_below(-c, -b, -a - pushing, u)
                    b += speed * rise
                    if a + (b + c * u) * u > level + slack:
                        u = root_below(c, b, a - level, u)
        return wp.where(wp.isnan(total), total, u)

    @kernel
    def largest_rates(
        load: Load, drives: Drives, second_load: Load, second_drives: Drives, third_load: Load, third_drives: Drives,
        rates: wp.array2d(dtype=real),
    ):  # fmt: skip
        """Find the largest rates of motions (N, M) [1/s] that three cases allow together; see `lowered`."""
        arm, motion = wp.tid()
        u, before = real(MAX_RATE), real(wp.inf)
        while u < before:
            before = u
            u = lowered(load, drives, arm, motion, u)
            u = lowered(second_load, second_drives, arm, motion, u)
            u = lowered(third_load, third_drives, arm, motion, u)
        rates[arm, motion] = u

    @kernel
    def drive_torques(
        load: Load, drives: Drives, durations: wp.array2d(dtype=real), density: int, torques: wp.array4d(dtype=real),
        speeds: wp.array4d(dtype=real),
    ):  # fmt: skip
        """Compute torques [N m] and speeds [rad/s] of motions that take these times (N, M) [s].

        Of a density above 1, every so manieth of the S samples is kept, with the largest values up to the next ones;
        the first and the last one, at rest, stay as they are.  torques, speeds: (N, M, (S - 1) / density + 1, D).
        """
        arm, motion = wp.tid()
        duration, last = durations[arm, motion], torques.shape[2] - 1
        for f in range(last + 1):
            reach = density
            if f == 0 or f == last or density == 1:
                reach = int(0)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
            for j in range(torques.shape[3]):
                largest, fastest = real(0.0), real(0.0)
                begin = density * f - reach
                for s in range(begin, density * f + reach + 1):
                    a, b, c, direction = parts(load, drives, arm, motion, s, j)
                    torque = a + b / duration + c / (duration * duration)
                    gear = drives.limit_friction[arm, j] * direction
                    torque *= one + wp.max(gear * wp.sign(torque), zero)
                    speed = load.velocity[arm, motion, s, j] / duration
                    if s == begin or wp.abs(torque) > wp.abs(largest):
                        largest = torque
                    if s == begin or wp.abs(speed) > wp.abs(fastest):
                        fastest = speed
                torques[arm, motion, f, j] = largest
                speeds[arm, motion, f, j] = fastest

    return SimpleNamespace(Load=Load, Drives=Drives, largest_rates=largest_rates, drive_torques=drive_torques)
