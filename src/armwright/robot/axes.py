"""Axes and vectors of local frames."""

from collections.abc import Sequence
from typing import Literal

from armwright.arrays import Array

Axis = Literal["x", "y", "z"]
Vector = tuple[float, float, float]

AXES: tuple[Axis, ...] = ("x", "y", "z")


ROUNDING = 1e-8  # largest error of a direction whose file writes right angles with nine decimals


def as_vector(values: Array) -> Vector:
    """Return the three values of an array."""
    x, y, z = values.tolist()
    return x, y, z


def unit_vector(axis: Axis | Vector) -> Vector:
    """Return the vector of length 1 along an axis."""
    return axis if isinstance(axis, tuple) else (float(axis == "x"), float(axis == "y"), float(axis == "z"))


def axis_along(direction: Sequence[float]) -> Axis | Vector:
    """Return the axis along a unit vector, without ROUNDING of x, y and z, of which those have their names."""
    near = [round(value) + 0.0 for value in direction]
    x, y, z = near if all(abs(a - b) < ROUNDING for a, b in zip(near, direction, strict=True)) else direction
    return next((axis for axis in AXES if unit_vector(axis) == (x, y, z)), (x, y, z))


def axis_name(axis: Axis | Vector) -> str:
    """Return x, y, z, the same with a minus, or the three components."""
    if isinstance(axis, str):
        return axis
    opposite = axis_along([-value for value in axis])
    return f"-{opposite}" if isinstance(opposite, str) else f"({', '.join(f'{value:.3g}' for value in axis)})"
