"""Obstacles: what the arm should keep away from, solid and convex, as people write it in task files."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, model_validator

from armwright.exceptions import did_you_mean
from armwright.rotations import rotation_from_rpy, rotation_to_axis

Point = tuple[float, float, float]
Shape = Literal["box", "sphere", "cylinder", "ground"]

SHAPES: tuple[Shape, ...] = ("box", "sphere", "cylinder", "ground")
MOST_OBSTACLES = 100
LARGEST = 1000.0  # [m], of coordinates and sizes

Coordinate = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]  # [m]
Size = Annotated[float, Field(gt=0.0, le=LARGEST)]  # [m]
Angle = Annotated[float, Field(ge=-2 * math.pi, le=2 * math.pi)]  # [rad]
Place = tuple[Coordinate, Coordinate, Coordinate]
Name = Annotated[str, Field(pattern=r"^([A-Za-z0-9][A-Za-z0-9 ._-]{0,39})?$")]


@dataclass(frozen=True)
class Solid:
    """An obstacle as kernels and drawings take it, in a frame of its own.

    centre: of the frame in the world [m]; of the ground, a point of its surface.
    rotation: (3, 3), the frame's axes in the world as columns.
    half: half the sides of a box; radius, radius and half the height of a cylinder; three radii of a sphere [m].
        Zeros for the ground, which is all that lies below its frame's x and y axes.
    """

    shape: Shape
    centre: Point
    rotation: NDArray[np.float64]
    half: Point


class Box(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """A box of three sides about its centre, turned by yaw, or by roll, pitch and yaw as in URDF."""

    kind: Literal["box"]
    name: Name = ""  # for messages and drawings
    center: Place  # of the whole
    size: tuple[Size, Size, Size]  # along its own x, y and z [m]
    yaw: Angle = 0.0  # about z
    rpy: tuple[Angle, Angle, Angle] | None = None  # instead of it: about x, then y, then z

    @model_validator(mode="after")
    def _check_one_rotation(self) -> Self:
        if self.rpy is not None and self.yaw != 0.0:
            raise ValueError("yaw and rpy are both given; the last of rpy is the yaw")
        return self

    @property
    def solid(self) -> Solid:
        x, y, z = self.size
        return Solid("box", self.center, rotation_from_rpy(*(self.rpy or (0.0, 0.0, self.yaw))), (x / 2, y / 2, z / 2))

    def describe(self) -> str:
        """What it is, on one line."""
        x, y, z = self.size
        turned = f", turned by yaw {self.yaw:g} rad" if self.yaw else ""
        if self.rpy is not None:
            turned = f", turned by roll, pitch, yaw {_point(self.rpy)} rad"
        return f"{_called(self.name)}box of {x:g} x {y:g} x {z:g} m (along x, y, z) about {_point(self.center)}{turned}"


class Sphere(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """A ball."""

    kind: Literal["sphere"]
    name: Name = ""  # for messages and drawings
    center: Place  # of the whole
    radius: Size  # about the centre

    @property
    def solid(self) -> Solid:
        return Solid("sphere", self.center, np.eye(3), (self.radius, self.radius, self.radius))

    def describe(self) -> str:
        """What it is, on one line."""
        return f"{_called(self.name)}sphere of radius {self.radius:g} m about {_point(self.center)}"


class Cylinder(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """A round bar with flat ends. axis: its direction, a letter or a vector of any length."""

    kind: Literal["cylinder"]
    name: Name = ""  # for messages and drawings
    center: Place  # of the whole
    radius: Size  # of its round ends
    height: Size  # from end to end
    axis: Literal["x", "y", "z"] | Place = "z"

    @model_validator(mode="after")
    def _check_axis(self) -> Self:
        if not isinstance(self.axis, str) and math.hypot(*self.axis) < 1e-6:
            raise ValueError(f"axis = {_point(self.axis)} has no direction; give x, y, z or a vector")
        return self

    @property
    def solid(self) -> Solid:
        axis = np.eye(3)["xyz".index(self.axis)] if isinstance(self.axis, str) else np.array(self.axis)
        return Solid("cylinder", self.center, rotation_to_axis(axis), (self.radius, self.radius, self.height / 2))

    def describe(self) -> str:
        """What it is, on one line."""
        axis = self.axis if isinstance(self.axis, str) else _point(self.axis)
        return (
            f"{_called(self.name)}cylinder of radius {self.radius:g} m and height {self.height:g} m about "
            f"{_point(self.center)}, its axis along {axis}"
        )


class Ground(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """All that lies below a height, such as a floor or the top of a table without end."""

    kind: Literal["ground"]
    name: Name = ""  # for messages and drawings
    z: Coordinate = 0.0  # below which all is solid

    @property
    def solid(self) -> Solid:
        return Solid("ground", (0.0, 0.0, self.z), np.eye(3), (0.0, 0.0, 0.0))

    def describe(self) -> str:
        """What it is, on one line."""
        return f"{_called(self.name)}ground, solid everywhere below z = {self.z:g} m"


Obstacle = Annotated[Box | Sphere | Cylinder | Ground, Field(discriminator="kind")]
_RECORDS: Mapping[str, type[BaseModel]] = {"box": Box, "sphere": Sphere, "cylinder": Cylinder, "ground": Ground}


def check_obstacle(record: Any, number: int) -> None:
    """ValueError where a record is none of the kinds, or has keys that its kind does not have."""
    if not isinstance(record, dict):
        return  # a value already, or nothing that could be one, which is said elsewhere
    content = cast("dict[Any, Any]", record)
    kind = str(content.get("kind"))
    if kind not in _RECORDS:
        said = f'kind "{kind}" is unknown.{did_you_mean(kind, _RECORDS)}' if "kind" in content else "kind is missing."
        raise ValueError(f"obstacle {number}: {said} Kinds: {', '.join(_RECORDS)}")
    keys = _RECORDS[kind].model_fields
    for key in content:
        if key not in keys:
            raise ValueError(
                f'obstacle {number}: a {kind} has no "{key}".{did_you_mean(str(key), keys)} Keys: {", ".join(keys)}'
            )


def _point(values: Point) -> str:
    return "(" + ", ".join(f"{value:g}" for value in values) + ")"


def _called(name: str) -> str:
    return f"{name}: " if name else ""
