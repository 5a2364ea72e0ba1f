"""Advice on the sampler, from the durations of a study's random trials."""

import statistics
from collections.abc import Sequence

from armwright.problem.problem import Problem
from armwright.runs.config import Method
from armwright.runs.trial import FinishedTrial
from armwright.search.samplers import SURROGATE

FAST_SECONDS = 0.02  # an evaluation that takes less is faster than the choice of a design by the surrogate


def sampler_advice(problem: Problem, method: Method, trials: Sequence[FinishedTrial]) -> str:
    """Return which command suits fast evaluations, or an empty string if the surrogate pays.

    Args:
        problem: the problem.
        method: search settings of the run.
        trials: the finished trials; the advice comes with the last random one.
    """
    if not method.sampler.startswith(SURROGATE) or len(trials) != method.n_init:
        return ""
    seconds = statistics.median(trial.seconds.get("evaluation", 0.0) for trial in trials)
    if seconds >= FAST_SECONDS:
        return ""
    faster = "--sampler tpe with more trials" if problem.evaluator is not None else "armwright design"
    return (
        f"an evaluation takes {1e3 * seconds:.1f} ms, less than the surrogate's choice of a design; "
        f"{faster} may find more in the same time"
    )
