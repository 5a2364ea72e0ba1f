"""Settings that every run records, whichever search made it."""

import operator
from typing import Any

from armwright.exceptions import SettingsError
from armwright.problem.problem import Problem
from armwright.runs.config import FrontMethod, Method, RunConfig, record_objectives, versions

MAX_INTEGER = 2**31 - 1


def run_config(problem: Problem, method: Method | FrontMethod, seed: int) -> RunConfig:
    """Return the settings of a new run."""
    return RunConfig(
        task=problem.task,
        space=problem.space,
        tolerance=problem.tolerance,
        device=problem.device,
        objectives=record_objectives(problem.objectives),
        reference_point=problem.reference_point,
        method=method,
        seed=check_integer("seed", seed, 0),
        evaluator=None if problem.evaluator is None else problem.evaluator.name,
        versions=versions(problem.evaluator),
    )


def check_integer(name: str, value: Any, least: int) -> int:
    """Return the value as an int; SettingsError unless it is an integer from `least` on."""
    try:
        number = operator.index(value)  # accepts the integers of numpy
    except TypeError:
        number = -1
    if isinstance(value, bool) or not least <= number <= MAX_INTEGER:
        raise SettingsError(f"{name}: expected a whole number from {least} to {MAX_INTEGER}, got {value!r}")
    return number
