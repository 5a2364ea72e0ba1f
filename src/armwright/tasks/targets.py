"""Targets of a task: positions, tool directions, tolerances and weights."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, Self, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, model_serializer, model_validator

from armwright.arrays import Array
from armwright.rotations import rotation_from_rpy, rotation_to_axis

MAX_COORDINATE = 1000.0  # [m]
MAX_WEIGHT = 1e6
MIN_TOLERANCE = 1e-9  # [m], [rad]

Point = tuple[float, float, float]
Coordinate = Annotated[float, Field(ge=-MAX_COORDINATE, le=MAX_COORDINATE)]  # [m]
Position = tuple[Coordinate, Coordinate, Coordinate]
Size = Annotated[float, Field(gt=0.0, le=MAX_COORDINATE)]  # [m]
Angle = Annotated[float, Field(ge=-2 * math.pi, le=2 * math.pi)]  # [rad]


def _check_direction(vector: Point) -> Point:
    if math.hypot(*vector) < 1e-6:
        raise ValueError(f"expected a direction, got {list(vector)}; try [0, 0, -1]")
    return vector


def _check_length(value: Any) -> Any:
    """Return the value of a position; ValueError for a list of more or fewer than three."""
    if isinstance(value, (list, tuple)) and len(cast("list[Any]", value)) != 3:
        numbers = cast("list[Any]", value)
        hint = "; write decimals with a point: 0.4, not 0,4" if len(numbers) > 3 else ""
        raise ValueError(f"expected three numbers x, y, z [m], got {len(numbers)}: {numbers!s:.80}{hint}")
    return cast("Any", value)


TargetPoint = Annotated[Point, BeforeValidator(_check_length)]
Direction = Annotated[Position, AfterValidator(_check_direction)]  # of any length

ObstacleName = Annotated[str, Field(pattern=r"^([A-Za-z0-9][A-Za-z0-9 ._-]{0,39})?$")]
TARGET_NAME = r"^([A-Za-z][A-Za-z0-9 ._-]{0,39})?$"  # empty for none
REACHED = 1e-3  # [m]; a target nearer than this counts as reached
ALIGNED = math.radians(1.0)  # [rad]; likewise for a target's axis or orientation
AXIS, ORIENTATION = 2, 3  # number of angles that count at a target; 0 for a point


@dataclass(frozen=True)
class TargetArrays:
    """Tool directions, tolerances and weights of T targets."""

    # (T,) number of angles that count: 0 for a point, AXIS if the tool's z counts, ORIENTATION if its x does, too
    n_angular: NDArray[np.intp]
    rotation: Array  # (T, 3, 3) the tool's own x, y and z in the world as columns; axes that do not count are arbitrary
    tolerance: Array  # (T,) distance from which on a target counts as unreached [m]
    angle_tolerance: Array  # (T,) angle likewise [rad]
    weight: Array  # (T,) factor of a target's share of a sum of errors
    stated_tolerance: Array  # (T,) tolerance if the task states it, else 0: what an error objective ignores [m]
    stated_angle_tolerance: Array  # (T,) angle likewise [rad]
    restarts: int = 0  # number of further starts of the inverse kinematics

    def __len__(self) -> int:
        return len(self.n_angular)

    @property
    def oriented(self) -> bool:
        """True if any target has an axis or an orientation."""
        return bool(self.n_angular.any())

    @property
    def metres_per_radian(self) -> Array:
        """(T,) length that an angle off counts as when a posture is kept [m/rad]: the ratio of the tolerances."""
        return self.tolerance / self.angle_tolerance


class Target(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """A point that the tip should reach, and the tool's direction there."""

    name: str = Field(default="", pattern=TARGET_NAME)  # name in the steps of a cycle and in tables; empty for none
    position: TargetPoint  # position of the tip [m]
    axis: Direction | None = None  # world direction of the tool's z axis, of any length; the tool may rotate about it
    # Instead of an axis, roll, pitch and yaw of the tool about the fixed x, then y, then z [rad]
    orientation: Point | None = None
    # Distance from which on the target counts as unreached [m]; None for REACHED
    tolerance: float | None = Field(default=None, ge=MIN_TOLERANCE, le=MAX_COORDINATE)
    # Angle likewise, for a target with an axis or an orientation [rad]; None for ALIGNED
    angle_tolerance: float | None = Field(default=None, ge=MIN_TOLERANCE, le=math.pi)
    weight: float = Field(default=1.0, gt=0.0, le=MAX_WEIGHT)  # factor of its share of a sum of errors
    on: ObstacleName = ""  # obstacle that tool and payload may touch there; empty for the one beyond the tip
    into: ObstacleName = ""  # obstacle with a hole or a chuck, which tool and payload may enter there

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.axis is not None and self.orientation is not None:
            raise ValueError("expected axis or orientation, got both; an orientation states all axes")
        if self.orientation is not None and max(map(abs, self.orientation)) > 2 * math.pi:
            raise ValueError(
                f"orientation: expected roll, pitch, yaw within ±2π rad, got {list(self.orientation)} (90° is 1.5708)"
            )
        if self.axis is None and self.orientation is None and self.angle_tolerance is not None:
            raise ValueError("angle_tolerance needs an axis or an orientation")
        return self

    @model_serializer(mode="wrap")
    def _brief(self, handler: Any):  # a return type would replace the schema of the fields
        """Leave out values that are the defaults."""
        defaults = {name: field.default for name, field in type(self).model_fields.items()}
        return {name: value for name, value in handler(self).items() if value != defaults[name]}

    @property
    def is_plain(self) -> bool:
        """True if it is nothing but a position."""
        return not (self.name or self.description)

    @property
    def n_angular(self) -> int:
        """Number of angles that count: 0, AXIS or ORIENTATION."""
        return AXIS if self.axis is not None else ORIENTATION if self.orientation is not None else 0

    @property
    def rotation(self) -> np.ndarray:
        """(3, 3) the tool's axes in the world as columns; axes that do not count are arbitrary."""
        if self.axis is not None:
            return rotation_to_axis(self.axis)
        return np.eye(3) if self.orientation is None else rotation_from_rpy(*self.orientation)

    @property
    def description(self) -> str:
        """Everything but the position, on one line; empty for a plain point."""
        parts = [] if self.axis is None else [f"axis {_vector(self.axis)}"]
        parts += [] if self.orientation is None else [f"orientation {_vector(self.orientation)} rad"]
        parts += [] if self.tolerance is None else [f"tolerance {1e3 * self.tolerance:g} mm"]
        parts += [] if self.angle_tolerance is None else [f"angle tolerance {math.degrees(self.angle_tolerance):.4g}°"]
        parts += [f"weight {self.weight:g}"] * (self.weight != 1.0)
        parts += [f"{word} {name}" for word, name in (("on", self.on), ("into", self.into)) if name]
        return ", ".join(parts)


