"""What a workshop makes of a design: copies of it whose base or one link is a little off."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import FloatParameter

TOLERANCE = 1e-3  # [m]
SHORTEST = 1e-6  # [m] of a link


def moved(space: DesignSpace, rows: NDArray[np.float64], tolerance: float = TOLERANCE) -> Iterator[NDArray[np.float64]]:
    """Designs as rows (N, P) with one length or coordinate of the base off by ±tolerance [m], one after the other.

    In the paper's space 2 (3 + D) times.

    A copy may lie a tolerance outside the design space: what is built knows no ranges.
    """
    rows = space.normalised(rows)
    for column in measured_columns(space):
        for offset in (-tolerance, tolerance):
            copies = rows.copy()
            copies[:, column] += offset
            if not space.parameters[column].name.startswith("origin_"):
                copies[:, column] = np.maximum(copies[:, column], SHORTEST)
            yield copies


def measured_columns(space: DesignSpace) -> list[int]:
    """The places of the parameters that are lengths."""
    return [i for i, p in enumerate(space.parameters) if isinstance(p, FloatParameter) and p.unit == "m"]
