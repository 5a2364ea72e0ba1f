"""What is known of an existing arm on a task: a URDF may lack drives, prices and the shape of links."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array, finite_or_none
from armwright.problem.arm_quantities import cycle_time
from armwright.problem.constraints import Constraint
from armwright.problem.drive_quantities import dynamic_torque, dynamic_utilisation, price, speed_utilisation
from armwright.problem.evaluation import Evaluation
from armwright.problem.facts import Facts, fact_of, facts_of
from armwright.problem.objective import Objective
from armwright.problem.problem import Problem
from armwright.robot.arm import Arm
from armwright.text import rounded


def known_values(quantity: Objective, evaluation: Evaluation, minimised: bool = False) -> tuple[Array, str]:
    """Return what `Objective.known` does of existing arms, whose URDFs do not tell clearances."""
    if "clearance" in quantity.needs:
        return np.full(len(evaluation), np.nan), "a URDF states no shape that clearances are measured from"
    return quantity.known(evaluation, minimised)


@dataclass(frozen=True)
class ExistingArm:
    """An existing arm on a task."""

    problem: Problem  # task, its objectives and constraints
    evaluation: Evaluation  # physics of this arm alone
    price: float | None = None  # price as stated, in place of that of its parts [USD]; None if not stated

    def value(self, quantity: Objective, minimised: bool = False) -> float | None:
        """Return a quantity; None if it is not known."""
        if quantity == price and self.price is not None:
            return self.price
        return finite_or_none(known_values(quantity, self.evaluation, minimised)[0][0])

    def facts(self, arm: Arm) -> Facts:
        """Return what is known of the arm, which was evaluated."""
        (facts,) = facts_of(self.evaluation, [arm], known_values)
        stated = {} if self.price is None else {price.name: fact_of(price, self.price)}
        return {**facts, **stated}

    @property
    def objectives(self) -> tuple[float | None, ...]:
        """The objectives of the problem, minimised."""
        return tuple(self.value(objective, minimised=True) for objective in self.problem.objectives)

    @property
    def violated(self) -> tuple[str, ...]:
        """The constraints that it violates, with what it has, and the limits of its own drives along the cycle."""
        of_task = tuple(
            f"{constraint.description} (it has {rounded(measured)})"
            for constraint, measured in self._measured
            if measured is not None and float(constraint.violation(np.array(measured))) > 0.0
        )
        return of_task + tuple(self._overloads)

    @property
    def _overloads(self) -> Iterator[str]:
        """Yield which efforts and speeds of the URDF the cycle exceeds; corner speeds, which it lacks, aside."""
        drives, bounded = self.evaluation.arms.actuation, {c.quantity for c in self.problem.constraints}
        if drives is None or self.evaluation.cycle_paths is None or self.value(cycle_time) is None:
            return
        loads = self.evaluation.loads
        torque = drives.safety_factor[0] * np.abs(loads.torques[0]).max(axis=(0, 1)) / drives.peak[0]
        speed = np.abs(loads.speeds[0]).max(axis=(0, 1)) / drives.no_load_speed[0]
        decided = dynamic_utilisation in bounded and self.value(dynamic_utilisation) is not None
        decided |= self.value(dynamic_torque) is None
        if np.nanmax(torque, initial=0.0) > 1.0 and not decided:
            yield f"an effort of its file (along the cycle it needs {np.nanmax(torque):.0%}, safety factor included)"
        if np.nanmax(speed, initial=0.0) > 1.0 and speed_utilisation not in bounded:
            yield f"a speed of its file (along the cycle it needs {np.nanmax(speed):.0%})"

    @property
    def undecided(self) -> tuple[str, ...]:
        """The constraints on quantities that are not known."""
        return tuple(constraint.description for constraint, measured in self._measured if measured is None)

    @property
    def _measured(self) -> list[tuple[Constraint, float | None]]:
        return [(constraint, self.value(constraint.quantity)) for constraint in self.problem.constraints]
