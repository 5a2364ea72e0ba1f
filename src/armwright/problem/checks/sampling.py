"""Constraints that no random design satisfies."""

import math
import time
from collections.abc import Callable

import numpy as np

from armwright.arrays import Array
from armwright.problem.checks.finding import Finding
from armwright.problem.problem import Problem

FIRST = 16  # designs of the first batches; kernels are loaded before the time counts
MAX_BATCH = 4096
MAX_SAMPLES = 1_000_000
ENOUGH = 300  # samples, below which it means little that none satisfies a constraint
SEED = 20  # of the samples alone: searches have random numbers of their own


def check_by_sampling(
    problem: Problem, seconds: float, at_least: int = 0, clock: Callable[[], float] = time.perf_counter
) -> tuple[list[Finding], int]:
    """Find constraints that no random design satisfies; return findings and the number of samples.

    Constraints count in the task's first case, for exact arms: a design that violates one there violates it anyway.
    Sampling takes about `seconds` by the clock, without the loading of kernels: less if that is too short for enough
    samples, more if `at_least` so many take longer. Without constraints there are none.
    """
    if not problem.constraints:
        return [], 0
    rng = np.random.default_rng(SEED)
    best = violations(problem, problem.space.sample_matrix(FIRST, rng)).min(axis=0)
    n, size, started = FIRST, FIRST, clock()
    while n < MAX_SAMPLES:
        best = np.minimum(best, violations(problem, problem.space.sample_matrix(size, rng)).min(axis=0))
        n += size
        spent = max(1e-9, clock() - started)
        rate = (n - FIRST) / spent
        left = max(rate * (seconds - spent), at_least - n)  # samples
        if left <= 0.0 or n + left < ENOUGH:
            break
        size = max(1, min(MAX_BATCH, math.ceil(left / 2)))
    if n < ENOUGH:
        return [], n
    evidence = f"none of {n:,} samples"
    return [
        Finding(
            f'no random design satisfies "{constraint.description}"; the best has {constraint.measured(value):.4g} '
            f"{constraint.quantity.unit}",
            evidence,
        )
        for constraint, value in zip(problem.constraints, best.tolist(), strict=True)
        if value > 0.0
    ], n


def violations(problem: Problem, matrix: Array) -> Array:
    """Return the (N, C) violations of designs (N, P) in the task's first case; satisfied at <= 0."""
    evaluation = problem.physics(matrix)
    return np.column_stack([constraint(evaluation) for constraint in problem.constraints])
