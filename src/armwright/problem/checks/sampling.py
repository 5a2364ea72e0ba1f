"""Constraints that no random design satisfies."""

import math
import time
from collections.abc import Callable

import numpy as np

from armwright.arrays import Array
from armwright.pareto import NOT_EVALUATED
from armwright.problem.checks.finding import Finding
from armwright.problem.problem import Problem

FIRST = 16  # designs of the first batches; kernels are loaded before the time counts
MAX_BATCH = 4096
MAX_SAMPLES = 1_000_000
ENOUGH = 300  # evaluated samples, below which it means little that none satisfies a constraint
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
    best, evaluated = _sampled(problem, FIRST, rng)
    n, size, started = FIRST, FIRST, clock()
    while n < MAX_SAMPLES:
        found, known = _sampled(problem, size, rng)
        best, evaluated, n = np.minimum(best, found), evaluated + known, n + size
        spent = max(1e-9, clock() - started)
        rate = (n - FIRST) / spent
        left = max(rate * (seconds - spent), at_least - n)  # samples
        if left <= 0.0 or n + left < ENOUGH:
            break
        size = max(1, min(MAX_BATCH, math.ceil(left / 2)))
    return [
        Finding(
            f'no random design satisfies "{constraint.description}"; the best has {constraint.measured(value):.4g} '
            f"{constraint.quantity.unit}",
            f"none of {known:,} samples",
        )
        for constraint, value, known in zip(problem.constraints, best.tolist(), evaluated.tolist(), strict=True)
        if value > 0.0 and known >= ENOUGH
    ], n


def _sampled(problem: Problem, n: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return the (C,) least violations of n designs in the task's first case, and of how many they were evaluated."""
    found = problem.violations(problem.physics(problem.space.sample_matrix(n, rng)))
    return found.min(axis=0), (found < NOT_EVALUATED).sum(axis=0)
