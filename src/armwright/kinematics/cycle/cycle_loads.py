"""Durations, torques and speeds along a cycle, each motion from rest to rest with a fifth-order profile.

s = 10 τ³ - 15 τ⁴ + 6 τ⁵ at the share τ of a motion's duration T: the profile of least jerk (Flash & Hogan 1985). So
s' = s_τ / T and s'' = s_ττ / T², and the torque is a polynomial in 1 / T at each instant.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import UnknownQuantityError
from armwright.kinematics.arms.actuation import FIXED_RATINGS, Actuation, actuation_at_joints
from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.kinematics.arms.bearings import bearing_offsets
from armwright.kinematics.chunks import SAMPLES
from armwright.kinematics.cycle.cycle_path import CycleGroup, CyclePaths
from armwright.kinematics.cycle.drive_limits import MotionLoad, drive_torques, least_time
from armwright.kinematics.cycle.torque_terms import TorqueTerms
from armwright.kinematics.devices import Device, Loaded, load_kernels
from armwright.tasks.motions import CyclePlan

ROUNDING = 1.0 + 1e-9  # of a least duration, so that its limits hold in spite of rounding
MIN_TIME, MAX_TIME = 0.15, 1e3  # [s] of a motion that is as fast as possible; drives cannot follow shorter ones
MORE_PAYLOAD = 0.1  # share of the payload by which it may be heavier in a motion as fast as possible
VOLTAGE_SHARE = 0.9  # of the voltage, that suffices for it


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


def holding_torques(paths: CyclePaths, terms: Sequence[TorqueTerms], device: Device = "cpu") -> Array:
    """Return (N, M, F, D) torques against gravity at the instants of each motion [N m], or forces [N]."""
    shape = len(paths.jumps), len(paths.plan.motions), len(paths.instants), paths.groups[0].arms.dof
    torques = np.full(shape, np.nan)
    for group, own in zip(paths.loaded, terms, strict=True):
        load, _ = _loads(paths, group, own, device)
        at_rest = replace(load, inertial=np.zeros_like(load.inertial), velocity=np.zeros_like(load.velocity))
        drives, times = _without_drives(group.arms), np.ones(load.gravity.shape[:2])
        torques[group.index], _ = drive_torques(at_rest, drives, times, group.density, device)
    return torques


def cycle_loads(
    paths: CyclePaths, terms: Sequence[TorqueTerms], kept: Array | None = None, device: Device = "cpu"
) -> CycleLoads:
    """Return the loads of N arms along a cycle, by their torque terms from `torque_terms`.

    kept: (N, M) durations of the motions [s]; None for those of the cycle and of the drives. The drives' own inertia
        and friction count where they are known.

    Raises:
        UnknownQuantityError: A step should be as fast as possible, but the arms have no actuators with known speeds.
    """
    plan, n = paths.plan, len(paths.jumps)
    m, dof = len(plan.motions), paths.groups[0].arms.dof
    durations, holding = np.full((n, m), np.nan), np.full((n, m, dof), np.nan)
    torques, speeds = np.full((2, n, m, len(paths.instants), dof), np.nan)
    for group, own in zip(paths.loaded, terms, strict=True):
        size = max(1, 4 * SAMPLES[device] // (m * len(paths.instants) * group.density))
        for rows in (slice(at, at + size) for at in range(0, len(group.index), size)):
            part = CycleGroup(group.index[rows], group.arms[rows], group.paths, group.source[rows], group.is_sharp)
            load, heavier = _loads(paths, part, own[rows], device)
            times = _durations(part.arms, plan, load, heavier, device) if kept is None else kept[part.index]
            durations[part.index], drives = times, _known(part.arms)
            torques[part.index], speeds[part.index] = drive_torques(load, drives, times, group.density, device)
        holding[group.index] = _resting(paths, group, own)
    return CycleLoads(durations, np.array(plan.dwells), torques, speeds, holding, np.array(paths.instants.weight))


def _resting(paths: CyclePaths, group: CycleGroup, terms: TorqueTerms) -> Array:
    """Return (N, M, D) torques at rest after each motion, with what the next one carries [N m], or forces [N]."""
    plan, picked = paths.plan, group.picks(paths)
    m = np.arange(len(plan.motions))
    then = (m + 1) % len(m)
    ends = picked.start[group.source[:, then]] + picked.first[then]
    carries = np.array([motion.carries for motion in plan.motions])[then]
    if not plan.cycle.closed:
        ends[:, -1] = picked.start[group.source[:, -1]] + picked.last[-1]
        carries[-1] = plan.motions[-1].carries
    at = terms.torques[np.arange(len(ends))[:, None], ends]  # (N, M, 6, D)
    return at[:, :, 0] + carries[:, None] * at[:, :, 3]


def cycle_bearing_loads(
    paths: CyclePaths, terms: Sequence[TorqueTerms], durations: Array, device: Device = "cpu"
) -> Array:
    """Return the (N, M, D, 3) largest tilting moment [N m], axial and radial force [N] of the joints in each motion.

    terms: with wrenches.  durations: (N, M) of the motions [s].
    """
    loaded = load_kernels("cycle.load_kernels", device)
    largest = np.full((*durations.shape, paths.groups[0].arms.dof, 3), np.nan)
    for group, own in zip(paths.loaded, terms, strict=True):
        arms, found = group.arms, np.empty_like(largest[group.index])
        given = (_picks_on(paths, group, loaded), durations[group.index], arms.motion, arms.axis, bearing_offsets(arms))
        loaded.launch("bearing_loads", found.shape[:2], *given, own.wrenches, outputs=[found])
        largest[group.index] = found
    return largest


def _picks_on(paths: CyclePaths, group: CycleGroup, loaded: Loaded) -> Any:
    """Return samples and instants as kernels take them."""
    picked = group.picks(paths)
    values = {name: getattr(picked, name) for name in ("start", "low", "high", "share", "rate", "change", "way")}
    carried = np.array([float(motion.carries) for motion in paths.plan.motions])
    return loaded.struct("Picks", values | {"source": group.source, "carried": carried})


def _loads(
    paths: CyclePaths, group: CycleGroup, terms: TorqueTerms, device: Device
) -> tuple[MotionLoad, MotionLoad]:  # fmt: skip
    """Return the loads of all motions as they are and with a heavier payload."""
    loaded = load_kernels("cycle.load_kernels", device)
    n, m = group.source.shape
    shape = n, m, len(paths.instants.times(group.density)), terms.torques.shape[3]
    gravity, inertial, velocity, acceleration, *heavier = np.empty((6, *shape))
    given = _picks_on(paths, group, loaded), terms.torques, terms.states, loaded.kernels.real(MORE_PAYLOAD)
    found = [gravity, inertial, velocity, acceleration, *heavier]
    loaded.launch("motion_loads", (n, m), *given, outputs=found)
    load = MotionLoad(gravity, inertial, velocity, acceleration)
    return load, replace(load, gravity=heavier[0], inertial=heavier[1])


def _known(arms: ArmArrays) -> Actuation:
    """Return the drives with the inertia and friction that are known; without any, such of no inertia and friction."""
    drives = _without_drives(arms) if arms.actuation is None else arms.actuation
    names = ("rotor_inertia", "coulomb", "viscous", "limit_friction")
    return replace(drives, **{name: np.nan_to_num(getattr(drives, name)) for name in names})


def _without_drives(arms: ArmArrays) -> Actuation:
    """Return drives that deliver any torque, without inertia and friction."""
    ratings = np.broadcast_to(FIXED_RATINGS, (*arms.motion.shape, len(FIXED_RATINGS)))
    return actuation_at_joints(ratings, np.ones(arms.motion.shape), np.zeros(len(arms)), np.ones(len(arms)))


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
    if drives is None:
        durations = np.abs(load.velocity).max(axis=(2, 3)) + 1e-9  # (N, M), in proportion to the travel
    else:
        drives = _known(arms)
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
