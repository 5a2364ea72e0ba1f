"""Parts that the rules for arms and the rules for any Optuna study share."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")

MIDDLE = (0.35, 0.65)  # shares of a gap between which a rule fills it
FIRST_SPREAD, MORE_SPREAD, MAX_CHANGES = 0.01, 1.5, 20


def draw_gap(sizes: Sequence[float], rng: np.random.Generator) -> int:
    """Draw the index of a gap with a probability that grows with the square of its size.

    The widest gap is not always taken, since it may be wide because no design can fill it.
    """
    weights = np.array(sizes) ** 2 + 1e-12  # never all zero
    return int(rng.choice(len(weights), p=weights / weights.sum()))


def change_until_new(value: T, is_tried: Callable[[T], bool], change: Callable[[T, float], T]) -> T:
    """Change a value by growing steps until it has not been tried; return the last if none is new.

    `change` returns a value, changed by a spread given as a share of the parameters' scale.
    """
    spread = FIRST_SPREAD
    for _ in range(MAX_CHANGES):
        if not is_tried(value):
            break
        value = change(value, spread)
        spread *= MORE_SPREAD
    return value


def proposal_id(name: str, number: int, rule: str) -> str:
    """Return the id of a rule's proposal, from which `rule_of` reads the rule."""
    return f"{name}-{number:04d}-{rule}"


def rule_of(proposal: str | None) -> str:
    """Return the rule that made the proposal with this id; some other text for proposals of no rule."""
    return (proposal or "").rpartition("-")[2]
