"""Solid convex obstacles that the arm should keep away from, as in task files."""

from dataclasses import dataclass
from typing import Annotated, Literal, Self, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, model_validator

from armwright.rotations import rotation_from_rpy, rotation_to_axis
from armwright.tasks.moments import describe_vector
from armwright.tasks.targets import Angle, Coordinate, Direction, ObstacleName, Point, Position, Size

Shape = Literal["box", "sphere", "cylinder", "ground"]

SHAPES: tuple[Shape, ...] = get_args(Shape)
MAX_OBSTACLES = 100


@dataclass(frozen=True)
class Solid:
    """The shape of an obstacle in its own frame, for kernels and drawings."""

    shape: Shape  # kind of the shape
    centre: Point  # origin of the frame in the world [m]; a point of the surface for the ground
    rotation: NDArray[np.float64]  # (3, 3) the axes of the frame in the world as columns
    # Half the sides of a box; radius, radius and half the height of a cylinder; three radii of a sphere [m].
    # Zeros for the ground, which fills everything below its x and y axes.
    half: Point

    def contains(self, points: NDArray[np.float64], depth: float = 0.0) -> NDArray[np.bool_]:
        """Return (N,) True for the points (N, 3) [m] that are deeper than `depth` [m] below the surface."""
        return self.signed_distance(points) < -depth

    def signed_distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the (N,) distances of points (N, 3) from the surface [m]; inside, minus the depth."""
        local, half = (points - self.centre) @ self.rotation, np.array(self.half)
        match self.shape:
            case "ground":
                return local[:, 2]
            case "sphere":
                return np.linalg.norm(local, axis=1) - half[0]
            case "cylinder":
                excess = np.column_stack([np.hypot(local[:, 0], local[:, 1]), np.abs(local[:, 2])]) - half[1:]
            case "box":
                excess = np.abs(local) - half
        return np.minimum(excess.max(axis=1), 0.0) + np.linalg.norm(np.maximum(excess, 0.0), axis=1)


class Record(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """The fields that obstacles of all kinds have."""

    kind: Shape
    name: ObstacleName = ""  # for messages and drawings

    def describe(self) -> str:
        """Return a description on one line."""
        return f"{self.name}: {self._describe()}" if self.name else self._describe()

    def _describe(self) -> str:
        raise NotImplementedError


class Box(Record, frozen=True):
    """A box about its centre, rotated by yaw, or by roll, pitch and yaw as in URDF."""

    kind: Literal["box"]
    center: Position  # [m]
    size: tuple[Size, Size, Size]  # along its own axes
    yaw: Angle = 0.0  # about z
    rpy: tuple[Angle, Angle, Angle] | None = None  # instead of yaw: about the fixed x, then y, then z

    @model_validator(mode="after")
    def _check_one_rotation(self) -> Self:
        if self.rpy is not None and self.yaw != 0.0:
            raise ValueError("expected yaw or rpy, got both; the third angle of rpy is the yaw")
        return self

    @property
    def solid(self) -> Solid:
        x, y, z = self.size
        return Solid("box", self.center, rotation_from_rpy(*(self.rpy or (0.0, 0.0, self.yaw))), (x / 2, y / 2, z / 2))

    def _describe(self) -> str:
        x, y, z = self.size
        rotation = f", turned by yaw {self.yaw:g} rad" if self.yaw else ""
        if self.rpy is not None:
            rotation = f", turned by roll, pitch, yaw {describe_vector(self.rpy)} rad"
        return f"box of {x:g} x {y:g} x {z:g} m (along x, y, z) about {describe_vector(self.center)}{rotation}"


class Sphere(Record, frozen=True):
    """A sphere about its centre."""

    kind: Literal["sphere"]
    center: Position  # [m]
    radius: Size

    @property
    def solid(self) -> Solid:
        return Solid("sphere", self.center, np.eye(3), (self.radius, self.radius, self.radius))

    def _describe(self) -> str:
        return f"sphere of radius {self.radius:g} m about {describe_vector(self.center)}"


class Cylinder(Record, frozen=True):
    """A cylinder about its centre. axis: its direction, a letter or a vector of any length."""

    kind: Literal["cylinder"]
    center: Position  # [m]
    radius: Size
    height: Size
    axis: Literal["x", "y", "z"] | Direction = "z"

    @property
    def solid(self) -> Solid:
        axis = np.eye(3)["xyz".index(self.axis)] if isinstance(self.axis, str) else np.array(self.axis)
        return Solid("cylinder", self.center, rotation_to_axis(axis), (self.radius, self.radius, self.height / 2))

    def _describe(self) -> str:
        axis = self.axis if isinstance(self.axis, str) else describe_vector(self.axis)
        return (
            f"cylinder of radius {self.radius:g} m and height {self.height:g} m about "
            f"{describe_vector(self.center)}, its axis along {axis}"
        )


class Ground(Record, frozen=True):
    """Everything below a height, such as a floor or an endless table top."""

    kind: Literal["ground"]
    z: Coordinate = 0.0  # everything below is solid

    @property
    def solid(self) -> Solid:
        return Solid("ground", (0.0, 0.0, self.z), np.eye(3), (0.0, 0.0, 0.0))

    def _describe(self) -> str:
        return f"ground, solid everywhere below z = {self.z:g} m"


Obstacle = Annotated[Box | Sphere | Cylinder | Ground, Field(discriminator="kind")]
