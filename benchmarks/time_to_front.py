"""Seconds and evaluations to 90, 95 and 99 % of the best known hypervolume: TPE, TPE with the rules, Optuna's NSGA-II,
pymoo's NSGA-II, and our search, which ends earlier where it stalls. Each may take LONGEST seconds; kernels are loaded
before.

    python benchmarks/time_to_front.py
"""

import sys
import time
from collections.abc import Callable
from contextlib import suppress

import numpy as np
from peers import Nsga2

from armwright.pareto import hypervolume
from armwright.problem.problem import Problem
from armwright.proof.front_gap import known_front
from armwright.study.front.front_run import find_front
from armwright.study.front.search_budget import SearchProgress
from armwright.study.progress import Progress
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task

TASKS = ("target-1", "target-2", "target-3")
SHARES = (0.90, 0.95, 0.99)
LONGEST = 12.0  # [s]
SEEDS = range(2)

Course = list[tuple[int, float, float]]  # evaluations, seconds, hypervolume


class EnoughError(Exception):
    pass


def main() -> None:
    print(f"Time to a share of the best known hypervolume: seconds (evaluations), median of {len(SEEDS)} seeds")
    print(f"  {'':26s}" + "".join(f"{share:>20.0%}" for share in SHARES) + f"   at the end ({LONGEST:.0f} s at most)")
    for name in TASKS:
        problem = Problem(load_task(name))
        problem.evaluate(problem.space.sample(100, seed=0))
        known = known_front(problem)
        assert known is not None
        assert problem.reference_point is not None
        best = known.hypervolume(problem.reference_point)
        for method, run in METHODS.items():
            row(f"{name} {method}", [run(problem, seed) for seed in SEEDS], best)


def row(words: str, courses: list[Course], best: float) -> None:
    cells = []
    for share in SHARES:
        reached = [next(((s, n) for n, s, h in course if h >= share * best), (np.inf, np.inf)) for course in courses]
        seconds, evaluations = np.median(reached, axis=0)
        cells.append(f"{seconds:8.1f} ({evaluations:9,.0f})" if np.isfinite(seconds) else "-")
    last = np.mean([course[-1][2] / best for course in courses])
    print(f"  {words:26s}" + "".join(f"{cell:>20s}" for cell in cells) + f"   {last:.1%}", flush=True)


def study(**settings: object) -> Callable[[Problem, int], Course]:
    def run(problem: Problem, seed: int) -> Course:
        course: Course = []
        started = time.perf_counter()

        def watch(progress: Progress) -> None:
            seconds = time.perf_counter() - started
            if progress.doing == "finished":
                course.append((progress.number + 1, seconds, progress.hypervolume or 0.0))
            if seconds > LONGEST:
                raise EnoughError

        with suppress(EnoughError):
            optimize(problem, n_total=100_000, seed=seed, watch=watch, **settings)  # pyright: ignore[reportArgumentType]
        return course

    return run


def ours(problem: Problem, seed: int) -> Course:
    course: Course = []

    def watch(progress: SearchProgress) -> None:
        course.append((progress.evaluations, progress.seconds, progress.hypervolume))

    find_front(problem, budget=LONGEST, seed=seed, watch=watch)
    return course


def pymoo(problem: Problem, seed: int) -> Course:
    assert problem.reference_point is not None
    course = Nsga2(problem, seed, population=100, seconds=LONGEST).course
    return [(n, seconds, hypervolume(values, problem.reference_point)) for n, seconds, values in course]


METHODS = {
    "TPE": study(proposer="none"),
    "TPE + rules": study(proposer="rules"),
    "Optuna's NSGA-II": study(proposer="none", sampler="nsga2"),
    "pymoo's NSGA-II": pymoo,
    "armwright design": ours,
}


if __name__ == "__main__":
    sys.exit(main())
