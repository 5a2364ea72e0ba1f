"""Warp kernel of the largest rate of motions that drives can follow, in float64; see `least_time`.

A thread takes one motion of an arm. Its rate u = 1 / T descends from root to root of the limits that do not hold, until
all hold. No rate that a step passes is allowed, so the order of the limits does not matter.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.ik_math import kernel

ALLOWED = 1.0 + 1e-10  # of a limit relative to the peak torque
ROUNDING = 1e-13  # of a sum relative to its terms


@cache
def drive_kernels() -> SimpleNamespace:
    """Return the kernel."""
    real = wp.float64
    zero, one, two = real(0.0), real(1.0), real(2.0)
    allowed, slack, rounding = real(ALLOWED), real(ALLOWED - 1.0), real(ROUNDING)

    @wp.struct
    class Load:
        """`MotionLoad` of N arms, M motions, S samples and D joints."""

        gravity: wp.array4d(dtype=real)
        coulomb: wp.array4d(dtype=real)
        viscous: wp.array4d(dtype=real)
        inertial: wp.array4d(dtype=real)
        velocity: wp.array4d(dtype=real)
        gear: wp.array4d(dtype=real)

    @wp.struct
    class Limits:
        """Those of `Actuation`."""

        safety_factor: wp.array(dtype=real)  # (N,)
        peak: wp.array2d(dtype=real)  # (N, D)
        no_load_speed: wp.array2d(dtype=real)  # (N, D)
        falling_range: wp.array2d(dtype=real)  # (N, D)

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

    @kernel
    def lower_rates(load: Load, limits: Limits, rates: wp.array2d(dtype=real)):
        """Lower the rates of motions (N, M) [1/s] until the limits allow them; -infinite if they allow none.

        NaN if a rating is unknown.
        """
        arm, motion = wp.tid()
        u = rates[arm, motion]
        total = real(0.0)
        before = real(wp.inf)
        while u < before and u > zero:
            before = u
            for j in range(limits.peak.shape[1]):
                fastest, gap = limits.no_load_speed[arm, j], limits.falling_range[arm, j]
                level, rise = real(wp.inf), zero  # of the falling line, relative to the range of speeds
                if gap > zero:
                    level = fastest / gap
                    rise = one / gap
                share = limits.safety_factor[arm] / limits.peak[arm, j]
                for s in range(load.gravity.shape[2]):
                    gravity, velocity = load.gravity[arm, motion, s, j], load.velocity[arm, motion, s, j]
                    if share * wp.abs(gravity) > one:
                        u = real(-wp.inf)
                    # From here on, the velocity is not negative.
                    speed = wp.abs(velocity)
                    if speed * u > fastest:
                        u = fastest / speed
                    pushing = one + wp.abs(load.gear[arm, motion, s, j])
                    scale = share * pushing * wp.sign(velocity)
                    a = scale * (gravity + load.coulomb[arm, motion, s, j])
                    b, c = scale * load.viscous[arm, motion, s, j], scale * load.inertial[arm, motion, s, j]
                    total += a + b + c + speed + gap
                    torque = a + (b + c * u) * u
                    if torque > allowed:
                        u = root_below(c, b, a - one, u)
                    elif -torque > allowed * pushing:
                        u = root_below(-c, -b, -a - pushing, u)
                    b += speed * rise
                    if a + (b + c * u) * u > level + slack:
                        u = root_below(c, b, a - level, u)
        rates[arm, motion] = wp.where(wp.isnan(total), total, u)

    return SimpleNamespace(Load=Load, Limits=Limits, lower_rates=lower_rates)
