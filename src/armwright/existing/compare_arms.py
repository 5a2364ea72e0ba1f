"""Compare existing arms on a task with the designs of a run.

The base of an arm is given, or searched within the ranges of the design space: first for the smallest errors at the
targets, then for the smallest violation of constraints, then for the smallest torque. Reach, payload and all other
values are those of the data sheets.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pydantic import ConfigDict, TypeAdapter

from armwright.exceptions import RunFolderError, SettingsError, TaskError, did_you_mean
from armwright.existing.base_placement import Placement, placed
from armwright.existing.existing_arm import ExistingArm
from armwright.files import MAX_DERIVED, read_bytes
from armwright.kinematics.arms.arm_arrays import FIXED, stack_arms
from armwright.pareto import front_indices, knee_index, paper_solution_indices
from armwright.problem.facts import Fact, Facts, reach_facts
from armwright.problem.over_reach import reach_lines
from armwright.problem.problem import Problem
from armwright.proof.design_record import compute_facts
from armwright.robot.arm import Arm, Vector
from armwright.robot.mounting import Mounting
from armwright.robot.robot_descriptions import find_urdf
from armwright.robot.urdf_reader import UrdfArm, read_urdf
from armwright.runs.folder import RunFolder, read_run
from armwright.runs.history import History
from armwright.spaces.design_space import DesignSpace, default_space
from armwright.tasks.catalogue import load_task
from armwright.tasks.task import Task

EXISTING_ARMS = "existing_arms.json"  # in a run folder: the arms of its last comparison


@dataclass(frozen=True)
class ComparedArm:
    """An arm evaluated on a task.

    base: position of its base link, or of a design's first joint [m].
    yaw: turn of its base link about the vertical [rad].
    values: of the problem's objectives; None if unknown, such as a price.
    facts: what is known of it; the price of an existing arm as stated.
    dominates, dominated_by: numbers of designs on the run's front, see `dominance_counts`; None without a run.
    violated: constraints of the task that it violates. Such an arm is not compared with feasible designs.
    notes: of an existing arm its tip and its joints; then assumptions, changes and missing data.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid", allow_inf_nan=False)

    name: str
    joints: int
    base: Vector
    values: tuple[float | None, ...]
    facts: Mapping[str, Fact]
    dominates: int | None = None
    dominated_by: int | None = None
    violated: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    yaw: float = 0.0

    def value(self, name: str) -> float | None:
        """Return a quantity of `facts`; None if it is not known."""
        return self.facts[name].value


_ARMS = TypeAdapter(tuple[ComparedArm, ...])


@dataclass(frozen=True)
class ArmComparison:
    """Existing arms on a task, and chosen designs of a run's front.

    arms: in the given order; placed: the same arms with their bases in position.
    designs: the most precise design of the front, its knee, and the one with the smallest last objective; empty without
        a run.
    front: size of the front.
    places: number of places tried for the base of each arm; 0 if it was given.
    """

    problem: Problem
    arms: tuple[ComparedArm, ...]
    placed: tuple[Arm, ...]
    designs: tuple[ComparedArm, ...]
    front: int
    places: int
    run: Path | None


def compare_arms(
    task: str | Path | Task,
    arms: Sequence[str | Path | UrdfArm],
    run: str | Path | None = None,
    *,
    space: DesignSpace | None = None,
    base: Sequence[float] | Mounting | None = None,
    tip: str | None = None,
    base_link: str | None = None,
    seed: int = 0,
    prices: Mapping[str, float] | None = None,
) -> ArmComparison:
    """Evaluate existing arms on a task exactly as designs are evaluated.

    Args:
        task: A task, its name or its file.
        arms: URDF files, names of arms in `robot_descriptions`, or results of `read_urdf`.
        run: A run folder of the same task, whose problem is used. The arms are stored there for its figures and page.
        space: Design space with the ranges for the base and the travel of slides, without a run; by default the
            one of the task's name, else the paper's.
        base: Position x, y, z of all base links [m], perhaps with their turn about the vertical as a fourth number
            [rad]; by default it is searched for each arm.
        tip: Link of the URDFs that has to reach the targets, see `read_urdf`.
        base_link: Link of the URDFs that stands at the base, see `read_urdf`.
        seed: Seed of the search for the base.
        prices: Prices of arms by name [USD]; a URDF states none.
    """
    task = task if isinstance(task, Task) else load_task(task)
    if not arms:
        raise SettingsError("expected at least one arm; give URDF files, or names such as ur5e")
    mounting = base if base is None or isinstance(base, Mounting) else Mounting.of(base)
    history = None if run is None else _history(Path(run), task, space)
    problem = Problem(task, space or default_space(task.name)) if history is None else history.problem
    described = [arm if isinstance(arm, UrdfArm) else read_urdf(find_urdf(arm), tip, base_link) for arm in arms]
    names = _names(arms, described)
    stated = _check_prices(prices or {}, names)
    places = [placed(problem, arm, seed, mounting) for arm in described]
    compared = [
        _compared(problem, history, name, place, arm.notes, stated.get(name))
        for name, arm, place in zip(names, described, places, strict=True)
    ]
    result = ArmComparison(
        problem=problem,
        arms=tuple(compared),
        placed=tuple(place.described.arm for place in places),
        designs=() if history is None else tuple(_chosen_designs(history)),
        front=0 if history is None else len(history.front),
        places=places[0].tried,
        run=None if run is None else Path(run),
    )
    if result.run is not None:
        with RunFolder(result.run) as folder:
            folder.write_text(EXISTING_ARMS, json.dumps([asdict(arm) for arm in result.arms], indent=2) + "\n")
    return result


