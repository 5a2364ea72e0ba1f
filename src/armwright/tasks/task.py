"""The task: points that the tip of the arm should reach, and which way it should point there."""

from collections import Counter
from collections.abc import Sequence
from typing import Annotated, Any, Self, cast

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    Field,
    PlainSerializer,
    ValidationError,
    ValidationInfo,
    model_validator,
)  # fmt: skip

from armwright.arrays import LARGEST_OBJECTIVE, Array
from armwright.files import check_name
from armwright.tasks.cycle import IN_ORDER, Cycle, target_indices
from armwright.tasks.moments import Mass
from armwright.tasks.motions import CyclePlan, plan_cycle
from armwright.tasks.obstacles import MAX_OBSTACLES, Obstacle, Solid
from armwright.tasks.payload import POINT_LOAD, LoadShape, Payload
from armwright.tasks.poses import along_line
from armwright.tasks.targets import MAX_COORDINATE, Point, Target, TargetArrays, TargetPoint, stack_targets
from armwright.tasks.tip_rules import Solids, TipRules, allowed_depths, placed, tip_solids
from armwright.tasks.tool import NO_TOOL, Tool
from armwright.tasks.workspace import MAX_POINTS, MAX_POSES, MAX_REGIONS, Region

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


def _plain(target: Point | Target) -> Point | Target:
    """Return the point of a target that is nothing else."""
    return target.position if isinstance(target, Target) and target.is_plain else target


def _expand_in_order(value: Any, info: ValidationInfo) -> Any:
    if isinstance(value, str) and value != IN_ORDER:
        raise ValueError(f"expected {IN_ORDER} or a record with steps, such as {{steps: [{{to: 1}}, {{to: 2}}]}}")
    if value != IN_ORDER:
        return value
    numbers = range(1, len(info.data.get("targets", ())) + 1)
    return {"closed": False, "steps": [{"to": number, "by": "line"} for number in numbers]}


def _mapping_to_pairs(value: Any) -> Any:
    if isinstance(value, dict):
        return tuple(cast("dict[str, Any]", value).items())
    if isinstance(value, tuple):  # of pairs, from a task
        return cast("Any", value)
    raise ValueError("expected objectives and their resolutions, such as {worst_error: 0.0005, price: 5}")


