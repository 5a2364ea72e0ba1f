"""Round tubes: their sections, and the materials that they are cut from."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, Field, field_validator

from armwright.exceptions import did_you_mean

MAX_DIAMETER = 1.0  # [m]
MODULI = 1e6, 2e12  # [Pa], from rubber to diamond; values below are probably in GPa


@dataclass(frozen=True, slots=True)
class Tube:
    """The section of a round tube; a solid bar if the wall is half the diameter."""

    outer_diameter: float  # [m]
    wall: float  # wall thickness [m], at most half the diameter

    @property
    def name(self) -> str:
        """Diameter and wall in millimetres: `30x2`."""
        return f"{1e3 * self.outer_diameter:.6g}x{1e3 * self.wall:.6g}"

    @property
    def radius(self) -> float:
        """The outer radius [m]."""
        return self.outer_diameter / 2

    @property
    def second_moment(self) -> float:
        """The second moment of area about a diameter, π (R⁴ - r⁴) / 4 [m⁴]; the polar one is twice as large."""
        return math.pi * (self.radius**4 - (self.radius - self.wall) ** 4) / 4

    def mass_per_metre(self, density: float) -> float:
        """Return the mass of a metre [kg/m] of a material of this density [kg/m³]."""
        return density * math.pi * (self.radius**2 - (self.radius - self.wall) ** 2)


def section_square(radius: float, wall: float | None) -> float:
    """Return R² + r² of outer and inner radius [m²]; r is 0 if the wall is unknown."""
    return radius**2 if wall is None else radius**2 + (radius - wall) ** 2


def check_tube(outer: float, wall: float) -> None:
    """Raise ValueError for an outer diameter and a wall [m] of no tube."""
    if outer > MAX_DIAMETER:
        raise ValueError(
            f"expected an outer diameter of at most {MAX_DIAMETER:g} m, got {outer:g} m; lengths are in metres: write "
            f"{outer / 1e3:g} for {outer:g} mm"
        )
    if min(outer, wall) <= 0.0:
        raise ValueError(f"expected an outer diameter and a wall above 0 m, got {outer:g} m and {wall:g} m")
    if wall > outer / 2:
        raise ValueError(
            f"expected a wall of at most the radius, {outer / 2:g} m for an outer diameter of {outer:g} m, got "
            f"{wall:g} m"
        )


class Material(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """The material of tubes."""

    name: str = Field(default="", max_length=40)  # for messages and tables
    density: float = Field(gt=0.0, le=3e4)  # [kg/m³]
    youngs: float  # Young's modulus along the tube [Pa]
    shear: float  # shear modulus around the tube [Pa]
    price_per_kg: float = Field(default=0.0, ge=0.0, le=1e6)  # [USD/kg]

    @field_validator("youngs", "shear")
    @classmethod
    def _check_modulus(cls, value: float) -> float:
        low, high = MODULI
        if not low <= value <= high:
            raise ValueError(f"expected {low:g} to {high:g} Pa, got {value:g} Pa; 70 GPa is 70.0e+9")
        return value


MATERIALS: Mapping[str, Material] = {  # without prices, which depend on the shop
    material.name: material
    for material in (
        # EN 1999-1-1:2007, 3.2.5: all alloys of the standard, 6060 and 6061 among them.
        Material(name="aluminium", density=2700, youngs=70e9, shear=27e9),
        # EN 1993-1-1:2005, 3.2.6; density: EN 1991-1-1, table A.4.
        Material(name="steel", density=7850, youngs=210e9, shear=81e9),
        # performance-composites.com, "Mechanical Properties of Carbon Fibre Composite Materials": standard fabric
        # at 0°/90° in epoxy, as in roll-wrapped tubes; density: substech.com. Pultruded tubes bend half as much.
        Material(name="carbon", density=1600, youngs=70e9, shear=5e9),
        # Printed solid, in the plane of the layers: the lower ends of the moduli and the middle of the densities of
        # additive.tools/materials; shear moduli by Poisson's ratios of 0.36 (PLA) and 0.38 (PETG).
        Material(name="pla", density=1240, youngs=3.0e9, shear=1.1e9),
        Material(name="petg", density=1270, youngs=2.0e9, shear=0.72e9),
    )
}


def resolve_material(entry: Any) -> Any:
    """Return the material of a name (ValueError if none has it); anything else unchanged, for pydantic to validate."""
    if not isinstance(entry, str):
        return entry
    if entry not in MATERIALS:
        raise ValueError(
            f'unknown material "{entry}".{did_you_mean(entry.lower(), MATERIALS)} Materials: {", ".join(MATERIALS)}; '
            "or give density [kg/m³], youngs [Pa] and shear [Pa]"
        )
    return MATERIALS[entry]
