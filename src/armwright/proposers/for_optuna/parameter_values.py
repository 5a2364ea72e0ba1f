"""Values of Optuna distributions: written as text, read from answers, checked, and scaled to 0 to 1.

Values are checked before Optuna sees them: it accepts a value out of range with only a warning, and leaves a trial with
an unknown category RUNNING.
"""

import json
import math
from numbers import Real
from typing import Any, cast

from optuna.distributions import BaseDistribution, CategoricalDistribution, FloatDistribution, IntDistribution

from armwright.exceptions import DesignError, did_you_mean
from armwright.text import one_line

ON_GRID, NEAR_GRID = 1e-8, 1e-6  # steps: Optuna's tolerance, and the distance that is rounded to the grid
LARGEST = 2**63  # magnitude from which integers are refused


def describe(distribution: BaseDistribution) -> str:
    """Describe the kind and range of a distribution."""
    if isinstance(distribution, CategoricalDistribution):
        return f"one of {', '.join(choice_texts(distribution))}"
    assert isinstance(distribution, (IntDistribution, FloatDistribution))
    kind = "whole number" if isinstance(distribution, IntDistribution) else "number"
    scale = ", on a log scale" if distribution.log else ""
    return f"{kind}, {_number(distribution.low)} to {_number(distribution.high)}{_steps(distribution)}{scale}"


def choice_texts(distribution: CategoricalDistribution) -> list[str]:
    """Return a unique text for each choice: as in JSON, or as in Python if those are not unique."""
    texts = [choice if isinstance(choice, str) else _json(choice) for choice in distribution.choices]
    folded = {text.strip().casefold() for text in texts}
    if len(folded) == len(texts) and "" not in folded:
        return texts
    return [repr(choice) for choice in distribution.choices]


def value_text(value: Any, distribution: BaseDistribution) -> str:
    """Return a value as a prompt shows it."""
    if isinstance(distribution, CategoricalDistribution):
        texts = zip(distribution.choices, choice_texts(distribution), strict=True)
        return next((text for choice, text in texts if _same(choice, value)), str(value))
    return f"{value:.6g}" if isinstance(distribution, FloatDistribution) else str(value)


def json_value(value: Any, distribution: BaseDistribution) -> Any:
    """Return a value for JSON without loss: choices as text, numbers unchanged."""
    return value_text(value, distribution) if isinstance(distribution, CategoricalDistribution) else value


def checked_value(name: str, value: Any, distribution: BaseDistribution) -> Any:
    """Return `value` in the type that Optuna stores.

    Raises:
        DesignError: The distribution does not contain the value.
    """
    if not isinstance(distribution, CategoricalDistribution):
        return _checked_number(name, value, distribution)
    same = [choice for choice in distribution.choices if _same(choice, value)]
    same += [c for c in distribution.choices if c == value and isinstance(c, bool) == isinstance(value, bool)]
    if not same:
        texts = choice_texts(distribution)
        hint = did_you_mean(value, texts) if isinstance(value, str) else ""
        raise DesignError(f"{name} = {_shown(value)} is not one of {', '.join(texts)}.{hint}".rstrip("."))
    return same[0]


def read_value(name: str, value: Any, distribution: BaseDistribution) -> Any:
    """Check a value from a model's answer, which may write numbers as text and choices in another case."""
    if isinstance(distribution, CategoricalDistribution):
        value = _closest_choice(value, distribution)
    elif isinstance(value, str):
        value = _parsed(value)
    return checked_value(name, value, distribution)


def is_number(distribution: BaseDistribution) -> bool:
    """Return whether a distribution is a range of at least two numbers."""
    return not isinstance(distribution, CategoricalDistribution) and not distribution.single()


