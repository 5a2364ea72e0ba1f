"""Axes and vectors of local frames."""

from typing import Literal

Axis = Literal["x", "y", "z"]
Vector = tuple[float, float, float]

AXES: tuple[Axis, ...] = ("x", "y", "z")


def unit_vector(axis: Axis) -> Vector:
    """Return the vector of length 1 along an axis."""
    return (float(axis == "x"), float(axis == "y"), float(axis == "z"))