def read_existing_arms(folder: Path, n_objectives: int) -> tuple[ComparedArm, ...]:
    """Return the arms of the last comparison with a run that has this number of objectives; empty without one."""
    path = folder / EXISTING_ARMS
    if not path.exists():
        return ()
    content = read_bytes(path, MAX_DERIVED, RunFolderError)
    try:
        arms = _ARMS.validate_json(content)
        if any(len(arm.values) != n_objectives for arm in arms):
            raise ValueError(f"expected {n_objectives} values")
    except ValueError as fault:  # includes pydantic's errors
        raise RunFolderError(f"{path} is damaged; remove it, and compare the arms again") from fault
    return arms


def dominance_counts(
    values: Sequence[float | None], violated: Sequence[str], history: History
) -> tuple[int, int] | None:
    """Return how many designs of the front an arm dominates, and how many dominate it.

    One arm dominates another that is worse in one objective and better in none. None if a value is unknown or the arm
    violates a constraint.
    """
    if None in values or violated or not history.front:
        return None
    own, front = np.array(values, dtype=np.float64), np.array([member.values for member in history.front])
    dominates = np.all(own <= front, axis=1) & np.any(own < front, axis=1)
    dominated_by = np.all(front <= own, axis=1) & np.any(front < own, axis=1)
    return int(dominates.sum()), int(dominated_by.sum())


def comparison_record(comparison: ArmComparison) -> dict[str, Any]:
    """Return the comparison in JSON types."""
    return {
        "task": comparison.problem.task.name,
        "objectives": [objective.name for objective in comparison.problem.objectives],
        "run": None if comparison.run is None else str(comparison.run),
        "front": comparison.front,
        "places": comparison.places,
        "arms": [asdict(arm) for arm in comparison.arms],
        "designs": [asdict(arm) for arm in comparison.designs],
    }


def _history(run: Path, task: Task, space: DesignSpace | None) -> History:
    """Read a run of the same task: with the same targets, and the same that an arm carries there."""
    if space is not None:
        raise SettingsError("expected a run or a space, got both; the run has its own space")
    _, history = read_run(run)
    own = history.problem.task
    if not len(history):
        raise RunFolderError(f"{run} has no finished trial yet, so there is nothing to compare with")
    asked, stored = ((one.targets, one.tool, one.payloads.tolist(), one.load_shape) for one in (task, own))
    if asked != stored:
        raise TaskError(f"{run} is a run of the task {own.name}, with other targets, another tool or other payloads")
    return history


def _names(arms: Sequence[str | Path | UrdfArm], described: Sequence[UrdfArm]) -> list[str]:
    """Return a name for each arm: of a file its stem, or its whole path if two stems are equal."""
    short = [arm.name if isinstance(arm, UrdfArm) else Path(arm).stem for arm in arms]
    long = [one.name if isinstance(arm, UrdfArm) else str(arm) for arm, one in zip(arms, described, strict=True)]
    return [whole if short.count(name) > 1 else name for name, whole in zip(short, long, strict=True)]


def _check_prices(prices: Mapping[str, float], names: Sequence[str]) -> Mapping[str, float]:
    """Return the prices; SettingsError if one is of no arm, or no price."""
    for name, price in prices.items():
        if name not in names:
            raise SettingsError(
                f'price of an unknown arm "{name}".{did_you_mean(name, names)} Arms: {", ".join(names)}'
            )
        if not 0.0 <= price < np.inf:
            raise SettingsError(f"price of {name}: expected a finite number of at least 0 USD, got {price}")
    return prices


def _compared(
    problem: Problem, history: History | None, name: str, place: Placement, notes: Sequence[str], price: float | None
) -> ComparedArm:
    """Evaluate an existing arm in its place; price: as stated [USD], in place of that of its parts."""
    arm = place.described.arm
    existing = ExistingArm(problem, problem.physics(stack_arms([arm])), price)
    values, violated = existing.objectives, existing.violated
    unknown = [o.name for o, one in zip(problem.objectives, values, strict=True) if one is None]
    notes = [*notes, *(f"{name} unknown, so the arm cannot be compared with the front" for name in unknown)]
    notes += [f"unknown whether it meets {description}" for description in existing.undecided]
    counts = None if history is None else dominance_counts(values, violated, history)
    dominates, dominated_by = counts or (None, None)
    return ComparedArm(
        name=name,
        joints=int((existing.evaluation.arms.motion < FIXED).sum()),
        base=place.mounting.position,
        values=values,
        facts={**_reach(problem, arm), **existing.facts(arm)},
        dominates=dominates,
        dominated_by=dominated_by,
        violated=violated,
        notes=tuple(notes),
        yaw=place.mounting.yaw,
    )


def _reach(problem: Problem, arm: Arm) -> Facts:
    return reach_facts(arm, reach_lines(arm, float(problem.task.payloads.max()))[-1])


def _chosen_designs(history: History) -> Iterator[ComparedArm]:
    """Yield the most precise design of the front, its knee, and the one with the smallest last objective."""
    reference = history.reference_point or (np.inf,) * len(history.problem.objectives)
    indices = front_indices(history.masked_objectives)
    if not indices:
        return
    first, last = paper_solution_indices(history.masked_objectives, reference) or (indices[0], indices[-1])
    knee = knee_index(history.masked_objectives, reference)
    for index in dict.fromkeys((first, knee, last)):
        if index is not None:
            member = history.member(index)
            yield ComparedArm(
                name=f"#{index} {member.design.joints}",
                joints=sum(joint.kind != "fixed" for joint in member.arm.joints),
                base=member.arm.base,
                values=member.values,
                facts={**_reach(history.problem, member.arm), **compute_facts(history, [index])[index]},
            )
