"""Custom parameters of a design space: values that an evaluator reads beside the arm, such as gains of a controller."""

import keyword
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, Literal, Self, cast

from pydantic import BaseModel, BeforeValidator, Field, PlainSerializer, ValidationError, model_validator

from armwright.spaces.field_types import Ordered
from armwright.spaces.parameters import CategoricalParameter, FloatParameter, Parameter, ParameterValue
from armwright.validation_messages import describe_fault

MAX_CUSTOM = 30  # entries of a space file
MAX_VALUE = 1e9  # of a bound
NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")
NUMBERED = re.compile(r"_\d+$")
CHOICE = r"^[A-Za-z0-9][A-Za-z0-9._+-]{0,39}$"
UNIT = r"^([^\[\]\s]([^\[\]\n\r\t]{0,18}[^\[\]\s])?)?$"

# Built-in parameters alone and with a suffix, as in link_3; keys of an answer; columns of the tables of a run.
PREFIXES = ("origin", "joint", "link", "direction", "tube", "motor", "stroke", "limit", "expected")
BUILT_IN = {
    *PREFIXES, "mount", "n_joints", "joints", "links", "directions", "tubes", "motors", "strokes", "ranges", "reason",
    "reasoning", "design", "designs", "number", "source",
}  # fmt: skip


class CustomParameter(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """A custom parameter: a range of numbers, or choices."""

    range: Ordered[float] | None = None  # smallest and largest value
    choices: tuple[Annotated[str, Field(pattern=CHOICE)], ...] = ()  # names to choose from, instead of a range
    # Scale on which values of the range are drawn; log for gains and other values that span decades
    scale: Literal["linear", "log"] = "linear"
    integer: bool = False  # whether values are whole numbers
    # joint: one value for each joint module that moves, with the numbers of the modules added to the name
    per: Literal["joint"] | None = None
    unit: str = Field(default="", pattern=UNIT)  # unit of the range

    @model_validator(mode="after")
    def _check_values(self) -> Self:
        if (self.range is None) == (not self.choices):
            raise ValueError("expected a range or choices; try range: [1, 10]")
        if self.range is None:
            self._check_choices()
        else:
            self._check_range(*self.range)
        return self

    def _check_range(self, low: float, high: float) -> None:
        shown = f"range = [{low:g}, {high:g}] {self.unit}".rstrip()
        if max(abs(low), abs(high)) > MAX_VALUE:
            raise ValueError(f"{shown}: expected values within ±{MAX_VALUE:g}; try another unit")
        if self.scale == "log" and low <= 0.0:
            raise ValueError(f"{shown}: expected values above 0 with scale: log; try scale: linear")
        if self.integer and not (low.is_integer() and high.is_integer()):
            raise ValueError(f"{shown}: expected whole numbers with integer: true; try [{round(low)}, {round(high)}]")

    def _check_choices(self) -> None:
        if len({choice.lower() for choice in self.choices}) != len(self.choices):
            raise ValueError(f"choices: expected different names, got {', '.join(self.choices)}")
        if self.scale != "linear" or self.integer or self.unit:
            raise ValueError("choices: expected no scale, integer or unit beside them; try range: [1, 10] for numbers")

    def parameter(self, name: str) -> Parameter:
        """Return the parameter of the search with this name."""
        if self.range is None:
            return CategoricalParameter(name, self.choices)
        low, high = self.range
        step = 1.0 if self.integer else 0.0
        return FloatParameter(name, low, high, self.unit, step, log=self.scale == "log", integer=self.integer)


def _read(value: Any) -> Any:
    """Return a mapping's pairs of name and parameter, other values as they are; ValueError names a wrong entry."""
    if not isinstance(value, dict):
        return value
    pairs: list[tuple[str, CustomParameter]] = []
    for name, content in cast("dict[Any, Any]", value).items():
        try:
            pairs.append((str(name), CustomParameter.model_validate(content)))
        except ValidationError as fault:
            raise ValueError(f"{name}: {describe_fault(fault, CustomParameter, content)}") from fault
    return tuple(pairs)


def _to_mapping(custom: Sequence[tuple[str, CustomParameter]]) -> dict[str, Any]:
    return {name: entry.model_dump(mode="json", exclude_defaults=True) for name, entry in custom}


Custom = Annotated[tuple[tuple[str, CustomParameter], ...], BeforeValidator(_read), PlainSerializer(_to_mapping)]


def check_names(names: Iterable[str]) -> None:
    """Raise ValueError for names that are malformed or those of built-in parameters."""
    for name in names:
        base = NUMBERED.sub("", name)
        if name in BUILT_IN or name.startswith(tuple(f"{prefix}_" for prefix in PREFIXES)):
            raise ValueError(f'parameters: "{name}" is the name of a built-in parameter; try "my_{base}"')
        if NUMBERED.search(name):
            raise ValueError(f'parameters: expected a name without a number at its end, got "{name}"; try per: joint')
        if not NAME.fullmatch(name) or keyword.iskeyword(name):
            raise ValueError(
                f'parameters: expected a name of at most 40 lowercase letters, digits and _, got "{name:.60}"; try kp'
            )


def describe_custom(custom: Sequence[tuple[str, CustomParameter]], params: Mapping[str, ParameterValue]) -> str:
    """Return the custom parameters of a design as text, those per joint in the order of the joints."""
    parts: list[str] = []
    for name, entry in custom:
        names = [name] if entry.per is None else [other for other in params if NUMBERED.sub("", other) == name]
        values = [params[other] for other in names]
        shown = ", ".join(value if isinstance(value, str) else f"{value:.4g}" for value in values)
        parts.append(f"{name} {shown} {entry.unit}".rstrip())
    return "; ".join(parts)
