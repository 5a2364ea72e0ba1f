"""What clearance costs: designs a second on one core, 6 joints, 8 targets, links against each other and 3 obstacles.

Random arms of the paper's space with 6 joints at the targets of target-1, about a floor, a shelf and a pole. Both sides
are measured in turn, as the speed of a shared machine drifts.

    python benchmarks/clearance.py
"""

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable

from armwright.evaluation import evaluate_arrays
from armwright.kinematics.arrays import arrays_of
from armwright.kinematics.clearance import clearances
from armwright.objectives import named_objectives
from armwright.obstacles import Box, Cylinder, Ground
from armwright.problem import Problem
from armwright.space import paper_space
from armwright.task import load_task

N, ROUNDS = 4000, 7
OBSTACLES = (
    Ground(kind="ground", z=-0.6),
    Box(kind="box", center=(0.5, 0.0, 0.2), size=(0.3, 0.7, 0.02), yaw=0.3),
    Cylinder(kind="cylinder", center=(0.3, 0.3, 0.0), radius=0.03, height=1.2),
)
TASK = load_task("target-1").model_copy(update={"obstacles": OBSTACLES, "reference_point": None})
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
    arms = arrays_of(SPACE, matrix)
    q = evaluate_arrays(arms, TASK.points).q
    paper = Problem(TASK, SPACE)
    with_clearance = Problem(TASK, SPACE, objectives=named_objectives(["position_error", "torque", "collision"]))
    work: dict[str, Callable[[], object]] = {
        "position error and torque": lambda: paper.evaluate_matrix(matrix),
        "and collision": lambda: with_clearance.evaluate_matrix(matrix),
        "clearance alone": lambda: clearances(arms, q, OBSTACLES),
        "of itself alone": lambda: clearances(arms, q),
    }
    for do in work.values():
        do()  # compiles and loads
    rounds = [{name: N / seconds(do) for name, do in work.items()} for _ in range(ROUNDS)]
    print(f"Clearance: designs/s on one core, D = 6, 8 targets, 3 obstacles; median of {ROUNDS} (least, most)")
    for name in work:
        found = [one[name] for one in rounds]
        print(f"  {name:26s} {statistics.median(found):10.0f}   ({min(found):.0f}, {max(found):.0f})")
    share = [one["and collision"] / one["position error and torque"] for one in rounds]
    print(f"  with collision, of without {statistics.median(share):10.2f}   ({min(share):.2f}, {max(share):.2f})")
    alone = min(seconds(lambda: clearances(arms[:1], q[:1], OBSTACLES)) for _ in range(50))
    print(f"  clearance of one design    {1e3 * alone:10.2f} ms")


def seconds(do: Callable[[], object]) -> float:
    started = time.perf_counter()
    do()
    return time.perf_counter() - started


if __name__ == "__main__":
    main()
