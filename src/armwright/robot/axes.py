"""Axes and vectors of local frames."""

from typing import Literal

Axis = Literal["x", "y", "z"]
Vector = tuple[float, float, float]

AXES: tuple[Axis, ...] = ("x", "y", "z")
