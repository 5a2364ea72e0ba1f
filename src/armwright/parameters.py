"""Named parameters of a design space, and a design as their values."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count, takewhile
from typing import Any

from armwright.exceptions import DesignError

Range = tuple[float, float]
ParameterValue = float | str

GRID_ERROR = 1e-9  # by which a value may miss its grid
GRID_DIGITS = 12  # decimals of a value on a grid


@dataclass(frozen=True, slots=True)
class FloatParameter:
    """A real parameter: low <= value <= high, in `unit`; step: of its grid, which begins at `low`, or 0 for none."""

    name: str
    low: float
    high: float
    unit: str
    step: float = 0.0

    def __post_init__(self) -> None:
        """0.0 for -0.0, which numpy takes for an end below 0."""
        object.__setattr__(self, "low", self.low + 0.0)
        object.__setattr__(self, "high", self.high + 0.0)

    def check(self, value: Any) -> float:
        """`value` as a float; DesignError where it is not a number within the range."""
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < math.inf:
            raise DesignError(f"{self.name} = {value!r} is not a finite number [{self.unit}]")
        if not self.low <= value <= self.high:
            shown = exact(value) if abs(value) < 1e300 else "a huge number"  # whole numbers have no largest
            raise DesignError(
                f"{self.name} = {shown} {self.unit} is outside "
                f"{exact(self.low)} <= {self.name} <= {exact(self.high)} {self.unit}"
            )
        if self.step > 0.0 and abs(self.settled(value) - value) > GRID_ERROR:
            raise DesignError(
                f"{self.name} = {exact(value)} {self.unit} is not on its grid: "
                f"{exact(self.low)} {self.unit} and multiples of {exact(self.step)} {self.unit} more"
            )
        return float(value)

    def settled(self, value: float) -> float:
        """The nearest value that it can take."""
        inside = min(max(float(value), self.low), self.high)
        if self.step == 0.0:
            return inside
        return round(self.low + self.step * round((inside - self.low) / self.step), GRID_DIGITS)


@dataclass(frozen=True, slots=True)
class CategoricalParameter:
    """A parameter that takes one of a few names."""

    name: str
    choices: tuple[str, ...]

    def check(self, value: Any) -> str:
        """`value`; DesignError where it is not one of the choices."""
        if value not in self.choices:
            raise DesignError(f"{self.name} = {value!r} is not one of {', '.join(self.choices)}")
        return value


Parameter = FloatParameter | CategoricalParameter


def exact(value: float) -> str:
    """A number in six digits, or in all where six do not give it back: a range must be told so that it can be met."""
    short = f"{value:g}"
    return short if float(short) == value else repr(float(value))


@dataclass(frozen=True)
class Design:
    """Parameter values: one point of a design space. The order of the mapping means nothing."""

    params: Mapping[str, ParameterValue]

    def __post_init__(self) -> None:
        object.__setattr__(self, "params", dict(self.params))

    def __hash__(self) -> int:
        return hash(frozenset(self.params.items()))

    @property
    def origin(self) -> tuple[float, float, float]:
        """The base position [m]."""
        return tuple(float(self.params[f"origin_{axis}"]) for axis in "xyz")  # pyright: ignore[reportReturnType]

    @property
    def joints(self) -> str:
        """The joint types in order, as one word, a letter for each module: `YPRP`."""
        return "".join(str(value) for value in self._numbered("joint"))

    @property
    def links(self) -> tuple[float, ...]:
        """The link lengths in order [m]."""
        return tuple(float(value) for value in self._numbered("link"))

    @property
    def directions(self) -> tuple[str, ...]:
        """Where the links leave to, in order; none where the space leaves no choice."""
        return tuple(str(value) for value in self._numbered("direction"))

    @property
    def mount(self) -> str | None:
        """Where the arm stands; None where the space leaves no choice."""
        return None if "mount" not in self.params else str(self.params["mount"])

    @property
    def motors(self) -> tuple[str, ...]:
        """The names of the modules' actuators in order; none where the space leaves no choice."""
        return tuple(str(value) for value in self._numbered("motor"))

    def _numbered(self, kind: str) -> list[ParameterValue]:
        """The values of kind_1, kind_2, … that there are, in whatever order the mapping has them."""
        modules = takewhile(lambda number: f"joint_{number}" in self.params, count(1))
        names = (f"{kind}_{number}" for number in modules)
        return [self.params[name] for name in names if name in self.params]
