"""Error objectives that constraints keep within the tolerances, so that a search cannot improve them."""

from collections.abc import Iterator

from armwright.problem.arm_quantities import cycle_time, mass, peak_torque
from armwright.problem.checks.finding import SUSPECTED, Finding
from armwright.problem.drive_quantities import price
from armwright.problem.ignored_errors import LINES, stated_tolerance
from armwright.problem.problem import Problem
from armwright.problem.stated_bounds import TOLERANCES, stated_bounds


def check_idle_objectives(problem: Problem) -> Iterator[Finding]:
    """Find objectives whose errors the constraints keep within the tolerances."""
    idle: list[str] = []
    for objective, bound in zip(problem.objectives, stated_bounds(problem), strict=True):
        if bound is not None and objective.name in LINES:
            is_idle = bound.value <= float(stated_tolerance(problem.task, objective).min(initial=0.0))
        else:
            is_idle = bound is not None and bound.reason == TOLERANCES
        idle += [objective.name] * is_idle
    if idle:
        yield Finding(
            f"{' and '.join(idle)}: 0 or next to 0 for every feasible design, as the constraints keep errors within "
            f"the tolerances; try {_others(problem)}",
            SUSPECTED,
        )


def _others(problem: Problem) -> str:
    """Return objectives that suit the task, as its file would state them."""
    motors, cycle = problem.space.actuators, problem.task.cycle
    first = cycle_time if motors and cycle is not None and None in cycle.durations() else peak_torque
    second = price if motors and all(motor.price is not None for motor in motors) else mass
    return f"objectives: [{first.name}, {second.name}]"
