"""Inertia of a link: a round tube of uniform density, and the body that it carries at its end.

About its centre, with outer and inner radius R and r, length l and mass m, a tube has m (R² + r²) / 2 around its axis
and m (3 (R² + r²) + l²) / 12 across it. Moments about other points follow from the parallel axis theorem.
"""

import numpy as np

from armwright.arrays import Array


def tube_inertia(mass: Array, offset: Array, section: Array) -> Array:
    """Return the inertia (..., 3, 3) of tubes about their centres [kg m²].

    mass: (...) [kg].  offset: (..., 3) along the tube, as long as it [m].  section: (...) R² + r² [m²].
    """
    square = (offset**2).sum(axis=-1)
    length = np.sqrt(square)[..., None]
    axis = np.where(length > 0.0, offset / np.where(length > 0.0, length, 1.0), (0.0, 0.0, 1.0))
    along = axis[..., :, None] * axis[..., None, :]
    across_axis = (mass * (3.0 * section + square) / 12.0)[..., None, None]
    return across_axis * (np.eye(3) - along) + (mass * section / 2.0)[..., None, None] * along


def point_inertia(mass: Array, lever: Array) -> Array:
    """Return the inertia (..., 3, 3) of point masses (...) [kg] about points at (..., 3) from them [kg m²]."""
    squared = (lever**2).sum(axis=-1)[..., None, None] * np.eye(3)
    return mass[..., None, None] * (squared - lever[..., :, None] * lever[..., None, :])
