"""What a workshop makes of a design: copies of it whose base or one link is a little off."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from armwright.space import DesignSpace, FloatParameter

TOLERANCE = 1e-3  # [m]
SHORTEST = 1e-6  # [m] of a link


def moved(space: DesignSpace, rows: NDArray[np.float64], tolerance: float = TOLERANCE) -> Iterator[NDArray[np.float64]]:
    """2 (3 + D) times (N, P): designs as rows with one length or coordinate of the base off by ±tolerance [m].

    A copy may lie a tolerance outside the design space: what is built knows no ranges.
    """
    for column, parameter in enumerate(space.parameters):
        if isinstance(parameter, FloatParameter):
            for offset in (-tolerance, tolerance):
                copies = rows.copy()
                copies[:, column] += offset
                if parameter.name.startswith("link_"):
                    copies[:, column] = np.maximum(copies[:, column], SHORTEST)
                yield copies
