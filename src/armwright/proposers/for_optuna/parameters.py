"""The parameters of any Optuna study: their distributions, and values checked against these before Optuna sees them.

Optuna takes a value out of range with only a warning, and leaves a trial with an unknown category RUNNING.
"""

import json
import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

import optuna
from optuna.distributions import BaseDistribution, CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.trial import FrozenTrial, TrialState

from armwright.exceptions import DesignError, SettingsError, did_you_mean

Space = Mapping[str, BaseDistribution]

ON_GRID, NEAR_GRID = 1e-8, 1e-6  # steps; Optuna's tolerance, and what is moved onto the grid
LARGEST = 2**63  # whole numbers beyond it are no parameters
MOST_NAMES = 30  # listed in a refusal
_KEY = re.compile(r"[A-Za-z0-9_.-]{1,64}")  # what every vendor takes as a property's name


@dataclass(frozen=True)
class Parameter:
    """A parameter as a model is told of it.

    key: the name, or a plain one in its place where vendors would not take it in a schema.
    conditional: whether some complete trials are without it.
    seen: how often complete trials had it, in words.
    """

    name: str
    key: str
    distribution: BaseDistribution
    conditional: bool = False
    seen: str = ""

    @property
    def words(self) -> str:
        """Kind and range."""
        return described(self.distribution)


def observed_space(study: optuna.Study) -> dict[str, BaseDistribution]:
    """The distributions of all finished trials; of a range that changed, the latest."""
    space: dict[str, BaseDistribution] = {}
    for trial in study.get_trials(deepcopy=False):
        if trial.state.is_finished():
            space.update(trial.distributions)
    return space


def stated_space(study: optuna.Study, given: Space) -> dict[str, BaseDistribution]:
    """What was given, and what the trials have shown besides; SettingsError where they differ in kind."""
    observed = observed_space(study)
    for name, distribution in given.items():
        if type(observed.get(name, distribution)) is not type(distribution):
            raise SettingsError(
                f"space says that {name} is {described(distribution)}; in the study's trials it is "
                f"{described(observed[name])}"
            )
    return {**observed, **given}


def told_parameters(space: Space, trials: Sequence[FrozenTrial]) -> list[Parameter]:
    """The space as a model is told of it after these trials."""
    complete = [trial for trial in trials if trial.state == TrialState.COMPLETE]
    parameters: list[Parameter] = []
    for (name, distribution), key in zip(space.items(), keys(space), strict=True):
        with_it = sum(name in trial.params for trial in complete)
        conditional = with_it < len(complete)
        seen = f"in {with_it} of {len(complete)} trials{_only_with(name, space, complete)}" if conditional else ""
        parameters.append(Parameter(name, key, distribution, conditional, seen))
    return parameters


def keys(names: Collection[str]) -> list[str]:
    """For each name one that may stand in a schema, all different; the name itself where it may."""
    found: list[str] = []
    for name in names:
        key = plain = name if _KEY.fullmatch(name) else re.sub(r"[^A-Za-z0-9_.-]", "_", name)[:56] or "_"
        taken = {*found, *names} - {name}
        number = 1
        while key in taken:
            number += 1
            key = f"{plain}_{number}"
        found.append(key)
    return found


def described(distribution: BaseDistribution) -> str:
    """Kind and range of a distribution in words."""
    if isinstance(distribution, CategoricalDistribution):
        return f"one of {', '.join(choice_texts(distribution))}"
    if not isinstance(distribution, (IntDistribution, FloatDistribution)):
        return str(distribution)
    kind = "whole number" if isinstance(distribution, IntDistribution) else "number"
    scale = ", on a log scale" if distribution.log else ""
    return f"{kind}, {_number(distribution.low)} to {_number(distribution.high)}{_steps(distribution)}{scale}"


