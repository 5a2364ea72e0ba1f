"""Build tolerance: copies of designs whose base or one link is slightly off."""

from collections.abc import Iterator

import numpy as np

from armwright.arrays import Array
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import FloatParameter

TOLERANCE = 1e-3  # [m]
MIN_LENGTH = 1e-6  # [m] of a link or stroke


def perturbed(space: DesignSpace, matrix: Array, tolerance: float = TOLERANCE) -> Iterator[Array]:
    """Yield copies of designs (N, P) with one length or base coordinate off by ±tolerance [m], one after the other.

    In the space of the paper these are 2 (3 + D) copies. They may lie outside the design space by the tolerance.
    """
    matrix = space.normalised(matrix)
    for column in length_columns(space):
        for offset in (-tolerance, tolerance):
            copies = matrix.copy()
            copies[:, column] += offset
            if not space.parameters[column].name.startswith("origin_"):
                copies[:, column] = np.maximum(copies[:, column], MIN_LENGTH)
            yield copies


def length_columns(space: DesignSpace) -> list[int]:
    """Return the columns of a design matrix that hold lengths and base coordinates of the arm."""
    own = space.custom_names
    lengths = (i for i, p in enumerate(space.parameters) if isinstance(p, FloatParameter) and p.unit == "m")
    return [i for i in lengths if space.parameters[i].name not in own]
