"""What designs have left if an arm, its supply or its payload are off: reserves of the motors, and clearances.

A design is evaluated again, changed in one way at a time:

- the base or one link is 1 mm off,
- the motors get 90 % of their voltage,
- the payload is 10 % heavier, or its centre is 10 mm off along an axis of the tip frame.

It holds if each change leaves a reserve of at least 1 and a geometry that serves the task. Along a cycle, a changed
design keeps its durations and its path; with another base or link its postures, as far as it can, as a robot that was
taught them would. Apart from these, an assumed quantity of all motors is halved or doubled, or all of them are.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, product
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array, finite_or_none
from armwright.exceptions import UnknownQuantityError
from armwright.kinematics.arms.actuation import Actuation
from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.kinematics.cycle.cycle_loads import MORE_PAYLOAD, VOLTAGE_SHARE
from armwright.problem.arm_quantities import CLEARANCES, FAR, clearance, collision
from armwright.problem.assumptions import assumed_values
from armwright.problem.constraints import Constraint
from armwright.problem.drive_quantities import reserve
from armwright.problem.evaluation import Evaluation
from armwright.problem.facts import fact_of
from armwright.problem.problem import Problem
from armwright.problem.scene import Scene
from armwright.proof.cycle_faults import motion_place
from armwright.robot.arm import Arm
from armwright.runs.history import History
from armwright.spaces.tolerance import TOLERANCE, length_columns, perturbed

NOMINAL, MOVED, SUPPLY = "as designed", "base or a link 1 mm off", "90 % of the voltage"
HEAVIER, SHIFTED = "payload +10 %", "payload 10 mm off-centre"
ASSUMED = "assumed values halved or doubled"
FACTORS = {"halved": 0.5, "doubled": 2.0}  # of assumed values
ALL = "all"
OFF_CENTRE = 0.01  # [m]
ROUNDING = 1e-3  # of a limit; what exceeds it by less breaks nothing
CONTACT = 1e-5  # [m] of overlap that is rounding
# Bounded quantities that say whether a geometry serves the task; of clearances, contact counts
ERRORS = ("unreached_targets", "position_error", "worst_error", "orientation_error", "worst_angle")
GEOMETRY = (*ERRORS, "path_error", "path_angle", "jumps")


@dataclass(frozen=True)
class Left:
    """What a perturbation of a design leaves, in the change that leaves least."""

    name: str
    holds: bool  # whether no limit is exceeded, and the geometry serves the task
    text: str  # the change and what decides: `link_2 +1 mm: reserve 0.96 (torque of joint 2, step 3)`
    reserve: float | None  # the smallest reserve; None if it is not known
    clearance: float | None  # smallest distance from anything [m]; None without anything near


@dataclass(frozen=True)
class Survival:
    """Whether a design holds, and what perturbations leave of it."""

    holds: bool
    verdict: str
    perturbations: tuple[Left, ...]  # those that decide, the design as it is first
    assumed: Left | None = None  # of assumed values; None if there are none, or they were not changed

    @classmethod
    def of(cls, found: Mapping[str, Left]) -> Self:
        """Return the survival of a design by what each perturbation leaves."""
        failing = [f"{one.name} ({one.text})" for one in found.values() if not one.holds]
        least = min(found.values(), key=lambda one: np.inf if one.reserve is None else one.reserve)
        verdict = f"does not hold: {', '.join(failing)}" if failing else f"holds; least with {least.name}: {least.text}"
        return cls(not failing, verdict, tuple(found.values()))


@dataclass(frozen=True)
class Changed:
    """R designs with a change each."""

    perturbation: str
    texts: Sequence[str]  # the change of each, or one of all
    evaluations: Sequence[Evaluation]  # of each case
    owners: NDArray[np.intp]  # (R,) index of the design that is changed, -1 if the row does not count


def survival_of(history: History, numbers: Sequence[int]) -> list[Survival]:
    """Return the survival of designs, by trial number, of a task with constraints."""
    problem, matrix = history.problem, history.matrix(numbers)
    nominal = problem.cases(matrix, history.entry(numbers))
    return survivals(problem, nominal, load_changes(problem, matrix, nominal))


def survivals(problem: Problem, nominal: Sequence[Evaluation], changes: Iterable[Changed]) -> list[Survival]:
    """Return the survival of N designs; none without constraints, when all changes have been evaluated.

    nominal: Their evaluation in each case.
    """
    everything = chain([Changed(NOMINAL, [NOMINAL], nominal, np.arange(len(nominal[0])))], changes)
    if not problem.constraints:
        deque(everything, maxlen=0)
        return []
    return [Survival.of(found) for found in _judged(problem, nominal, everything)]


def load_changes(problem: Problem, matrix: Array, nominal: Sequence[Evaluation]) -> Iterator[Changed]:
    """Yield N designs with each change of the geometry, and with each of a load if the task has constraints.

    matrix: (N, P) designs.  nominal: their evaluation in each case.
    """
    space, entry = problem.space, entry_of(nominal)
    names = [space.parameters[column].name for column in length_columns(space) for _ in "-+"]
    for index, (name, rows) in enumerate(zip(names, perturbed(space, matrix), strict=True)):
        owners = np.where(space.active(name, matrix), np.arange(len(matrix)), -1)
        arms = problem.arms(rows, nominal[0].arms.precision)
        text = f"{name} {'-+'[index % 2]}{1e3 * TOLERANCE:g} mm"
        yield Changed(MOVED, [text], problem.cases(arms, entry), owners)
    if not problem.constraints:
        return

    def loaded(name: str, text: str, scenes: Iterable[Scene], drives: Actuation | None = None) -> Changed:
        changed = [e.reloaded(one, drives) for e, one in zip(nominal, scenes, strict=True)]
        return Changed(name, [text], changed, np.arange(len(matrix)))

    if (drives := nominal[0].arms.actuation) is not None:
        yield loaded(SUPPLY, SUPPLY, problem.scenes, drives.at_voltage(VOLTAGE_SHARE))
    if problem.task.payloads.any():
        heavier = (replace(scene, payload=(1.0 + MORE_PAYLOAD) * scene.payload) for scene in problem.scenes)
        yield loaded(HEAVIER, HEAVIER, heavier)
        for axis, sign in product(range(3), (-1.0, 1.0)):
            shift = sign * OFF_CENTRE * np.eye(3)[axis]
            text = f"{'xyz'[axis]} {1e3 * sign * OFF_CENTRE:+g} mm"
            yield loaded(SHIFTED, text, [_shifted(scene, shift) for scene in problem.scenes])


def entry_of(nominal: Sequence[Evaluation]) -> Array | None:
    """Return (N, C, B, D) entries of designs (`Outcomes`) by their evaluation in each case; None without a cycle."""
    entries = [evaluation.entry for evaluation in nominal if evaluation.entry is not None]
    return np.concatenate(entries, axis=1) if entries else None


def _shifted(scene: Scene, shift: Array) -> Scene:
    """Return a scene whose payload has its centre shifted in the tip frame; shift: (3,) [m]."""
    x, y, z = (np.array(scene.load_shape.center) + shift).tolist()
    return replace(scene, load_shape=replace(scene.load_shape, center=(x, y, z)))


def _judged(problem: Problem, nominal: Sequence[Evaluation], changes: Iterable[Changed]) -> list[dict[str, Left]]:
    """Return what each perturbation leaves of N designs, at their nominal durations."""
    geometry = [constraint for constraint in problem.constraints if constraint.quantity.name in GEOMETRY]
    if any(constraint.quantity in (collision, *CLEARANCES) for constraint in problem.constraints):
        geometry.append(Constraint(clearance, ">=", 0.0))
    allowed = np.array([CONTACT if one.quantity == clearance else ROUNDING for one in geometry])
    durations = [kept_durations(evaluation) for evaluation in nominal]
    found: list[dict[str, Left]] = [{} for _ in range(len(nominal[0]))]
    for changed in changes:
        for each, kept in zip(changed.evaluations, durations, strict=True):
            evaluation = each.keeping(None if kept is None else kept[changed.owners])
            violations = np.array([constraint(evaluation) for constraint in geometry]).reshape(-1, len(changed.owners))
            fails = violations > allowed[:, None]
            reserves = reserve.known(evaluation)[0]
            holds = ~(fails.any(axis=0) | evaluation.is_stopped | (reserves < 1.0 - ROUNDING))
            distances = clearance.known(evaluation)[0]
            for row in np.flatnonzero(changed.owners >= 0).tolist():
                own, least = found[int(changed.owners[row])], finite_or_none(reserves[row])
                worst = own.get(changed.perturbation)
                if worst is not None and _rank(worst.holds, worst.reserve) <= _rank(bool(holds[row]), least):
                    continue
                faults = [
                    _describe(constraint, constraint.measured(float(violation)))
                    for constraint, violation, wrong in zip(geometry, violations[:, row], fails[:, row], strict=True)
                    if wrong
                ]
                if least is not None and (least < 1.0 - ROUNDING or not faults):
                    faults.append(f"reserve {least:.2f} ({_describe_limit(evaluation, row)})")
                change = changed.texts[row % len(changed.texts)]
                text = ", ".join(faults) or "geometry holds"
                own[changed.perturbation] = Left(
                    changed.perturbation,
                    bool(holds[row]),
                    text if change == changed.perturbation else f"{change}: {text}",
                    least,
                    float(distances[row]) if distances[row] < FAR else None,
                )
    return found


def _rank(holds: bool, least: float | None) -> tuple[bool, float]:
    """Return what makes one change worse than another: the smaller is."""
    return holds, np.inf if least is None else least


def kept_durations(evaluation: Evaluation) -> Array | None:
    """Return the (N, M) durations of motions [s]; None without a cycle of known durations."""
    try:
        return evaluation.loads.durations
    except UnknownQuantityError:
        return None


def _describe_limit(evaluation: Evaluation, row: int) -> str:
    """Describe what limits an arm most, by its reserves: `torque of joint 2, step 3, line in`."""
    cause, motion, joint = evaluation.reserves.weakest(row)
    if motion is None:
        return f"{cause} of joint {joint + 1}"
    place = f"target {motion + 1}" if evaluation.plan is None else motion_place(evaluation.plan, motion)
    return f"{cause} of joint {joint + 1}, {place}"


def _describe(constraint: Constraint, value: float | None) -> str:
    """Describe a bound that a geometry exceeds: `clearance -0.4 mm`."""
    label = constraint.quantity.label.lower()
    return label if constraint.quantity.unit == "targets" else f"{label} {fact_of(constraint.quantity, value).text}"


def evaluate_survival(history: History, numbers: Sequence[int], known: Mapping[int, Survival]) -> dict[int, Survival]:
    """Return the survival of feasible designs by trial number, assumed values included; empty without constraints.

    known: The survival of designs without assumed values, as far as it is known.
    """
    problem = history.problem
    if not problem.constraints or not numbers:
        return {}
    found = dict(known if known.keys() >= set(numbers) else zip(numbers, survival_of(history, numbers), strict=True))
    owners, texts, arms = _with_assumed_values(history, numbers)
    if not arms:
        return {number: found[number] for number in numbers}
    nominal = problem.cases(history.matrix(numbers), history.entry(numbers))
    stacked, entry = stack_arms(arms), entry_of(nominal)
    near = None if entry is None else entry[owners, ..., : stacked.dof]
    changed = Changed(ASSUMED, texts, problem.cases(stacked, near), np.array(owners))
    assumed = _judged(problem, nominal, [changed])
    return {n: replace(found[n], assumed=own.get(ASSUMED)) for n, own in zip(numbers, assumed, strict=True)}


def _with_assumed_values(history: History, numbers: Sequence[int]) -> tuple[list[int], list[str], list[Arm]]:
    """Return arms with changed motors, the index of the design of each, and its change."""
    owners: list[int] = []
    texts: list[str] = []
    arms: list[Arm] = []
    problem = history.problem
    for owner, number in enumerate(numbers):
        assumed = assumed_values(problem, [history.member(number).arm])
        names = list(dict.fromkeys(name for values in assumed.values() for name, value in values.items() if value))
        together = {name: {name} for name in names} | ({ALL: set(names)} if names else {})
        for (text, changed), (verb, factor) in product(together.items(), FACTORS.items()):
            records = tuple(one.scaled(changed & set(one.assumed), factor) for one in problem.space.actuators)
            space = problem.space.model_copy(update={"actuators": records})
            owners.append(owner)
            texts.append(f"{text.replace('_', ' ')} {verb}")
            arms.append(space.arm(history.trials[number].design, problem.task.tool))
    return owners, texts, arms
