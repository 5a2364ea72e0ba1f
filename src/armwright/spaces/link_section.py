"""The sections that links may have: round tubes of one material."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field

from armwright.robot.tubes import Material, Tube, check_tube, resolve_material, section_square

MAX_TUBES = 20


@dataclass(frozen=True, slots=True)
class LinkTube:
    """A tube as a link has it."""

    name: str  # the choice of a parameter: `30x2`
    radius: float  # the outer radius [m]
    wall: float | None = None  # wall thickness [m]; None without a material
    mass_per_metre: float = 0.0  # [kg/m]; 0 without a material, which leaves the mass to another key
    bending_stiffness: float | None = None  # EI [N m²]; None without a material
    torsional_stiffness: float | None = None  # GJ [N m²]; None without a material
    price_per_metre: float = 0.0  # [USD/m]

    @property
    def section(self) -> float:
        """The sum of the squares of outer and inner radius [m²]; a solid bar without a material."""
        return section_square(self.radius, self.wall)


def _check_tubes(tubes: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    for outer, wall in tubes:
        check_tube(outer, wall)
    names = [Tube(*tube).name for tube in tubes]
    if len(set(names)) != len(names):
        raise ValueError(f"duplicates among {', '.join(names)} (outer diameter x wall in mm)")
    return tubes


class LinkSection(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """The round sections that links may have, and their material."""

    # Outer diameter and wall of each tube [m]; a solid bar if the wall is half the diameter
    tubes: Annotated[tuple[tuple[float, float], ...], AfterValidator(_check_tubes)] = Field(
        default=((0.03, 0.015),), min_length=1, max_length=MAX_TUBES
    )
    # True if each link has a tube of its own, the parameters tube_j; else the parameter tube is that of all links
    per_link: bool = True
    # A name, or a record. None: masses as in `mass`, stiffness unknown
    material: Annotated[Material | None, BeforeValidator(resolve_material)] = None

    @property
    def options(self) -> tuple[LinkTube, ...]:
        """The tubes in the order of the file."""
        return _options(self)

    @property
    def description(self) -> str:
        """The tubes and their masses in a few words; needs a material."""
        if self.material is None:
            raise ValueError("a section without a material has no mass")
        name = f"{self.material.name}, " if self.material.name else ""
        shown = [f"{1e3 * o:.6g} mm outer diameter and {1e3 * w:.6g} mm wall" for o, w in self.tubes]
        masses = [f"{tube.mass_per_metre:.3g} kg per metre" for tube in self.options]
        if len(shown) == 1:
            return f"a tube of {shown[0]}, {name}{self.material.density:g} kg/m³ ({masses[0]})"
        each = " or ".join(f"{tube} ({mass})" for tube, mass in zip(shown, masses, strict=True))
        return f"tubes of {each}, {name}{self.material.density:g} kg/m³"


@lru_cache(maxsize=64)
def _options(section: LinkSection) -> tuple[LinkTube, ...]:
    return tuple(_option(Tube(outer, wall), section.material) for outer, wall in section.tubes)


def _option(tube: Tube, material: Material | None) -> LinkTube:
    if material is None:
        return LinkTube(tube.name, tube.radius)
    kg = tube.mass_per_metre(material.density)
    return LinkTube(
        name=tube.name,
        radius=tube.radius,
        wall=tube.wall,
        mass_per_metre=kg,
        bending_stiffness=material.youngs * tube.second_moment,
        torsional_stiffness=material.shear * (2.0 * tube.second_moment),
        price_per_metre=material.price_per_kg * kg,
    )
