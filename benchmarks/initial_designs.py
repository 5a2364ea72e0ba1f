"""What designs proposed by the rules bring as the first ones of a direct search (`armwright design --proposer rules`).

For each task, % of the best known hypervolume after some numbers of evaluations, without and with them: mean, and
standard error of the mean over the seeds.

    python benchmarks/initial_designs.py [--tasks target-1 desk-sorting] [--seeds 6]
"""

import argparse

import numpy as np

from armwright.arrays import Array
from armwright.pareto import hypervolume
from armwright.problem.problem import Problem
from armwright.proposers.rules import RulesProposer
from armwright.runs.front_gap import known_front
from armwright.spaces.design_space import default_space
from armwright.study.front_run import find_front
from armwright.tasks.catalogue import builtin_tasks

CYCLES = [name for name, task in builtin_tasks().items() if task.cycle is not None]
EVALUATIONS = (500, 1_500)
CHECKED = 1.05  # times the number of evaluations, up to which a record of the hypervolume counts for it


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--tasks", nargs="+", default=["target-1", "target-2", "target-3", *CYCLES])
    parser.add_argument("--seeds", type=int, default=6)
    options = parser.parse_args()
    print(f"  {'':22s}" + "".join(f"{n:>14,d}, none {n:>14,d}, rules" for n in EVALUATIONS))
    for name in options.tasks:
        problem = Problem(builtin_tasks()[name], default_space(name))
        without, seeded = (
            np.array([shares(problem, seed, proposer) for seed in range(options.seeds)])
            for proposer in (None, RulesProposer())
        )
        cells = (f"{cell(without[:, i]):>20s}{cell(seeded[:, i]):>21s}" for i in range(len(EVALUATIONS)))
        print(f"  {name:22s}" + "".join(cells), flush=True)


def shares(problem: Problem, seed: int, proposer: RulesProposer | None) -> list[float]:
    """The share of the best known hypervolume after each number of evaluations [%]."""
    known, point = known_front(problem), problem.reference_point
    assert known is not None
    assert point is not None
    run = find_front(problem, evaluations=EVALUATIONS[-1], seed=seed, initial_designs=proposer, stop_at_stall=False)
    course = run.summary["search"]["hypervolume_history"]
    best = hypervolume(known.values, point)
    return [100.0 * max((v for n, v in course if n <= CHECKED * limit), default=0.0) / best for limit in EVALUATIONS]


def cell(values: Array) -> str:
    return f"{values.mean():.1f} ± {values.std(ddof=1) / np.sqrt(len(values)):.1f}"


if __name__ == "__main__":
    main()
