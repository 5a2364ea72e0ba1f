"""The supply of the actuators of designs.

All actuators of an arm that take a common voltage have one supply. It has the highest voltage that all their makers
state; a voltage beside it that is only assumed to be allowed counts if they need it to have one supply at all:

    V = max(min_j s_j, max_j a_j)    for the ranges [a_j, b_j] of motors, s_j <= b_j the highest stated voltage

Of motors without a common voltage, as few supplies as possible are used: the range that ends first has a supply, which
all ranges that contain its end share; and so on with the others.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.actuation import ratings_of
from armwright.robot.actuators import ActuatorRecord
from armwright.robot.arm import Actuator
from armwright.spaces.space_schema import SpaceSchema


def supply_voltages(space: SpaceSchema, motors: NDArray[np.integer], moves: NDArray[np.bool_]) -> Array:
    """Return the (N, M) supply of each motor [V]; NaN where there is none, or where it takes any.

    motors: (N, M) index of the actuator in the space.  moves: (N, M) True for modules that have one.
    """
    if space.supply is not None:
        return np.full(motors.shape, space.supply)
    ranges = np.array([(*record.supply_range, record.stated_supply) for record in space.actuators])
    low, high, stated = ranges[motors].transpose(2, 0, 1)
    volts, left = np.full(motors.shape, np.nan), moves & np.isfinite(high)
    while left.any():
        end = np.where(left, high, np.inf).min(axis=1)
        group = left & (low <= end[:, None])
        shared = np.where(group, stated, np.inf).min(axis=1), np.where(group, low, 0.0).max(axis=1)
        volts = np.where(group, np.maximum(*shared)[:, None], volts)
        left &= ~group
    return volts


@lru_cache(maxsize=4096)
def supplied(record: ActuatorRecord, volts: float) -> Actuator:
    """Return an actuator at a supply [V]."""
    return record.at_supply(volts).actuator()


def supplied_ratings(space: SpaceSchema, motors: NDArray[np.integer], volts: Array) -> Array:
    """Return the (N, M, R) ratings of motors at their supplies; motors: (N, M) indices.  volts: (N, M) [V]."""
    known, level = np.unique(volts, return_inverse=True)
    pairs, place = np.unique(motors + len(space.actuators) * level.reshape(motors.shape), return_inverse=True)
    kinds: list[int] = (pairs % len(space.actuators)).tolist()
    supplies: list[float] = known[pairs // len(space.actuators)].tolist()
    table = [ratings_of(supplied(space.actuators[k], supply)) for k, supply in zip(kinds, supplies, strict=True)]
    return np.array(table)[place.reshape(motors.shape)]
