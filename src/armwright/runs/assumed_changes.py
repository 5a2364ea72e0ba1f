"""Feasibility of designs if the assumed values of their actuators are halved or doubled.

A design is evaluated again with each assumed quantity, of all its actuators, halved and doubled by itself, and with all
of them. What is still feasible with all of them is also simulated.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arm_arrays import stack_arms
from armwright.problem.problem import Problem
from armwright.robot.arm import Arm
from armwright.runs.assumptions import assumed_values
from armwright.runs.history import History
from armwright.runs.simulated_run import simulate_arm

FACTORS = {"halved": 0.5, "doubled": 2.0}
ALL = "all"
MAX_SHOWN = 2  # changes in a verdict


@dataclass(frozen=True)
class Broken:
    """A change with which a design is not feasible, or fails in the simulator.

    Attributes:
        change: The change: QUANTITY or all, halved or doubled.
        constraint: The constraint that is violated most; the simulator's reason if none is.
        measured: What the constraint bounds, in its unit; None from the simulator.
    """

    change: str
    constraint: str
    measured: float | None


@dataclass(frozen=True)
class AssumedVerdict:
    """Whether the verdict on a design holds with assumed values halved and doubled.

    Attributes:
        verdict: The result in words.
        changes: The number of changes.
        broken: Those with which it does not hold.
        simulated: Those that were simulated.
    """

    verdict: str
    changes: int
    broken: tuple[Broken, ...]
    simulated: tuple[str, ...]


@dataclass(frozen=True)
class _Change:
    """Values of an arm's actuators times a factor."""

    text: str
    names: tuple[str, ...]
    factor: float


def vary_assumed(history: History, designs: Mapping[int, bool]) -> dict[int, AssumedVerdict]:
    """Return the verdicts on designs by number; designs without assumed values, or only with zeros, are left out.

    Args:
        history: The trials.
        designs: Trial numbers of feasible designs, and whether to simulate the changes of all their values.

    Raises:
        MissingExtraError: MuJoCo is not installed, but a design should be simulated.
    """
    problem = history.problem
    changes = {number: list(_changes(history, number)) for number in designs}
    rows = [(number, change) for number, of_design in changes.items() for change in of_design]
    if not rows:
        return {}
    arms = [_changed(history, number, change) for number, change in rows]
    arrays = stack_arms(arms)
    evaluations = [problem.physics_of_arms(arrays, case) for case in range(len(problem.scenes))]
    violations = np.max([problem.violations(evaluation) for evaluation in evaluations], axis=0)
    broken: dict[int, list[Broken]] = {number: [] for number in designs}
    simulated: dict[int, list[str]] = {number: [] for number in designs}
    for row, (number, change) in enumerate(rows):
        if fault := _violated(problem, change, violations[row]):
            broken[number].append(fault)
        elif designs[number] and change.text.startswith(ALL):
            simulated[number].append(change.text)
            result = simulate_arm(problem, arms[row], evaluations[0], row, number).result
            broken[number] += [Broken(change.text, reason, None) for reason in result.reasons[:1]]
    return {
        number: AssumedVerdict(
            _verdict(problem, broken[number]), len(of_design), tuple(broken[number]), tuple(simulated[number])
        )
        for number, of_design in changes.items()
        if of_design
    }


def _changes(history: History, number: int) -> Iterator[_Change]:
    assumed = assumed_values(history.problem, [history.member(number).arm])
    names = tuple(dict.fromkeys(name for values in assumed.values() for name, value in values.items() if value))
    for text, those in (*((name, (name,)) for name in names), *([(ALL, names)] if names else [])):
        for verb, factor in FACTORS.items():
            yield _Change(f"{text} {verb}", those, factor)


def _changed(history: History, number: int, change: _Change) -> Arm:
    """Return the arm of a design with a change."""
    space = history.problem.space
    records = tuple(record.scaled(set(change.names) & set(record.assumed), change.factor) for record in space.actuators)
    changed = space.model_copy(update={"actuators": records})
    return changed.arm(history.trials[number].design, history.problem.task.tool)


def _violated(problem: Problem, change: _Change, violations: Array) -> Broken | None:
    """Return the constraint that a change violates most; violations: (C,)."""
    if not (violations > 0.0).any():
        return None
    worst = int(violations.argmax())
    constraint = problem.constraints[worst]
    return Broken(change.text, constraint.description, constraint.measured(float(violations[worst])))


def _verdict(problem: Problem, broken: Sequence[Broken]) -> str:
    if not broken:
        return "holds with assumed values halved and doubled"
    labels: Mapping[str, str] = {c.description: c.quantity.name.replace("_", " ") for c in problem.constraints}
    shown = [
        f"{one.change} ({one.constraint if one.measured is None else f'{labels[one.constraint]} {one.measured:.3g}'})"
        for one in broken[:MAX_SHOWN]
    ]
    left = len(broken) - MAX_SHOWN
    more = [f"and {left} more change{'s' if left > 1 else ''}"] if left > 0 else []
    return f"not with {', '.join([*shown, *more])}"
