"""What the rules proposer is worth: against TPE alone, and against TPE with as many Sobol points injected.

    python benchmarks/rules.py [--tasks 30] [--seeds 5] [--first-task 0] [--jobs 2]

The structures and constants of the rules were chosen on random tasks from 1000 on; the tasks here are others.
The figure is the hypervolume, averaged over the counted iterations of a run; a task's ratio divides the means
over its seeds. Intervals: 95 %, bootstrap over the tasks.
"""

import argparse
import itertools
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from scipy.stats import qmc

from armwright.problem.problem import Problem
from armwright.proposers.proposer import Proposal, Proposer
from armwright.proposers.rules import RulesProposer
from armwright.runs.history import History
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import FloatParameter, ParameterValue
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task, random_task

METHODS = ("TPE", "Sobol", "rules")
PAPER_TASKS = ("target-1", "target-2", "target-3")
RESAMPLES = 10_000


class SobolProposer(Proposer):
    """The points of one scrambled Sobol sequence over the space, one after the other."""

    name = "sobol"

    def __init__(self, run_seed: int) -> None:
        self._run_seed = run_seed

    def propose(self, history: History, seed: int, number: int) -> Proposal:
        space = history.problem.space
        earlier = sum(trial.source == self.name for trial in history)
        sequence = qmc.Sobol(len(space.parameters), scramble=True, rng=np.random.default_rng(self._run_seed))
        if earlier:
            sequence.fast_forward(earlier)
        return Proposal(space.design(parameters(space, sequence.random(1)[0])), f"sobol-{number:04d}")


def parameters(space: DesignSpace, point: np.ndarray) -> dict[str, ParameterValue]:
    """The parameter values at a point of the unit cube."""
    values: dict[str, ParameterValue] = {}
    for parameter, u in zip(space.parameters, point.tolist(), strict=True):
        if isinstance(parameter, FloatParameter):
            values[parameter.name] = parameter.low + u * (parameter.high - parameter.low)
        else:
            values[parameter.name] = parameter.choices[int(u * len(parameter.choices))]
    return values


def mean_hypervolume(cell: tuple[str | int, int, str]) -> float:
    """Of one run: a built-in task's name or a random task's number, the run's seed, the method."""
    task, seed, method = cell
    proposers: dict[str, Proposer | None] = {"TPE": None, "Sobol": SobolProposer(seed), "rules": RulesProposer()}
    problem = Problem(random_task(task) if isinstance(task, int) else load_task(task))
    return float(optimize(problem, proposer=proposers[method], seed=seed).hypervolume.mean())


def summary(name: str, ratios: np.ndarray) -> str:
    """Mean of the tasks' ratios and its bootstrap interval."""
    rows = np.random.default_rng(0).integers(len(ratios), size=(RESAMPLES, len(ratios)))
    low, high = np.quantile(ratios[rows].mean(axis=1), [0.025, 0.975])
    return (
        f"{name:<14} mean ratio {ratios.mean():.3f}  [{low:.3f}, {high:.3f}]  "
        f"smallest {ratios.min():.3f}, above 1 on {np.sum(ratios > 1.0)} of {len(ratios)} tasks"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", type=int, default=30)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--first-task", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()

    tasks = [*range(options.first_task, options.first_task + options.tasks), *PAPER_TASKS]
    cells = list(itertools.product(tasks, range(options.seeds), METHODS))
    with ProcessPoolExecutor(options.jobs) as pool:
        volumes = np.array(list(pool.map(mean_hypervolume, cells)))
    table = volumes.reshape(len(tasks), options.seeds, len(METHODS)).mean(axis=1)  # (tasks, methods)

    print(f"{'task':<12}" + "".join(f"{method:>8}" for method in METHODS) + "   rules/TPE  Sobol/TPE")
    for task, row in zip(tasks, table, strict=True):
        name = f"random-{task}" if isinstance(task, int) else task
        print(f"{name:<12}" + "".join(f"{v:8.2f}" for v in row) + f"{row[2] / row[0]:12.3f}{row[1] / row[0]:11.3f}")
    random = table[: options.tasks]
    print()
    print(summary("rules / TPE", random[:, 2] / random[:, 0]))
    print(summary("Sobol / TPE", random[:, 1] / random[:, 0]))
    print(summary("rules / Sobol", random[:, 2] / random[:, 1]))
    paper = table[options.tasks :]
    print(f"{', '.join(PAPER_TASKS)}: rules / TPE, mean {np.mean(paper[:, 2] / paper[:, 0]):.3f}")


if __name__ == "__main__":
    main()
