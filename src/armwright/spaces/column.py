"""The column that lifts the base of a floor-mounted arm, as a space file states it."""

from typing import Self

import numpy as np
from pydantic import BaseModel, Field, model_validator

from armwright.arrays import Array
from armwright.robot.arm import Column
from armwright.robot.tubes import Tube, check_tube


class ColumnKeys(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """The keys of a column; by default a tube of aluminium, 60 x 3 mm, without a price."""

    outer_diameter: float = 0.06  # [m]
    wall: float = 0.003  # [m]
    density: float = Field(default=2700.0, gt=0.0, le=3e4)  # [kg/m³]
    price_per_metre: float = Field(default=0.0, ge=0.0, le=1e6)  # [USD/m]
    foot: float | None = None  # height of its lower end [m]; None for that of what the task lets it stand on, else 0

    @model_validator(mode="after")
    def _check_section(self) -> Self:
        check_tube(self.outer_diameter, self.wall)
        return self

    @property
    def mass_per_metre(self) -> float:
        """The mass of a metre [kg/m]."""
        return Tube(self.outer_diameter, self.wall).mass_per_metre(self.density)

    @property
    def description(self) -> str:
        """The section and its mass in a few words."""
        return (
            f"{1e3 * self.outer_diameter:.6g} mm outer diameter and {1e3 * self.wall:.6g} mm wall, {self.density:g} "
            f"kg/m³ ({self.mass_per_metre:.3g} kg per metre)"
        )

    def lengths(self, height: Array) -> Array:
        """Return the (N,) lengths below bases at these heights (N,) [m]; 0 for bases that are not above the foot."""
        return np.maximum(height - (self.foot or 0.0), 0.0)

    def under(self, height: float) -> Column | None:
        """Return the column below a base at this height [m]; None if the base is not above the foot."""
        length = float(self.lengths(np.array(height)))
        if length == 0.0:
            return None
        mass, price = self.mass_per_metre * length, self.price_per_metre * length
        return Column(length, self.outer_diameter, self.wall, mass, price)