def describe_targets(specs: Sequence[Point | Target]) -> list[str]:
    """Describe targets with more than a position, one line for equal ones; numbers count from 1."""
    numbers: dict[str, list[int]] = {}
    for number, target in enumerate(specs, start=1):
        if isinstance(target, Target) and target.description:
            numbers.setdefault(target.description, []).append(number)
    return [
        f"target{'s' if len(group) > 1 else ''} {', '.join(map(str, group))}: {description}"
        for description, group in numbers.items()
    ]


def _vector(values: Point) -> str:
    return "(" + ", ".join(f"{value + 0.0:.4g}" for value in values) + ")"


@lru_cache
def stack_targets(records: tuple[Target | None, ...], restarts: int) -> TargetArrays:
    """Stack targets into arrays; None stands for a point alone."""
    targets = [record or Target(position=(0.0, 0.0, 0.0)) for record in records]
    return TargetArrays(
        n_angular=np.array([target.n_angular for target in targets], dtype=np.intp),
        rotation=np.array([target.rotation for target in targets]),
        tolerance=np.array([target.tolerance or REACHED for target in targets]),
        angle_tolerance=np.array([target.angle_tolerance or ALIGNED for target in targets]),
        weight=np.array([target.weight for target in targets]),
        stated_tolerance=np.array([target.tolerance or 0.0 for target in targets]),
        stated_angle_tolerance=np.array([target.angle_tolerance or 0.0 for target in targets]),
        restarts=restarts,
    )


def position_targets(n: int, restarts: int = 0) -> TargetArrays:
    """Return the arrays of `n` points, whose tolerances and weights are the defaults."""
    return stack_targets((None,) * n, restarts)
