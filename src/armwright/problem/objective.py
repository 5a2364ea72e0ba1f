"""An objective: a number for each target, made from an evaluation, and how these become one."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import UnknownQuantityError
from armwright.problem.evaluation import Evaluation

Over = Literal["sum", "max", "min", "rms", "arm"]
_OVER: Mapping[Over, str] = {
    "sum": " Summed over the targets.",
    "max": " The worst target counts.",
    "min": " The target where it is smallest counts.",
    "rms": " The root mean square over the targets.",
    "arm": "",
}


@dataclass(frozen=True)
class Objective:
    """A quantity per arm to minimise.

    Attributes:
        description: The quantity at one target, or for `over="arm"` of the arm, for readers new to this program.
        each: Its value per target, (N, T); for `over="arm"` of the arm itself, (N,).
        excess: What of this value an objective minimises, if not all: of errors, what exceeds the stated tolerances.
        over: How the values become one: their sum, maximum, minimum or root mean square.
        label: Its name in tables and figures; by default the name in words.
        symbol: Its name in formulas and prompts; by default E_name.
    """

    name: str
    unit: str
    description: str
    each: Callable[[Evaluation], Array]
    over: Over = "sum"
    label: str = ""
    symbol: str = ""
    excess: Callable[[Evaluation], Array] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "label", self.label or self.name.replace("_", " ").capitalize())
        object.__setattr__(self, "symbol", self.symbol or f"E_{self.name}")

    def __call__(self, evaluation: Evaluation) -> Array:
        """Return one value per arm, (N,), as constraints bound it."""
        return self._total(self.each(evaluation))

    def minimised(self, evaluation: Evaluation) -> Array:
        """Return one value per arm, (N,), as searches minimise it."""
        return self._total(self.shares(evaluation))

    def known(self, evaluation: Evaluation, minimised: bool = False) -> tuple[Array, str]:
        """Return (N,) values and an empty reason; NaN and the reason if task or arms leave the quantity open.

        Args:
            evaluation: Physics of N arms. What is not known of one is not known of any.
            minimised: Return the value that searches minimise.
        """
        try:
            values = self.minimised(evaluation) if minimised else self(evaluation)
        except UnknownQuantityError as unknown:
            return np.full(len(evaluation), np.nan), unknown.reason
        finite = np.isfinite(values)
        return np.where(finite, values, np.nan), "" if finite.all() else "it is not finite"

    def shares(self, evaluation: Evaluation) -> Array:
        """Return the shares of the targets in the minimised value, (N, T); for `over="arm"` the value itself, (N,)."""
        return (self.excess or self.each)(evaluation)

    def _total(self, each: Array) -> Array:
        match self.over:
            case "sum":
                return each.sum(axis=1)
            case "max":
                return each.max(axis=1)
            case "min":
                return each.min(axis=1)
            case "rms":
                return np.sqrt(np.mean(each**2, axis=1))
            case "arm":
                return each

    @property
    def explanation(self) -> str:
        """The quantity and how the targets count, in sentences."""
        return f"{self.description[0].upper()}{self.description[1:]}.{_OVER[self.over]}"

    @property
    def unit_in_brackets(self) -> str:
        """Its unit behind a name: ` [m]`; empty if it has none."""
        return f" [{self.unit}]" if self.unit else ""

    @property
    def is_of_targets(self) -> bool:
        """True if each target contributes to it."""
        return self.over != "arm"
