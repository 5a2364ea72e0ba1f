"""The task: points that the tip of the arm should reach, and which way it should point there."""

import os
import re
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal, Self, cast

import numpy as np
from pydantic import (
    BaseModel,
    Field,
    ModelWrapValidatorHandler,
    PrivateAttr,
    ValidationError,
    field_serializer,
    field_validator,
    model_validator,
)  # fmt: skip

from armwright.exceptions import TaskError, did_you_mean
from armwright.files import check_name
from armwright.tasks.moves import MOVE_STEP, Moves, check_moves, check_times
from armwright.tasks.obstacles import MOST_OBSTACLES, Obstacle, check_obstacle
from armwright.tasks.targets import (
    LARGEST_COORDINATE,
    Point,
    Target,
    TargetArrays,
    position_targets,
    read_target,
    stack_targets,
)
from armwright.tasks.workspace import MOST_POINTS, MOST_REGIONS, Region
from armwright.yaml_documents import parse_document, read_document

LARGEST_PAYLOAD = 1e4  # [kg]
MOST_TIMES_PAYLOAD = 100.0
LARGEST_NOISE = 1.0  # [m]
MOST_TARGETS = 10_000
MOST_RESTARTS = 100
IN_ORDER = "in_order"  # of moves: from each target to the next
_FOLDER = resources.files("armwright.tasks") / "builtin"
_RANDOM = re.compile(r"random-(0|[1-9]\d{0,8})")


