"""The task: points that the tip of the arm should reach, and which way it should point there."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Self, cast

import numpy as np
from pydantic import (
    BaseModel,
    BeforeValidator,
    Field,
    ModelWrapValidatorHandler,
    PrivateAttr,
    ValidationError,
    ValidationInfo,
    field_serializer,
    field_validator,
    model_validator,
)  # fmt: skip

from armwright.arrays import LARGEST_OBJECTIVE, Array
from armwright.files import check_name
from armwright.tasks.cycle import IN_ORDER, Cycle, read_cycle, target_indices
from armwright.tasks.moments import MAX_MASS
from armwright.tasks.motions import CyclePlan, along_line, plan_cycle
from armwright.tasks.obstacles import MAX_OBSTACLES, Obstacle, read_obstacle
from armwright.tasks.payload import POINT_LOAD, LoadShape, Payload, read_payload
from armwright.tasks.targets import (
    MAX_COORDINATE,
    Point,
    Target,
    TargetArrays,
    check_length,
    position_targets,
    stack_targets,
)
from armwright.tasks.tool import NO_TOOL, Tool, read_tool
from armwright.tasks.workspace import MAX_POINTS, MAX_POSES, MAX_REGIONS, Region
from armwright.yaml_documents import check_document

MAX_PAYLOAD_FACTOR = 100.0
MAX_NOISE = 1.0  # [m]
MAX_TARGETS = 10_000
MAX_RESTARTS = 100
MAX_DEPTH = 1e-3  # [m] of a line in an obstacle


def _listed(workspace: Any) -> list[Any]:
    """Return a box, or a list of them, as a list."""
    if isinstance(workspace, (dict, Region)):
        return [workspace]
    if isinstance(workspace, (list, tuple)):
        return list(cast("list[Any]", workspace))
    raise ValueError("workspace: expected {low: [x, y, z], high: [x, y, z], points: 200} [m], or a list of such boxes")


class Task(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Points that the tip should reach, and what else the arm has to do.

    Attributes:
        targets: Points [m]. Tool directions, tolerances and weights of targets are in `target_arrays`.
        tool: The tool at the end of the last link.
        payload: Mass that the tip carries, a point at all targets or at each [kg]; or a rigid body.
        payload_factors: Factors by which the payload may be heavier; each objective takes its worst case.
        target_noise: Distance by which all targets may be off along x, y or z [m]; likewise.
        restarts: Further starts of the inverse kinematics at each target, of which the best posture counts.
        obstacles: What the arm should keep away from; used by the objectives of clearance.
        cycle: Steps from target to target; `in_order` is a line to each target in turn.
        workspace: Boxes that the tip should cover. If targets are left out, they are the corners of the boxes.
        objectives: Names of the minimised objectives; by default the paper's two, and orientation_error if a
            target has a tool direction.
        constraints: Bounds that a design must satisfy, such as "torque_utilisation <= 0.8".
        resolution: Differences of objectives that do not matter, by name; of designs that differ by no more, `armwright
            design` reports one.
    """

    entry_records: ClassVar[Mapping[str, type]] = {"targets": Target}  # for messages: records that a list may hold

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")  # also names run folders
    targets: tuple[Point, ...] = Field(max_length=MAX_TARGETS)
    tool: Tool = NO_TOOL
    payload: float | tuple[float, ...] | Payload = 0.0
    payload_factors: tuple[Annotated[float, Field(ge=0.0, le=MAX_PAYLOAD_FACTOR)], ...] = Field(
        default=(), max_length=10
    )
    target_noise: float = Field(default=0.0, ge=0.0, le=MAX_NOISE)
    obstacles: tuple[Obstacle, ...] = Field(default=(), max_length=MAX_OBSTACLES)
    restarts: int = Field(default=0, ge=0, le=MAX_RESTARTS)
    cycle: Cycle | None = None
    workspace: Annotated[tuple[Region, ...], BeforeValidator(_listed)] = Field(default=(), max_length=MAX_REGIONS)
    objectives: tuple[str, ...] | None = None
    constraints: tuple[str, ...] = ()
    # One value per objective; for the paper's two: position error [m], torque [N m] times 40.
    reference_point: tuple[float, ...] | None = Field(default=None, min_length=1)
    resolution: tuple[tuple[str, Annotated[float, Field(gt=0.0)]], ...] = ()
    description: str = Field(default="", max_length=10_000)  # what the arm has to do; shown to proposers
    provenance: str = Field(default="", max_length=10_000)  # where the points come from
    _records: tuple[Target | None, ...] = PrivateAttr(())  # None for plain points; empty if all are

    @model_validator(mode="wrap")
    @classmethod
    def _take_records(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Separate the points of all targets from the records of those that have one."""
        given = cast("dict[str, Any]", data).get("targets") if isinstance(data, dict) else None
        if not isinstance(given, (list, tuple)):
            return handler(data)._checked()
        entries = cast("list[Any]", given)
        records = tuple(_read_target(entry, number) for number, entry in enumerate(entries, start=1))
        points = [entry if record is None else record.position for entry, record in zip(entries, records, strict=True)]
        task = handler({**cast("dict[str, Any]", data), "targets": points})
        kept = tuple(record if record is not None and not record.is_plain else None for record in records)
        if any(kept):
            task._records = kept  # pyright: ignore[reportAttributeAccessIssue] - only the fields are frozen
        return task._checked()

    def _checked(self) -> Self:
        """Return the task; ValueError if its cycle does not fit the targets."""
        names = [name for name in self._names if name]
        repeated = next((name for name in names if names.count(name) > 1), None)
        if repeated is not None:
            raise ValueError(f'targets: two are named "{repeated}"; give each its own name')
        if self.cycle is not None:
            _check_obstacles(self.plan(self.target_positions), self.obstacles)
        return self

    @field_validator("name")
    @classmethod
    def _check_name(cls, name: str) -> str:
        return check_name(name)

    @field_validator("resolution", mode="before")
    @classmethod
    def _mapping_to_pairs(cls, value: Any) -> Any:
        if isinstance(value, dict):
            return tuple(cast("dict[str, Any]", value).items())
        if isinstance(value, tuple):  # of pairs, from a task
            return cast("Any", value)
        raise ValueError("expected objectives and their resolutions, such as {worst_error: 0.0005, price: 5}")

    @field_serializer("resolution")
    def _pairs_to_mapping(self, value: tuple[tuple[str, float], ...]) -> dict[str, float]:
        return dict(value)

    @field_serializer("targets")
    def _with_records(self, targets: tuple[Point, ...]) -> tuple[Point | Target, ...]:
        return self.target_specs

    @field_validator("obstacles", mode="before")
    @classmethod
    def _read_obstacles(cls, value: Any) -> Any:
        if not isinstance(value, (list, tuple)):
            raise ValueError("expected a list of records, such as {kind: ground, z: 0.0}")
        records = cast("list[Any]", value)
        return [read_obstacle(record, number) for number, record in enumerate(records, start=1)]

    @model_validator(mode="before")
    @classmethod
    def _take_corners(cls, content: Any) -> Any:
        if not isinstance(content, dict) or "targets" in content or "workspace" not in content:
            return cast("Any", content)
        try:
            regions = [Region.model_validate(region) for region in _listed(content["workspace"])]
        except ValidationError:
            corners = ((0.0, 0.0, 0.0),)  # the field `workspace` itself reports what is wrong
        else:
            corners = tuple(dict.fromkeys(corner for region in regions for corner in region.corners))
        return {**cast("dict[str, Any]", content), "targets": corners}

    @model_validator(mode="before")
    @classmethod
    def _read_bodies(cls, content: Any) -> Any:
        if not isinstance(content, dict):
            return content
        given = cast("dict[str, Any]", content)
        readers = {"tool": read_tool, "payload": read_payload}
        return {**given, **{key: read(given[key]) for key, read in readers.items() if key in given}}

    @field_validator("cycle", mode="before")
    @classmethod
    def _expand_in_order(cls, value: Any, info: ValidationInfo) -> Any:
        if isinstance(value, str) and value != IN_ORDER:
            raise ValueError(f"expected {IN_ORDER} or a record with steps, such as {{steps: [{{to: 1}}, {{to: 2}}]}}")
        return read_cycle(value, len(info.data.get("targets", ())))

    @model_validator(mode="after")
    def _check_numbers(self) -> Self:
        if not self.targets:
            raise ValueError("targets is empty: give at least one point [x, y, z] in metres")
        for number, point in enumerate(self.targets, start=1):
            if max(abs(c) for c in point) > MAX_COORDINATE:
                raise ValueError(
                    f"target {number} = {list(point)} m is more than {MAX_COORDINATE:g} m away; "
                    "coordinates are in metres (armwright init --from FILE --unit mm converts)"
                )
        if isinstance(self.payload, tuple) and len(self.payload) != len(self.targets):
            raise ValueError(f"payload: expected 1 or {len(self.targets)} values [kg], got {len(self.payload)}")
        if not np.all((self.payloads >= 0.0) & (self.payloads <= MAX_MASS)):
            raise ValueError(f"payload: expected 0 to {MAX_MASS:g} kg, got {self.payload} kg")
        if self.cycle is not None and isinstance(self.payload, tuple):
            raise ValueError("payload: expected one value for the whole cycle, got a list")
        if sum(region.points for region in self.workspace) > MAX_POINTS:
            raise ValueError(f"workspace: expected at most {MAX_POINTS} points in all boxes together")
        n_poses = sum(region.points * region.directions.count for region in self.workspace if region.directions)
        if n_poses > MAX_POSES:
            raise ValueError(
                f"workspace: expected at most {MAX_POSES} points x directions in all boxes together, got {n_poses}; "
                "try fewer points"
            )
        if any(not 0.0 < value <= LARGEST_OBJECTIVE for value in self.reference_point or ()):
            raise ValueError(
                f"reference_point: expected values above 0 and at most {LARGEST_OBJECTIVE:g}, "
                f"got {list(self.reference_point or ())}"
            )
        return self

    @property
    def target_positions(self) -> np.ndarray:
        """Positions of the targets, (T, 3) [m]."""
        return np.array(self.targets, dtype=np.float64)

    @property
    def target_specs(self) -> tuple[Point | Target, ...]:
        """The targets as in a task file: a point, or a record if it has more than a position."""
        if not self._records:
            return self.targets
        return tuple(record or point for point, record in zip(self.targets, self._records, strict=True))

    @property
    def target_arrays(self) -> TargetArrays:
        """Tool directions, tolerances and weights of the targets, as arrays."""
        if not self._records:
            return position_targets(len(self.targets), self.restarts)
        return stack_targets(self._records, self.restarts)

    @property
    def is_plain(self) -> bool:
        """True if the targets are plain points, solved from one start and in one case."""
        return not self._records and self.restarts == 0 and len(self.cases) == 1

    @property
    def cases(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Nominal (T, 3) positions [m] and (T,) payloads [kg], then those of each variation."""
        noise, targets, payloads = self.target_noise, self.target_positions, self.payloads
        shifts = [sign * noise * axis for axis in np.eye(3) for sign in (-1.0, 1.0)] if noise > 0.0 else []
        heavier = [(targets, factor * payloads) for factor in self.payload_factors]
        return [(targets, payloads), *heavier, *((targets + shift, payloads) for shift in shifts)]

    @property
    def cases_description(self) -> str:
        """The variations in `cases` other than the nominal task; empty if there are none."""
        factors = ", ".join(f"{factor:g}" for factor in self.payload_factors)
        parts = [f"of payloads {factors} times as heavy"] if factors else []
        if self.target_noise > 0.0:
            parts.append(f"of targets that are all {1e3 * self.target_noise:g} mm off along x, y or z")
        return ", and ".join(parts)

    @property
    def payloads(self) -> np.ndarray:
        """Mass that the tip carries at each target, (T,) [kg]."""
        masses = self.payload.mass if isinstance(self.payload, Payload) else self.payload
        return np.broadcast_to(np.array(masses, dtype=np.float64), (len(self.targets),)).copy()

    @property
    def load_shape(self) -> LoadShape:
        """How the mass of the payload is distributed."""
        return self.payload.shape if isinstance(self.payload, Payload) else POINT_LOAD

    @property
    def target_names(self) -> tuple[str, ...]:
        """Name of each target; its number, counted from 1, if it has none."""
        return tuple(name or str(number) for number, name in enumerate(self._names, start=1))

    @property
    def _names(self) -> tuple[str, ...]:
        records = self._records or (None,) * len(self.targets)
        return tuple("" if record is None else record.name for record in records)

    @property
    def _numbers(self) -> dict[str, int]:
        """The index of each target that has a name."""
        return {name: index for index, name in enumerate(self._names) if name}

    @property
    def cycle_description(self) -> str:
        """The steps of the cycle on one line; empty without a cycle."""
        if self.cycle is None:
            return ""
        steps = target_indices(self.cycle.steps, self._numbers, len(self.targets))
        return self.cycle.describe([self.target_names[i] for i in steps])

    def plan(self, positions: Array) -> CyclePlan:
        """Return the motions of the cycle with the targets at these positions (T, 3) [m].

        Raises:
            ValueError: The task has no cycle, or one that no arm can follow.
        """
        if self.cycle is None:
            raise ValueError(f"task {self.name} has no cycle; try cycle: {IN_ORDER}")
        targets = target_indices(self.cycle.steps, self._numbers, len(positions))
        return plan_cycle(self.cycle, targets, positions, self.target_arrays)


def _check_obstacles(plan: CyclePlan, obstacles: Sequence[Obstacle]) -> None:
    """Raise ValueError if a line of the tip goes through an obstacle."""
    share = np.linspace(0.0, 1.0, 201)
    for motion in plan.motions:
        if motion.by == "joint":
            continue
        points = along_line(plan.poses, motion.start, motion.end, share).position
        for number, obstacle in enumerate(obstacles, start=1):
            inside = obstacle.solid.contains(points, MAX_DEPTH)
            if inside.any():
                name = f'"{obstacle.name}"' if obstacle.name else str(number)
                raise ValueError(
                    f"step {motion.step + 1}: the line goes through obstacle {name} at "
                    f"{[round(float(c), 3) for c in points[np.argmax(inside)]]} m; add a target on the way around it"
                )


def _read_target(entry: Any, number: int) -> Target | None:
    """Return the target of a record; None for anything else, such as a plain point."""
    if isinstance(entry, dict):
        return check_document(cast("dict[Any, Any]", entry), Target, ValueError, f"target {number}")
    try:
        check_length(entry)
    except ValueError as fault:
        raise ValueError(f"target {number}: {fault}") from None
    return entry if isinstance(entry, Target) else None
