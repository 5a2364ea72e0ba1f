"""Error objectives that constraints keep within the tolerances, so that a search cannot improve them."""

from collections.abc import Iterator

import numpy as np

from armwright.problem.checks.finding import SUSPECTED, Finding
from armwright.problem.constraints import Constraint
from armwright.problem.ignored_errors import ANGLES, LINES, POSITIONS, stated_tolerance
from armwright.problem.objective import Objective
from armwright.problem.objectives import cycle_time, dynamic_torque, mass, peak_torque, price, unreached_targets
from armwright.problem.problem import Problem


def check_idle_objectives(problem: Problem) -> Iterator[Finding]:
    """Find objectives whose errors the constraints keep within the tolerances."""
    for constraint in problem.constraints:
        bounded = [objective for objective in problem.objectives if _is_bounded(problem, objective, constraint)]
        for ignored, why in ((True, "below which they count as 0"), (False, "and postures are found more exactly")):
            names = [objective.name for objective in bounded if _is_ignored(problem, objective) == ignored]
            if names:
                yield Finding(
                    f"{' and '.join(names)}: {'0' if ignored else 'next to 0'} for every feasible design, as "
                    f'"{constraint.description}" keeps errors within the {"stated " if ignored else ""}tolerances, '
                    f"{why}; try {_others(problem)}",
                    SUSPECTED,
                )


def _is_bounded(problem: Problem, objective: Objective, constraint: Constraint) -> bool:
    """Return whether a constraint keeps an error objective within the tolerances."""
    if objective.name in LINES:
        tolerance = stated_tolerance(problem.task, objective)
        return constraint.quantity == objective and constraint.bound <= float(tolerance.min(initial=0.0))
    is_error = objective.name in (*POSITIONS, *ANGLES)
    return is_error and constraint.quantity == unreached_targets and constraint.bound < 1.0


def _is_ignored(problem: Problem, objective: Objective) -> bool:
    """Return whether errors within the tolerances count as 0 at all targets."""
    if objective.name in LINES:
        return True
    arrays = problem.task.target_arrays
    relevant = arrays.n_angular > 0 if objective.name in ANGLES else np.full(len(arrays), True)
    return bool((stated_tolerance(problem.task, objective)[relevant] > 0.0).all())


def _others(problem: Problem) -> str:
    """Return objectives that suit the task, as its file would state them."""
    motors, cycle = problem.space.actuators, problem.task.cycle
    if cycle is None:
        first = peak_torque
    elif None not in cycle.durations():
        first = dynamic_torque
    else:
        first = cycle_time if motors else peak_torque
    second = price if motors and all(motor.price is not None for motor in motors) else mass
    return f"objectives: [{first.name}, {second.name}]"
