"""Named parameters of a design space, and a design as their values."""

import math
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from itertools import count, takewhile
from typing import Any

import numpy as np

from armwright.exceptions import DesignError
from armwright.spaces.joint_modules import MODULES, Module

Range = tuple[float, float]
ParameterValue = float | str

GRID_ERROR = 1e-9  # tolerance for a value on a grid
GRID_DIGITS = 12  # decimals of a value on a grid


@dataclass(frozen=True, slots=True)
class _Named:
    """A parameter and the condition under which it is active."""

    name: str
    _: KW_ONLY
    module: int | None = None  # counted from 1, that the arm must have; None if the parameter is always active
    types: frozenset[str] | None = None  # the types that this module may have; None for any

    def is_active(self, params: Mapping[str, ParameterValue], max_joints: int) -> bool:
        """Return whether the parameter is active, given the values of the parameters before it."""
        if self.module is None:
            return True
        if self.module > int(params.get("n_joints", max_joints)):
            return False
        return self.types is None or params.get(f"joint_{self.module}") in self.types


@dataclass(frozen=True, slots=True)
class FloatParameter(_Named):
    """A numeric parameter."""

    low: float  # the lower bound, in `unit`
    high: float
    unit: str
    step: float = 0.0  # the step of its grid, which starts at `low`; 0 for none
    log: bool = False  # whether it is drawn on a logarithmic scale; its values are above 0
    integer: bool = False  # whether its values are whole numbers, as `int`; its step is one, too

    def __post_init__(self) -> None:
        """Replace -0.0 by 0.0: numpy sorts -0.0 below 0.0."""
        object.__setattr__(self, "low", self.low + 0.0)
        object.__setattr__(self, "high", self.high + 0.0)

    @property
    def default(self) -> float:
        """The middle of the range, on its scale."""
        return self.nearest(math.sqrt(self.low * self.high) if self.log else (self.low + self.high) / 2)

    def check(self, value: Any) -> float:
        """Return `value` as a float, or as an int if values are whole numbers.

        Raises DesignError if it is not a number within the range, or not on the grid.
        """
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < math.inf:
            raise DesignError(f"{self.name} = {value!r} is not a finite number [{self.unit}]")
        if not self.low <= value <= self.high:
            shown = exact(value) if abs(value) < 1e300 else "a huge number"  # an integer may exceed the largest float
            raise DesignError(
                f"{self.name} = {shown} {self.unit} is outside "
                f"{exact(self.low)} <= {self.name} <= {exact(self.high)} {self.unit}"
            )
        if self.step > 0.0 and abs(self.nearest(value) - value) > GRID_ERROR:
            raise DesignError(
                f"{self.name} = {exact(value)} {self.unit} is not on its grid: "
                f"{exact(self.low)} {self.unit} plus multiples of {exact(self.step)} {self.unit}"
            )
        return round(value) if self.integer else float(value)

    def nearest(self, value: float) -> float:
        """Return the allowed value closest to `value`."""
        inside = min(max(float(value), self.low), self.high)
        if self.step == 0.0:
            return inside
        return round(self.low + self.step * round((inside - self.low) / self.step), GRID_DIGITS)

    def encode(self, value: Any) -> float:
        """Return `value` as an entry of a design matrix."""
        return value

    def decode(self, number: float) -> float:
        """Return the value that an entry of a design matrix stands for."""
        return round(number) if self.integer else number

    def sample(self, rng: np.random.Generator) -> float:
        """Return the matrix entry of a value that is drawn uniformly on its scale."""
        margin = self.step / 2 if self.integer else 0.0  # the ends are as likely as any other number
        low, high = self.low - margin, self.high + margin
        if self.log:
            return self.nearest(math.exp(rng.uniform(math.log(low), math.log(high))))
        return self.nearest(float(rng.uniform(low, high)))


@dataclass(frozen=True, slots=True)
class CategoricalParameter(_Named):
    """A parameter with a few named choices."""

    choices: tuple[str, ...]

    @property
    def default(self) -> str:
        """The first of the choices."""
        return self.choices[0]

    def check(self, value: Any) -> str:
        """Return `value`; DesignError if it is not one of the choices."""
        if value not in self.choices:
            raise DesignError(f"{self.name} = {value!r} is not one of {', '.join(self.choices)}")
        return value

    def nearest(self, value: Any) -> str:
        """Return `value` if it is one of the choices, else the default."""
        return value if value in self.choices else self.default

    def encode(self, value: Any) -> float:
        """Return `value` as an entry of a design matrix: its index; DesignError if it is not one of the choices."""
        try:
            return self.choices.index(value)
        except ValueError:
            return self.choices.index(self.check(value))  # which raises the reason

    def decode(self, number: float) -> str:
        """Return the value that an entry of a design matrix stands for."""
        return self.choices[int(number)]

    def sample(self, rng: np.random.Generator) -> float:
        """Return the matrix entry of a uniformly drawn choice."""
        return float(rng.integers(len(self.choices)))


Parameter = FloatParameter | CategoricalParameter


def exact(value: float) -> str:
    """Format a number with six digits, or with all if six do not reproduce it."""
    short = f"{value:g}"
    return short if float(short) == value else repr(float(value))


@dataclass(frozen=True)
class Design:
    """Parameter values: one point of a design space. The order of the mapping is irrelevant."""

    params: Mapping[str, ParameterValue]

    def __post_init__(self) -> None:
        object.__setattr__(self, "params", dict(self.params))

    def __hash__(self) -> int:
        return hash(frozenset(self.params.items()))

    @property
    def modules(self) -> tuple[Module, ...]:
        """The joint modules in order."""
        return tuple(MODULES[letter] for letter in self.joints)  # pyright: ignore[reportArgumentType]

    @property
    def module_of_joint(self) -> tuple[int, ...]:
        """The index of each joint's module; a module may have two joints."""
        return tuple(i for i, module in enumerate(self.modules) for _ in module.joints)

    @property
    def origin(self) -> tuple[float, float, float]:
        """The base position [m]."""
        return tuple(float(self.params[f"origin_{axis}"]) for axis in "xyz")  # pyright: ignore[reportReturnType]

    @property
    def joints(self) -> str:
        """The joint types in order, as one word with a letter per module: `YPRP`."""
        return "".join(str(value) for value in self._numbered("joint"))

    @property
    def links(self) -> tuple[float, ...]:
        """The link lengths in order [m]."""
        return tuple(float(value) for value in self._numbered("link"))

    @property
    def mount(self) -> str | None:
        """The surface that the arm is mounted on; None if it is not a parameter of the space."""
        return None if "mount" not in self.params else str(self.params["mount"])

    @property
    def motors(self) -> tuple[str, ...]:
        """The names of the modules' actuators in order; empty if they are not parameters of the space."""
        return tuple(str(value) for value in self._numbered("motor"))

    @property
    def tubes(self) -> tuple[str, ...]:
        """The names of the links' tubes in order, or of the one of all links; empty if they are not parameters."""
        return (str(self.params["tube"]),) if "tube" in self.params else tuple(map(str, self._numbered("tube")))

    def _numbered(self, kind: str) -> list[ParameterValue]:
        """Return the values of kind_1, kind_2, …, in the order of the modules."""
        modules = takewhile(lambda number: f"joint_{number}" in self.params, count(1))
        names = (f"{kind}_{number}" for number in modules)
        return [self.params[name] for name in names if name in self.params]
