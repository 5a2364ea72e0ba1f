"""Buy or build: arms that exist already, on a task, beside the designs of a run.

An arm has to stand somewhere. Its base is searched within the ranges that the space gives to the base of designs, so
that it misses the targets least, and then needs least torque; or it is given.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from pydantic import BaseModel, TypeAdapter

from armwright.arrays import Array
from armwright.exceptions import RunFolderError, SettingsError, TaskError
from armwright.kinematics.arm_arrays import FIXED, stack_arms
from armwright.pareto import front_indices, knee_index, paper_solution_indices
from armwright.problem.constraints import Quantity
from armwright.problem.evaluation import Evaluation
from armwright.problem.objectives import (
    OF_CLEARANCE,
    PEAK_TORQUE,
    POSITION_ERROR,
    PRICE,
    REACHED,
    TORQUE,
    TORQUE_UTILISATION,
    UNREACHED_TARGETS,
    WORST_ERROR,
    Objective,
)
from armwright.problem.problem import POSTURES_AT_ONCE, Problem
from armwright.robot.arm import Arm, Joint, Vector
from armwright.robot.robot_descriptions import find_urdf
from armwright.robot.urdf_reader import UrdfArm, read_urdf
from armwright.runs.folder import RunFolder, read_run
from armwright.runs.history import FrontMember, History
from armwright.search.cma_es import refine
from armwright.search.encoding import DesignEncoding
from armwright.seeding import derived_seed
from armwright.spaces.design_space import DesignSpace, paper_space
from armwright.spaces.parameters import FloatParameter
from armwright.tasks.task import Task, load_task

EXISTING_ARMS = "existing_arms.json"  # of a run folder: the arms that were compared with it last
POSITIONS = 300  # of the base, at random
REFINED = 4  # of these, the best ones,
REFINEMENT = 300  # by so many evaluations each
MEASURES: tuple[Objective, ...] = (
    POSITION_ERROR,
    TORQUE,
    WORST_ERROR,
    UNREACHED_TARGETS,
    PEAK_TORQUE,
    TORQUE_UTILISATION,
)


@dataclass(frozen=True)
class ComparedArm:
    """An arm on a task.

    base: where its base link stands; of a design, its first joint [m].
    values: of the problem's objectives; None where one cannot be known, such as a price.
    measures: the same by the names of `MEASURES`.
    dominates, dominated_by: how many designs of the run's front, as of `dominance_counts`; None without a run, too.
    violated: the task's constraints that it does not keep; it then stands nowhere beside designs that do.
    notes: what was chosen, changed or missing.
    """

    name: str
    joints: int
    reach: float  # [m]
    mass: float  # [kg]
    base: Vector
    values: tuple[float | None, ...]
    measures: Mapping[str, float | None]
    dominates: int | None = None
    dominated_by: int | None = None
    violated: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class ArmComparison:
    """Arms that exist on a task, and chosen designs of a run's front.

    arms: in the order in which they were named; placed: the arms themselves, where their bases stand.
    designs: the front's most precise, its knee, and the one of least last objective; none without a run.
    front: how many designs it has.
    positions: of the base, how many were tried for each arm; 0 where it was given.
    """

    problem: Problem
    arms: tuple[ComparedArm, ...]
    placed: tuple[Arm, ...]
    designs: tuple[ComparedArm, ...]
    front: int
    positions: int
    run: Path | None


def compare_arms(
    task: str | Path | Task,
    arms: Sequence[str | Path | UrdfArm],
    run: str | Path | None = None,
    *,
    space: DesignSpace | None = None,
    base: Vector | None = None,
    tip: str | None = None,
    base_link: str | None = None,
    seed: int = 0,
) -> ArmComparison:
    """Evaluates arms that exist on a task as its designs are evaluated.

    arms: URDF files, names of arms in `robot_descriptions`, or what `read_urdf` returned.
    run: a run folder of the same task; its problem counts, and the arms are kept there for its figures and its page.
    space: whose ranges for the base and travel of slides count where there is no run; without it, the paper's.
    base: where all base links stand [m]; without it, it is searched for each arm.
    tip, base_link: links of the URDFs, as of `read_urdf`.
    """
    wanted = task if isinstance(task, Task) else load_task(task)
    if not arms:
        raise SettingsError("no arm was named: give URDF files, or names of arms such as ur5e")
    if base is not None and not np.all(np.isfinite(base)):
        raise SettingsError(f"the base must be three finite numbers [m], not {base}")
    history = None
    if run is None:
        problem = Problem(wanted, paper_space() if space is None else space)
    else:
        if space is not None:
            raise SettingsError("a space goes with a new problem; the run has its own")
        _, history = read_run(Path(run))
        problem = history.problem
        if not len(history):
            raise RunFolderError(f"{run} has no finished trial yet, so there is nothing to compare with")
        if not (
            np.array_equal(wanted.target_positions, problem.task.target_positions)
            and np.array_equal(wanted.payloads, problem.task.payloads)
        ):
            raise TaskError(f"{run} is a run of the task {problem.task.name}, with other targets or payloads")
    read = [arm if isinstance(arm, UrdfArm) else read_urdf(find_urdf(arm), tip, base_link) for arm in arms]
    names = _names(arms, read)
    placed: list[Arm] = []
    compared: list[ComparedArm] = []
    for name, arm in zip(names, read, strict=True):
        ready = _with_travel(arm.arm, problem.space.travel)
        place = _searched(problem, ready, seed) if base is None else base
        placed.append(_moved(ready, place))
        compared.append(_compared(problem, history, name, placed[-1], place, arm.notes))
    result = ArmComparison(
        problem=problem,
        arms=tuple(compared),
        placed=tuple(placed),
        designs=() if history is None else tuple(_of_front(history)),
        front=0 if history is None else len(history.front),
        positions=POSITIONS + REFINED * REFINEMENT if base is None else 0,
        run=None if run is None else Path(run),
    )
    if result.run is not None:
        _write(result.run, result)
    return result


class _ArmRecord(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """One arm of existing_arms.json."""

    name: str
    joints: int
    reach: float
    mass: float
    base: Vector
    values: tuple[float | None, ...]
    measures: dict[str, float | None]
    dominates: int | None
    dominated_by: int | None
    violated: tuple[str, ...]
    notes: tuple[str, ...]


_RECORDS = TypeAdapter(tuple[_ArmRecord, ...])


def read_existing_arms(folder: Path, n_objectives: int) -> tuple[ComparedArm, ...]:
    """The arms that were last compared with a run of so many objectives; none where none were."""
    path = folder / EXISTING_ARMS
    try:
        records = _RECORDS.validate_json(path.read_bytes())
        if any(len(record.values) != n_objectives for record in records):
            raise ValueError(f"not {n_objectives} values")
    except FileNotFoundError:
        return ()
    except OSError as fault:
        raise RunFolderError(f"cannot read {path}: {fault.strerror or fault}") from fault
    except ValueError as fault:  # pydantic's is one, too
        raise RunFolderError(f"{path} is damaged; remove it, and compare the arms again") from fault
    return tuple(ComparedArm(**dict(record)) for record in records)


def _write(run: Path, result: ArmComparison) -> None:
    with RunFolder(run) as folder:
        folder.write_text(EXISTING_ARMS, json.dumps([asdict(arm) for arm in result.arms], indent=2) + "\n")


def _names(arms: Sequence[str | Path | UrdfArm], read: Sequence[UrdfArm]) -> list[str]:
    """As they were named: a file without its folder and ending; with them where two are the same."""
    names = [arm.name if isinstance(arm, UrdfArm) else Path(arm).stem for arm in arms]
    whole = [one.name if isinstance(arm, UrdfArm) else str(arm) for arm, one in zip(arms, read, strict=True)]
    return [long if names.count(name) > 1 else name for name, long in zip(names, whole, strict=True)]


def _with_travel(arm: Arm, travel: float) -> Arm:
    """Its slides moved by actuators as those of designs are, which does not change their force."""

    def changed(joint: Joint) -> Joint:
        if joint.kind != "prismatic":
            return joint
        motor = joint.actuator
        speed = None if motor is None or motor.speed is None else motor.speed / travel
        geared = None if motor is None else replace(motor, effort=motor.effort * travel, speed=speed)
        return replace(joint, actuator=geared, travel=travel)

    return replace(arm, joints=tuple(map(changed, arm.joints)))


def _moved(arm: Arm, place: Sequence[float]) -> Arm:
    """The arm, whose base link stands at the world's origin, with it at `place` [m]."""
    x, y, z = (float(a + b) for a, b in zip(arm.base, place, strict=True))
    return replace(arm, base=(x, y, z))


