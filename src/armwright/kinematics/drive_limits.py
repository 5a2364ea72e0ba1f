"""What the drives of joints can deliver, and the least time of a motion that respects it.

A motor that pushes in the direction of its motion delivers the smaller of its peak torque P and the line through
(corner speed, P) and (no-load speed, 0). A motor that brakes delivers P. Required torques count with the safety factor.
Drives of which a rating is unknown give NaN.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.actuation import Actuation


@dataclass(frozen=True)
class MotionLoad:
    """What a motion of N arms requires of D joints at S samples, for any duration T.

    The torque at a sample is gravity + coulomb + viscous / T + inertial / T², the speed is velocity / T. Sliding joints
    have N, m/s and m instead of N m, rad/s and rad.
    """

    gravity: Array  # (N, S, D) [N m]
    coulomb: Array  # (N, S, D) friction in the direction of the velocity, 0 at rest [N m]
    viscous: Array  # (N, S, D) friction at T = 1 s [N m s]
    inertial: Array  # (N, S, D) of links and rotors, with Coriolis terms, at T = 1 s [N m s²]
    velocity: Array  # (N, S, D) at T = 1 s [rad]

    def torque(self, time: Array) -> Array:
        """Return the (N, S, D) torques [N m] for durations (N,) [s]."""
        duration = time[:, None, None]
        return self.gravity + self.coulomb + self.viscous / duration + self.inertial / duration**2


def motion_load(gravity: Array, inertial: Array, velocity: Array, acceleration: Array, drives: Actuation) -> MotionLoad:
    """Return the load of a motion, with friction and rotor inertia of the drives.

    Args:
        gravity: (N, S, D) torques that hold the arm [N m].
        inertial: (N, S, D) torques that move its links in T = 1 s, without gravity [N m s²].
        velocity: (N, S, D) of the joints, for T = 1 s [rad].
        acceleration: (N, S, D) of the joints, for T = 1 s [rad].
        drives: Actuation of the N arms.
    """
    coulomb, viscous, rotor = (each[:, None] for each in (drives.coulomb, drives.viscous, drives.rotor_inertia))
    return MotionLoad(
        gravity=gravity,
        coulomb=coulomb * np.sign(velocity),
        viscous=viscous * velocity,
        inertial=inertial + rotor * acceleration,
        velocity=velocity,
    )


def available_torque(torque: Array, velocity: Array, drives: Actuation) -> Array:
    """Return how much torque drives can deliver in the direction of the torques that are required.

    Args:
        torque: (N, K, D) of which the direction counts [N m].
        velocity: (N, K, D) [rad/s].
        drives: Actuation of the N arms.

    Returns:
        (N, K, D) absolute torques [N m].
    """
    peak, no_load = drives.peak[:, None], drives.no_load_speed[:, None]
    gap, speed = _falling_range(drives)[:, None], np.abs(velocity)
    share = np.where(gap == 0.0, speed <= no_load, (no_load - speed) / np.where(gap == 0.0, 1.0, gap))
    motoring = torque * velocity > 0.0
    return np.where(motoring, peak * np.clip(np.where(motoring, share, 1.0), 0.0, 1.0), peak)


def torque_speed_utilisation(torque: Array, velocity: Array, drives: Actuation) -> Array:
    """Return the factor by which torque and speed together exceed what drives can deliver.

    It is the largest ratio of the point (required torque, speed) to the border of the available torques in the same
    direction from (0, 0): at most 1 if the drive can deliver the torque, and at rest the share of the peak torque.

    Args:
        torque: (N, K, D) required, without the safety factor [N m].
        velocity: (N, K, D) [rad/s].
        drives: Actuation of the N arms.

    Returns:
        (N, K, D) utilisations; 0 for fixed joints.
    """
    share = drives.safety_factor[:, None, None] * np.abs(torque) / drives.peak[:, None]
    along_line = (share * _falling_range(drives)[:, None] + np.abs(velocity)) / drives.no_load_speed[:, None]
    return np.where(torque * velocity > 0.0, np.maximum(share, along_line), share)


def least_time(load: MotionLoad, drives: Actuation) -> Array:
    """Return the least durations (N,) of motions that drives can follow [s]; infinite if there is none.

    With u = 1 / T, each limit at each sample is a quadratic inequality α u² + β u + γ <= 0. Turned so that the velocity
    w is not negative, and with the safety factor k, the torque is τ(u) = a + b u + c u² and the limits are

        k τ <= P,   -k τ <= P,   k τ + P w u / (ω₀ - ω_c) <= P ω₀ / (ω₀ - ω_c),   w u <= ω₀

    The third one, the falling line, always holds for τ <= 0 within the speed limit, so a motor that brakes needs no
    case of its own. α >= 0 allows an interval of u, α < 0 excludes one: gravity may permit a motion that is impossible
    at a lower speed. So the result is the largest u that all inequalities allow together, not the least of their ends.
    An arm that could not stop on the way, because k |gravity| > P, has none.

    Args:
        load: Load of the motions of N arms.
        drives: Actuation of the N arms.

    Examples:
        A motor of 2 N m and 10 rad/s turns a disc of 0.1 kg m² by 1 rad at a constant speed.

        >>> import numpy as np
        >>> from armwright.kinematics.actuation import actuation_at_joints
        >>> ratings = np.array([[[2.0, 1.0, 0.0, 10.0, 0.1, 0.0, 0.0, 12.0, 2.0]]])
        >>> drives = actuation_at_joints(ratings, np.ones((1, 1)), np.zeros(1), np.ones(1))
        >>> still, turn = np.zeros((1, 1, 1)), np.ones((1, 1, 1))
        >>> float(least_time(motion_load(still, still, turn, still, drives), drives)[0])
        0.1
    """
    limits = _limits(load, drives)
    lower, upper = limits.allowed()
    with np.errstate(divide="ignore"):
        fastest = (drives.no_load_speed[:, None] / np.abs(load.velocity)).min(axis=(1, 2))
    rate = limits.largest_allowed(np.minimum(upper, fastest))
    peak = drives.peak[:, None]
    holds = (drives.safety_factor[:, None, None] * np.abs(load.gravity) <= peak).all(axis=(1, 2))
    with np.errstate(divide="ignore"):
        time = np.where(holds & (rate >= lower) & (rate > 0.0), 1.0 / rate, np.inf)
    known = ~np.isnan(drives.peak + drives.corner_speed + drives.no_load_speed).any(axis=1)
    return np.where(known & ~np.isnan(load.coulomb + load.viscous + load.inertial).any(axis=(1, 2)), time, np.nan)


def _falling_range(drives: Actuation) -> Array:
    """Return the (N, D) range of speeds over which the available torque falls [rad/s]; 0 for fixed joints."""
    finite = np.isfinite(drives.no_load_speed)
    return np.where(finite, drives.no_load_speed - np.where(finite, drives.corner_speed, 0.0), 0.0)


@dataclass(frozen=True)
class _Quadratics:
    """Inequalities α u² + β u + γ <= 0 of N arms, (N, M) each, and the roots r <= s of the left sides."""

    alpha: Array
    constant: NDArray[np.bool_]  # True if α = β = 0, or if there is no limit
    possible: NDArray[np.bool_]  # True if there are real roots, or if a constant is at most 0
    r: Array
    s: Array

    def allowed(self) -> tuple[Array, Array]:
        """Return the (N,) least and largest u > 0 that the inequalities with α >= 0 allow; least > largest if none."""
        convex = ~self.constant & (self.alpha >= 0.0)
        lower = np.where(convex, np.where(self.possible, self.r, np.inf), 0.0)
        lower = np.where(self.constant & ~self.possible, np.inf, lower)
        return lower.max(axis=1, initial=0.0), np.where(convex, self.s, np.inf).min(axis=1, initial=np.inf)

    def largest_allowed(self, rate: Array) -> Array:
        """Return the (N,) largest u <= rate that no inequality with α < 0 excludes: each excludes r < u < s."""
        excludes = (self.alpha < 0.0) & ~self.constant & self.possible
        r, s = np.where(excludes, self.r, np.inf), np.where(excludes, self.s, -np.inf)
        while True:  # each step leaves an interval for good
            inside = (r < rate[:, None]) & (rate[:, None] < s)
            if not inside.any():
                return rate
            rate = np.minimum(rate, np.where(inside, r, np.inf).min(axis=1))


def _limits(load: MotionLoad, drives: Actuation) -> _Quadratics:
    """Return the limits of the torque, relative to its peak."""
    forward = np.where(load.velocity < 0.0, -1.0, 1.0) * drives.safety_factor[:, None, None] / drives.peak[:, None]
    a, b, c = forward * (load.gravity + load.coulomb), forward * load.viscous, forward * load.inertial
    gap = _falling_range(drives)
    falls = gap > 0.0
    slope = np.where(falls, 1.0 / np.where(falls, gap, 1.0), 0.0)
    level = np.where(falls, np.where(falls, drives.no_load_speed, 0.0) * slope, np.inf)
    alpha = np.stack([c, -c, c], axis=1)
    beta = np.stack([b, -b, b + slope[:, None] * np.abs(load.velocity)], axis=1)
    gamma = np.stack([a - 1.0, -a - 1.0, a - level[:, None]], axis=1)
    return _solved(*(each.reshape(len(gap), -1) for each in (alpha, beta, gamma)))


def _solved(alpha: Array, beta: Array, gamma: Array) -> _Quadratics:
    """Return the quadratics with their roots, without cancellation (Press et al. 2007, section 5.6)."""
    alpha = alpha + 0.0  # -0 would turn the sign of an infinite root
    constant = (alpha == 0.0) & (beta == 0.0)
    endless = np.isinf(gamma)  # no limit
    gamma = np.where(endless, -1.0, gamma)
    alpha, beta = np.where(endless, 0.0, alpha), np.where(endless, 0.0, beta)
    constant = constant | endless
    discriminant = beta**2 - 4.0 * alpha * gamma
    q = -0.5 * (beta + np.copysign(np.sqrt(np.maximum(discriminant, 0.0)), beta))
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = q / alpha, np.where(q == 0.0, 0.0, gamma / q)
    return _Quadratics(
        alpha=alpha,
        constant=constant,
        possible=np.where(constant, gamma <= 0.0, discriminant >= 0.0),
        r=np.minimum(one, other),
        s=np.maximum(one, other),
    )
