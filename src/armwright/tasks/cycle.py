"""The cycle of a task: which targets the tool visits, in which order, how and in what time."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Literal, Self, cast

from pydantic import BaseModel, Field, StrictInt, StrictStr, model_validator

from armwright.exceptions import did_you_mean
from armwright.tasks.targets import MIN_TOLERANCE

By = Literal["line", "joint"]
Action = Literal["pick", "place"]

IN_ORDER = "in_order"  # a line to each target in turn
FASTEST = "fastest"
MAX_STEPS = 1000
MAX_DURATION = 1e4  # [s]
NEAR_LINE = 2e-3  # [m] from a line
NEAR_DIRECTION = 0.02  # [rad] likewise
_BY: Mapping[By, str] = {"line": "a line", "joint": "a joint motion"}


Duration = Literal["fastest"] | Annotated[float, Field(gt=0.0, le=MAX_DURATION)]  # [s]


class Strict(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """A record of a task file."""


class Step(Strict, frozen=True):
    """A motion to a target, and what happens there."""

    to: StrictStr | StrictInt  # name or number of the target; numbers count from 1
    by: By = "joint"  # straight line of the tool, or a straight line in joint space
    do: Action | None = None  # pick or place the payload on arrival
    # Duration from the previous target to this one [s], or fastest; by default the cycle's
    time: Duration | None = None


class PathTolerance(Strict, frozen=True):
    """Largest deviations of the tool along lines."""

    # Distance of the tip from the line [m]; None for NEAR_LINE
    path: float | None = Field(default=None, ge=MIN_TOLERANCE, le=1000.0)
    # Angle of the tool from its direction or orientation [rad]; None for NEAR_DIRECTION
    angle: float | None = Field(default=None, ge=MIN_TOLERANCE, le=3.2)

    @property
    def largest_distance(self) -> float:
        """The stated distance, else the default [m]."""
        return self.path or NEAR_LINE

    @property
    def largest_angle(self) -> float:
        """The stated angle, else the default [rad]."""
        return self.angle or NEAR_DIRECTION


class Cycle(Strict, frozen=True):
    """Steps from target to target, each from rest to rest.

    The cycle starts at rest at the target of its first step. If it is closed, the `by` and `time` of that step describe
    the way back to it, and its `do` happens on arrival.
    """

    steps: tuple[Step, ...] = Field(min_length=2, max_length=MAX_STEPS)
    closed: bool = True  # return to the first target at the end
    time: Duration = FASTEST  # duration of each step that does not state its own [s], or fastest
    dwell: float = Field(default=0.0, ge=0.0, le=MAX_DURATION)  # time at rest after each pick and place [s]
    # Length of the lines before and after each pick and place, along the tool's z axis [m]
    approach: float | None = Field(default=None, gt=0.0, le=1000.0)
    tolerance: PathTolerance = PathTolerance()  # largest deviations along lines

    @model_validator(mode="after")
    def _check_actions(self) -> Self:
        done = [(number, step.do) for number, step in enumerate(self.steps, start=1) if step.do]
        before = [done[-1], *done] if self.closed and done else done
        if done and not self.closed and done[0][1] == "place":
            raise ValueError(f"step {done[0][0]}: place without a pick before it")
        for (_, last), (number, action) in pairwise(before):
            if last == action:
                other = "pick" if action == "place" else "place"
                raise ValueError(f"step {number}: {action} without a {other} before it")
        return self

    def durations(self) -> tuple[float | None, ...]:
        """Return the duration of each step [s]; None for fastest."""
        times = [step.time or self.time for step in self.steps]
        return tuple(None if time == FASTEST else float(cast("float", time)) for time in times)

    def describe(self, names: Sequence[str]) -> str:
        """Return a description on one line; names: of each step's target."""

        def stop(index: int) -> str:
            action = self.steps[index].do
            return f"{names[index]} ({action})" if action else names[index]

        route = [stop(0), *(f"by {_BY[self.steps[i].by]} to {stop(i)}" for i in range(1, len(self.steps)))]
        route += [f"by {_BY[self.steps[0].by]} back to {names[0]}"] if self.closed else []
        lines = f"; lines of {1e3 * (self.approach or 0.0):g} mm before and after pick and place"
        return ", ".join(route) + (lines if self.approach else "")

    def describe_times(self) -> str:
        """Return a description of the durations."""
        times = self.durations()
        order = [*range(1, len(times)), *([0] if self.closed else [])]
        each = ["as fast as possible" if times[i] is None else f"{times[i]:g} s" for i in order]
        dwell = f"; {self.dwell:g} s at rest after each pick and place" if self.dwell else ""
        return (
            each[0] + (" for each step" if len(each) > 1 else "") if len(set(each)) == 1 else ", ".join(each)
        ) + dwell

    def carried(self) -> tuple[bool, ...]:
        """Return, for each step, whether the payload is carried on the way to its target."""
        if not any(step.do for step in self.steps):
            return (True,) * len(self.steps)
        holds = self.closed and [step.do for step in self.steps if step.do][-1] == "pick"
        loaded: list[bool] = []
        for step in self.steps:
            loaded.append(holds)
            holds = holds if step.do is None else step.do == "pick"
        return tuple(loaded)


def target_indices(steps: Sequence[Step], names: Mapping[str, int], n_targets: int) -> tuple[int, ...]:
    """Return the index of each step's target, counted from 0; ValueError if a step names one that does not exist."""
    return tuple(_index(number, step.to, names, n_targets) for number, step in enumerate(steps, start=1))


def _index(number: int, to: str | int, names: Mapping[str, int], n_targets: int) -> int:
    if isinstance(to, int):
        if not 1 <= to <= n_targets:
            raise ValueError(f"step {number}: there is no target {to}; targets are counted from 1 to {n_targets}")
        return to - 1
    if to not in names:
        known = f"Names: {', '.join(names)}" if names else "The targets have no names; use their numbers, from 1"
        raise ValueError(f'step {number}: unknown target "{to}".{did_you_mean(to, names)} {known}')
    return names[to]
