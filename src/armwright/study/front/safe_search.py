"""A short search around a front for the cheapest design that holds (proof/perturbations.py)."""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import takewhile

import numpy as np

from armwright.proof.perturbations import Survival, survival_of
from armwright.proof.recommendation import cheapest_first
from armwright.runs.history import FRONT_SEARCH, History
from armwright.runs.trial import FinishedTrial
from armwright.search.encoding import DesignEncoding
from armwright.search.front.variation import offspring

ROUNDS, CHILDREN = 3, 100  # generations of designs, all children of the front
AT_ONCE = 10  # designs that are perturbed together


def find_safe_design(
    history: History, survival: Mapping[int, Survival], left: Callable[[], float], each: float, seed: int
) -> tuple[FinishedTrial, Survival] | None:
    """Return a design that holds and is cheaper than those of the front that do, as its next trial; None without any.

    survival: of the designs of the front.  left: returns the time that is left [s].  each: time of an evaluation [s].
    """
    problem, rng = history.problem, np.random.default_rng(seed)
    encoding = DesignEncoding(problem.space.parameters)
    pool = problem.space.matrix([member.design for member in history.front])
    pool = pool[np.argsort(encoding.structures(pool), kind="stable")]
    trials, longest = list(history), CHILDREN * each  # [s] of a step
    for _ in range(ROUNDS):
        started = time.monotonic()
        if left() < longest:
            break
        children = offspring(pool, np.zeros(len(pool), dtype=np.int64), encoding, CHILDREN, rng)
        for design, one in zip(problem.space.designs(children), problem.evaluate(children), strict=True):
            if max(one.violations) <= 0.0:
                trials.append(FinishedTrial(len(trials), FRONT_SEARCH, design, **vars(one)))
        longest = max(longest, time.monotonic() - started)
    found = History(problem, trials, 0, history.frozen_reference_point)
    numbers = [number for number, one in survival.items() if one.holds] + [*range(len(history), len(trials))]
    order = list(takewhile(lambda number: number >= len(history), cheapest_first(found, numbers)))
    for first in range(0, len(order), AT_ONCE):
        started, some = time.monotonic(), order[first : first + AT_ONCE]
        if left() < longest:
            break
        for number, one in zip(some, survival_of(found, some), strict=True):
            if one.holds:
                return replace(trials[number], number=len(history)), one
        longest = max(longest, time.monotonic() - started)
    return None
