"""What the drives of joints can deliver, and the least time of a motion that respects it.

A motor that pushes in the direction of its motion delivers the smaller of its peak torque P and the line through
(corner speed, P) and (no-load speed, 0). A motor that brakes delivers P. Required torques count with the safety factor.
Drives of which a rating is unknown give NaN.

A gear takes a share μ of the torque that it passes on as friction, where makers state torques before it: a motor that
pushes needs (1 + μ) τ. One that brakes or holds needs τ at most, since friction helps it, which counts for nothing. The
share of limits that makers state at the output is 0 (`Actuation.limit_friction`).
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.actuation import Actuation
from armwright.kinematics.devices import Device, Loaded, load_kernels

MAX_RATE = 1e9  # [1/s] of motions without any limit, which take no time
STILL = 1e-6  # [rad] or [m] in a duration of 1 s; a joint that rests moves by less, from rounding
DRIVES = (  # of `Actuation`, that kernels take
    "safety_factor", "peak", "no_load_speed", "falling_range", "rotor_inertia", "coulomb", "viscous", "limit_friction",
)  # fmt: skip


@dataclass(frozen=True)
class MotionLoad:
    """What motions of N arms, such as M of each, require of D joints at S samples, for any duration T.

    The torque without friction and rotors is gravity + inertial / T², the speed is velocity / T, and the acceleration
    acceleration / T². Sliding joints have N, m/s and m instead of N m, rad/s and rad.
    """

    gravity: Array  # (N, ..., S, D) [N m]
    inertial: Array  # (N, ..., S, D) of the links, with Coriolis terms, at T = 1 s [N m s²]
    velocity: Array  # (N, ..., S, D) of the joints at T = 1 s [rad]
    acceleration: Array  # (N, ..., S, D) likewise [rad]

    def on(self, loaded: Loaded) -> Any:
        """Return the load as kernels take it, of M motions."""
        n, *_, s, dof = self.gravity.shape
        return loaded.struct("Load", {name: each.reshape(n, -1, s, dof) for name, each in vars(self).items()})


def drive_torques(
    load: MotionLoad, drives: Actuation, durations: Array, density: int = 1, device: Device = "cpu"
) -> tuple[Array, Array]:
    """Return (N, ..., F, D) torques that drives deliver [N m] and speeds [rad/s], for durations (N, ...) [s].

    The torque is gravity + c sign(ω) + v ω + (inertial + J acceleration) / T² with the Coulomb friction c, the viscous
    friction v and the inertia J of the rotor, and 1 + μ times this with the friction of the gear if the motor pushes.
    Joints that rest have no friction.

    density: of samples; above 1, every so manieth is kept, with the largest torque and speed up to the next ones.
    """
    *of_motions, s, dof = load.gravity.shape
    loaded, times = load_kernels("cycle.drive_kernels", device), durations.reshape(len(durations), -1)
    found = np.empty((2, *times.shape, (s - 1) // density + 1, dof))
    loaded.launch(
        "drive_torques", times.shape, load.on(loaded), _on(drives, loaded), times, density, outputs=list(found)
    )
    torques, speeds = found.reshape(2, *of_motions, -1, dof)
    return torques, speeds


def _on(drives: Actuation, loaded: Loaded) -> Any:
    """Return drives as kernels take them."""
    return loaded.struct("Drives", {name: getattr(drives, name) for name in DRIVES})


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

    cases: Up to three loads of the motions and their drives, such as with a heavier payload or less voltage; all of
        them hold.

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
        >>> float(least_time((MotionLoad(still, still, turn, still), drives))[0])
        0.1
    """
    *of_motions, _, _ = cases[0][0].gravity.shape
    loaded, rate = load_kernels("cycle.drive_kernels", device), np.empty((of_motions[0], math.prod(of_motions[1:])))
    given = [
        part for load, drives in (*cases, cases[0], cases[0])[:3] for part in (load.on(loaded), _on(drives, loaded))
    ]
    loaded.launch("largest_rates", rate.shape, *given, outputs=[rate])
    with np.errstate(divide="ignore", over="ignore"):
        return np.where(rate >= MAX_RATE, 0.0, 1.0 / np.maximum(rate, 0.0)).reshape(of_motions)
