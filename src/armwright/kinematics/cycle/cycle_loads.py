"""Durations, torques and speeds along a cycle, each motion from rest to rest with a fifth-order profile.

s = 10 τ³ - 15 τ⁴ + 6 τ⁵ at the share τ of a motion's duration T: the profile of least jerk (Flash & Hogan 1985). So
s' = s_τ / T and s'' = s_ττ / T², and the torque is a polynomial in 1 / T at each instant.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.exceptions import UnknownQuantityError
from armwright.kinematics.arms.actuation import Actuation
from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.kinematics.arms.bearings import bearing_offsets
from armwright.kinematics.chunks import SAMPLES
from armwright.kinematics.cycle.cycle_path import CycleGroup, CyclePaths
from armwright.kinematics.cycle.drive_limits import MotionLoad, least_time, motion_load
from armwright.kinematics.cycle.instants import Instants
from armwright.kinematics.cycle.torque_terms import TorqueTerms
from armwright.kinematics.devices import Device, load_kernels
from armwright.tasks.motions import CyclePlan

ROUNDING = 1.0 + 1e-9  # of a least duration, so that its limits hold in spite of rounding
MIN_TIME, MAX_TIME = 0.15, 1e3  # [s] of a motion that is as fast as possible; drives cannot follow shorter ones
MORE_PAYLOAD = 0.1  # share of the payload by which it may be heavier in a motion as fast as possible
VOLTAGE_SHARE = 0.9  # of the voltage, that suffices for it
Counts = tuple[int, ...]  # of samples along each motion
BETWEEN = 16  # times as many instants of a sharp path, of which the largest values count


@dataclass(frozen=True)
class CycleLoads:
    """N arms along the M motions of a cycle, at F instants of each; NaN of arms without loads (`CyclePaths`).

    Of sharp paths (`CycleGroup`), the largest values around each instant are kept.
    """

    durations: Array  # (N, M) [s]
    dwells: Array  # (M,) time at rest after each motion [s]
    torques: Array  # (N, M, F, D) torques of the drives that count against their limits [N m], or forces [N]
    speeds: Array  # (N, M, F, D) joint speeds [rad/s] or [m/s]
    holding: Array  # (N, M, D) torques at rest after each motion [N m], or forces [N]
    weights: Array  # (F,) of the instants in a mean over a motion

    @property
    def cycle_time(self) -> Array:
        """(N,) duration of the cycle [s]."""
        return self.durations.sum(axis=1) + self.dwells.sum()

    @property
    def rms_torques(self) -> Array:
        """(N, D) root mean square of the torques over the cycle, dwells included [N m], or forces [N]."""
        return np.sqrt(self.mean(self.torques**2, self.holding**2))

    def mean(self, moving: Array, resting: Array) -> Array:
        """Return the (N, ...) means over the cycle of (N, M, F, ...) values in motion and (N, M, ...) after motions."""
        total = np.einsum("nm,f,nmf...->n...", self.durations, self.weights, moving)
        total += np.einsum("m,nm...->n...", self.dwells, resting)
        return (total.T / self.cycle_time).T


def holding_torques(paths: CyclePaths, terms: Sequence[TorqueTerms]) -> Array:
    """Return (N, M, F, D) torques against gravity at the instants of each motion [N m], or forces [N]."""
    shape = len(paths.jumps), len(paths.plan.motions), len(paths.instants), paths.groups[0].arms.dof
    torques = np.full(shape, np.nan)
    for group, own in zip(paths.loaded, terms, strict=True):
        density = _density(group)
        gravity = _at_instants(own.torques[:, :, 0], group.counts, paths.instants.times(density))
        torques[group.index] = _thinned(gravity, density)
    return torques


def cycle_loads(
    paths: CyclePaths, terms: Sequence[TorqueTerms], kept: Array | None = None, device: Device = "cpu"
) -> CycleLoads:
    """Return the loads of N arms along a cycle, by their torque terms from `torque_terms`.

    kept: (N, M) durations of the motions [s]; None for those of the cycle and of the drives.

    Raises:
        UnknownQuantityError: A step should be as fast as possible, but the arms have no actuators with known speeds.
    """
    plan, n = paths.plan, len(paths.jumps)
    m, dof = len(plan.motions), paths.groups[0].arms.dof
    durations, holding = np.full((n, m), np.nan), np.full((n, m, dof), np.nan)
    torques, speeds = np.full((2, n, m, len(paths.instants), dof), np.nan)
    for group, own in zip(paths.loaded, terms, strict=True):
        density, gravity = _density(group), own.torques[:, :, 0]
        instants = paths.instants.times(density)
        size = max(1, 4 * SAMPLES[device] // (m * len(instants)))
        for rows in (slice(at, at + size) for at in range(0, len(group.index), size)):
            index, arms = group.index[rows], group.arms[rows]
            load, heavier = _loads(own[rows], arms, group.counts, instants)
            times = _durations(arms, plan, load, heavier, device) if kept is None else kept[index]
            durations[index] = times
            torques[index] = _thinned(load.torque(times), density)
            speeds[index] = _thinned(load.velocity / times[:, :, None, None], density)
        holding[group.index] = gravity[:, np.cumsum(group.counts) % gravity.shape[1]]  # as the next motion begins
        if not plan.cycle.closed:
            holding[group.index, -1] = gravity[:, -1]
    return CycleLoads(durations, np.array(plan.dwells), torques, speeds, holding, np.array(paths.instants.weight))


def cycle_bearing_loads(
    paths: CyclePaths, terms: Sequence[TorqueTerms], durations: Array, device: Device = "cpu"
) -> Array:
    """Return the (N, M, D, 3) largest tilting moment [N m], axial and radial force [N] of the joints in each motion.

    terms: with wrenches.  durations: (N, M) of the motions [s].
    """
    loaded = load_kernels("cycle.bearing_kernels", device)
    largest = np.full((*durations.shape, paths.groups[0].arms.dof, 3), np.nan)
    for group, own in zip(paths.loaded, terms, strict=True):
        moments = _at(group.counts, paths.instants.times(_density(group)))
        arms, found = group.arms, np.empty_like(largest[group.index])
        given = (*moments, durations[group.index], arms.motion, arms.axis, bearing_offsets(arms), own.wrenches)
        loaded.launch("bearing_loads", found.shape[:2], *given, outputs=[found])
        largest[group.index] = found
    return largest


def _density(group: CycleGroup) -> int:
    """Return how many times as many instants are evaluated as are kept."""
    return BETWEEN if group.is_sharp else 1


def _thinned(values: Array, density: int) -> Array:
    """Return (..., F, D) of values (..., density (F - 1) + 1, D): the largest in magnitude from instant to instant.

    The first and the last one, at rest, stay as they are.
    """
    if density == 1:
        return values
    windows = sliding_window_view(values, 2 * density + 1, axis=-2)
    nearby = windows[..., ::density, :, :]  # (..., F - 2, D, 2 density + 1)
    largest = np.abs(nearby).argmax(axis=-1)[..., None]
    between = np.take_along_axis(nearby, largest, axis=-1)[..., 0]
    return np.concatenate([values[..., :1, :], between, values[..., -1:, :]], axis=-2)


def _loads(terms: TorqueTerms, arms: ArmArrays, counts: Counts, instants: Instants) -> tuple[MotionLoad, MotionLoad]:
    """Return the loads of all motions as they are and with a heavier payload.

    The drives' own inertia and friction count where they are known.
    """
    _, _, s_t, s_tt = _at(counts, instants)
    rate, change = s_t[:, None], s_tt[:, None]
    torques, states = (_at_instants(each, counts, instants) for each in (terms.torques, terms.states))
    gravity, drag, push, *payload = np.ascontiguousarray(np.moveaxis(torques, 3, 0))
    q_s, q_ss = np.ascontiguousarray(np.moveaxis(states, 3, 0))
    inertial, velocity = drag * rate**2 + push * change, q_s * rate
    if arms.actuation is None:
        nothing = np.zeros(gravity.shape)
        load = MotionLoad(gravity, nothing, nothing, inertial, velocity, nothing)
    else:
        names = ("rotor_inertia", "coulomb", "viscous", "limit_friction")
        known = {name: np.nan_to_num(getattr(arms.actuation, name)) for name in names}
        acceleration = q_ss * rate**2 + q_s * change
        load = motion_load(gravity, inertial, velocity, acceleration, replace(arms.actuation, **known))
    more_gravity, more_drag, more_push = (MORE_PAYLOAD * part for part in payload)
    more_inertial = more_drag * rate**2 + more_push * change
    return load, replace(load, gravity=gravity + more_gravity, inertial=load.inertial + more_inertial)


def quintic(t: Array) -> tuple[Array, Array, Array]:
    """Return s, s_τ and s_ττ of the profile at shares of the duration."""
    s = t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
    return s, 30.0 * t**2 * (1.0 - t) ** 2, 60.0 * t * (1.0 - t) * (1.0 - 2.0 * t)


def _at_instants(values: Array, counts: Counts, instants: Instants) -> Array:
    """Return (N, M, F, ...) of values at the samples of all motions (N, R, ...), interpolated at F instants of each."""
    before, share, _, _ = _at(counts, instants)
    share = share.reshape(*share.shape, *(1,) * (values.ndim - 2))
    return (1.0 - share) * values[:, before] + share * values[:, before + 1]


@cache
def _at(counts: Counts, instants: Instants) -> tuple[NDArray[np.int32], Array, Array, Array]:
    """Return the sample before each of F instants of M motions, the share of the way to the next (M, F), s_τ and s_ττ.

    counts: Samples of each motion, equally spaced in s.
    """
    s, rate, change = quintic(np.array(instants.time))
    steps = np.array(counts)[:, None] - 1
    before = np.minimum((s * steps).astype(np.int32), steps - 1)
    return before + np.cumsum([[0], *steps[:-1] + 1], axis=0, dtype=np.int32), s * steps - before, rate, change


def check_durations(drives: Actuation | None, plan: CyclePlan) -> Actuation | None:
    """Return the drives if their torques and speeds are known, else None.

    Raises:
        UnknownQuantityError: They are not known, and a step should be as fast as possible.
    """
    if drives is not None and not np.isnan(drives.peak + drives.no_load_speed + drives.corner_speed).any():
        return drives
    if any(plan.times[motion.step] is None for motion in plan.motions):
        raise UnknownQuantityError(
            "cycle_time and other quantities of time need the duration of each step, or actuators with known torques "
            "and speeds; try cycle: {time: 1.5, ...}",
            "the task leaves durations open, and a torque or speed of the drives is not known",
        )
    return None


def _durations(arms: ArmArrays, plan: CyclePlan, load: MotionLoad, heavier: MotionLoad, device: Device) -> Array:
    """Return the (N, M) durations: the least for torques and speeds, scaled to a step's own time if it states one.

    The least ones keep the safety factor, and the makers' limits with less voltage and with a heavier payload. Without
    known torques and speeds, the motions of a step share its time by the largest travel of a joint.
    """
    drives = check_durations(arms.actuation, plan)
    durations = np.abs(load.velocity).max(axis=(2, 3)) + 1e-9  # (N, M), in proportion to the travel
    if drives is not None:
        bare = drives.at_makers_limits
        cases = (load, drives), (load, bare.at_voltage(VOLTAGE_SHARE)), (heavier, bare)
        least = least_time(*cases[: 3 if any(motion.carries for motion in plan.motions) else 2], device=device)
        durations = np.clip(np.where(np.isfinite(least), ROUNDING * least, MAX_TIME), MIN_TIME, MAX_TIME)
    for step in {motion.step for motion in plan.motions}:
        own = [i for i, motion in enumerate(plan.motions) if motion.step == step]
        time = plan.times[step]
        if time is not None:
            durations[:, own] *= time / durations[:, own].sum(axis=1, keepdims=True)
    return durations
