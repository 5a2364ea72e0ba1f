"""What the drives of joints can deliver, and the least time of a motion that respects it.

A motor that pushes in the direction of its motion delivers the smaller of its peak torque P and the line through
(corner speed, P) and (no-load speed, 0). A motor that brakes delivers P. Required torques count with the safety factor.
Drives of which a rating is unknown give NaN.

A gear takes a share μ of the torque that it passes on as friction, where makers state torques before it: a motor that
pushes needs (1 + μ) τ. One that brakes or holds needs τ at most, since friction helps it, which counts for nothing. The
share of limits that makers state at the output is 0 (`Actuation.limit_friction`).
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.actuation import Actuation

MAX_RATE = 1e9  # [1/s] of motions without any limit, which take no time
ALLOWED = 1.0 + 1e-10  # of a limit relative to the peak torque
STILL = 1e-6  # [rad] or [m] in a duration of 1 s; a joint that rests moves by less, from rounding
ROUNDING = 1e-13  # of a sum relative to its terms


@dataclass(frozen=True)
class MotionLoad:
    """What a motion of N arms requires of D joints at S samples, for any duration T.

    The torque at a sample is gravity + coulomb + viscous / T + inertial / T², with the friction of the gear if it is in
    the direction of the velocity. The speed is velocity / T. Sliding joints have N, m/s and m instead of N m, rad/s and
    rad.
    """

    gravity: Array  # (N, S, D) [N m]
    coulomb: Array  # (N, S, D) friction in the direction of the velocity, 0 at rest [N m]
    viscous: Array  # (N, S, D) friction at T = 1 s [N m s]
    inertial: Array  # (N, S, D) of links and rotors, with Coriolis terms, at T = 1 s [N m s²]
    velocity: Array  # (N, S, D) at T = 1 s [rad]
    gear: Array  # (N, S, D) share of the torque that the gear takes, with the sign of the velocity, 0 at rest

    def torque(self, time: Array) -> Array:
        """Return the (N, S, D) torques [N m] for durations (N,) [s]."""
        duration = time[:, None, None]
        torque = self.gravity + self.coulomb + self.viscous / duration + self.inertial / duration**2
        return torque * (1.0 + np.maximum(self.gear * np.sign(torque), 0.0))


def motion_load(gravity: Array, inertial: Array, velocity: Array, acceleration: Array, drives: Actuation) -> MotionLoad:
    """Return the load of a motion of N arms, with friction and rotor inertia of the drives.

    gravity: (N, S, D) torques that hold the arm [N m].  inertial: (N, S, D) torques that move its links in T = 1 s,
    without gravity [N m s²].  velocity, acceleration: (N, S, D) of the joints, for T = 1 s [rad].
    """
    coulomb, viscous, rotor = (each[:, None] for each in (drives.coulomb, drives.viscous, drives.rotor_inertia))
    direction = np.sign(np.where(np.abs(velocity) > STILL, velocity, 0.0))
    return MotionLoad(
        gravity=gravity,
        coulomb=coulomb * direction,
        viscous=viscous * velocity,
        inertial=inertial + rotor * acceleration,
        velocity=velocity,
        gear=drives.limit_friction[:, None] * direction,
    )


def torque_speed_utilisation(torque: Array, velocity: Array, drives: Actuation) -> Array:
    """Return (N, K, D) factors by which torque and speed together exceed what drives can deliver; 0 for fixed joints.

    Each is the largest ratio of the point (required torque, speed) to the border of the available torques in the same
    direction from (0, 0): at most 1 if the drive can deliver the torque, and at rest the share of the peak torque.

    torque: (N, K, D) required, without the safety factor [N m].  velocity: (N, K, D) [rad/s].
    """
    share = drives.safety_factor[:, None, None] * np.abs(torque) / drives.peak[:, None]
    along_line = (share * drives.falling_range[:, None] + np.abs(velocity)) / drives.no_load_speed[:, None]
    return np.where(torque * velocity > 0.0, np.maximum(share, along_line), share)


def available_torque(torque: Array, velocity: Array, drives: Actuation) -> Array:
    """Return the (N, K, D) torques that drives deliver at most at these speeds, in the direction of torques [N m].

    torque: (N, K, D) required [N m].  velocity: (N, K, D) [rad/s].
    """
    peak, gap, no_load = (each[:, None] for each in (drives.peak, drives.falling_range, drives.no_load_speed))
    below = no_load - np.abs(velocity)
    line = np.where(gap > 0.0, below / np.where(gap > 0.0, gap, 1.0), below >= 0.0)
    return np.where(torque * velocity > 0.0, np.clip(line, 0.0, 1.0), 1.0) * peak


def least_time(*cases: tuple[MotionLoad, Actuation]) -> Array:
    """Return the least durations (N,) of motions of N arms that drives can follow [s]; infinite if there is none.

    cases: Loads of the motions and their drives, such as with a heavier payload or less voltage; all of them hold.

    With u = 1 / T, each limit at each sample is a quadratic inequality α u² + β u + γ <= 0. Turned so that the velocity
    w is not negative, with the safety factor k and η = 1 + μ by the friction μ of the gear, the torque without this
    friction is τ(u) = a + b u + c u² and the limits are

        k η τ <= P,   -k τ <= P,   k η τ + P w u / (ω₀ - ω_c) <= P ω₀ / (ω₀ - ω_c),   w u <= ω₀

    The third one, the falling line, always holds for τ <= 0 within the speed limit, so a motor that brakes needs no
    case of its own. α >= 0 allows an interval of u, α < 0 excludes one: gravity may permit a motion that is impossible
    at a lower speed. So the result is the largest u that all inequalities allow together, not the least of their ends.
    From the speed limit, u descends to the roots of the inequalities that do not hold there, until all hold. An arm
    that could not stop on the way, because k |gravity| > P, has none.

    Examples:
        A motor of 2 N m and 10 rad/s turns a disc of 0.1 kg m² by 1 rad at a constant speed.

        >>> import numpy as np
        >>> from armwright.kinematics.arms.actuation import actuation_at_joints, ratings_of
        >>> from armwright.robot.arm import Actuator
        >>> motor = Actuator("servo", 0.1, peak_torque=2.0, speed=10.0, corner_speed=0.0, rotor_inertia=0.1,
        ...                  coulomb_friction=0.0, viscous_friction=0.0, limit_friction=0.0)
        >>> ratings = np.array([[ratings_of(motor)]])
        >>> drives = actuation_at_joints(ratings, np.ones((1, 1)), np.zeros(1), np.ones(1))
        >>> still, turn = np.zeros((1, 1, 1)), np.ones((1, 1, 1))
        >>> float(least_time((motion_load(still, still, turn, still, drives), drives))[0])
        0.1
    """
    first, *others = [_Limits.of(load, drives) for load, drives in cases]
    holds = np.all([one.hold for one in (first, *others)], axis=0)
    rate = np.where(holds, np.min([one.fastest for one in (first, *others)], axis=0), -np.inf)
    rows = np.flatnonzero(holds)
    while len(rows):
        first.lower(rate, rows)
        allowed = rate.copy()
        for one in others:
            one.lower(rate, rows)
        rows = np.flatnonzero((rate < allowed) & (rate > 0.0))
    with np.errstate(divide="ignore", over="ignore"):
        time = np.where(rate >= MAX_RATE, 0.0, 1.0 / np.maximum(rate, 0.0))
    return np.where(np.all([one.known for one in (first, *others)], axis=0), time, np.nan)


@dataclass(frozen=True)
class _Limits:
    """Limits of N motions: a + b u + c u² within ±1, plus d u at most the level, for M joints and samples.

    Attributes:
        a, b, c: (N, M) torque of a motor that pushes, with the safety factor, relative to the peak torque.
        braking: (N, M) η, the largest of the same terms of a motor that brakes.
        d: (N, M) speed relative to the range of falling torque [s].
        level: (N, M) no-load speed relative to that range; infinite without one.
        fastest: (N,) largest u by the no-load speeds, at most MAX_RATE [1/s].
        hold: (N,) True if the drives hold the arm at rest on the way.
        known: (N,) True if all ratings are known.
    """

    a: Array
    b: Array
    c: Array
    braking: Array
    d: Array
    level: Array
    fastest: Array
    hold: NDArray[np.bool_]
    known: NDArray[np.bool_]

    @classmethod
    def of(cls, load: MotionLoad, drives: Actuation) -> Self:
        """Return the limits of a load."""
        n, samples, _ = load.gravity.shape
        pushing = 1.0 + np.abs(load.gear)
        scale = np.where(load.velocity < 0.0, -1.0, 1.0) * (drives.safety_factor[:, None] / drives.peak)[:, None]
        torques = (load.gravity + load.coulomb, load.viscous, load.inertial)
        speed, gap = np.abs(load.velocity), drives.falling_range
        falls = gap > 0.0
        width = np.where(falls, gap, 1.0)
        level = np.where(falls, np.where(falls, drives.no_load_speed, 1.0) / width, np.inf)
        held = drives.safety_factor[:, None, None] * np.abs(load.gravity) <= drives.peak[:, None]
        ratings = drives.peak + drives.corner_speed + drives.no_load_speed
        needed = load.coulomb + load.viscous + load.gear + load.inertial
        with np.errstate(divide="ignore", over="ignore"):
            fastest = (drives.no_load_speed / speed.max(axis=1)).min(axis=1)
        return cls(
            *((pushing * scale * torque).reshape(n, -1) for torque in torques),
            braking=pushing.reshape(n, -1),
            d=(speed * np.where(falls, 1.0 / width, 0.0)[:, None]).reshape(n, -1),
            level=np.repeat(level[:, None], samples, axis=1).reshape(n, -1),
            fastest=np.minimum(fastest, MAX_RATE),
            hold=np.all(held, axis=(1, 2)),
            known=~np.any(np.isnan(ratings)[:, None] | np.isnan(needed), axis=(1, 2)),
        )

    def lower(self, rate: Array, rows: NDArray[np.intp]) -> None:
        """Lower the rates (N,) of these rows, in place, until the limits allow them; -infinite if they allow none."""
        while len(rows := rows[rate[rows] > 0.0]):  # each step passes at least one root for good
            lower = self.largest_root_below(rate, rows)
            rows, lower = rows[lower < np.inf], lower[lower < np.inf]
            rate[rows] = lower

    def largest_root_below(self, rate: Array, rows: NDArray[np.intp]) -> Array:
        """Return, for each row, the least over the limits that its rate exceeds of their largest smaller roots.

        No u between is allowed. It is infinite if no limit is exceeded, and -infinite if one has no smaller root.
        """
        u = rate[rows, None]
        a, b, c, d, level = (each[rows] for each in (self.a, self.b, self.c, self.d, self.level))
        braking = self.braking[rows]
        torque = a + (b + c * u) * u
        lower = np.full(len(rows), np.inf)
        for sign, most in ((1.0, np.ones_like(braking)), (-1.0, braking)):
            i, j = np.nonzero(sign * torque > ALLOWED * most)
            roots = _largest_root_below(sign * c[i, j], sign * b[i, j], sign * a[i, j] - most[i, j], u[i, 0])
            np.minimum.at(lower, i, roots)
        i, j = np.nonzero(torque + d * u > level + (ALLOWED - 1.0))
        roots = _largest_root_below(c[i, j], b[i, j] + d[i, j], a[i, j] - level[i, j], u[i, 0])
        np.minimum.at(lower, i, roots)
        return lower


def _largest_root_below(alpha: Array, beta: Array, gamma: Array, u: Array) -> Array:
    """Return the largest root of α x² + β x + γ below u, where it is positive; infinite where it is 0 but for rounding.

    -infinite without such a root. Roots are free of cancellation (Press et al. 2007, section 5.6).
    """
    terms = np.stack([alpha * u**2, beta * u, gamma])
    discriminant = beta**2 - 4.0 * alpha * gamma
    q = -0.5 * (beta + np.copysign(np.sqrt(np.maximum(discriminant, 0.0)), beta))
    with np.errstate(divide="ignore", invalid="ignore"):
        roots = np.stack([q / alpha, gamma / q])
    below = np.where(roots < u, roots, -np.inf).max(axis=0)  # NaN is not below
    positive = terms.sum(axis=0) > ROUNDING * np.abs(terms).sum(axis=0)
    return np.where(positive, np.where(discriminant >= 0.0, below, -np.inf), np.inf)
