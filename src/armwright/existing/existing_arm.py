"""What is known of an existing arm on a task: a URDF may lack drives, prices and the shape of links."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import SettingsError
from armwright.problem.constraints import Constraint
from armwright.problem.evaluation import Evaluation
from armwright.problem.objective import Objective
from armwright.problem.objectives import (
    CLEARANCE_QUANTITIES,
    CYCLE_TIME,
    DYNAMIC_UTILISATION,
    PRICE,
    SPEED_UTILISATION,
)
from armwright.problem.problem import Problem
from armwright.text import rounded


def known_values(quantity: Objective, evaluation: Evaluation, minimised: bool = False) -> Array | None:
    """Return (N,) values of existing arms; None if their URDFs do not tell.

    Args:
        quantity: The quantity.
        evaluation: Physics of the arms.
        minimised: Return its value as an objective, which ignores errors below stated tolerances.
    """
    if quantity in CLEARANCE_QUANTITIES:
        return None
    try:
        return quantity.minimised(evaluation) if minimised else quantity(evaluation)
    except SettingsError:
        return None


@dataclass(frozen=True)
class ExistingArm:
    """An existing arm on a task."""

    problem: Problem  # task, its objectives and constraints
    evaluation: Evaluation  # physics of this arm alone
    price: float | None = None  # price as stated, in place of that of its parts [USD]; None if not stated

    def value(self, quantity: Objective, minimised: bool = False) -> float | None:
        """Return a quantity; None if it is not known or not finite."""
        if quantity == PRICE and self.price is not None:
            return self.price
        values = known_values(quantity, self.evaluation, minimised)
        return float(values[0]) if values is not None and np.isfinite(values[0]) else None

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
        if drives is None or self.evaluation.cycle_paths is None or self.value(CYCLE_TIME) is None:
            return
        loads = self.evaluation.loads
        torque = drives.safety_factor[0] * np.abs(loads.torques[0]).max(axis=(0, 1)) / drives.peak[0]
        speed = np.abs(loads.speeds[0]).max(axis=(0, 1)) / drives.no_load_speed[0]
        decided = DYNAMIC_UTILISATION in bounded and self.value(DYNAMIC_UTILISATION) is not None
        if np.nanmax(torque, initial=0.0) > 1.0 and not decided:
            yield f"an effort of its file (along the cycle it needs {np.nanmax(torque):.0%}, safety factor included)"
        if np.nanmax(speed, initial=0.0) > 1.0 and SPEED_UTILISATION not in bounded:
            yield f"a speed of its file (along the cycle it needs {np.nanmax(speed):.0%})"

    @property
    def undecided(self) -> tuple[str, ...]:
        """The constraints on quantities that are not known."""
        return tuple(constraint.description for constraint, measured in self._measured if measured is None)

    @property
    def _measured(self) -> list[tuple[Constraint, float | None]]:
        return [(constraint, self.value(constraint.quantity)) for constraint in self.problem.constraints]
