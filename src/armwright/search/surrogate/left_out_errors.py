"""Errors of the surrogate's predictions of a run."""

from typing import Any

import numpy as np

from armwright.runs.history import History
from armwright.search.surrogate.surrogate import Observations, Screen, Surrogate

FEWEST = 10  # designs whose errors mean something


def left_out_errors(surrogate: Surrogate, history: History) -> dict[str, Any] | None:
    """Return the leave-one-out errors for summary.json; None if fewer than ten designs were evaluated.

    An error is the root mean square over the standard deviation of the transformed objective; None if the objective is
    constant. Repeated designs count once, because predictions from their copies would be perfect.
    """
    trials = [trial for trial in history if trial.duplicate_of is None and trial.failure is None]
    if len(trials) < FEWEST:
        return None
    space = surrogate.problem.space
    matrix = space.normalised(space.matrix([trial.design for trial in trials]))
    values = np.array([trial.values for trial in trials])
    quality = Screen(surrogate, Observations(matrix, values, np.zeros(len(trials), dtype=bool), matrix[:0])).quality
    errors = {
        objective.name: round(float(np.sqrt(1.0 - share)), 4) if np.ptp(column) > 0.0 else None
        for objective, share, column in zip(surrogate.problem.objectives, quality, values.T, strict=True)
    }
    return {"designs": len(trials), "errors": errors}
