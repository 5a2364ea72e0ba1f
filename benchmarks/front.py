"""How near `FrontSearch` comes to the best known front of each built-in task, and what pymoo's NSGA-II reaches.

For each task: the share of the best known hypervolume after some numbers of evaluations (mean and worst over the
seeds), the evaluations and seconds to 99 %, and the time beside the kernels. Of pymoo everything counts that it ever
found (peers.py).

    python benchmarks/front.py [--seeds 5] [--tasks target-1 target-2] [--budget 200000] [--populations 100 200]
"""

import argparse
import sys
import time
from dataclasses import dataclass, field

import numpy as np
from peers import Nsga2
from searches import reference_point_of

from armwright.arrays import Array
from armwright.experiments.plan import suite_tasks
from armwright.pareto import hypervolume
from armwright.problem.problem import Problem
from armwright.proof.front_gap import known_front
from armwright.search.front.front_search import FrontSearch
from armwright.tasks.catalogue import load_task

BUDGETS = (10_000, 20_000, 50_000, 100_000, 200_000)
PEERS_BUDGET = 100_000  # evaluations
GOAL = 0.99


@dataclass
class Run:
    """What a search reached: (evaluations, seconds, hypervolume) as it went, and its own µs an evaluation."""

    course: list[tuple[int, float, float]] = field(default_factory=list)
    own: float = 0.0

    def at(self, budget: int) -> float:
        """The hypervolume within `budget` evaluations."""
        return next((volume for n, _, volume in reversed(self.course) if n <= budget), 0.0)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--tasks", nargs="+", default=suite_tasks())
    parser.add_argument("--budget", type=int, default=BUDGETS[-1])
    parser.add_argument("--populations", nargs="*", type=int, default=[100, 200])
    options = parser.parse_args()
    budgets = [budget for budget in BUDGETS if budget <= options.budget]
    print(f"Front search: % of the best known hypervolume, mean (worst) of {options.seeds} seeds")
    print(
        f"  {'':24s}" + "".join(f"{budget:>16,d}" for budget in budgets) + "   own µs   to 99 %: evaluations, seconds"
    )
    for name in options.tasks:
        compare(name, budgets, options)


def compare(name: str, budgets: list[int], options: argparse.Namespace) -> None:
    """One task's lines: ours, then pymoo's."""
    problem = Problem(load_task(name))
    reference_point = reference_point_of(problem)
    known = known_front(problem)
    assert known is not None
    best = known.hypervolume(reference_point)
    row(name, [ours(problem, reference_point, seed, budgets[-1]) for seed in range(options.seeds)], budgets, best)
    for population in options.populations:
        runs = [pymoo(problem, reference_point, seed, population, budgets) for seed in range(options.seeds)]
        row(f"  NSGA-II, {population}", runs, [budget for budget in budgets if budget <= PEERS_BUDGET], best)


def row(words: str, runs: list[Run], budgets: list[int], best: float) -> None:
    cells = "".join(
        f"{100.0 * np.mean([run.at(budget) for run in runs]) / best:7.2f} "
        f"({100.0 * min(run.at(budget) for run in runs) / best:6.2f})"
        for budget in budgets
    )
    reached = [next(((n, s) for n, s, volume in run.course if volume >= GOAL * best), None) for run in runs]
    there = [pair for pair in reached if pair]
    evaluations, seconds = np.mean(there, axis=0) if there else (np.nan, np.nan)
    last = f"{evaluations:9,.0f} {seconds:5.1f} ({len(there)} of {len(runs)})" if there else "never"
    print(f"  {words:24s}{cells:80s} {np.mean([run.own for run in runs]):8.1f}   {last}", flush=True)


def ours(problem: Problem, reference_point: tuple[float, ...], seed: int, budget: int) -> Run:
    kernels = 0.0

    def evaluate(rows: Array) -> Array:
        nonlocal kernels
        started = time.perf_counter()
        values = problem.evaluate(rows).values
        kernels += time.perf_counter() - started
        return values

    search, run, seconds = FrontSearch(problem.space.parameters, evaluate, reference_point, seed), Run(), 0.0
    while search.evaluations < budget:
        started = time.perf_counter()
        search.step()
        seconds += time.perf_counter() - started
        run.course.append((search.evaluations, seconds, search.hypervolume))
    run.own = 1e6 * (seconds - kernels) / search.evaluations
    return run


def pymoo(problem: Problem, reference_point: tuple[float, ...], seed: int, population: int, budgets: list[int]) -> Run:
    peer = Nsga2(problem, seed, population, evaluations=min(PEERS_BUDGET, budgets[-1]))
    course = [(n, seconds, hypervolume(values, reference_point)) for n, seconds, values in peer.course]
    return Run(course, 1e6 * peer.own_seconds / peer.evaluations)


if __name__ == "__main__":
    sys.exit(main())
