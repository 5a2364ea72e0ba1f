"""SBArchOpt's Bayesian optimisation as a sampler of Optuna: SMT's mixed-discrete hierarchical Gaussian processes.

Each trial fits the processes to all earlier ones. Spaces without logarithmic parameters, problems without constraints.
"""

import warnings
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np
from optuna import Study
from optuna.distributions import BaseDistribution
from optuna.samplers import BaseSampler, RandomSampler
from optuna.trial import FrozenTrial, TrialState

from armwright.arrays import Array
from armwright.exceptions import SettingsError
from armwright.problem.problem import Problem
from armwright.spaces.optuna_distributions import distributions
from armwright.spaces.parameters import CategoricalParameter

ARCH_SBO = "sb_arch_opt.algo.arch_sbo"


class HierarchicalGP(BaseSampler):
    """Chooses the whole design of one trial."""

    def __init__(self, problem: Problem, n_startup: int, seed: int) -> None:
        self._space, self._n_startup, self._seed = problem.space, n_startup, seed
        self._random = RandomSampler(seed=seed)

    def infer_relative_search_space(self, study: Study, trial: FrozenTrial) -> dict[str, BaseDistribution]:
        """Return all parameters; none for an enqueued trial or before enough evaluations succeeded."""
        done = study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))
        is_early = "fixed_params" in trial.system_attrs or len(done) < self._n_startup
        return {} if is_early else distributions(self._space)

    def sample_relative(
        self, study: Study, trial: FrozenTrial, search_space: dict[str, BaseDistribution]
    ) -> dict[str, Any]:
        """Return the free parameters of the design that SBArchOpt's criteria choose."""
        if not search_space:
            return {}
        population: Any = import_module("pymoo.core.population").Population
        import_module("sb_arch_opt.util").set_global_random_seed(self._seed)
        states = (TrialState.COMPLETE, TrialState.FAIL)
        done = [t for t in study.get_trials(deepcopy=False, states=states) if t.params]
        n = len(study.directions)
        values = [t.values if t.state is TrialState.COMPLETE else [np.nan] * n for t in done]
        designs = [self._space.from_free_values(t.params) for t in done]
        problem = _arch_problem(self._space, n)
        # Without the projection of many inputs (KPLS), which ignores the hierarchy.
        infill: Any = import_module(ARCH_SBO).get_arch_sbo_gp(problem, kpls_n_dim=None).infill_obj
        infill.seed = self._seed
        known = population.new(X=self._space.matrix(designs), F=np.array(values))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of starts of hyperparameters, and of how SBArchOpt samples
            chosen: Any = infill.do(problem, known, 1).get("X")
        return self._space.free_values(self._space.designs(np.asarray(chosen, dtype=np.float64))[0])

    def sample_independent(
        self, study: Study, trial: FrozenTrial, param_name: str, param_distribution: BaseDistribution
    ) -> Any:
        """Return a random value."""
        return self._random.sample_independent(study, trial, param_name, param_distribution)


def hierarchical_gp(problem: Problem, n_startup: int) -> Callable[[int], HierarchicalGP]:
    """Return a factory of samplers for a problem; SettingsError if a package is missing."""
    try:
        import_module(ARCH_SBO)
    except (ImportError, AssertionError) as reason:  # it asserts that its own imports succeeded
        raise SettingsError("packages are missing; pip install sb-arch-opt smt numba") from reason
    return lambda seed: HierarchicalGP(problem, n_startup, seed)


def _arch_problem(space: Any, n_objectives: int) -> Any:
    """Return the design space as a problem of SBArchOpt."""
    from pymoo.core.variable import Choice, Real  # pyright: ignore
    from sb_arch_opt.problem import ArchOptProblemBase  # pyright: ignore

    names = [p.name for p in space.parameters]

    class ArchProblem(ArchOptProblemBase):  # pyright: ignore
        def _is_conditionally_active(self) -> list[bool]:
            return [space.condition(name) is not None for name in names]

        def _correct_x(self, x: Array, is_active: Any) -> None:
            x[:] = space.normalised(x)
            is_active[:] = np.column_stack([space.active(name, x) for name in names])

    variables = [
        Choice(options=list(p.choices)) if isinstance(p, CategoricalParameter) else Real(bounds=(p.low, p.high))
        for p in space.parameters
    ]
    return ArchProblem(variables, n_obj=n_objectives)
