"""The surrogate as an Optuna sampler."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from optuna import Study
from optuna.distributions import BaseDistribution
from optuna.samplers import BaseSampler, RandomSampler
from optuna.study import StudyDirection
from optuna.trial import FrozenTrial, TrialState

from armwright.exceptions import SettingsError
from armwright.problem.problem import Problem
from armwright.search.callable_names import name_of
from armwright.search.surrogate.cheap_features import FeatureFunction
from armwright.search.surrogate.surrogate import STARTUP, Observations, Surrogate
from armwright.spaces.optuna_distributions import distributions
from armwright.spaces.parameters import Design


@dataclass(frozen=True)
class SurrogateFactory:
    """Makes a sampler for each trial; they share what saves time."""

    surrogate: Surrogate = field(repr=False)  # of a problem
    name: str  # in the settings of a run

    def __call__(self, seed: int) -> "SurrogateSampler":
        """Return the sampler of one trial."""
        return SurrogateSampler(self.surrogate, seed)

    def __repr__(self) -> str:
        return self.name


def surrogate_sampler(problem: Problem, features: FeatureFunction | None = None) -> SurrogateFactory:
    """Return a factory of samplers that learn how evaluations differ from the built-in physics.

    Gaussian processes predict each objective from quantities that the built-in physics gives without an evaluation.
    The next design is the one with the largest expected gain of hypervolume. Meant for evaluations that take longer
    than a tenth of a second.

    Args:
        problem: the problem; the sampler never calls its evaluator.
        features: further numbers that may predict the objectives, from a design.

    Raises:
        SettingsError: `features` is not a function.

    Examples:
        >>> import armwright as aw
        >>> problem = aw.Problem(aw.load_task("target-1"))
        >>> sampler = aw.surrogate_sampler(problem, features=lambda design: [max(design.links)])
        >>> aw.optimize(problem, proposer="none", sampler=sampler, n_init=5, n_total=1).trials[5].source
        'bbo'
    """
    name = "surrogate"
    if features is not None:
        if not callable(features):
            raise SettingsError(f"features: expected a function of a design, got {features!r}")
        name += f"(features={name_of(features)})"
    return SurrogateFactory(Surrogate(problem, features), name)


class SurrogateSampler(BaseSampler):
    """Chooses the whole design of one trial."""

    def __init__(self, surrogate: Surrogate, seed: int) -> None:
        self._surrogate = surrogate
        self._seed = seed
        self._random = RandomSampler(seed=seed)

    def infer_relative_search_space(self, study: Study, trial: FrozenTrial) -> dict[str, BaseDistribution]:
        """Return all parameters of the space; none for an enqueued trial or without enough finished ones."""
        if "fixed_params" in trial.system_attrs or len(self._observations(study, trial).matrix) < STARTUP:
            return {}
        return distributions(self._surrogate.problem.space)

    def sample_relative(
        self, study: Study, trial: FrozenTrial, search_space: dict[str, BaseDistribution]
    ) -> dict[str, Any]:
        """Return the free parameters of the chosen design."""
        if not search_space:
            return {}
        space = self._surrogate.problem.space
        row = self._surrogate.choose(self._observations(study, trial), self._seed)
        return space.free_values(space.designs(row[None])[0])

    def sample_independent(
        self, study: Study, trial: FrozenTrial, param_name: str, param_distribution: BaseDistribution
    ) -> Any:
        """Return a random value."""
        return self._random.sample_independent(study, trial, param_name, param_distribution)

    def rejection(self, study: Study, design: Design) -> tuple[float, tuple[float, ...]] | None:
        """Return the gain and the prediction of a design that is not worth an evaluation; None if it is."""
        space = self._surrogate.problem.space
        row = space.normalised(space.matrix([design]))[0]
        return self._surrogate.rejection(self._observations(study, None), row, self._seed)

    def _observations(self, study: Study, trial: FrozenTrial | None) -> Observations:
        signs = np.array([1.0 if d is StudyDirection.MINIMIZE else -1.0 for d in study.directions])
        trials = study.get_trials(deepcopy=False, states=(TrialState.COMPLETE, TrialState.FAIL, TrialState.RUNNING))
        done = [t for t in trials if t.state is not TrialState.RUNNING and t.params]
        own = None if trial is None else trial.number
        pending = [t for t in trials if t.state is TrialState.RUNNING and t.number != own and t.params]
        failed = np.array([has_failed(t) for t in done])
        values = [np.zeros(len(signs)) if has_failed(t) else signs * t.values for t in done]
        return Observations(self._matrix(done), np.array(values), failed, self._matrix(pending))

    def _matrix(self, trials: Sequence[FrozenTrial]) -> Any:
        space = self._surrogate.problem.space
        params: list[Mapping[str, Any]] = [trial.params for trial in trials]
        return space.normalised(space.matrix([space.from_free_values(given) for given in params]))


def has_failed(trial: FrozenTrial) -> bool:
    """Return whether the evaluation of a finished trial failed, so that its values mean nothing."""
    return trial.state is TrialState.FAIL or not np.all(np.isfinite(trial.values))
