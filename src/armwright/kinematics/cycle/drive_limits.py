"""What the drives of joints can deliver, and the least time of a motion that respects it.

A motor that pushes in the direction of its motion delivers the smaller of its peak torque P and the line through
(corner speed, P) and (no-load speed, 0). A motor that brakes delivers P. Required torques count with the safety factor.
Drives of which a rating is unknown give NaN.

A gear takes a share μ of the torque that it passes on as friction, where makers state torques before it: a motor that
pushes needs (1 + μ) τ. One that brakes or holds needs τ at most, since friction helps it, which counts for nothing. The
share of limits that makers state at the output is 0 (`Actuation.limit_friction`).
"""

from dataclasses import dataclass
from itertools import cycle
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.actuation import Actuation
from armwright.kinematics.devices import Device, load_kernels

MAX_RATE = 1e9  # [1/s] of motions without any limit, which take no time
LIMITS = ("safety_factor", "peak", "no_load_speed", "falling_range")  # of `Actuation`, that bound rates
STILL = 1e-6  # [rad] or [m] in a duration of 1 s; a joint that rests moves by less, from rounding


@dataclass(frozen=True)
class MotionLoad:
    """What motions of N arms, such as M of each, require of D joints at S samples, for any duration T.

    The torque at a sample is gravity + coulomb + viscous / T + inertial / T², with the friction of the gear if it is in
    the direction of the velocity. The speed is velocity / T. Sliding joints have N, m/s and m instead of N m, rad/s and
    rad.
    """

    gravity: Array  # (N, ..., S, D) [N m]
    coulomb: Array  # (N, ..., S, D) friction in the direction of the velocity, 0 at rest [N m]
    viscous: Array  # (N, ..., S, D) friction at T = 1 s [N m s]
    inertial: Array  # (N, ..., S, D) of links and rotors, with Coriolis terms, at T = 1 s [N m s²]
    velocity: Array  # (N, ..., S, D) at T = 1 s [rad]
    gear: Array  # (N, ..., S, D) share of the torque that the gear takes, with the sign of the velocity, 0 at rest

    def torque(self, time: Array) -> Array:
        """Return the (N, ..., S, D) torques [N m] for durations (N, ...) [s]."""
        duration = time[..., None, None]
        torque = self.gravity + self.coulomb + self.viscous / duration + self.inertial / duration**2
        return torque * (1.0 + np.maximum(self.gear * np.sign(torque), 0.0))


def motion_load(gravity: Array, inertial: Array, velocity: Array, acceleration: Array, drives: Actuation) -> MotionLoad:
    """Return the load of a motion of N arms, with friction and rotor inertia of the drives.

    gravity: (N, ..., S, D) torques that hold the arm [N m].  inertial: (N, ..., S, D) torques that move its links in
    T = 1 s, without gravity [N m s²].  velocity, acceleration: (N, ..., S, D) of the joints, for T = 1 s [rad].
    """
    along = tuple(range(1, gravity.ndim - 1))
    ratings = (drives.coulomb, drives.viscous, drives.rotor_inertia, drives.limit_friction)
    coulomb, viscous, rotor, gear = (np.expand_dims(each, along) for each in ratings)
    direction = np.sign(np.where(np.abs(velocity) > STILL, velocity, 0.0))
    return MotionLoad(
        gravity=gravity,
        coulomb=coulomb * direction,
        viscous=viscous * velocity,
        inertial=inertial + rotor * acceleration,
        velocity=velocity,
        gear=gear * direction,
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


def least_time(*cases: tuple[MotionLoad, Actuation], device: Device = "cpu") -> Array:
    """Return the least durations (N, ...) of motions of N arms that drives can follow [s]; infinite if there is none.

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
    *of_motions, _, _ = cases[0][0].gravity.shape
    loaded, rate = load_kernels("cycle.drive_kernels", device), np.full(of_motions, MAX_RATE).reshape(of_motions[0], -1)
    given: list[tuple[Any, Any]] = []
    for load, drives in cases:
        fields = {name: each.reshape(*rate.shape, *each.shape[-2:]) for name, each in vars(load).items()}
        limits = {name: getattr(drives, name) for name in LIMITS}
        given.append((loaded.struct("Load", fields), loaded.struct("Limits", limits)))
    left = len(given)
    for case in cycle(given):  # until all others leave what one of them allows
        before = rate.copy()
        loaded.launch("lower_rates", rate.shape, *case, outputs=[rate])
        left = len(given) - 1 if (rate < before).any() else left - 1
        if not left:
            break
    with np.errstate(divide="ignore", over="ignore"):
        return np.where(rate >= MAX_RATE, 0.0, 1.0 / np.maximum(rate, 0.0)).reshape(of_motions)
