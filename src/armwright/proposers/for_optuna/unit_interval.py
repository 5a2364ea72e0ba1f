"""Numbers of any Optuna study on a scale from 0 to 1: logarithms and steps of the distribution are heeded."""

import math
from typing import Any

from optuna.distributions import BaseDistribution, FloatDistribution, IntDistribution


def is_number(distribution: BaseDistribution) -> bool:
    """Whether it is a range of numbers, more than one."""
    return isinstance(distribution, (FloatDistribution, IntDistribution)) and not distribution.single()


def to_unit(value: Any, distribution: BaseDistribution) -> float:
    """Where between the ends of its range a number lies, 0 to 1."""
    assert isinstance(distribution, (FloatDistribution, IntDistribution))
    low, high = distribution.low, distribution.high
    if distribution.log:
        return (math.log(value) - math.log(low)) / (math.log(high) - math.log(low))
    return (value / 2 - low / 2) / (high / 2 - low / 2)  # the whole width may be beyond the largest float


def from_unit(share: float, distribution: BaseDistribution) -> int | float:
    """The number at `share` of the range, the nearest of its steps; beyond 0 and 1 an end."""
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
