"""Regions that an arm should cover, as in task files, and the points that sample them."""

from itertools import product
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, model_validator

from armwright.arrays import Array

LARGEST = 1000.0  # [m], of coordinates
MOST_POINTS = 10_000
MOST_REGIONS = 20
USUAL_POINTS = 200

Coordinate = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]  # [m]
Position = tuple[Coordinate, Coordinate, Coordinate]

BASES = (2, 3, 5)  # of Halton's sequence, for x, y and z


class Region(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """A box along the world's axes; it may be flat, a line or a point."""

    low: Position  # smallest x, y and z [m]
    high: Position  # largest x, y and z [m]
    points: Annotated[int, Field(ge=1, le=MOST_POINTS)] = USUAL_POINTS  # samples of it

    @model_validator(mode="after")
    def _check_corners(self) -> Self:
        for axis, low, high in zip("xyz", self.low, self.high, strict=True):
            if low > high:
                raise ValueError(f"workspace: expected low {axis} <= high {axis}, got {low:g} m and {high:g} m")
        return self

    @property
    def corners(self) -> tuple[Position, ...]:
        """Different corners [m]: eight of a box, fewer if it is flat."""
        x, y, z = zip(self.low, self.high, strict=True)
        return tuple(dict.fromkeys(product(x, y, z)))

    def describe(self) -> str:
        """Return a description on one line."""
        low, high = (", ".join(f"{value:g}" for value in corner) for corner in (self.low, self.high))
        return f"box from ({low}) to ({high}), {self.points} points"


def sample_regions(regions: tuple[Region, ...]) -> Array:
    """Return (W, 3) points spread evenly over each region by Halton's sequence, without its first point [m]."""
    parts = [np.zeros((0, 3))]
    for region in regions:
        low, high = np.array(region.low), np.array(region.high)
        shares = np.column_stack([_radical_inverse(np.arange(1, region.points + 1), base) for base in BASES])
        parts.append(low + (high - low) * shares)
    return np.concatenate(parts)


def _radical_inverse(numbers: NDArray[np.int64], base: int) -> Array:
    """Return the radical inverses (n,) of numbers: their digits in reverse order behind the point."""
    inverses, digit = np.zeros(len(numbers)), 1.0
    while numbers.any():
        digit /= base
        inverses += digit * (numbers % base)
        numbers = numbers // base
    return inverses
