"""BBO's row of the paper's table: five seeds on each of the three tasks.

E_hv: mean over the 200 iterations of the mean over seeds; σ_hv: mean over iterations of the standard deviation
over seeds (ddof = 0).

    python benchmarks/paper.py [--seeds 5] [--proposer none]
"""

import argparse
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from armwright.problem import Problem
from armwright.study import optimize
from armwright.task import load_task

PAPER = {"target-1": (6.70, 2.03), "target-2": (13.16, 2.39), "target-3": (14.64, 3.43)}


def curve(cell: tuple[str, str, int]) -> np.ndarray:
    task, proposer, seed = cell
    return optimize(Problem(load_task(task)), proposer=proposer, seed=seed).hypervolume


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--proposer", default="none")
    options = parser.parse_args()
    cells = [(task, options.proposer, seed) for task in PAPER for seed in range(options.seeds)]
    with ProcessPoolExecutor(2) as pool:
        curves = np.array(list(pool.map(curve, cells))).reshape(len(PAPER), options.seeds, -1)
    print(
        f"Paper's tasks, --proposer {options.proposer}, {options.seeds} seeds: E_hv (σ_hv), and at the last iteration"
    )
    for (task, (mean, deviation)), runs in zip(PAPER.items(), curves, strict=True):
        ours = f"{runs.mean():5.2f} ({runs.std(axis=0).mean():.2f}), last {runs[:, -1].mean():5.2f}"
        apart = (runs.mean() - mean) / deviation
        print(f"  {task}: {ours}   paper's BBO {mean:5.2f} ({deviation:.2f}); apart by {apart:+.2f} of the paper's σ")


if __name__ == "__main__":
    main()