def choice_texts(distribution: CategoricalDistribution) -> list[str]:
    """Each choice as text, all different: as JSON has it, else as Python has it."""
    texts = [choice if isinstance(choice, str) else _json(choice) for choice in distribution.choices]
    folded = {text.strip().casefold() for text in texts}
    if len(folded) == len(texts) and "" not in folded:
        return texts
    return [repr(choice) for choice in distribution.choices]


def value_text(value: Any, distribution: BaseDistribution) -> str:
    """A value as a model reads it, and may write it."""
    if isinstance(distribution, CategoricalDistribution):
        return next(
            (t for t, c in zip(choice_texts(distribution), distribution.choices, strict=True) if _same(c, value)),
            str(value),
        )
    return f"{value:.6g}" if isinstance(distribution, FloatDistribution) else str(value)


def written_value(value: Any, distribution: BaseDistribution) -> Any:
    """A value as JSON, without loss: a choice as text, a number as it is."""
    return value_text(value, distribution) if isinstance(distribution, CategoricalDistribution) else value


def checked_value(name: str, value: Any, distribution: BaseDistribution) -> Any:
    """`value` in the type that Optuna keeps; DesignError where the distribution does not hold it."""
    if isinstance(distribution, CategoricalDistribution):
        same = [choice for choice in distribution.choices if _same(choice, value)]
        same += [c for c in distribution.choices if c == value and isinstance(c, bool) == isinstance(value, bool)]
        if not same:
            texts = choice_texts(distribution)
            hint = did_you_mean(value, texts) if isinstance(value, str) else ""
            raise DesignError(f"{name} = {_shown(value)} is not one of {', '.join(texts)}.{hint}".rstrip("."))
        return same[0]
    if isinstance(distribution, IntDistribution):
        return _checked_int(name, value, distribution)
    if isinstance(distribution, FloatDistribution):
        return _checked_float(name, value, distribution)
    return value


def read_value(name: str, value: Any, distribution: BaseDistribution) -> Any:
    """`checked_value` of what a model wrote: numbers as text, a choice in other letters."""
    if isinstance(distribution, CategoricalDistribution):
        value = _choice(value, distribution)
    elif isinstance(value, str):
        value = _parsed(value)
    return checked_value(name, value, distribution)


def value_schema(parameter: Parameter) -> dict[str, Any]:
    """JSON schema of a parameter's value. Ranges are told, not enforced: a refusal says what is wrong."""
    distribution = parameter.distribution
    words = {} if parameter.key == parameter.name else {"description": parameter.name}
    if isinstance(distribution, CategoricalDistribution):
        return {"type": "string", "enum": list(dict.fromkeys(choice_texts(distribution))), **words}
    kind = "integer" if isinstance(distribution, IntDistribution) else "number"
    return {"type": kind, "description": ": ".join([*words.values(), parameter.words])}


def checked_params(params: Mapping[str, Any], given: Space, observed: Space) -> dict[str, Any]:
    """Parameters that both hold: the space that a proposer knows, and the one that the trials so far have shown."""
    checked: dict[str, Any] = {}
    for name, value in params.items():
        if name not in given and name not in observed:
            raise unknown(name, {**observed, **given})
        for space in (given, observed):
            if name in space:
                value = checked_value(name, value, space[name])
        checked[name] = value
    return checked


def unknown(name: str, names: Collection[str]) -> DesignError:
    """The refusal of a name that is none of `names`."""
    listed = ", ".join(list(names)[:MOST_NAMES]) + (", …" if len(names) > MOST_NAMES else "")
    return DesignError(f'there is no parameter "{name}".{did_you_mean(name, names)} Parameters: {listed}')


def _checked_int(name: str, value: Any, distribution: IntDistribution) -> int:
    low, high, step = distribution.low, distribution.high, distribution.step
    allowed = f"{low} <= {name} <= {high}{_steps(distribution)}"
    if not _is_whole(value) or not -LARGEST < value < LARGEST:
        raise DesignError(f"{name} = {_shown(value)} is not a whole number with {allowed}")
    number = int(value)
    if not low <= number <= high:
        raise DesignError(f"{name} = {number} is outside {allowed}")
    if (number - low) % step:
        raise DesignError(f"{name} = {number} is between the steps of {allowed}")
    return number


