"""What straight moves cost: designs a second on one core, 6 joints, 8 targets, 7 moves from each to the next.

Random arms of the paper's space with 6 joints at the targets of target-1, whose corners lie 0.9 m apart and more. Both
sides are measured in turn, as the speed of a shared machine drifts.

    python benchmarks/moves.py
"""

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable

from armwright.objectives import named_objectives
from armwright.problem import Problem
from armwright.space import paper_space
from armwright.task import load_task

N, ROUNDS = 1000, 5
TASK = load_task("target-1").model_copy(update={"moves": "in_order", "move_time": 1.5, "reference_point": None})
SPACE = paper_space(6)


def main() -> None:
    if "--one-core" not in sys.argv:
        # In a process of its own, which never had more threads than that.
        subprocess.run(
            [sys.executable, __file__, "--one-core"],
            check=True,
            preexec_fn=lambda: os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:1]),
        )
        return
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
    for do in work.values():
        do()  # compiles and loads
    rounds = [{name: N / seconds(do) for name, do in work.items()} for _ in range(ROUNDS)]
    samples = sum(n + 1 for n in TASK.lines.steps(TASK.points))
    print(
        f"Moves: designs/s on one core, D = 6, 8 targets, 7 moves, {samples} samples; median of {ROUNDS} (least, most)"
    )
    for name in work:
        found = [one[name] for one in rounds]
        print(f"  {name:26s} {statistics.median(found):10.0f}   ({min(found):.0f}, {max(found):.0f})")
    design = matrix[:1]
    alone = min(seconds(lambda: problems["and path error"].evaluate_matrix(design)) for _ in range(20))
    print(f"  a single design, with path error {1e3 * alone:10.2f} ms")


def seconds(do: Callable[[], object]) -> float:
    started = time.perf_counter()
    do()
    return time.perf_counter() - started


if __name__ == "__main__":
    main()
