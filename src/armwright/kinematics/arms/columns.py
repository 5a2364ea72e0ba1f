"""Columns below the bases of stacked arms."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.rigid_bodies import PerArm
from armwright.robot.arm import Arm


@dataclass(frozen=True)
class Columns(PerArm):
    """Upright cylinders below the bases of N arms, each from its foot to the base."""

    half: NDArray[np.floating[Any]]  # (N, 3) radius, radius, half the length [m]; length 0 without a column


def stack_columns(arms: Sequence[Arm], precision: Any) -> Columns | None:
    """Return the columns of N arms; None if there are none."""
    columns = [arm.column for arm in arms]
    diameter = np.array([0.0 if column is None else column.outer_diameter for column in columns])
    return columns_of(diameter, np.array([0.0 if column is None else column.length for column in columns]), precision)


def columns_of(diameter: Array | float, length: Array, precision: Any) -> Columns | None:
    """Return the columns of N arms with these diameters and lengths (N,) [m]; None if all lengths are 0."""
    if not length.any():
        return None
    radius = np.where(length > 0.0, np.asarray(diameter) / 2, 0.0)
    return Columns(np.stack([radius, radius, length / 2], axis=-1).astype(precision))