def _checked_float(name: str, value: Any, distribution: FloatDistribution) -> float:
    low, high, step = distribution.low, distribution.high, distribution.step
    allowed = f"{_number(low)} <= {name} <= {_number(high)}{_steps(distribution)}"
    try:
        number = math.nan if isinstance(value, bool) or not isinstance(value, Real) else float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise DesignError(f"{name} = {_shown(value)} is not a finite number with {allowed}")
    if not low <= number <= high:
        raise DesignError(f"{name} = {_number(number)} is outside {allowed}")
    if step is None:
        return number
    steps = (number - low) / step
    off = abs(steps - round(steps))
    if off < ON_GRID:
        return number
    if off < NEAR_GRID:
        return min(low + round(steps) * step, high)
    raise DesignError(f"{name} = {_number(number)} is between the steps of {allowed}")


def _is_whole(value: Any) -> bool:
    if isinstance(value, bool):
        return False
    return isinstance(value, Integral) or (isinstance(value, Real) and float(value).is_integer())


def _choice(value: Any, distribution: CategoricalDistribution) -> Any:
    """The choice that a model means, else the value itself."""
    texts = choice_texts(distribution)
    if isinstance(value, str) and value.strip() in [text.strip() for text in texts]:
        return distribution.choices[[text.strip() for text in texts].index(value.strip())]
    exact = [choice for choice in distribution.choices if _same(choice, value)]
    if exact:
        return exact[0]
    word = _folded(value if isinstance(value, str) else _json(value))
    meant = [
        choice
        for choice, text in zip(distribution.choices, texts, strict=True)
        if word in (_folded(text), _folded(str(choice)), _folded(repr(choice)))
    ]
    if not meant and not isinstance(value, bool):
        number = _parsed(value) if isinstance(value, str) else value
        meant = [c for c in distribution.choices if isinstance(c, (int, float)) and type(c) is not bool and c == number]
    return meant[0] if len(meant) == 1 else value


def _only_with(name: str, space: Space, complete: Sequence[FrozenTrial]) -> str:
    """The categorical parameter whose choices tell the trials with `name` from those without it, in words."""
    for other, distribution in space.items():
        if not isinstance(distribution, CategoricalDistribution) or any(other not in t.params for t in complete):
            continue
        chosen: dict[bool, set[str]] = {True: set(), False: set()}
        for trial in complete:
            chosen[name in trial.params].add(value_text(trial.params[other], distribution))
        if chosen[True] and not chosen[True] & chosen[False]:
            return f", always with {other} = {' or '.join(sorted(chosen[True]))}"
    return ""


def _steps(distribution: IntDistribution | FloatDistribution) -> str:
    step = distribution.step
    if step is None or (isinstance(distribution, IntDistribution) and step == 1):
        return ""
    return f" in steps of {_number(step)}"


def _same(choice: Any, value: Any) -> bool:
    """Equal, and of one type: True is not 1; NaN is NaN."""
    if type(choice) is not type(value):
        return False
    return choice == value or (isinstance(choice, float) and math.isnan(choice) and math.isnan(value))


def _json(value: Any) -> str:
    return json.dumps(value) if value is None or isinstance(value, (bool, int, float)) else str(value)


def _folded(text: str) -> str:
    return text.strip().strip("'\"").casefold()


def _parsed(text: str) -> Any:
    """The number that a text is, else the text."""
    for kind in (int, float):
        try:
            return kind(text.strip())
        except ValueError:
            continue
    return text


def _number(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:.10g}"


def _shown(value: Any) -> str:
    if isinstance(value, int) and not -LARGEST < value < LARGEST:
        return "a number beyond 64 bits"
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
