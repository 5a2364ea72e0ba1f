"""How near `FrontSearch` comes to the best known front of each built-in task, and what pymoo's NSGA-II reaches.

For each task: the share of the best known hypervolume after some numbers of evaluations (mean and worst over the
seeds), the evaluations and seconds to 99 %, and the search's own time beside the kernels. The best known is the
largest hypervolume of all runs made here and of the fronts in --known (files TASK-values.npy, arrays (N, M)).
pymoo works on the same columns (a category is the whole part of a real number) with its default operators.

    python benchmarks/front.py [--seeds 5] [--tasks target-1 target-2] [--known FOLDER] [--pymoo-seeds 5]
"""

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.callback import Callback
from pymoo.core.problem import Problem as PymooProblem
from pymoo.optimize import minimize

from armwright.pareto import default_reference_point, hypervolume
from armwright.problem import Problem
from armwright.search.front import FrontSearch
from armwright.space import FloatParameter
from armwright.task import builtin_tasks

BUDGETS = (10_000, 25_000, 50_000, 100_000, 200_000, 400_000)
PYMOO_BUDGETS = (50_000, 100_000)
POPULATIONS = (100, 200)
GOAL = 0.99


@dataclass
class Timed:
    """A function of rows and the seconds spent in it."""

    function: Callable[[np.ndarray], np.ndarray]
    seconds: float = 0.0

    def __call__(self, rows: np.ndarray) -> np.ndarray:
        started = time.perf_counter()
        values = self.function(rows)
        self.seconds += time.perf_counter() - started
        return values


@dataclass
class Run:
    """What a search reached: (evaluations, seconds, hypervolume) as it went, and its own µs an evaluation."""

    course: list[tuple[int, float, float]] = field(default_factory=list)
    own: float = 0.0

    def at(self, budget: int) -> float:
        """The hypervolume once `budget` evaluations were made."""
        return next(h for n, _, h in self.course if n >= budget)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--pymoo-seeds", type=int, default=5)
    parser.add_argument("--tasks", nargs="+", default=list(builtin_tasks()))
    parser.add_argument("--budget", type=int, default=BUDGETS[-1])
    parser.add_argument("--known", type=Path)
    options = parser.parse_args()
    budgets = [budget for budget in BUDGETS if budget <= options.budget]
    print(f"Front search: % of the best known hypervolume, mean (worst) of {options.seeds} seeds")
    print(f"  {'task':14s}" + "".join(f"{budget:>16,d}" for budget in budgets) + "     to 99 %: evaluations, seconds")
    for name in options.tasks:
        compare(name, budgets, options)


def compare(name: str, budgets: list[int], options: argparse.Namespace) -> None:
    """One task's lines: ours, then pymoo's."""
    problem = Problem(builtin_tasks()[name])
    reference_point = problem.reference_point or default_reference_point(problem.evaluate(problem.space.sample(10, 0)))
    ours = [search(problem, reference_point, seed, budgets[-1]) for seed in range(options.seeds)]
    theirs = {
        population: [pymoo(problem, reference_point, seed, population) for seed in range(options.pymoo_seeds)]
        for population in POPULATIONS
    }
    every = [run.course[-1][2] for run in [*ours, *(run for runs in theirs.values() for run in runs)]]
    best = max([*every, known(options.known, name, reference_point)])
    reached = [next(((n, s) for n, s, h in run.course if h >= GOAL * best), (np.nan, np.nan)) for run in ours]
    evaluations, seconds = np.array(reached).T
    print(
        f"  {name:14s}{shares(ours, budgets, best)}     {np.mean(evaluations):9,.0f}  {np.mean(seconds):6.1f}   "
        f"best known {best:.4f}, own time {np.mean([run.own for run in ours]):.1f} µs an evaluation"
    )
    for population, runs in theirs.items():
        if runs:
            some = [budget if budget in PYMOO_BUDGETS else None for budget in budgets]
            print(
                f"    NSGA-II {population:<4d}{shares(runs, some, best)}     own time "
                f"{np.mean([run.own for run in runs]):.1f} µs an evaluation"
            )
    sys.stdout.flush()


def shares(runs: list[Run], budgets: list[int] | list[int | None], best: float) -> str:
    """Mean and worst share at each budget [%]; blank where there is none."""
    cells: list[str] = []
    for budget in budgets:
        values = [100.0 * run.at(budget) / best for run in runs] if budget else []
        cells.append(f"{np.mean(values):7.2f} ({min(values):6.2f})" if values else " " * 16)
    return "".join(cells)


def known(folder: Path | None, name: str, reference_point: tuple[float, float]) -> float:
    """The hypervolume of a front that was found before; 0 where there is none."""
    file = folder / f"{name}-values.npy" if folder else None
    return hypervolume(np.load(file), reference_point) if file and file.exists() else 0.0


def search(problem: Problem, reference_point: tuple[float, float], seed: int, budget: int) -> Run:
    evaluate = Timed(problem.evaluate_matrix)
    made = FrontSearch(problem.space.parameters, evaluate, reference_point, seed)
    run, own = Run(), 0.0
    while made.evaluations < budget:
        started = time.perf_counter()
        made.step()
        own += time.perf_counter() - started
        run.course.append((made.evaluations, own, made.hypervolume))
    run.own = 1e6 * (own - evaluate.seconds) / made.evaluations
    return run


class Columns(PymooProblem):
    """The problem as pymoo takes it: real columns, a category is the whole part of its number."""

    def __init__(self, problem: Problem, evaluate: Timed) -> None:
        ranges = [
            (p.low, p.high) if isinstance(p, FloatParameter) else (0.0, len(p.choices) - 1e-9)
            for p in problem.space.parameters
        ]
        low, high = np.array(ranges).T
        super().__init__(n_var=len(ranges), n_obj=2, xl=low, xu=high)
        self._categorical = [not isinstance(p, FloatParameter) for p in problem.space.parameters]
        self._evaluate_rows = evaluate

    def _evaluate(self, x: np.ndarray, out: dict, *args: object, **kwargs: object) -> None:
        out["F"] = self._evaluate_rows(np.where(self._categorical, np.floor(x), x))


class Course(Callback):
    """The hypervolume of all that was evaluated so far, at pymoo's budgets."""

    def __init__(self, run: Run, reference_point: tuple[float, float], evaluate: Timed) -> None:
        super().__init__()
        self._run, self._reference_point = run, reference_point
        self._values: list[np.ndarray] = []

    def update(self, algorithm: NSGA2) -> None:
        self._values.append(algorithm.off.get("F") if algorithm.off is not None else algorithm.pop.get("F"))
        evaluations = algorithm.evaluator.n_eval
        due = PYMOO_BUDGETS[len(self._run.course)] if len(self._run.course) < len(PYMOO_BUDGETS) else np.inf
        if evaluations >= due:
            # All points ever found, not only the population: what an archive beside it would hold.
            self._run.course.append((evaluations, 0.0, hypervolume(np.vstack(self._values), self._reference_point)))


def pymoo(problem: Problem, reference_point: tuple[float, float], seed: int, population: int) -> Run:
    evaluate = Timed(problem.evaluate_matrix)
    run = Run()
    started = time.perf_counter()
    minimize(
        Columns(problem, evaluate),
        NSGA2(pop_size=population),
        ("n_eval", PYMOO_BUDGETS[-1]),
        seed=seed,
        callback=Course(run, reference_point, evaluate),
    )
    run.own = 1e6 * (time.perf_counter() - started - evaluate.seconds) / PYMOO_BUDGETS[-1]
    return run


if __name__ == "__main__":
    main()
