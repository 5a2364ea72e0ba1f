"""What straight moves cost: designs a second on one core, 6 joints, 8 targets, 7 moves from each to the next.

Random arms of the paper's space with 6 joints at the targets of target-1, whose corners lie 0.9 m apart and more. Both
sides are measured in turn, as the speed of a shared machine drifts.

    python benchmarks/moves.py
"""

from collections.abc import Callable

from one_core import on_one_core, print_rates, rates_in_turn, seconds

from armwright.problem.objectives import named_objectives
from armwright.problem.problem import Problem
from armwright.spaces.design_space import paper_space
from armwright.tasks.catalogue import load_task

N, ROUNDS = 1000, 5
TASK = load_task("target-1").model_copy(update={"moves": "in_order", "move_time": 1.5, "reference_point": None})
SPACE = paper_space(6)


def main() -> None:
    matrix = SPACE.matrix(SPACE.sample(N, seed=0))
    names = {
        "position error and torque": ["position_error", "torque"],
        "and path error": ["position_error", "torque", "path_error"],
        "and collision": ["position_error", "torque", "path_error", "collision"],
        "and dynamic torque": ["position_error", "torque", "path_error", "dynamic_torque"],
    }
    problems = {words: Problem(TASK, SPACE, objectives=named_objectives(some)) for words, some in names.items()}
    work: dict[str, Callable[[], object]] = {
        words: lambda problem=problem: problem.evaluate_matrix(matrix) for words, problem in problems.items()
    }
    rates = rates_in_turn(work, N, ROUNDS)
    samples = sum(n + 1 for n in TASK.straight_moves.steps(TASK.target_positions))
    print(
        f"Moves: designs/s on one core, D = 6, 8 targets, 7 moves, {samples} samples; median of {ROUNDS} (least, most)"
    )
    print_rates(rates)
    design = matrix[:1]
    alone = min(seconds(lambda: problems["and path error"].evaluate_matrix(design)) for _ in range(20))
    print(f"  a single design, with path error {1e3 * alone:10.2f} ms")


if __name__ == "__main__":
    on_one_core(__file__, main)
