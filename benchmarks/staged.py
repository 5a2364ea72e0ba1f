"""What the screening of offspring gains and loses on the tasks with cycles, in the spaces of their names.

For each task and seed: the hypervolume of a screened search after BUDGET evaluations, of an unscreened one after as
many, after as much processor time, and after ten times as many. The rates are designs considered per second of
processor time by the screened search, and evaluated by the other one; `bounds` is the share that these discarded.
Hypervolumes are in % of the best known front's.

    python benchmarks/staged.py [--tasks desk-sorting lathe-tending] [--seeds 2] [--budget 2000]
"""

import argparse
import time
from dataclasses import dataclass, field

import numpy as np
from searches import new_search

from armwright.pareto import hypervolume
from armwright.problem.problem import Problem
from armwright.runs.front_gap import known_front
from armwright.search.screening import Screen, pays
from armwright.spaces.design_space import default_space
from armwright.tasks.catalogue import builtin_tasks

LONGER = 10  # times the budget that the unscreened search ends with


@dataclass
class Course:
    """A search as it went: evaluations, seconds and hypervolume after each generation, and what the screen did."""

    points: list[tuple[int, float, float]] = field(default_factory=list[tuple[int, float, float]])
    counts: dict[str, int] = field(default_factory=dict[str, int])

    @property
    def seconds(self) -> float:
        return self.points[-1][1]

    def within(self, evaluations: float = np.inf, seconds: float = np.inf) -> float:
        """The hypervolume within a budget."""
        return next((v for n, s, v in reversed(self.points) if n <= evaluations and s <= seconds), 0.0)


def main() -> None:
    cycles = [name for name, task in builtin_tasks().items() if pays(Problem(task, default_space(name)))]
    parser = argparse.ArgumentParser()
    parser.add_argument("--tasks", nargs="+", default=cycles)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--budget", type=int, default=2000)
    options = parser.parse_args()
    print(
        f"  {'task, seed':22s}{'considered/s':>13s}{'evaluated/s':>12s}{'ratio':>7s}{'bounds':>8s}"
        f"{'screened':>10s}{'same N':>10s}{'same time':>10s}{f'{LONGER} N':>10s}{'loss':>8s}"
    )
    for name in options.tasks:
        problem = Problem(builtin_tasks()[name], default_space(name))
        problem.evaluate(problem.space.sample(100, seed=0))  # loads the kernels
        for seed in range(options.seeds):
            row(problem, seed, options.budget)


def row(problem: Problem, seed: int, budget: int) -> None:
    known = known_front(problem)
    assert known is not None
    reference_point = problem.reference_point
    assert reference_point is not None
    best = hypervolume(known.values, reference_point)
    screened, plain = (
        run(problem, seed, budget, Screen(problem, lambda: reference_point)),
        run(problem, seed, LONGER * budget, None),
    )
    considered = screened.counts["considered"] / screened.seconds
    evaluated = plain.points[-1][0] / plain.seconds
    shares = [screened.within(), plain.within(budget), plain.within(seconds=screened.seconds), plain.within()]
    cells = "".join(f"{100.0 * volume / best:10.2f}" for volume in shares)
    print(
        f"  {problem.task.name + f', {seed}':22s}{considered:13,.0f}{evaluated:12,.0f}{considered / evaluated:7.1f}"
        f"{screened.counts['discarded_by_bounds'] / screened.counts['considered']:8.1%}{cells}"
        f"{1.0 - shares[0] / shares[-1]:8.2%}",
        flush=True,
    )


def run(problem: Problem, seed: int, budget: int, screen: Screen | None) -> Course:
    reference_point = problem.reference_point
    assert reference_point is not None
    course, search = Course(), new_search(problem, reference_point, seed, screen)
    started = time.process_time()
    while search.evaluations < budget:
        search.step()
        course.points.append((search.evaluations, time.process_time() - started, search.hypervolume))
    course.counts = {} if screen is None else screen.counts
    return course


if __name__ == "__main__":
    main()
