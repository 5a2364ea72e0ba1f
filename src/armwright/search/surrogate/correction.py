"""How an objective follows from quantities of the built-in physics, in words.

Statements describe the evaluated designs and are made only on strong evidence:

1. The objective over a quantity of the same unit is nearly constant, for all designs or apart for short and long arms.
2. The objective is within a small distance of such a quantity.
3. Its ranks and those of a quantity are nearly the same or the opposite.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.problem.objective import Objective
from armwright.problem.objectives import LENGTH

FEWEST = 20  # designs of a statement
FEWEST_OF_PART = 10  # designs of a statement on short or long arms
COUNTED = 0.9  # of the designs must have a positive objective and quantity
SPREAD = 1.5  # the largest 90 % quantile of ratios over their 10 % quantile
LEAST_VARIATION = 0.2  # interquartile range of the objective's logarithm
UNEXPLAINED = 0.5  # the largest interquartile range of the ratio's logarithm over that of the objective
SPLITS = np.linspace(0.1, 0.9, 9)  # quantiles of the lengths between which arms may differ
LEAST_DIFFERENCE = 1.1  # of median ratios of short and long arms
LEAST_WITHIN = 0.9  # of the designs, whose difference from a quantity is stated
DIFFERENCE = 0.1  # the largest such difference over the range of 80 % of the objective's values
RANK_CORRELATION = 0.8  # the least one that is stated

Quantities = Mapping[Objective, Array]


@dataclass(frozen=True)
class Ratio:
    """Ratios of an objective to a quantity over some designs.

    Attributes:
        values: (N,) positive ratios.
    """

    values: Array

    @property
    def is_narrow(self) -> bool:
        """Whether the ratios are nearly equal."""
        low, high = np.quantile(self.values, [0.1, 0.9])
        return bool(high <= SPREAD * low)

    def differs_from(self, other: "Ratio") -> bool:
        """Return whether the medians differ and the interquartile ranges do not overlap."""
        low, high = sorted((self, other), key=lambda ratio: float(np.median(ratio.values)))
        apart = np.quantile(low.values, 0.75) < np.quantile(high.values, 0.25)
        return bool(apart and np.median(high.values) >= LEAST_DIFFERENCE * np.median(low.values))

    def describe(self) -> tuple[str, str]:
        """Return the median ratio, and the range of 80 % of them."""
        low, middle, high = (f"{ratio:.3g}" for ratio in np.quantile(self.values, [0.1, 0.5, 0.9]))
        return f"{middle} times", low if low == high else f"{low} to {high}"


def describe_correction(objective: Objective, values: Array, quantities: Quantities) -> str:
    """Return how an objective follows from a quantity; an empty string if the evidence is weak.

    Args:
        objective: the objective.
        values: (N,) of evaluated designs.
        quantities: (N,) of each quantity of these designs.
    """
    if len(values) < FEWEST:
        return ""
    rules = (_describe_ratio, _describe_difference, _describe_trend)
    return next(filter(None, (rule(objective, values, quantities) for rule in rules)), "")


def _describe_ratio(objective: Objective, values: Array, quantities: Quantities) -> str:
    """Return the ratio of an objective to the quantity of its unit that it follows best; empty without a close one."""
    found: list[tuple[float, str]] = []
    lengths = quantities.get(LENGTH)
    for quantity, column in quantities.items():
        factor = _factor(quantity.unit, objective.unit)
        positive = (values > 0.0) & (column > 0.0)
        if factor is None or positive.sum() < max(FEWEST, COUNTED * len(values)):
            continue
        ratios = values[positive] / (column[positive] * factor)
        names = objective.name, f"our {_in_words(quantity)}"
        text, unexplained = _describe_ratios(*names, ratios, None if lengths is None else lengths[positive])
        variation = _interquartile(np.log(values[positive]))
        if text and variation >= LEAST_VARIATION and unexplained <= UNEXPLAINED * variation:
            found.append((unexplained, text))
    return min(found)[1] if found else ""


def _describe_ratios(objective: str, quantity: str, ratios: Array, lengths: Array | None) -> tuple[str, float]:
    """Return a statement on ratios, empty if they differ much, and the interquartile range of what it leaves open."""
    by_length = None if lengths is None else _describe_by_length(objective, quantity, ratios, lengths)
    if by_length is not None:
        return by_length
    whole = Ratio(ratios)
    if not whole.is_narrow:
        return "", np.inf
    times, within = whole.describe()
    relation = "equals" if times == "1 times" else f"is {times}"
    return f"{objective} {relation} {quantity} (80 % of designs: {within})", _interquartile(np.log(ratios))


def _describe_by_length(objective: str, quantity: str, ratios: Array, lengths: Array) -> tuple[str, float] | None:
    """Return the same apart for arms above and below some length; None if these do not differ.

    The length is the rounded quantile that leaves the least variance of the ratios' logarithms.
    """
    logs = np.log(ratios)
    thresholds = {float(f"{length:.2g}") for length in np.quantile(lengths, SPLITS)}
    splits = {t: lengths > t for t in sorted(thresholds)}
    splits = {t: long for t, long in splits.items() if min(long.sum(), (~long).sum()) >= FEWEST_OF_PART}
    if not splits:
        return None
    threshold, is_long = min(splits.items(), key=lambda one: _variance_within(logs, one[1]))
    long, short = Ratio(ratios[is_long]), Ratio(ratios[~is_long])
    if not (long.is_narrow and short.is_narrow and long.differs_from(short)):
        return None
    (times, within), (other_times, other_within) = long.describe(), short.describe()
    text = (
        f"{objective} is {times} {quantity} on arms longer than {threshold:g} m and {other_times} on others "
        f"(80 % of designs: {within} and {other_within})"
    )
    rest = logs - np.log(np.where(is_long, np.median(long.values), np.median(short.values)))
    return text, _interquartile(rest)


def _variance_within(values: Array, is_one: NDArray[np.bool_]) -> float:
    """Return the variance of values (N,) that are in two parts, each about its own mean."""
    return float(sum(((part - part.mean()) ** 2).sum() for part in (values[is_one], values[~is_one]))) / len(values)


def _describe_difference(objective: Objective, values: Array, quantities: Quantities) -> str:
    """Return how close an objective is to the nearest quantity of its unit; empty if that is not close."""
    found: list[tuple[float, str]] = []
    low, high = np.quantile(values, [0.1, 0.9])
    for quantity, column in quantities.items():
        factor = _factor(quantity.unit, objective.unit)
        if factor is None:
            continue
        off = np.abs(values - column * factor)
        bound = float(np.quantile(off, LEAST_WITHIN))
        shown = float(f"{1.05 * bound:.2g}")  # rounding never makes it smaller than the bound
        text = (
            f"{objective.name} is within {shown:g} {objective.unit} of our {_in_words(quantity)} on "
            f"{100.0 * np.mean(off <= shown):.0f} % of designs"
        )
        if bound <= DIFFERENCE * (high - low) and np.ptp(column) > 0.0:
            found.append((bound, text))
    return min(found)[1] if found else ""


def _describe_trend(objective: Objective, values: Array, quantities: Quantities) -> str:
    """Return with which quantity an objective rises or falls; empty if it follows none."""
    varying = {q: column for q, column in quantities.items() if np.ptp(column) > 0.0}
    if np.ptp(values) == 0.0 or not varying:
        return ""
    found = {q: float(np.corrcoef(_ranks(values), _ranks(column))[0, 1]) for q, column in varying.items()}
    quantity, correlation = max(found.items(), key=lambda pair: abs(pair[1]))
    if abs(correlation) < RANK_CORRELATION:
        return ""
    verb = "grows with" if correlation > 0.0 else "falls with growing"
    return f"on these designs, {objective.name} {verb} our {_in_words(quantity)} (rank correlation {correlation:.2f})"


def _factor(unit: str, wanted: str) -> float | None:
    """Return the factor from a unit such as `N m x 40` to the wanted one; None if they measure different things."""
    if unit == wanted:
        return 1.0
    base, _, multiple = unit.partition(" x ")
    return 1.0 / float(multiple) if multiple and base == wanted else None


def _in_words(quantity: Objective) -> str:
    return quantity.name.replace("_", " ")


def _ranks(values: Array) -> Array:
    """Return (N,) ranks; equal values share their mean rank."""
    _, index, counts = np.unique(values, return_inverse=True, return_counts=True)
    return (np.cumsum(counts) - 0.5 * (counts - 1))[index]


def _interquartile(values: Array) -> float:
    low, high = np.quantile(values, [0.25, 0.75])
    return float(high - low)
