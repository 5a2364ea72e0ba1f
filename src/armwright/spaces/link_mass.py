"""The mass of a link without a material, as a function of its length."""

from typing import Annotated, Literal, TypeVar

from pydantic import BaseModel, Field

from armwright.arrays import Array

Length = TypeVar("Length", float, Array)


class MassPerMetre(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Links of one section and material: the mass is proportional to the length."""

    kind: Literal["per_metre"] = "per_metre"
    kg: float = Field(default=0.0121, ge=0.0, le=1e4)  # of a metre of link [kg/m]


class MassPerLink(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Links of one mass, whatever their length."""

    kind: Literal["per_link"]
    kg: float = Field(default=0.002, ge=0.0, le=1e4)  # of each link [kg]


def link_mass(model: MassPerMetre | MassPerLink, length: Length) -> Length:
    """Return the mass of links of these lengths [m] in [kg]."""
    return model.kg * length if model.kind == "per_metre" else model.kg + 0.0 * length


MassModel = Annotated[MassPerMetre | MassPerLink, Field(discriminator="kind")]
