"""Solid convex obstacles that the arm should keep away from, as in task files."""

from dataclasses import dataclass
from pathlib import PurePath
from typing import Annotated, Any, Literal, Self, cast, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, Field, ValidationInfo, model_validator

from armwright.rotations import rotation_from_rpy, rotation_to_axis
from armwright.tasks.meshes import MAX_CORNERS, NO_HULL, Corners, Hull, read_hull, scaled_hull
from armwright.tasks.moments import describe_vector
from armwright.tasks.targets import Angle, Coordinate, Direction, ObstacleName, Point, Position, Size

Shape = Literal["box", "sphere", "cylinder", "ground", "mesh"]

SHAPES: tuple[Shape, ...] = get_args(Shape)
MAX_OBSTACLES = 100


@dataclass(frozen=True)
class Solid:
    """The shape of an obstacle in its own frame, for kernels and drawings."""

    shape: Shape  # kind of the shape
    centre: Point  # origin of the frame in the world [m]; a point of the surface for the ground
    rotation: NDArray[np.float64]  # (3, 3) the axes of the frame in the world as columns
    # Half the sides of a box, or of one around a mesh; radius, radius and half the height of a cylinder; three radii of
    # a sphere [m]. Zeros for the ground, which fills everything below its x and y axes.
    half: Point
    hull: Hull = NO_HULL  # of a mesh [m]

    @property
    def gyration(self) -> NDArray[np.float64]:
        """(3,) moments of inertia of a uniform box or cylinder about its centre, around its axes, per mass [m²]."""
        squares = np.square(self.half) / (3.0 if self.shape == "box" else (4.0, 4.0, 3.0))  # mean squares along x, y, z
        return squares.sum() - squares

    def contains(self, points: NDArray[np.float64], depth: float = 0.0) -> NDArray[np.bool_]:
        """Return (N,) True for the points (N, 3) [m] that are deeper than `depth` [m] below the surface."""
        return self.signed_distance(points) < -depth

    def signed_distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the (N,) distances of points (N, 3) from the surface [m]; inside, minus the depth.

        Outside a mesh, that from the nearest plane of a face, which is at most the distance.
        """
        local, half = (points - self.centre) @ self.rotation, np.array(self.half)
        match self.shape:
            case "mesh":
                return (local @ self.hull.planes[:, :3].T - self.hull.planes[:, 3]).max(axis=1)
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


class Mesh(Record, frozen=True):
    """The convex hull of a mesh. Its file is read with that of the task, which holds its corners from then on."""

    kind: Literal["mesh"]
    mesh: str = Field(max_length=200)  # the file, beside that of the task or in a folder there
    position: Position = (0.0, 0.0, 0.0)  # of the file's origin [m]
    rpy: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)  # of the file's axes about the fixed x, then y, then z
    scale: Size = 1.0  # length of the file's unit [m]
    points: Corners = Field(min_length=4, max_length=MAX_CORNERS)  # corners of the hull, in the file
    source: str = Field(default="convex hull", max_length=300)  # what it is the hull of

    @model_validator(mode="before")
    @classmethod
    def _read(cls, given: Any, info: ValidationInfo) -> Any:
        if not isinstance(given, dict) or "points" in given or not isinstance(given.get("mesh"), str):
            return cast("Any", given)
        record = cast("dict[str, Any]", given)
        file = PurePath(record["mesh"])
        if info.context is None or file.is_absolute() or ".." in file.parts:
            raise ValueError(f"mesh: expected a file beside a task file or in a folder there, got {file}")
        points, source = read_hull(info.context / file)
        return {**record, "points": points.tolist(), "source": source}

    @model_validator(mode="after")
    def _check_volume(self) -> Self:
        scaled_hull(self.points, self.scale)  # raises if it is flat
        return self

    @property
    def solid(self) -> Solid:
        rotation, (middle, hull) = rotation_from_rpy(*self.rpy), scaled_hull(self.points, self.scale)
        (x, y, z), (a, b, c) = (self.position + rotation @ middle).tolist(), hull.corners.max(axis=0).tolist()
        return Solid("mesh", (x, y, z), rotation, (a, b, c), hull)

    def _describe(self) -> str:
        x, y, z = (2.0 * side for side in self.solid.half)
        rotation = f", turned by roll, pitch, yaw {describe_vector(self.rpy)} rad" if any(self.rpy) else ""
        return f"{self.source}, {x:.3g} x {y:.3g} x {z:.3g} m about {describe_vector(self.solid.centre)}{rotation}"


def _name_kind(record: Any) -> Any:
    is_mesh = isinstance(record, dict) and "mesh" in record
    return {"kind": "mesh"} | cast("Any", record) if is_mesh else cast("Any", record)


Obstacle = Annotated[
    Annotated[Box | Sphere | Cylinder | Ground | Mesh, Field(discriminator="kind")], BeforeValidator(_name_kind)
]
