"""The tool that an arm carries at the end of its last link."""

import math
from typing import Self

from pydantic import BaseModel, model_validator

from armwright.tasks.moments import Mass, Moments, describe_vector
from armwright.tasks.targets import Angle, Position, Size


class Tool(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """A tool, in a frame at the end of the last link and parallel to the frame of that link."""

    tip: Position = (0.0, 0.0, 0.0)  # position of the tip [m]
    # Roll, pitch and yaw of the tip frame about the fixed x, then y, then z [rad]
    rpy: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)
    mass: Mass = 0.0
    center: Position = (0.0, 0.0, 0.0)  # centre of mass [m]
    # Moments about the centre of mass, around x, y and z [kg m²]; by default those of its body, uniform, or of a point
    inertia: Moments = (0.0, 0.0, 0.0)
    # Its body, which keeps clear of obstacles and the arm: a box about `center`, with these sides along the axes of the
    # tip frame [m], or a cylinder of this radius from the end of the last link to the tip [m]; none by default
    size: tuple[Size, Size, Size] | None = None
    radius: Size | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name in ("center", "inertia"):
            if self.mass == 0.0 and any(getattr(self, name)) and not (name == "center" and self.size):
                raise ValueError(f"{name} needs a mass above 0 kg, such as mass: 0.35")
        if self.size is not None and self.radius is not None:
            raise ValueError("expected size or radius, got both; a size is a box, a radius a cylinder up to the tip")
        if self.radius is not None and not any(self.tip):
            raise ValueError("radius needs a tip away from the end of the last link, such as tip: [0, 0, 0.1]")
        return self

    @property
    def length(self) -> float:
        """Distance from the end of the last link to the tip [m]."""
        return math.hypot(*self.tip)

    def describe(self) -> str:
        """Return the tool on one line; empty without a tool."""
        parts = [f"tip at {describe_vector(self.tip)} m"] if any(self.tip) else []
        parts += [f"rpy {describe_vector(self.rpy)} rad"] if any(self.rpy) else []
        parts += [f"{self.mass:g} kg at {describe_vector(self.center)} m"] if self.mass else []
        parts += [f"inertia {describe_vector(self.inertia)} kg m²"] if any(self.inertia) else []
        parts += [f"a box of {describe_vector(self.size)} m"] if self.size else []
        parts += [f"a cylinder of radius {self.radius:g} m up to the tip"] if self.radius else []
        return ", ".join(parts)


NO_TOOL = Tool()
