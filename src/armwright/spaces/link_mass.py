"""The mass of a link as a function of its length."""

import math
from typing import Annotated, Literal, Self, TypeVar

from pydantic import BaseModel, Field, model_validator

from armwright.arrays import Array

Length = TypeVar("Length", float, Array)


class MassPerMetre(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Links of one section and material: the mass is proportional to the length."""

    kind: Literal["per_metre"] = "per_metre"
    kg: float = Field(default=0.0121, ge=0.0, le=1e4)  # of a metre of link [kg/m]

    def mass(self, length: Length) -> Length:
        """Return the mass of links of these lengths [m] in [kg]."""
        return self.kg * length

    @property
    def description(self) -> str:
        """The model in a few words."""
        return f"{self.kg:g} kg per metre of link"


class MassPerLink(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Links of one mass, whatever their length."""

    kind: Literal["per_link"]
    kg: float = Field(default=0.002, ge=0.0, le=1e4)  # of each link [kg]

    def mass(self, length: Length) -> Length:
        """Return the mass of links of these lengths [m] in [kg]."""
        return self.kg + 0.0 * length

    @property
    def description(self) -> str:
        """The model in a few words."""
        return f"{self.kg:g} kg for each link, whatever its length"


class MassOfTube(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Links cut from a round tube of a real material; a solid bar if the wall is half the diameter."""

    kind: Literal["tube"]
    density: float = Field(gt=0.0, le=3e4)  # of the material [kg/m³]
    outer_diameter: float = Field(gt=0.0, le=1.0)  # of all tubes [m]
    wall: float = Field(gt=0.0)  # at most half the diameter [m]

    @model_validator(mode="after")
    def _check_wall(self) -> Self:
        if self.wall > self.outer_diameter / 2:
            raise ValueError(f"wall = {self.wall:g} m is more than half of outer_diameter = {self.outer_diameter:g} m")
        return self

    def mass(self, length: Length) -> Length:
        """Return the mass of links of these lengths [m] in [kg]."""
        outer = self.outer_diameter / 2
        inner = outer - self.wall
        return self.density * math.pi * (outer**2 - inner**2) * length

    @property
    def description(self) -> str:
        """The model in a few words."""
        return (
            f"a tube of {self.outer_diameter * 1e3:g} mm outer diameter and {self.wall * 1e3:g} mm wall, "
            f"{self.density:g} kg/m³ ({self.mass(1.0):.3g} kg per metre)"
        )


MassModel = Annotated[MassPerMetre | MassPerLink | MassOfTube, Field(discriminator="kind")]
