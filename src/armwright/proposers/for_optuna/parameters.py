"""The parameters of an Optuna study: their distributions, and their names in prompts and schemas."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import optuna
from optuna.distributions import BaseDistribution, CategoricalDistribution
from optuna.trial import FrozenTrial, TrialState

from armwright.exceptions import DesignError, did_you_mean
from armwright.proposers.for_optuna.parameter_values import checked_value, describe, value_text

Space = Mapping[str, BaseDistribution]

MAX_NAMES = 30  # listed in an error
_KEY = re.compile(r"[A-Za-z0-9_.-]{1,64}")  # property names that every vendor accepts


@dataclass(frozen=True)
class Parameter:
    """A parameter as prompts and schemas show it."""

    name: str  # its name in the study
    key: str  # the name, or a valid property name in its place
    distribution: BaseDistribution  # its values
    conditional: bool = False  # true if some complete trials lack it
    seen: str = ""  # how many complete trials have it, as text

    @property
    def description(self) -> str:
        """Kind and range."""
        return describe(self.distribution)


def observed_space(study: optuna.Study) -> dict[str, BaseDistribution]:
    """Return the distributions of all finished trials; the latest of each parameter."""
    space: dict[str, BaseDistribution] = {}
    for trial in study.get_trials(deepcopy=False):
        if trial.state.is_finished():
            space.update(trial.distributions)
    return space


def study_parameters(space: Space, trials: Sequence[FrozenTrial]) -> list[Parameter]:
    """Return the parameters of a space, with the conditions under which the trials have them."""
    complete = [trial for trial in trials if trial.state == TrialState.COMPLETE]
    parameters: list[Parameter] = []
    for (name, distribution), key in zip(space.items(), unique_keys(space), strict=True):
        n = sum(name in trial.params for trial in complete)
        conditional = n < len(complete)
        seen = f"in {n} of {len(complete)} trials{_condition(name, space, complete)}" if conditional else ""
        parameters.append(Parameter(name, key, distribution, conditional, seen))
    return parameters


def unique_keys(names: Collection[str]) -> list[str]:
    """Return a valid, unique property name for each name; the name itself if it is valid."""
    keys: list[str] = []
    for name in names:
        key = plain = name if _KEY.fullmatch(name) else re.sub(r"[^A-Za-z0-9_.-]", "_", name)[:56] or "_"
        taken = {*keys, *names} - {name}
        number = 1
        while key in taken:
            number += 1
            key = f"{plain}_{number}"
        keys.append(key)
    return keys


def checked_params(params: Mapping[str, Any], given: Space, observed: Space) -> dict[str, Any]:
    """Check parameters against the space of a proposer and the space of the trials so far.

    Raises:
        DesignError: A name is unknown, or a value lies in only one of the spaces.
    """
    checked: dict[str, Any] = {}
    for name, value in params.items():
        if name not in given and name not in observed:
            raise unknown_parameter(name, {**observed, **given})
        for space in (given, observed):
            if name in space:
                value = checked_value(name, value, space[name])
        checked[name] = value
    return checked


def unknown_parameter(name: str, names: Collection[str]) -> DesignError:
    """Return the error for a name that is not one of `names`."""
    listed = ", ".join(list(names)[:MAX_NAMES]) + (", …" if len(names) > MAX_NAMES else "")
    return DesignError(f'unknown parameter "{name}".{did_you_mean(name, names)} Parameters: {listed}')


def _condition(name: str, space: Space, complete: Sequence[FrozenTrial]) -> str:
    """Return ", always with NAME = CHOICE" for the choice that separates the trials with `name` from those without."""
    for other, distribution in space.items():
        if not isinstance(distribution, CategoricalDistribution) or any(other not in t.params for t in complete):
            continue
        chosen: dict[bool, set[str]] = {True: set(), False: set()}
        for trial in complete:
            chosen[name in trial.params].add(value_text(trial.params[other], distribution))
        if chosen[True] and not chosen[True] & chosen[False]:
            return f", always with {other} = {' or '.join(sorted(chosen[True]))}"
    return ""
