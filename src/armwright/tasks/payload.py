"""Payloads that the tip carries."""

from dataclasses import dataclass
from typing import Self

from pydantic import BaseModel, Field, model_validator

from armwright.tasks.moments import MAX_MASS, Moments, describe_vector
from armwright.tasks.targets import Point, Position, Size


@dataclass(frozen=True)
class LoadShape:
    """How the mass of a payload is distributed, whatever that mass, in the tip frame."""

    center: Point = (0.0, 0.0, 0.0)  # centre of mass [m]
    gyration: Point = (0.0, 0.0, 0.0)  # moments of inertia about the centre, around x, y and z, per mass [m²]


POINT_LOAD = LoadShape()


class Payload(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """A rigid payload, in the tip frame."""

    mass: float = Field(gt=0.0, le=MAX_MASS)  # [kg]
    center: Position = (0.0, 0.0, 0.0)  # centre of mass [m]
    size: tuple[Size, Size, Size] | None = None  # sides of a box of uniform density along x, y and z [m]
    inertia: Moments | None = None  # instead of a size, moments about the centre of mass, around x, y and z [kg m²]

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.size is not None and self.inertia is not None:
            raise ValueError("expected size or inertia, got both; a size stands for the inertia of a uniform box")
        return self

    @property
    def shape(self) -> LoadShape:
        """Its centre and its moments of inertia per mass; those of a point without size and inertia."""
        if self.size is not None:
            x, y, z = (side**2 / 12.0 for side in self.size)
            return LoadShape(self.center, (y + z, z + x, x + y))
        x, y, z = self.inertia or (0.0, 0.0, 0.0)
        return LoadShape(self.center, (x / self.mass, y / self.mass, z / self.mass))

    def describe(self) -> str:
        """Return the payload on one line."""
        parts = [f"{self.mass:g} kg", f"centre at {describe_vector(self.center)} m in the tip frame"]
        parts += [] if self.size is None else [f"a box of {describe_vector(self.size)} m"]
        parts += [] if self.inertia is None else [f"moments of inertia {describe_vector(self.inertia)} kg m²"]
        return ", ".join(parts)
