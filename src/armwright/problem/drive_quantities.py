# ruff: noqa: D205, D401 (a docstring here is the description that users and models read)
"""Quantities of arms that depend on their actuators, whose ratings are known."""

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.bearings import bearing_limits
from armwright.kinematics.cycle.drive_limits import torque_speed_utilisation
from armwright.problem.evaluation import Evaluation
from armwright.problem.objective import Need, quantity

CYCLE: tuple[Need, ...] = ("cycle", "durations", "masses")  # of loads along the cycle
MOTIONS: tuple[Need, ...] = ("motions", "durations", "masses")  # of loads at rest and along it
LIMITS = ("peak", "continuous", "corner_speed", "no_load_speed")  # of actuators, that reserves are measured from


@quantity("of allowed", over="max", needs=("motions", "masses"), ratings=("peak",), symbol="E_util")
def torque_utilisation(e: Evaluation) -> Array:
    """The largest share of its actuator's peak torque that any joint needs to hold the kept posture up against
    gravity, times the safety factor; above 1 the arm does not hold it with this factor.
    """
    peak = (e.drives.peak * e.arms.travel / e.drives.safety_factor[:, None])[:, None]
    return e.worst_torques(lambda torques: np.abs(torques / peak).max(axis=-1))


@quantity("USD", over="arm", ratings=("price",))
def price(e: Evaluation) -> Array:
    """The price of all actuators, and of links and column if the space states one."""
    return e.drives.price + e.arms.structure_price


@quantity("N m", over="max", needs=CYCLE, symbol="E_dynamic")
def dynamic_torque(e: Evaluation) -> Array:
    """The largest absolute torque of any motor on the way to the target, gravity and inertia included."""
    travel = e.arms.travel[:, None]
    return e.worst_loads(lambda torques, _: np.abs(torques * travel).max(axis=-1))


@quantity(
    "of allowed",
    over="max",
    needs=CYCLE,
    ratings=("peak", "corner_speed", "no_load_speed"),
    symbol="E_dynutil",
)
def dynamic_utilisation(e: Evaluation) -> Array:
    """The largest factor by which any actuator's torque, times the safety factor, and speed together exceed its
    torque-speed limit on the way to the target; above 1 it cannot.
    """
    return e.worst_loads(lambda torques, speeds: torque_speed_utilisation(torques, speeds, e.drives).max(axis=-1))


@quantity("of allowed", over="max", needs=("cycle", "durations"), ratings=("no_load_speed",), symbol="E_speed")
def speed_utilisation(e: Evaluation) -> Array:
    """The largest share of any actuator's no-load speed on the way to the target; above 1 it cannot."""
    speed = e.drives.no_load_speed[:, None]
    return e.worst_loads(lambda _, speeds: np.abs(speeds / speed).max(axis=-1))


@quantity("of allowed", over="arm", needs=CYCLE, ratings=("continuous",), symbol="E_thermal")
def thermal_utilisation(e: Evaluation) -> Array:
    """The largest share of any actuator's continuous torque that its torque takes, as a root mean square over the
    cycle with its dwells, times the safety factor; above 1 it overheats.
    """
    return e.drives.safety_factor * (e.loads.rms_torques / e.drives.continuous).max(axis=1)


@quantity("N m", over="max", needs=MOTIONS, ratings=("bearing_offset",), symbol="E_tilting")
def tilting_moment(e: Evaluation) -> Array:
    """The largest moment across the axis of any joint that turns, about the bearing of its actuator, at rest and on
    the way to the target.
    """
    return e.bearing_loads[..., 0].max(axis=-1)


@quantity("N", over="max", needs=MOTIONS, ratings=("bearing_offset",), symbol="E_axial")
def axial_force(e: Evaluation) -> Array:
    """The largest force along the axis of any joint that turns, at rest and on the way to the target."""
    return e.bearing_loads[..., 1].max(axis=-1)


@quantity("N", over="max", needs=MOTIONS, ratings=("bearing_offset",), symbol="E_radial")
def radial_force(e: Evaluation) -> Array:
    """The largest force across the axis of any joint that turns, at rest and on the way to the target."""
    return e.bearing_loads[..., 2].max(axis=-1)


@quantity("of allowed", over="max", needs=MOTIONS, ratings=("peak",), symbol="E_bearing")
def bearing_utilisation(e: Evaluation) -> Array:
    """The largest share of what the maker of an actuator allows across its shaft, of moment, axial and radial force,
    that any joint takes at rest and on the way to the target; 0 where no maker states a limit.
    """
    if not e.has_bearing_limits:
        return np.zeros(e.position_error.shape)
    return (e.bearing_loads / np.nan_to_num(bearing_limits(e.drives), nan=np.inf)[:, None]).max(axis=(-2, -1))


@quantity("x load", over="arm", needs=MOTIONS, ratings=LIMITS, symbol="reserve", more_is_better=True)
def reserve(e: Evaluation) -> Array:
    """How many times the torque, mean torque, speed or load across the axis that the cycle takes of any actuator its
    maker allows, without safety factor; below 1 it cannot. Without a cycle, what holds the arm at the targets.
    """
    return e.reserves.least


@quantity("of allowed", over="arm", needs=MOTIONS, ratings=LIMITS)
def limit_use(e: Evaluation) -> Array:
    """The largest share of any actuator's limit of torque, mean torque, speed or load across the axis that the cycle
    takes, without safety factor: 1 / reserve.
    """
    return 1.0 / e.reserves.least


@quantity("A", over="arm", needs=CYCLE, ratings=("peak", "voltage", "current"), symbol="I_peak")
def peak_current(e: Evaluation) -> Array:
    """The largest current that all actuators together draw from the supply along the cycle."""
    return e.supply.peak


@quantity("A", over="arm", needs=CYCLE, ratings=("peak", "voltage", "current"), symbol="I_mean")
def mean_current(e: Evaluation) -> Array:
    """The mean current that all actuators together draw from the supply over the cycle with its dwells."""
    return e.supply.mean


@quantity("voltages", over="arm", ratings=("voltage",))
def voltages(e: Evaluation) -> Array:
    """The least number of supplies that the voltages of the actuators allow."""
    voltage = np.sort(e.drives.voltage, axis=1)  # (N, J) [V]; 0 for fixed joints
    return (np.diff(voltage, axis=1, prepend=0.0) > 0.0).sum(axis=1).astype(np.float64)
