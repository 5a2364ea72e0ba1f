"""Survival of recommended designs: which constraints they break if an arm, its supply, motors or payload are off.

A design is evaluated again, changed in one way at a time:

- the base or one link is 1 mm off,
- the motors get 90 % of their voltage,
- an assumed quantity of all motors is halved or doubled, or all of them are,
- the payload is 10 % heavier, or its centre is 10 mm off along an axis of the tip frame.

Along a cycle, a changed design keeps its postures as far as it can, as a robot that was taught them would. What is
feasible with all assumed values halved or doubled is also simulated.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays, stack_arms
from armwright.problem.assumptions import assumed_values
from armwright.problem.constraints import Constraint
from armwright.problem.evaluation import Evaluation
from armwright.problem.problem import Problem
from armwright.problem.scene import Scene
from armwright.proof.simulated_run import simulate_arm
from armwright.robot.actuators import ActuatorRecord
from armwright.robot.arm import Arm
from armwright.runs.history import History
from armwright.runs.trial import Count
from armwright.spaces.tolerance import TOLERANCE, length_columns, perturbed

MOVED, SUPPLY, ASSUMED = "base or a link 1 mm off", "90 % of the voltage", "assumed values halved or doubled"
HEAVIER, SHIFTED = "payload +10 %", "payload 10 mm off-centre"
PERTURBATIONS = (MOVED, SUPPLY, ASSUMED, HEAVIER, SHIFTED)
VOLTAGE_SHARE = 0.9
FACTORS = {"halved": 0.5, "doubled": 2.0}  # of assumed values
ALL = "all"
LOAD_FACTOR = 1.1
OFF_CENTRE = 0.01  # [m]
ROUNDING = 1e-3  # of a bound; a smaller violation breaks nothing


@dataclass(frozen=True)
class Change:
    """A change of a design."""

    perturbation: str  # the perturbation that it belongs to
    text: str  # the change, such as `link_2 +1 mm`


@dataclass(frozen=True)
class Broken:
    """A constraint that a changed design violates, or a failure in the simulator."""

    change: str
    constraint: str  # the constraint; the simulator's reason if it is none
    measured: float | None = None  # what the constraint bounds, in its unit; None from the simulator
    violation: float | None = None  # the violation of the constraint, relative to its bound; None from the simulator


@dataclass(frozen=True)
class Perturbation:
    """A perturbation of a design."""

    name: str
    changes: Count  # the number of changes that were evaluated
    broken: tuple[Broken, ...]  # the constraints that they violate, of each change the most violated one first


@dataclass(frozen=True)
class Survival:
    """Survival of a design."""

    verdict: str
    perturbations: tuple[Perturbation, ...]
    simulated: tuple[str, ...]  # changes that were simulated as well


@dataclass(frozen=True)
class _Batch:
    """R changed designs in a changed scene."""

    changes: Sequence[Change]
    owners: NDArray[np.intp]  # (R,) index of the design that is changed
    arms: ArmArrays
    scenes: Sequence[Scene]  # the scene of each case


def evaluate_survival(history: History, designs: Mapping[int, bool]) -> dict[int, Survival]:
    """Return the survival of designs by trial number; empty without constraints.

    designs: Trial numbers of feasible designs, and whether to simulate the changes of all their assumed values.
    """
    problem, numbers = history.problem, list(designs)
    if not problem.constraints or not numbers:
        return {}
    matrix = problem.space.matrix([history.trials[number].design for number in numbers])
    near = [problem.physics(matrix, case).entry_postures for case in range(len(problem.scenes))]
    found: list[dict[Change, list[Broken]]] = [{} for _ in numbers]
    simulated: list[list[str]] = [[] for _ in numbers]
    for batch in (_moved(problem, matrix), *_loaded(problem, matrix)):
        _evaluate(problem, batch, near, found)
    rows, arms = _with_changed_motors(history, numbers)
    if rows:
        changes, owners = [change for _, change in rows], np.array([owner for owner, _ in rows])
        batch = _Batch(changes, owners, stack_arms(arms), problem.scenes)
        evaluation = _evaluate(problem, batch, near, found)
        for row, (owner, change) in enumerate(rows):
            if designs[numbers[owner]] and change.text.startswith(ALL) and not found[owner][change]:
                simulated[owner].append(change.text)
                result = simulate_arm(problem, arms[row], evaluation, row, numbers[owner]).result
                found[owner][change] = [Broken(change.text, reason) for reason in result.reasons[:1]]
    return {
        number: _survival(problem.constraints, found[owner], simulated[owner]) for owner, number in enumerate(numbers)
    }


def _evaluate(
    problem: Problem, batch: _Batch, near: Sequence[Array | None], found: Sequence[dict[Change, list[Broken]]]
) -> Evaluation:
    """Add what changed designs break to `found` by design and change; return their evaluation in the first case.

    near: (N, B, D) postures of the N designs in each case.
    """
    near = [None if postures is None else postures[batch.owners, :, : batch.arms.dof] for postures in near]
    evaluations = list(problem.cases(batch.arms, near, batch.scenes))
    violations = np.max([problem.violations(evaluation) for evaluation in evaluations], axis=0)
    for change, owner, row in zip(batch.changes, batch.owners, violations, strict=True):
        pairs = sorted(zip(row.tolist(), problem.constraints, strict=True), key=lambda pair: -pair[0])
        found[owner][change] = [
            Broken(change.text, constraint.description, constraint.measured(violation), violation)
            for violation, constraint in pairs
            if violation > ROUNDING
        ]
    return evaluations[0]


def _moved(problem: Problem, matrix: Array) -> _Batch:
    """Return the designs with one length or coordinate of the base off by ±1 mm."""
    space = problem.space
    names = [space.parameters[column].name for column in length_columns(space) for _ in "-+"]
    active = np.array([space.active(name, matrix) for name in names])  # (K, N)
    arms = problem.arms(np.stack(list(perturbed(space, matrix)))[active])
    which, owners = np.nonzero(active)
    changes = [Change(MOVED, f"{names[k]} {'-+'[k % 2]}{1e3 * TOLERANCE:g} mm") for k in which.tolist()]
    return _Batch(changes, owners, arms, problem.scenes)


def _loaded(problem: Problem, matrix: Array) -> Iterator[_Batch]:
    """Yield the designs with a heavier payload, and with one whose centre is off; nothing without a payload."""
    if not problem.task.payloads.any():
        return
    arms, owners = problem.arms(matrix), np.arange(len(matrix))
    heavier = [replace(scene, payload=LOAD_FACTOR * scene.payload) for scene in problem.scenes]
    yield _Batch([Change(HEAVIER, HEAVIER)] * len(matrix), owners, arms, heavier)
    for axis in range(3):
        for sign in (-1.0, 1.0):
            change = Change(SHIFTED, f"{'xyz'[axis]} {sign * 1e3 * OFF_CENTRE:+g} mm")
            shift = np.eye(3)[axis] * sign * OFF_CENTRE
            yield _Batch([change] * len(matrix), owners, arms, [_shifted(scene, shift) for scene in problem.scenes])


def _shifted(scene: Scene, shift: Array) -> Scene:
    """Return a scene whose payload has its centre shifted in the tip frame; shift: (3,) [m]."""
    x, y, z = (np.array(scene.load_shape.center) + shift).tolist()
    return replace(scene, load_shape=replace(scene.load_shape, center=(x, y, z)))


def _with_changed_motors(history: History, numbers: Sequence[int]) -> tuple[list[tuple[int, Change]], list[Arm]]:
    """Return the index of a design and its change for each design with changed motors, and these arms."""
    rows: list[tuple[int, Change]] = []
    arms: list[Arm] = []
    space = history.problem.space
    for owner, number in enumerate(numbers):
        actuators = space.supplied_actuators(history.trials[number].design)
        changed = {Change(SUPPLY, SUPPLY): tuple(record.at_voltage(VOLTAGE_SHARE) for record in actuators)}
        for text, names in _assumed(history, number).items():
            for verb, factor in FACTORS.items():
                changed[Change(ASSUMED, f"{text} {verb}")] = tuple(
                    supplied.scaled(names & set(record.assumed), factor)
                    for supplied, record in zip(actuators, space.actuators, strict=True)
                )
        for change, records in changed.items() if actuators else ():
            rows.append((owner, change))
            arms.append(_arm(history, number, records))
    return rows, arms


def _assumed(history: History, number: int) -> dict[str, set[str]]:
    """Return the assumed values of a design to change together, by name: each by itself, and all of them."""
    assumed = assumed_values(history.problem, [history.member(number).arm])
    names = list(dict.fromkeys(name for values in assumed.values() for name, value in values.items() if value))
    return {name: {name} for name in names} | ({ALL: set(names)} if names else {})


def _arm(history: History, number: int, actuators: tuple[ActuatorRecord, ...]) -> Arm:
    """Return the arm of a design with other actuators of the same names."""
    changed = history.problem.space.model_copy(update={"actuators": actuators, "supply": None})
    return changed.arm(history.trials[number].design, history.problem.task.tool)


def _survival(
    constraints: Sequence[Constraint], found: Mapping[Change, Sequence[Broken]], simulated: Sequence[str]
) -> Survival:
    """Return the survival of a design from what each of its changes breaks."""
    of_perturbation: dict[str, list[Sequence[Broken]]] = {name: [] for name in PERTURBATIONS}
    for change, broken in found.items():
        of_perturbation[change.perturbation].append(broken)
    perturbations = tuple(
        Perturbation(name, len(of_changes), tuple(one for broken in of_changes for one in broken))
        for name, of_changes in of_perturbation.items()
        if of_changes
    )
    texts = [_describe(constraints, one) for one in perturbations if one.broken]
    some = "holds all but" if len(texts) < len(perturbations) else "holds none"
    verdict = f"{some}: {', '.join(texts)}" if texts else "holds all perturbations"
    return Survival(verdict, perturbations, tuple(simulated))


def _describe(constraints: Sequence[Constraint], perturbation: Perturbation) -> str:
    """Describe the worst that a perturbation breaks: `payload +10 % (torque_utilisation 1.04 > 1)`."""
    worst = max(perturbation.broken, key=lambda one: one.violation or 0.0)
    text = worst.constraint
    for constraint in constraints:
        if constraint.description == worst.constraint and worst.measured is not None:
            sign = ">" if constraint.relation == "<=" else "<"
            text = f"{constraint.quantity.name} {worst.measured:.4g} {sign} {constraint.bound:g}"
    change = "" if worst.change == perturbation.name else f"{worst.change}: "
    others = len({one.change for one in perturbation.broken}) - 1
    return f"{perturbation.name} ({change}{text}{f' and {others} more' if others else ''})"