def to_unit(value: Any, distribution: BaseDistribution) -> float:
    """Scale a number from its range to 0 to 1; logarithmic if the distribution is."""
    assert isinstance(distribution, (FloatDistribution, IntDistribution))
    low, high = distribution.low, distribution.high
    if distribution.log:
        return (math.log(value) - math.log(low)) / (math.log(high) - math.log(low))
    return (value / 2 - low / 2) / (high / 2 - low / 2)  # halved, since the whole width may overflow


def from_unit(share: float, distribution: BaseDistribution) -> int | float:
    """Scale 0 to 1 to the distribution's range, rounded to its steps; shares outside are clipped."""
    assert isinstance(distribution, (FloatDistribution, IntDistribution))
    low, high, step = distribution.low, distribution.high, distribution.step
    share = min(max(share, 0.0), 1.0)
    if distribution.log:
        value = math.exp((1.0 - share) * math.log(low) + share * math.log(high))
    else:
        value = (1.0 - share) * low + share * high
    if step is not None:
        value = low + round((value - low) / step) * step
    value = min(max(value, low), high)
    return int(value) if isinstance(distribution, IntDistribution) else float(value)


def _checked_number(name: str, value: Any, distribution: BaseDistribution) -> int | float:
    assert isinstance(distribution, (FloatDistribution, IntDistribution))
    low, high, step = distribution.low, distribution.high, distribution.step
    allowed = f"{_number(low)} <= {name} <= {_number(high)}{_steps(distribution)}"
    whole = isinstance(distribution, IntDistribution)
    number = _as_number(value, whole)
    if number is None:
        raise DesignError(f"{name} = {_shown(value)} is not a {'whole' if whole else 'finite'} number with {allowed}")
    if not low <= number <= high:
        raise DesignError(f"{name} = {_number(number)} is outside {allowed}")
    if step is None:
        return number
    steps = (number - low) / step
    off = (number - low) % step if whole else abs(steps - round(steps))
    if off < ON_GRID:
        return number
    if off < NEAR_GRID:
        return min(low + round(steps) * step, high)
    raise DesignError(f"{name} = {_number(number)} is between the steps of {allowed}")


def _as_number(value: Any, whole: bool) -> int | float | None:
    """Return a finite number, as an integer of 64 bits if it has to be whole; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    if not whole:
        return number if math.isfinite(number) else None
    return int(cast("Any", value)) if number.is_integer() and abs(number) < LARGEST else None


def _closest_choice(value: Any, distribution: CategoricalDistribution) -> Any:
    """Return the only choice that a value may stand for, or the value itself."""
    choices = list(zip(distribution.choices, choice_texts(distribution), strict=True))
    given = value.strip() if isinstance(value, str) else None
    exact = [c for c, text in choices if text.strip() == given] or [c for c, _ in choices if _same(c, value)]
    if exact:
        return exact[0]
    folded = _folded(value if isinstance(value, str) else _json(value))
    similar = [c for c, text in choices if folded in (_folded(text), _folded(str(c)), _folded(repr(c)))]
    if not similar and not isinstance(value, bool):
        number = _parsed(value) if isinstance(value, str) else value
        similar = [c for c, _ in choices if isinstance(c, (int, float)) and type(c) is not bool and c == number]
    return similar[0] if len(similar) == 1 else value


def _steps(distribution: IntDistribution | FloatDistribution) -> str:
    step = distribution.step
    if step is None or (isinstance(distribution, IntDistribution) and step == 1):
        return ""
    return f" in steps of {_number(step)}"


def _same(choice: Any, value: Any) -> bool:
    """Compare with types, since True == 1; NaN equals NaN."""
    if type(choice) is not type(value):
        return False
    return choice == value or (isinstance(choice, float) and math.isnan(choice) and math.isnan(value))


def _json(value: Any) -> str:
    return json.dumps(value) if value is None or isinstance(value, (bool, int, float)) else str(value)


def _folded(text: str) -> str:
    return text.strip().strip("'\"").casefold()


def _parsed(text: str) -> Any:
    """Return the number that a text stands for, or the text."""
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
    return one_line(repr(value), 60)