class Task(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Target points [m], and what belongs to them: the hypervolume's reference point, where they come from.

    targets: points; where records are given that say more (`Target`), that is in `target_specs` and `target_arrays`.
    payload: what the tip carries at all targets, or at each [kg].
    payload_factors: the payload may also be so many times as heavy; the worst case counts, in each objective.
    target_noise: the targets may also be off by so much along x, y or z, all together; likewise [m].
    restarts: further starts of the inverse kinematics at each target, of which the best posture counts.
    obstacles: what the arm should keep away from; they count where an objective is of clearance.
    moves: straight lines that the tip goes along, as pairs of targets counted from 1, or from each target to the next.
    move_step: from one sample of such a line to the next, at most [m].
    move_time: of every move, or of each, from rest to rest [s].
    workspace: boxes that the tip should cover; where targets are left out, these are the boxes' corners.
    objectives: names of the minimised objectives; by default the paper's two, and orientation_error if a
        target has a tool direction.
    constraints: bounds that a design must satisfy, such as "torque_utilisation <= 0.8".
    """

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")  # of run folders, too
    targets: tuple[Point, ...]
    payload: float | tuple[float, ...] = 0.0
    payload_factors: tuple[Annotated[float, Field(ge=0.0, le=MOST_TIMES_PAYLOAD)], ...] = Field(
        default=(), max_length=10
    )
    target_noise: float = Field(default=0.0, ge=0.0, le=LARGEST_NOISE)
    obstacles: tuple[Obstacle, ...] = ()
    restarts: int = Field(default=0, ge=0, le=MOST_RESTARTS)
    moves: Literal["in_order"] | tuple[tuple[int, int], ...] = ()
    move_step: Annotated[float, Field(gt=0.0, le=LARGEST_COORDINATE)] = MOVE_STEP
    move_time: float | tuple[float, ...] | None = None
    workspace: tuple[Region, ...] = ()
    objectives: tuple[str, ...] | None = None
    constraints: tuple[str, ...] = ()
    # One value an objective; of the paper's: (position error [m], torque [α-scaled]).
    reference_point: tuple[float, ...] | None = Field(default=None, min_length=1)
    description: str = Field(default="", max_length=10_000)  # what the arm has to do; proposers are told
    provenance: str = Field(default="", max_length=10_000)  # where the points come from
    _records: tuple[Target | None, ...] = PrivateAttr(())  # of each target that says more; empty where none does

    @model_validator(mode="wrap")
    @classmethod
    def _take_records(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Points of all targets, and the records of those that have one, apart."""
        given = cast("dict[str, Any]", data).get("targets") if isinstance(data, dict) else None
        if not isinstance(given, (list, tuple)):
            return handler(data)
        entries = cast("list[Any]", given)
        records = tuple(
            read_target(entry, number) if isinstance(entry, (dict, Target)) else None
            for number, entry in enumerate(entries, start=1)
        )
        points = [entry if record is None else record.position for entry, record in zip(entries, records, strict=True)]
        task = handler({**cast("dict[str, Any]", data), "targets": points})
        kept = tuple(record if record is not None and record.description else None for record in records)
        if any(kept):
            task._records = kept  # pyright: ignore[reportAttributeAccessIssue] - frozen are the fields alone
        return task

    @field_validator("name")
    @classmethod
    def _check_name(cls, name: str) -> str:
        return check_name(name)

    @field_serializer("targets")
    def _with_records(self, targets: tuple[Point, ...]) -> tuple[Point | Target, ...]:
        return self.target_specs

    @field_validator("obstacles", mode="before")
    @classmethod
    def _check_obstacles(cls, value: Any) -> Any:
        if not isinstance(value, (list, tuple)):
            raise ValueError("obstacles is a list of records, such as {kind: ground, z: 0.0}")
        records = cast("list[Any]", value)
        if len(records) > MOST_OBSTACLES:
            raise ValueError(f"obstacles has {len(records)} records; at most {MOST_OBSTACLES} are allowed")
        for number, record in enumerate(records, start=1):
            check_obstacle(record, number)
        return records

    @model_validator(mode="before")
    @classmethod
    def _take_corners(cls, content: Any) -> Any:
        if not isinstance(content, dict) or "targets" in content or "workspace" not in content:
            return cast("Any", content)
        try:
            regions = [Region.model_validate(region) for region in _listed(content["workspace"])]
        except ValidationError:
            corners = ((0.0, 0.0, 0.0),)  # what is wrong with the workspace is said of itself, by its field
        else:
            corners = tuple(dict.fromkeys(corner for region in regions for corner in region.corners))
        return {**cast("dict[str, Any]", content), "targets": corners}

    @field_validator("workspace", mode="before")
    @classmethod
    def _check_workspace(cls, value: Any) -> Any:
        regions = _listed(value)
        if len(regions) > MOST_REGIONS:
            raise ValueError(f"workspace has {len(regions)} boxes; at most {MOST_REGIONS} are allowed")
        return regions

    @field_validator("moves", mode="before")
    @classmethod
    def _check_moves(cls, value: Any) -> Any:
        pairs = cast("list[Any]", value) if isinstance(value, (list, tuple)) else [None]
        if value != IN_ORDER and not all(_is_pair(pair) for pair in pairs):
            raise ValueError(f"moves is {IN_ORDER}, or a list of pairs of targets counted from 1: [[1, 2], [2, 3]]")
        return cast("Any", value)

    @model_validator(mode="after")
    def _check_numbers(self) -> Self:
        if not self.targets:
            raise ValueError("targets is empty: give at least one point [x, y, z] in metres")
        if len(self.targets) > MOST_TARGETS:
            raise ValueError(f"targets has {len(self.targets)} points; at most {MOST_TARGETS} are allowed")
        for number, point in enumerate(self.targets, start=1):
            if max(abs(c) for c in point) > LARGEST_COORDINATE:
                raise ValueError(
                    f"target {number} = {list(point)} m is more than {LARGEST_COORDINATE:g} m away; "
                    "coordinates are in metres (armwright init --from FILE --unit mm converts)"
                )
        payloads = self.payload if isinstance(self.payload, tuple) else (self.payload,)
        if isinstance(self.payload, tuple) and len(self.payload) != len(self.targets):
            raise ValueError(f"payload has {len(self.payload)} values for {len(self.targets)} targets; give one or all")
        if not all(0.0 <= kg <= LARGEST_PAYLOAD for kg in payloads):
            raise ValueError(f"payload = {self.payload} kg is outside 0 <= payload <= {LARGEST_PAYLOAD:g} kg")
        if self.moves == IN_ORDER and len(self.targets) < 2:
            raise ValueError(f"moves: {IN_ORDER} needs two targets or more")
        check_moves([(start + 1, end + 1) for start, end in self.straight_moves.pairs], self.targets, self.move_step)
        if self.move_time is not None:
            check_times(self.move_time, len(self.straight_moves))
        if sum(region.points for region in self.workspace) > MOST_POINTS:
            raise ValueError(f"workspace has more than {MOST_POINTS} points together")
        if self.reference_point is not None and min(self.reference_point) <= 0.0:
            raise ValueError(f"reference_point = {list(self.reference_point)} must be above 0 in each objective")
        return self

    @property
    def target_positions(self) -> np.ndarray:
        """The targets as an array (T, 3) [m]."""
        return np.array(self.targets, dtype=np.float64)

    @property
    def target_specs(self) -> tuple[Point | Target, ...]:
        """The targets as a task file has them: a record where one says more than its point."""
        if not self._records:
            return self.targets
        return tuple(record or point for point, record in zip(self.targets, self._records, strict=True))

    @property
    def target_arrays(self) -> TargetArrays:
        """How the targets are to be reached."""
        if not self._records:
            return position_targets(len(self.targets), self.restarts)
        return stack_targets(self._records, self.restarts)

    @property
    def is_plain(self) -> bool:
        """Whether the targets are points and nothing else, from one start, in one case."""
        return not self._records and self.restarts == 0 and len(self.cases) == 1

    @property
    def cases(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """(T, 3) points [m] and (T,) payloads [kg]: as the task stands, then each by itself that it may come to."""
        noise = self.target_noise
        shifts = [sign * noise * axis for axis in np.eye(3) for sign in (-1.0, 1.0)] if noise > 0.0 else []
        heavier = [(self.target_positions, factor * self.payloads) for factor in self.payload_factors]
        return [
            (self.target_positions, self.payloads),
            *heavier,
            *((self.target_positions + shift, self.payloads) for shift in shifts),
        ]

    @property
    def cases_description(self) -> str:
        """What the task may come to beside what it says; empty for nothing."""
        factors = ", ".join(f"{factor:g}" for factor in self.payload_factors)
        found = [f"of payloads {factors} times as heavy"] if factors else []
        if self.target_noise > 0.0:
            found.append(f"of targets that are all {1e3 * self.target_noise:g} mm off along x, y or z")
        return ", and ".join(found)

    @property
    def payloads(self) -> np.ndarray:
        """What the tip carries at each target, (T,) [kg]."""
        return np.broadcast_to(np.array(self.payload, dtype=np.float64), (len(self.targets),)).copy()

    @property
    def straight_moves(self) -> Moves:
        """The straight moves, with targets counted from 0."""
        if self.moves == IN_ORDER:
            pairs = tuple((i, i + 1) for i in range(len(self.targets) - 1))
        else:
            pairs = tuple((start - 1, end - 1) for start, end in self.moves)
        times = () if self.move_time is None else self.move_time
        return Moves(pairs, self.move_step, times if isinstance(times, tuple) else (times,) * len(pairs))


def builtin_names() -> list[str]:
    """The names of the tasks that come with armwright, the paper's first."""
    names = [file.name.removesuffix(".yaml") for file in _FOLDER.iterdir() if file.name.endswith(".yaml")]
    return sorted(names, key=_file_order)


def builtin_tasks() -> dict[str, Task]:
    """The tasks that come with armwright, by name.

    Examples:
        >>> import armwright as aw
        >>> {name: len(task.targets) for name, task in aw.builtin_tasks().items() if name.startswith("target")}
        {'target-1': 8, 'target-2': 9, 'target-3': 8}
    """
    return {name: _builtin(name) for name in builtin_names()}


@cache
def _builtin(name: str) -> Task:
    file = _FOLDER / f"{name}.yaml"
    return parse_document(file.read_text(encoding="utf-8"), Task, TaskError, file.name)


def load_task(name_or_path: str | Path) -> Task:
    """A built-in task by its name, `random-N` of the seeded family, or the task of a YAML file.

    Examples:
        >>> import armwright as aw
        >>> aw.load_task("target-1").targets[0]
        (-0.45, -0.45, -0.45)
        >>> aw.load_task("target-4")
        Traceback (most recent call last):
        armwright.exceptions.TaskError: unknown task "target-4". Did you mean "target-3"? ...
    """
    known = builtin_names()
    if str(name_or_path) in known:
        return _builtin(str(name_or_path))
    if seeded := _RANDOM.fullmatch(str(name_or_path)):
        return random_task(int(seeded[1]))
    path = Path(name_or_path)
    if os.path.isfile(path):  # unlike Path.is_file, False for a name that is too long, too
        return read_document(path, Task, TaskError)
    if os.path.isdir(path):
        raise TaskError(f"{path} is a folder, not a task file")
    if path.suffix in (".yaml", ".yml"):
        raise TaskError(f"there is no file {path}; `armwright init {path}` writes one to edit")
    raise TaskError(
        f'unknown task "{name_or_path}".{did_you_mean(str(name_or_path), known)} '
        f"`armwright tasks` lists the {len(known)} built-in ones; random-N and YAML files are tasks, too"
    )


def random_task(seed: int) -> Task:
    """One of a family of tasks without symmetry, for benchmarks.

    6 to 12 points, uniform in a box; the box's centre is uniform in [-0.5, 0.5] x [-0.5, 0.5] x [0, 0.6] m,
    its half sides in [0.15, 0.6] m. Reference point as the paper's tasks.
    """
    rng = np.random.default_rng([0x61726D, seed])
    n = int(rng.integers(6, 13))
    centre = rng.uniform([-0.5, -0.5, 0.0], [0.5, 0.5, 0.6])
    half = rng.uniform(0.15, 0.6, 3)
    points = centre + half * rng.uniform(-1.0, 1.0, (n, 3))
    return Task(
        name=f"random-{seed}",
        targets=tuple((round(x, 4), round(y, 4), round(z, 4)) for x, y, z in points.tolist()),
        reference_point=(5.0, 5.0),
        description="Uniform points in a random box.",
        provenance=f"armwright.tasks.task.random_task({seed})",
    )


def _listed(workspace: Any) -> list[Any]:
    """One box, or a list of them, as a list."""
    if isinstance(workspace, (dict, Region)):
        return [workspace]
    if isinstance(workspace, (list, tuple)):
        return list(cast("list[Any]", workspace))
    raise ValueError("workspace is {low: [x, y, z], high: [x, y, z], points: 200} in metres, or a list of such boxes")


def _is_pair(value: Any) -> bool:
    if not isinstance(value, (list, tuple)):
        return False
    pair = cast("list[Any]", value)
    return len(pair) == 2 and all(isinstance(target, int) and not isinstance(target, bool) for target in pair)


def _file_order(name: str) -> tuple[int, str]:
    first = ("target-", "autodesign-", "slideopt-")
    return next((i for i, prefix in enumerate(first) if name.startswith(prefix)), len(first)), name
