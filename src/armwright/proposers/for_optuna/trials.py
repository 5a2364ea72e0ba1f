"""Where the trials of any Optuna study stand: which are best, and what they come to, minimised."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from optuna.study import StudyDirection
from optuna.trial import FrozenTrial

from armwright.llm.feedback import N_PARETO
from armwright.pareto import front_mask


def minimised(trials: Sequence[FrozenTrial], directions: Sequence[StudyDirection]) -> NDArray[np.float64]:
    """(N, M) the values of complete trials, less being better in each."""
    signs = np.array([-1.0 if d == StudyDirection.MAXIMIZE else 1.0 for d in directions])
    return signs * np.array([trial.values for trial in trials]).reshape(len(trials), len(directions))


def best_trials(complete: Sequence[FrozenTrial], directions: Sequence[StudyDirection]) -> list[FrozenTrial]:
    """The Pareto front of the feasible trials; of one objective, the N_PARETO best, the best first.

    Where none is feasible, those that come nearest to it.
    """
    feasible = [trial for trial in complete if violation(trial) == 0.0]
    if not feasible:
        return sorted(complete, key=violation)[:N_PARETO]
    values = minimised(feasible, directions)
    if len(directions) == 1:
        return [feasible[i] for i in np.argsort(values[:, 0], kind="stable")[:N_PARETO]]
    return [feasible[i] for i in np.flatnonzero(front_mask(values))]


def violation(trial: FrozenTrial) -> float:
    """By how much a trial is infeasible; infinite where that is not a number."""
    total = sum(value for value in trial.constraints.values() if not value <= 0.0)
    return total if total == total else float("inf")
