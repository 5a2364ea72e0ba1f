"""Regions that an arm should cover, as a task file has them, and the points that stand for them."""

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
Place = tuple[Coordinate, Coordinate, Coordinate]

BASES = (2, 3, 5)  # of Halton's sequence, for x, y and z


class Region(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """A box along the world's axes; one that is flat, or a line, is one, too."""

    low: Place  # the least x, y and z [m]
    high: Place  # the largest [m]
    points: Annotated[int, Field(ge=1, le=MOST_POINTS)] = USUAL_POINTS  # that stand for it

    @model_validator(mode="after")
    def _check_corners(self) -> Self:
        for axis, low, high in zip("xyz", self.low, self.high, strict=True):
            if low > high:
                raise ValueError(f"workspace: its low {axis} = {low:g} m is above its high {axis} = {high:g} m")
        return self

    @property
    def corners(self) -> tuple[Place, ...]:
        """Eight of a box, fewer of one that is flat."""
        x, y, z = zip(self.low, self.high, strict=True)
        return tuple(dict.fromkeys(product(x, y, z)))

    def describe(self) -> str:
        """What it is, on one line."""
        low, high = (", ".join(f"{value:g}" for value in corner) for corner in (self.low, self.high))
        return f"box from ({low}) to ({high}), {self.points} points"


def sample_regions(regions: tuple[Region, ...]) -> Array:
    """(W, 3) spread evenly over each region, by Halton's sequence from its second point on, always the same [m]."""
    parts = [np.zeros((0, 3))]
    for region in regions:
        low, high = np.array(region.low), np.array(region.high)
        shares = np.column_stack([_mirrored(np.arange(1, region.points + 1), base) for base in BASES])
        parts.append(low + (high - low) * shares)
    return np.concatenate(parts)


def _mirrored(numbers: NDArray[np.int64], base: int) -> Array:
    """Their digits in a base, behind the point and in reverse order: (n,) between 0 and 1."""
    shares, place = np.zeros(len(numbers)), 1.0
    while numbers.any():
        place /= base
        shares += place * (numbers % base)
        numbers = numbers // base
    return shares
