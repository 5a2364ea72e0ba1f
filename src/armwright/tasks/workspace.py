"""Regions that an arm should cover, as in task files, and the points that sample them."""

import math
from itertools import product
from typing import Annotated, Self

import numpy as np
from pydantic import BaseModel, Field, model_validator

from armwright.arrays import Array
from armwright.rotations import cone_directions
from armwright.tasks.targets import Direction, Position

MAX_POINTS = 10_000
MAX_REGIONS = 20
MAX_DIRECTIONS = 100
MAX_POSES = 50_000  # points with directions


class ToolDirections(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Directions of the tool's z axis that an arm should reach at each point: a cone, sampled evenly."""

    axis: Direction = (0.0, 0.0, -1.0)  # middle of the cone, of any length
    half_angle: Annotated[float, Field(ge=0.0, le=math.pi)] = math.pi  # half the opening angle [rad]; π: all directions
    count: Annotated[int, Field(ge=1, le=MAX_DIRECTIONS)] = 12
    share: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0  # of the directions that a dexterous point needs

    @property
    def vectors(self) -> Array:
        """(M, 3) unit vectors in the cone."""
        return cone_directions(self.axis, self.half_angle, self.count)

    def describe(self) -> str:
        """Return a description on one line."""
        axis = ", ".join(f"{value:g}" for value in self.axis)
        return f"{self.count} tool directions within {math.degrees(self.half_angle):.3g}° of ({axis})"


class Region(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """A box along the world's axes; it may be flat, a line or a point."""

    low: Position  # smallest x, y and z [m]
    high: Position  # largest x, y and z [m]
    points: Annotated[int, Field(ge=1, le=MAX_POINTS)] = 200  # number of samples
    directions: ToolDirections | None = None  # for dexterous_volume

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
        ways = "" if self.directions is None else f", {self.directions.describe()}"
        return f"box from ({low}) to ({high}), {self.points} points{ways}"


def sample_regions(regions: tuple[Region, ...]) -> Array:
    """Return (W, 3) points spread evenly over each region by Halton's sequence, without its first point [m]."""
    from scipy.stats import qmc  # takes half a second to import

    parts = [np.zeros((0, 3))]
    for region in regions:
        shares = qmc.Halton(3, scramble=False).fast_forward(1).random(region.points)
        parts.append(np.array(region.low) + (np.array(region.high) - np.array(region.low)) * shares)
    return np.concatenate(parts)
