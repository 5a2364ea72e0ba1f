"""A study's trials as rules and prompts use them: minimised values, violations and the best trials."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import optuna
from optuna.distributions import CategoricalDistribution
from optuna.study import StudyDirection
from optuna.trial import FrozenTrial, TrialState

from armwright.arrays import Array
from armwright.exceptions import DesignError
from armwright.llm.feedback import N_PARETO
from armwright.pareto import front_mask, penalised_objectives
from armwright.proposers.for_optuna.parameter_values import checked_value, to_unit, value_text
from armwright.proposers.for_optuna.parameters import Space

Params = dict[str, Any]


@dataclass(frozen=True)
class StudyView:
    """The trials of a study that rules can learn from."""

    space: Space  # distributions of the parameters
    complete: tuple[FrozenTrial, ...]  # complete trials with finite values and at least one parameter in the space
    params: tuple[Params, ...]  # the parameters of each that lie in the space; ranges may have changed since
    values: Array  # (N, M) values to minimise; infeasible trials rank behind all feasible ones
    best: tuple[int, ...]  # indices of `best_trials`, sorted by the first value; at least two, or none
    tried: tuple[Params, ...]  # parameters of all trials, running ones included
    source: str  # name of the proposer

    @classmethod
    def of(cls, study: optuna.Study, space: Space, source: str) -> "StudyView":
        """Collect the usable trials of a study for the proposer named `source`."""
        trials = study.get_trials(deepcopy=False)
        finite = [t for t in trials if t.state == TrialState.COMPLETE and np.all(np.isfinite(t.values))]
        usable = [(trial, params) for trial in finite if (params := params_in_space(trial.params, space))]
        complete = [trial for trial, _ in usable]
        values = minimised(complete, study.directions)
        penalised = penalised_objectives(values, violation_ranks(complete)[:, None])
        best_numbers = {trial.number for trial in best_trials(complete, study.directions)}
        best = [i for i in _ascending(values[:, 0]) if complete[i].number in best_numbers]
        if len(best) < 2:  # rules need two parents: the best trial and the second best
            best = _ascending(penalised[:, 0])[:2] if len(complete) > 1 else []
        tried = tuple(given_params(trial) for trial in trials)
        return cls(space, tuple(complete), tuple(p for _, p in usable), penalised, tuple(best), tried, source)

    @cached_property
    def ranks(self) -> Array:
        """(N, M) rank of each trial in each objective, from 0 for the best to below 1."""
        return self.values.argsort(axis=0, kind="stable").argsort(axis=0, kind="stable") / len(self.values)

    @property
    def choices(self) -> list[str]:
        """Categorical parameters with at least two distinguishable choices."""
        categories = {n: d for n, d in self.space.items() if isinstance(d, CategoricalDistribution)}
        return [n for n, d in categories.items() if len({value_text(choice, d) for choice in d.choices}) > 1]

    def unit(self, index: int, name: str) -> float:
        """Return a parameter of a complete trial, scaled to 0 to 1."""
        return to_unit(self.params[index][name], self.space[name])

    def number(self, index: int) -> int:
        """Return the study's number of a complete trial."""
        return self.complete[index].number


def given_params(trial: FrozenTrial) -> Params:
    """Return the parameters of a trial, including enqueued ones that it has not drawn yet."""
    return {**trial.system_attrs.get("fixed_params", {}), **trial.params}


def params_in_space(params: Mapping[str, Any], space: Space) -> Params:
    """Return the parameters that lie in the space; enqueued trials may name unknown ones."""
    inside: Params = {}
    for name, value in params.items():
        try:
            if name in space:
                inside[name] = checked_value(name, value, space[name])
        except DesignError:
            continue
    return inside


def minimised(trials: Sequence[FrozenTrial], directions: Sequence[StudyDirection]) -> Array:
    """Return the values of complete trials (N, M), negated if they are maximised."""
    signs = np.array([-1.0 if d == StudyDirection.MAXIMIZE else 1.0 for d in directions])
    return signs * np.array([trial.values for trial in trials]).reshape(len(trials), len(directions))


def best_trials(complete: Sequence[FrozenTrial], directions: Sequence[StudyDirection]) -> list[FrozenTrial]:
    """Return the Pareto front of the feasible trials; for one objective, the N_PARETO best in order.

    If no trial is feasible, return the N_PARETO trials with the smallest violations.
    """
    feasible = [trial for trial in complete if violation(trial) == 0.0]
    if not feasible:
        return sorted(complete, key=violation)[:N_PARETO]
    values = minimised(feasible, directions)
    if len(directions) == 1:
        return [feasible[i] for i in _ascending(values[:, 0])[:N_PARETO]]
    return [feasible[i] for i in np.flatnonzero(front_mask(values))]


def violation(trial: FrozenTrial) -> float:
    """Return the total constraint violation of a trial; infinite if it is NaN."""
    total = sum(value for value in trial.constraints.values() if not value <= 0.0)
    return total if total == total else float("inf")


def violation_ranks(trials: Sequence[FrozenTrial]) -> Array:
    """Return the dense rank (N,) of each violation, 0 for feasible trials.

    Ranks replace the violations themselves, which may be infinite or too large to add.
    """
    violations = np.array([violation(trial) for trial in trials], dtype=np.float64)
    return np.searchsorted(np.unique(violations[violations > 0.0]), violations, side="right").astype(np.float64)


def _ascending(values: Array) -> list[int]:
    order: list[int] = np.argsort(values, kind="stable").tolist()
    return order
