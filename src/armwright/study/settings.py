"""Settings of a study, checked."""

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass

from armwright.exceptions import SettingsError
from armwright.problem.problem import Problem
from armwright.proposers.factory import choose_proposer
from armwright.proposers.proposer import Proposer
from armwright.runs.config import Method
from armwright.search.samplers import SamplerFactory, sampler_name
from armwright.search.surrogate.sampler import SurrogateFactory
from armwright.spaces.parameters import Design
from armwright.study.workers.cluster import Workers
from armwright.validation_messages import check_integer


@dataclass(frozen=True)
class EvaluationOptions:
    """How the designs of a study are evaluated."""

    workers: Workers | None = None  # processes that evaluate the designs; None: this process
    timeout: float | None = None  # for one call of the custom evaluator [s]; None for no limit
    allow_failures: bool = False  # whether the run goes on if its first evaluations all fail with the same exception


def study_method(
    proposer: Proposer | None,
    sampler: str | SamplerFactory,
    n_init: int,
    n_step: int,
    n_total: int,
    in_flight: int | None,
    initial_designs: Sequence[Design] = (),
    screen: bool = True,
) -> Method:
    """Return the search settings of `optimize` with these arguments.

    Raises:
        SettingsError: an argument is out of range, or two of them exclude each other.
    """
    if len(initial_designs) > n_init:
        raise SettingsError(
            f"{len(initial_designs)} initial designs do not fit into the n_init = {n_init} first trials"
        )
    if in_flight is not None and proposer is not None and not proposer.overlaps:
        chat = " with memory chat" if proposer.settings().get("memory") == "chat" else ""
        raise SettingsError(f"in_flight does not go with the proposer {proposer.name}{chat}, which is asked one by one")
    return Method(
        proposer=None if proposer is None else {"name": proposer.name, **proposer.settings()},
        sampler=sampler_name(sampler),
        n_init=check_integer("n_init", n_init, 1),
        n_step=check_integer("n_step", n_step, 1),
        n_total=check_integer("n_total", n_total, 1),
        in_flight=None if in_flight is None else check_integer("in_flight", in_flight, 1),
        initial_designs=tuple(dict(design.params) for design in initial_designs),
        screen=screen and proposer is not None and isinstance(sampler, SurrogateFactory),
    )


def check_proposer(proposer: str | Proposer | None) -> Proposer | None:
    """Return the proposer of a name, or the given one."""
    if isinstance(proposer, str):
        return choose_proposer(proposer).proposer
    if isinstance(proposer, type):
        raise SettingsError(f"proposer = {proposer.__name__} is a class; give an instance of it: {proposer.__name__}()")
    return proposer


def check_settings(problem: Problem, method: Method, evaluation: EvaluationOptions) -> None:
    """Raise a SettingsError for settings that exclude each other, or for an initial design outside the space."""
    for design in method.initial_designs:
        problem.space.design(design)
    if evaluation.timeout is not None:
        if not 0.0 < evaluation.timeout < math.inf:
            raise SettingsError(f"evaluation_timeout: expected seconds > 0, got {evaluation.timeout!r}")
        if problem.evaluator is None:
            raise SettingsError("evaluation_timeout ends custom evaluators; without --evaluator leave it out")
        if sys.platform == "win32":
            raise SettingsError("evaluation_timeout needs Linux or macOS; leave it out")
    if evaluation.workers is not None and method.in_flight is not None:
        raise SettingsError("in_flight does not go with --workers, which evaluate while a question is asked anyway")
