"""What a workshop makes of a design: copies of it whose base or one link is a little off."""

import numpy as np

from armwright.evaluation import Array
from armwright.space import DesignSpace, FloatParameter

TOLERANCE = 1e-3  # [m]
SHORTEST = 1e-6  # [m] of a link


def moved(space: DesignSpace, rows: Array, tolerance: float = TOLERANCE) -> Array:
    """(N, K, P) for designs as rows (N, P): each length and each coordinate of the base by ±tolerance [m], alone.

    K = 2 (3 + D). A copy may lie a tolerance outside the design space: what is built knows no ranges.
    """
    lengths = [i for i, parameter in enumerate(space.parameters) if isinstance(parameter, FloatParameter)]
    copies = np.repeat(rows[:, None], 2 * len(lengths), axis=1)
    for k, column in enumerate(lengths):
        copies[:, 2 * k, column] -= tolerance
        copies[:, 2 * k + 1, column] += tolerance
    links = [i for i in lengths if space.parameters[i].name.startswith("link_")]
    copies[..., links] = np.maximum(copies[..., links], SHORTEST)
    return copies
