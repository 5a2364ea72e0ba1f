"""What clearance costs: designs a second on one core, 6 joints, 8 targets, links against each other and 3 obstacles.

Random arms of the paper's space with 6 joints at the targets of target-1, about a floor, a shelf and a pole. Both sides
are measured in turn, as the speed of a shared machine drifts.

    python benchmarks/clearance.py
"""

import statistics
from collections.abc import Callable

from one_core import on_one_core, print_rates, rates_in_turn, seconds

from armwright.kinematics.clearance import clearances
from armwright.problem.evaluation import Scene, evaluate_arrays
from armwright.problem.objectives import named_objectives
from armwright.problem.problem import Problem
from armwright.spaces.batch_builder import stack_designs
from armwright.spaces.design_space import paper_space
from armwright.tasks.catalogue import load_task
from armwright.tasks.obstacles import Box, Cylinder, Ground

N, ROUNDS = 4000, 7
OBSTACLES = (
    Ground(kind="ground", z=-0.6),
    Box(kind="box", center=(0.5, 0.0, 0.2), size=(0.3, 0.7, 0.02), yaw=0.3),
    Cylinder(kind="cylinder", center=(0.3, 0.3, 0.0), radius=0.03, height=1.2),
)
TASK = load_task("target-1").model_copy(update={"obstacles": OBSTACLES, "reference_point": None})
SPACE = paper_space(6)


def main() -> None:
    matrix = SPACE.matrix(SPACE.sample(N, seed=0))
    arms = stack_designs(SPACE, matrix)
    q = evaluate_arrays(arms, Scene(TASK.target_positions, TASK.payloads, TASK.target_arrays)).q
    paper = Problem(TASK, SPACE)
    with_clearance = Problem(TASK, SPACE, objectives=named_objectives(["position_error", "torque", "collision"]))
    work: dict[str, Callable[[], object]] = {
        "position error and torque": lambda: paper.evaluate_matrix(matrix),
        "and collision": lambda: with_clearance.evaluate_matrix(matrix),
        "clearance alone": lambda: clearances(arms, q, OBSTACLES),
        "of itself alone": lambda: clearances(arms, q),
    }
    rates = rates_in_turn(work, N, ROUNDS)
    print(f"Clearance: designs/s on one core, D = 6, 8 targets, 3 obstacles; median of {ROUNDS} (least, most)")
    print_rates(rates)
    share = [a / b for a, b in zip(rates["and collision"], rates["position error and torque"], strict=True)]
    print(f"  with collision, of without {statistics.median(share):10.2f}   ({min(share):.2f}, {max(share):.2f})")
    alone = min(seconds(lambda: clearances(arms[:1], q[:1], OBSTACLES)) for _ in range(50))
    print(f"  clearance of one design    {1e3 * alone:10.2f} ms")


if __name__ == "__main__":
    on_one_core(__file__, main)
