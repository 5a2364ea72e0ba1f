"""Whether a search of all arms finds what searches of some arms find: each number of joints, the best joint sequences.

The sequences are the ten with the most hypervolume after a survey of each. A task's lines:

    equal effort    hypervolume of the joint search over that of the union of all searches of sub-spaces, which have as
                    many evaluations together
    each            the same over the best single sub-space, which has the full budget by itself
    union           the same over the union of all sub-spaces, of which each has the full budget

    python benchmarks/whole.py [--tasks target-1 desk-sorting] [--budget 50000] [--cycle-budget 5000]
"""

import argparse
import math

import numpy as np
from searches import by_number, by_sequence, reference_point_of, searched

from armwright.pareto import hypervolume
from armwright.problem.problem import Problem
from armwright.spaces.design_space import DesignSpace, default_space
from armwright.tasks.catalogue import builtin_tasks

SEQUENCES = 10
SURVEY, CYCLE_SURVEY = 2_000, 200  # evaluations of each sequence


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--tasks", nargs="+", default=list(builtin_tasks()))
    parser.add_argument("--budget", type=int, default=50_000)
    parser.add_argument("--cycle-budget", type=int, default=5_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    print(f"  {'':24s}{'equal effort':>14s}{'each':>10s}{'union':>10s}   best single sub-space")
    for name in options.tasks:
        problem = Problem(builtin_tasks()[name], default_space(name))
        has_cycle = problem.task.cycle is not None
        budget = options.cycle_budget if has_cycle else options.budget
        compare(problem, budget, CYCLE_SURVEY if has_cycle else SURVEY, options.seed)


def compare(problem: Problem, budget: int, survey: int, seed: int) -> None:
    """One task's line."""
    reference = reference_point_of(problem)

    def values_in(space: DesignSpace, evaluations: int) -> np.ndarray:
        return searched(Problem(problem.task, space), reference, seed, evaluations).values

    def volume(values: np.ndarray) -> float:
        return hypervolume(values, reference)

    sequences = {label: volume(values_in(space, survey)) for label, space in by_sequence(problem.space)}
    best = sorted(sequences, key=lambda label: -sequences[label])[:SEQUENCES]
    spaces = dict(by_sequence(problem.space)) | dict(by_number(problem.space))
    chosen = [label for label in spaces if label in best or label.isdigit()]
    joint = volume(values_in(problem.space, budget))
    full = {label: values_in(spaces[label], budget) for label in chosen}
    shared = np.vstack([values_in(spaces[label], math.ceil(budget / len(chosen))) for label in chosen])
    single = {label: volume(values) for label, values in full.items()}
    top = max(single, key=lambda label: single[label])
    shares = [
        np.divide(joint, other) for other in (volume(shared), single[top], volume(np.vstack(list(full.values()))))
    ]
    print(f"  {problem.task.name:24s}{shares[0]:14.2%}{shares[1]:10.2%}{shares[2]:10.2%}   {top}", flush=True)


if __name__ == "__main__":
    main()