def _searched(problem: Problem, arm: Arm, seed: int) -> Vector:
    """The position of the base link from which the arm misses least, and then needs least torque [m]."""
    named = {parameter.name: parameter for parameter in problem.space.parameters}
    parameters = [cast("FloatParameter", named[f"origin_{axis}"]) for axis in "xyz"]

    def evaluate(places: Array) -> Array:
        """(N, 1) from 1 on where targets are missed, below it by torque."""
        size = max(1, POSTURES_AT_ONCE[problem.device] // len(problem.task.target_positions))
        losses = np.empty((len(places), 1))
        for first in range(0, len(places), size):
            rows = slice(first, first + size)
            evaluation = problem.physics_of_arms(stack_arms([_moved(arm, place) for place in places[rows].tolist()]))
            missed = np.maximum(evaluation.position_error - REACHED, 0.0).sum(axis=1)
            torque = TORQUE(evaluation)
            losses[rows, 0] = np.where(missed > 0.0, 1.0 + missed, torque / (1.0 + torque))
        return losses

    rows = DesignEncoding(parameters).random(POSITIONS, np.random.default_rng(derived_seed(seed, 0)))
    losses = evaluate(rows)
    best = np.argsort(losses[:, 0], kind="stable")[:REFINED]
    refined = refine(parameters, evaluate, rows[best], losses[best], (1.0,), REFINEMENT, derived_seed(seed, 1))
    x, y, z = refined.matrix[refined.values[:, 0].argmin()].tolist()
    return x, y, z


def _compared(
    problem: Problem, history: History | None, name: str, arm: Arm, base: Vector, notes: Sequence[str] = ()
) -> ComparedArm:
    evaluation = problem.physics_of_arms(stack_arms([arm]))
    values = tuple(_known(objective, evaluation) for objective in problem.objectives)
    bounds = [(constraint, _known(constraint.quantity, evaluation)) for constraint in problem.constraints]
    violated = tuple(
        f"{constraint.words} (it has {value:.3g})"
        for constraint, value in bounds
        if value is not None and float(constraint(evaluation)[0]) > 0.0
    )
    unknown = [o.name for o, value in zip(problem.objectives, values, strict=True) if value is None]
    said = [*notes, *(f"its {name} is not known, so it cannot be placed among the designs" for name in unknown)]
    said += [f"whether it keeps {constraint.words} is not known" for constraint, value in bounds if value is None]
    stands = None if history is None else dominance_counts(values, violated, history)
    return ComparedArm(
        name=name,
        joints=int((evaluation.arms.motion < FIXED).sum()),
        reach=arm.reach,
        mass=arm.mass,
        base=base,
        values=values,
        measures={objective.name: _known(objective, evaluation) for objective in MEASURES},
        dominates=None if stands is None else stands[0],
        dominated_by=None if stands is None else stands[1],
        violated=violated,
        notes=tuple(said),
    )


def _known(quantity: Quantity, evaluation: Evaluation) -> float | None:
    """None where it needs efforts or prices that the arm does not state, or its shape, of which only lines are read."""
    actuation = evaluation.arms.actuation
    if quantity.name == TORQUE_UTILISATION.name and actuation is None:
        return None
    if quantity.name == PRICE.name and (actuation is None or np.isnan(actuation.price).any()):
        return None
    if quantity.name in {known.name for known in OF_CLEARANCE}:
        return None
    return float(quantity(evaluation)[0])


def _of_front(history: History) -> list[ComparedArm]:
    """Of the front its most precise design, its knee, and the one with least of the last objective."""
    reference = history.reference_point or (np.inf,) * len(history.problem.objectives)
    numbers = front_indices(history.masked_objectives)
    if not numbers:
        return []
    first, last = paper_solution_indices(history.masked_objectives, reference) or (numbers[0], numbers[-1])
    knee = knee_index(history.masked_objectives, reference)
    chosen = [number for number in dict.fromkeys((first, knee, last)) if number is not None]
    return [_of_design(history, history.member(number)) for number in chosen]


def _of_design(history: History, member: FrontMember) -> ComparedArm:
    name = f"#{member.number} {member.design.joints}"
    compared = _compared(history.problem, None, name, member.arm, member.arm.base)
    return replace(compared, values=member.values, violated=(), notes=())


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


def as_records(comparison: ArmComparison) -> dict[str, Any]:
    """The comparison as JSON has it."""
    return {
        "task": comparison.problem.task.name,
        "objectives": [objective.name for objective in comparison.problem.objectives],
        "run": None if comparison.run is None else str(comparison.run),
        "front": comparison.front,
        "positions": comparison.positions,
        "arms": [asdict(arm) for arm in comparison.arms],
        "designs": [asdict(arm) for arm in comparison.designs],
    }
