"""What cycles cost: full cycles evaluated a second on one core, a single one, and designs with `--robust`.

Random arms of six joints with an XM540-W270 at each, which point the tool down at 8 targets and go from each to the
next along 7 lines: candidates, path, clearance, durations and torques. With `--robust`, the copies of a design that are
off by 1 mm keep its postures; that is compared with copies that choose theirs.

    python benchmarks/cycles.py
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from one_core import on_one_core, print_rates, rates_in_turn, seconds

from armwright.arrays import Array
from armwright.problem.problem import Outcomes, Problem, worst_case
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.tolerance import TOLERANCE, perturbed
from armwright.tasks.task import Task

N, ROUNDS = 256, 5
ANGLES = np.linspace(-0.9, 0.9, 8)
TARGETS = [
    {"position": [0.3 * np.cos(angle), 0.3 * np.sin(angle), 0.1 + 0.05 * (i % 2)], "axis": [0, 0, -1]}
    for i, angle in enumerate(ANGLES.tolist())
]
LINES = [{"to": i + 1, "by": "line"} for i in range(len(TARGETS))]
TASK = Task.model_validate(
    {
        "name": "lines",
        "targets": TARGETS,
        "payload": 0.1,
        "tool": {"tip": [0.0, 0.0, 0.1]},
        "cycle": {"closed": False, "time": 1.5, "steps": LINES},
        "obstacles": [{"kind": "ground", "z": -0.01}],
        "objectives": ["worst_error", "torque_utilisation", "mass"],
    }
)
SPACE = DesignSpace.model_validate(
    {
        "name": "six-axis",
        "joints": 6,
        "restrict": {f"joint_{j}": letter for j, letter in enumerate("YPPPYR", start=1)},
        "link": [0.05, 0.25],
        "origin_x": [-0.1, 0.1],
        "origin_y": [-0.1, 0.1],
        "origin_z": [0.0, 0.1],
        "actuators": ["XM540-W270"],
    }
)


def main() -> None:
    problem = Problem(TASK, SPACE)
    matrix = SPACE.matrix(SPACE.sample(N, seed=0))
    outcomes = problem.evaluate_matrix(matrix)
    feasible = matrix[(outcomes.violations <= 0.0).all(axis=1)]
    assert len(feasible)
    many = feasible[np.arange(N) % len(feasible)]
    robust = replace(problem, tolerance=TOLERANCE)
    work: dict[str, Callable[[], object]] = {
        "random designs": lambda: problem.evaluate_matrix(matrix),
        "feasible designs": lambda: problem.evaluate_matrix(many),
        "feasible designs, robust": lambda: robust.evaluate_matrix(many),
    }
    print(f"Cycles a second on one core; {len(feasible)} of {N} random designs are feasible; median of {ROUNDS}")
    print_rates(rates_in_turn(work, N, ROUNDS))
    alone = min(seconds(lambda: problem.evaluate_matrix(feasible[:1])) for _ in range(20))
    print(f"  a single design {1e3 * alone:10.2f} ms")
    compare(robust.evaluate_matrix(feasible), copies_that_choose(problem, feasible))


def copies_that_choose(problem: Problem, matrix: Array) -> Outcomes:
    """Return the worst case over copies that choose their postures."""
    return worst_case([problem.evaluate_matrix(rows) for rows in (matrix, *perturbed(SPACE, matrix))])


def compare(kept: Outcomes, chosen: Outcomes) -> None:
    """Print how many designs are feasible with all their copies, and how much the torque utilisation differs."""
    holds, other = ((one.violations <= 0.0).all(axis=1) for one in (kept, chosen))
    print(
        f"  feasible with all copies: {holds.sum()} with kept postures, {other.sum()} with chosen ones, of {len(kept)}"
    )
    change = (kept.values[:, 1] / chosen.values[:, 1] - 1.0)[holds & other]
    shown = ", ".join(f"{value:+.1%}" for value in np.quantile(change, [0.0, 0.25, 0.5, 0.75, 1.0]))
    print(f"  torque utilisation with kept postures relative to chosen ones, quartiles of {len(change)}: {shown}")


if __name__ == "__main__":
    on_one_core(__file__, main)