class Task(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Points that the tip should reach, and what else the arm has to do."""

    name: Annotated[str, AfterValidator(check_name)] = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")
    # Points [m], or records with a tool direction, a tolerance, a weight or a name; by default the workspace's corners.
    targets: tuple[Annotated[TargetPoint | Target, AfterValidator(_plain)], ...] = Field(
        min_length=1, max_length=MAX_TARGETS
    )
    tool: Tool = NO_TOOL  # at the end of the last link
    # Mass that the tip carries, a point at all targets or at each [kg]; or a rigid body
    payload: Mass | tuple[Mass, ...] | Payload = 0.0
    # Factors by which the payload may be heavier; each objective takes its worst case.
    payload_factors: tuple[Annotated[float, Field(ge=0.0, le=MAX_PAYLOAD_FACTOR)], ...] = Field(
        default=(), max_length=10
    )
    target_noise: float = Field(default=0.0, ge=0.0, le=MAX_NOISE)  # by which all targets may be off along an axis [m]
    obstacles: tuple[Obstacle, ...] = Field(default=(), max_length=MAX_OBSTACLES)  # for the objectives of clearance
    restarts: int = Field(default=0, ge=0, le=MAX_RESTARTS)  # further starts of the inverse kinematics at each target
    cycle: Annotated[Cycle | None, BeforeValidator(_expand_in_order)] = (
        None  # `in_order`: a line to each target in turn
    )
    # Boxes that the tip should cover
    workspace: Annotated[tuple[Region, ...], BeforeValidator(_listed)] = Field(default=(), max_length=MAX_REGIONS)
    # By default the paper's two, and orientation_error if a target has a tool direction
    objectives: tuple[str, ...] | None = None
    constraints: tuple[str, ...] = ()  # such as "torque_utilisation <= 0.8"
    # One value per objective; for the paper's two: position error [m], torque [N m] times 40.
    reference_point: tuple[Annotated[float, Field(gt=0.0, le=LARGEST_OBJECTIVE)], ...] | None = Field(
        default=None, min_length=1
    )
    # Differences of objectives that do not matter, by name; of designs that differ by no more, `design` reports one.
    resolution: Annotated[
        tuple[tuple[str, Annotated[float, Field(gt=0.0)]], ...],
        BeforeValidator(_mapping_to_pairs),
        PlainSerializer(dict, return_type=dict[str, float]),
    ] = ()
    description: str = Field(default="", max_length=10_000)  # what the arm has to do; shown to proposers
    provenance: str = Field(default="", max_length=10_000)  # where the points come from

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

    @model_validator(mode="after")
    def _check_numbers(self) -> Self:
        far = np.abs(self.target_positions).max(axis=1) > MAX_COORDINATE
        if far.any():
            number = int(np.argmax(far))
            raise ValueError(
                f"target {number + 1} = {self.target_positions[number].tolist()} m is more than {MAX_COORDINATE:g} m "
                "away; coordinates are in metres (armwright init --from FILE --unit mm converts)"
            )
        if isinstance(self.payload, tuple) and len(self.payload) != len(self.targets):
            raise ValueError(f"payload: expected 1 or {len(self.targets)} values [kg], got {len(self.payload)}")
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
        repeated = [name for name, count in Counter(filter(None, self._names)).items() if count > 1]
        if repeated:
            raise ValueError(f'targets: two are named "{repeated[0]}"; give each its own name')
        allowed_depths(self._records, self.target_arrays, self.obstacles, {})  # raises for unknown names
        if self.cycle is not None:
            _check_obstacles(self.plan(self.target_positions), self.obstacles)
        return self

    @property
    def target_positions(self) -> np.ndarray:
        """Positions of the targets, (T, 3) [m]."""
        points = [target.position if isinstance(target, Target) else target for target in self.targets]
        return np.array(points, dtype=np.float64)

    @property
    def _records(self) -> tuple[Target | None, ...]:
        """The target if it is more than a point, else None."""
        return tuple(target if isinstance(target, Target) else None for target in self.targets)

    @property
    def target_arrays(self) -> TargetArrays:
        """Tool directions, tolerances and weights of the targets, as arrays."""
        return stack_targets(self._records, self.restarts)

    @property
    def is_plain(self) -> bool:
        """True if the targets are plain points, solved from one start and in one case."""
        return not any(self._records) and self.restarts == 0 and len(self.cases) == 1

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
    def tip_rules(self) -> TipRules:
        """Tool and payload as bodies at the T targets, and what they may touch there."""
        allowed = allowed_depths(self._records, self.target_arrays, self.obstacles, self.tip_solids)
        return TipRules(self.payloads > 0.0, allowed, self.tip_solids)

    @property
    def tip_solids(self) -> Solids:
        """`tool` and `payload` in the tip frame, those that are bodies."""
        return tip_solids(self.tool, self.payload if isinstance(self.payload, Payload) else None)

    @property
    def bodies_at_targets(self) -> list[Solid]:
        """Tool and payload at the targets that state a direction; angles that do not count are arbitrary."""
        arrays, carried = self.target_arrays, self.payloads > 0.0
        if self.cycle is not None:
            carried &= self.plan(self.target_positions).holds_payload(len(carried))
        return [
            placed(solid, self.target_positions[i], arrays.rotation[i])
            for i in np.flatnonzero(arrays.n_angular).tolist()
            for name, solid in self.tip_solids.items()
            if name == "tool" or carried[i]
        ]

    @property
    def target_names(self) -> tuple[str, ...]:
        """Name of each target; its number, counted from 1, if it has none."""
        return tuple(name or str(number) for number, name in enumerate(self._names, start=1))

    @property
    def _names(self) -> tuple[str, ...]:
        return tuple("" if record is None else record.name for record in self._records)

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

        Raises ValueError if the task has no cycle, or one that no arm can follow.
        """
        if self.cycle is None:
            raise ValueError(f"task {self.name} has no cycle; try cycle: {IN_ORDER}")
        targets = target_indices(self.cycle.steps, self._numbers, len(positions))
        return plan_cycle(self.cycle, targets, positions, self.target_arrays, self.tip_rules)


def _check_obstacles(plan: CyclePlan, obstacles: Sequence[Obstacle]) -> None:
    """Raise ValueError if a line of the tip goes through an obstacle."""
    share = np.linspace(0.0, 1.0, 201)
    for motion in plan.motions:
        if motion.by == "joint":
            continue
        points = along_line(plan.poses, motion.start, motion.end, share).position
        allowed = plan.rules(motion, share).allowed
        for number, obstacle in enumerate(obstacles, start=1):
            inside = obstacle.solid.signed_distance(points) < -np.maximum(allowed[:, number - 1], MAX_DEPTH)
            if inside.any():
                name = f'"{obstacle.name}"' if obstacle.name else str(number)
                raise ValueError(
                    f"step {motion.step + 1}: the line goes through obstacle {name} at "
                    f"{[round(float(c), 3) for c in points[np.argmax(inside)]]} m; add a target on the way around it"
                )
