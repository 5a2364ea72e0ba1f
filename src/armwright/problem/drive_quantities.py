"""Quantities of arms that depend on their actuators."""

from collections.abc import Mapping
from typing import cast

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import UnknownQuantityError
from armwright.kinematics.arms.actuation import Actuation
from armwright.kinematics.cycle.drive_limits import torque_speed_utilisation
from armwright.kinematics.cycle.supply import SupplyCurrents
from armwright.problem.evaluation import Evaluation
from armwright.robot.actuators import UNITS

# Ratings of actuators that a quantity needs, by its name.
RATINGS: Mapping[str, tuple[str, ...]] = {
    "price": ("price",),
    "torque_utilisation": ("peak",),
    "dynamic_utilisation": ("peak", "corner_speed", "no_load_speed"),
    "speed_utilisation": ("no_load_speed",),
    "thermal_utilisation": ("continuous",),
    "voltages": ("voltage",),
    "peak_current": ("peak", "voltage", "current"),
    "mean_current": ("peak", "voltage", "current"),
    "deflection": ("joint_stiffness",),
    "payload_deflection": ("joint_stiffness",),
    "backlash_error": ("backlash",),
    "payload_capacity": ("peak",),
}

KEYS = {"peak": "peak_torque", "continuous": "rated_torque", "no_load_speed": "speed"}  # of these in records


def require_ratings(actuation: Actuation | None, quantity: str) -> Actuation:
    """Return the actuation of arms; UnknownQuantityError if it lacks what a quantity of this name needs."""
    if actuation is None:
        raise UnknownQuantityError(
            f"objective {quantity} needs actuators: name some in the space file (actuators: [...])",
            "no actuators are named",
        )
    for rating in RATINGS[quantity]:
        if np.isnan(getattr(actuation, rating)).any():
            key = KEYS.get(rating, rating)
            raise UnknownQuantityError(
                f"objective {quantity} needs the {key} of every actuator; try {key} [{UNITS[key]}] in the record of "
                "each in the space file, or leave out those without",
                f"the {key.replace('_', ' ')} of an actuator is not known",
            )
    return actuation


def _motor_peak(evaluation: Evaluation, quantity: str) -> Array:
    """Return (N, 1, J) peak torques of the motors [N m], divided by the safety factor."""
    actuation = require_ratings(evaluation.arms.actuation, quantity)
    return (actuation.peak * evaluation.arms.travel / actuation.safety_factor[:, None])[:, None]


def torque_utilisation(evaluation: Evaluation) -> Array:
    """Return (N, T) the largest share of its peak torque that a motor needs at rest, times the safety factor."""
    peak = _motor_peak(evaluation, "torque_utilisation")
    return evaluation.worst_torques(lambda torques: np.abs(torques / peak).max(axis=-1))


def dynamic_utilisation(evaluation: Evaluation) -> Array:
    """Return (N, T) the largest torque-speed utilisation on the way to each target."""
    drives = require_ratings(evaluation.arms.actuation, "dynamic_utilisation")
    return evaluation.worst_loads(
        lambda torques, speeds: torque_speed_utilisation(torques, speeds, drives).max(axis=-1)
    )


def speed_utilisation(evaluation: Evaluation) -> Array:
    """Return (N, T) the largest share of its no-load speed that a motor needs on the way to each target."""
    speed = require_ratings(evaluation.arms.actuation, "speed_utilisation").no_load_speed[:, None]
    return evaluation.worst_loads(lambda _, speeds: np.abs(speeds / speed).max(axis=-1))


def dynamic_torque(evaluation: Evaluation) -> Array:
    """Return (N, T) the largest torque of a motor on the way to each target [N m]."""
    travel = evaluation.arms.travel[:, None]
    return evaluation.worst_loads(lambda torques, _: np.abs(torques * travel).max(axis=-1))


def thermal_utilisation(evaluation: Evaluation) -> Array:
    """Return the (N,) largest share of its continuous torque that a motor needs, times the safety factor."""
    drives = require_ratings(evaluation.arms.actuation, "thermal_utilisation")
    share = evaluation.loads.rms_torques / drives.continuous
    return drives.safety_factor * share.max(axis=1)


def voltages(evaluation: Evaluation) -> Array:
    """Return the (N,) number of different voltages; fixed joints have 0 V."""
    voltage = np.sort(require_ratings(evaluation.arms.actuation, "voltages").voltage, axis=1)
    first = np.diff(voltage, axis=1, prepend=0.0) > 0.0
    return first.sum(axis=1).astype(np.float64)


def price(evaluation: Evaluation) -> Array:
    """Return the (N,) prices of actuators and links [USD]."""
    return require_ratings(evaluation.arms.actuation, "price").price + evaluation.arms.structure_price


def peak_current(evaluation: Evaluation) -> Array:
    """Return the (N,) largest currents from the supply along the cycle [A]."""
    return _currents(evaluation, "peak_current").peak


def mean_current(evaluation: Evaluation) -> Array:
    """Return the (N,) mean currents from the supply over the cycle [A]."""
    return _currents(evaluation, "mean_current").mean


def _currents(evaluation: Evaluation, quantity: str) -> SupplyCurrents:
    require_ratings(evaluation.arms.actuation, quantity)
    return cast("SupplyCurrents", evaluation.supply)
