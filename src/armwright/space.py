"""The design space: named parameters, and the arm that their values build.

The paper's space (D = 4) is `paper_space()`: the base position O, one of three rotation axes for each
joint, one length for each link. Every number of it can be changed in a YAML file.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import count, takewhile
from pathlib import Path
from typing import Annotated, Any, Literal, Self, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, field_serializer, field_validator, model_validator

from armwright.arm import Actuator, Arm, Axis, Joint, uniform_link
from armwright.catalogue import ActuatorRecord, TorqueKind, resolved
from armwright.documents import check_document, read_document
from armwright.exceptions import DesignError, SpaceError, did_you_mean

JointType = Literal["R", "P", "Y"]
Range = tuple[float, float]
Restriction = float | str | Range | tuple[str, ...]
ParameterValue = float | str

JOINT_AXES: dict[JointType, Axis] = {"R": "x", "P": "y", "Y": "z"}
JOINT_WORDS: dict[JointType, str] = {
    "R": "roll, about local x",
    "P": "pitch, about local y",
    "Y": "yaw, about local z, along the link",
}
TOY_MASS = 0.1  # [kg] of a whole arm
LARGEST_ANGLE = 2 * math.pi  # [rad]
MOST_ACTUATORS = 50
LARGEST_LENGTH = 1000.0  # [m]; beyond it float32 kernels lose the millimetre


@dataclass(frozen=True, slots=True)
class FloatParameter:
    """A real parameter: low <= value <= high, in `unit`."""

    name: str
    low: float
    high: float
    unit: str

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
        return float(value)


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
        """The joint types in order, as one word: `YPRP`."""
        return "".join(str(value) for value in self._numbered("joint"))

    @property
    def links(self) -> tuple[float, ...]:
        """The link lengths in order [m]."""
        return tuple(float(value) for value in self._numbered("link"))

    @property
    def motors(self) -> tuple[str, ...]:
        """The names of the joints' actuators in order; none where the space leaves no choice."""
        return tuple(str(value) for value in self._numbered("motor"))

    def _numbered(self, kind: str) -> list[ParameterValue]:
        """The values of kind_1, kind_2, …, in whatever order the mapping has them."""
        names = takewhile(self.params.__contains__, (f"{kind}_{number}" for number in count(1)))
        return [self.params[name] for name in names]


class MassPerMetre(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Links of one section and material: mass grows with length."""

    kind: Literal["per_metre"] = "per_metre"
    kg: float = Field(default=0.0121, ge=0.0, le=1e4)

    def mass(self, length: float) -> float:
        """Of a link of `length` [m], in [kg]."""
        return self.kg * length

    def masses(self, lengths: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of links of these lengths [m], in [kg]."""
        return self.kg * lengths

    def words(self) -> str:
        return f"{self.kg:g} kg per metre of link"


class MassPerLink(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Modules of one mass, whatever their length."""

    kind: Literal["per_link"]
    kg: float = Field(default=0.002, ge=0.0, le=1e4)

    def mass(self, length: float) -> float:
        """Of any link, in [kg]."""
        return self.kg

    def masses(self, lengths: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of links of these lengths [m], in [kg]."""
        return np.full_like(lengths, self.kg)

    def words(self) -> str:
        return f"{self.kg:g} kg for each link, whatever its length"


class MassOfTube(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Links cut from a round tube (or bar, where the wall is half the diameter) of a real material."""

    kind: Literal["tube"]
    density: float = Field(gt=0.0, le=3e4)  # [kg/m³]
    outer_diameter: float = Field(gt=0.0, le=1.0)  # [m]
    wall: float = Field(gt=0.0)  # [m]

    @model_validator(mode="after")
    def _check_wall(self) -> Self:
        if self.wall > self.outer_diameter / 2:
            raise ValueError(f"wall = {self.wall:g} m is more than half of outer_diameter = {self.outer_diameter:g} m")
        return self

    def mass(self, length: float) -> float:
        """Of a link of `length` [m], in [kg]."""
        outer = self.outer_diameter / 2
        inner = outer - self.wall
        return self.density * math.pi * (outer**2 - inner**2) * length

    def masses(self, lengths: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of links of these lengths [m], in [kg]."""
        outer = self.outer_diameter / 2
        inner = outer - self.wall
        return self.density * math.pi * (outer**2 - inner**2) * lengths

    def words(self) -> str:
        return (
            f"a tube of {self.outer_diameter * 1e3:g} mm outer diameter and {self.wall * 1e3:g} mm wall, "
            f"{self.density:g} kg/m³ ({self.mass(1.0):.3g} kg per metre)"
        )


MassModel = Annotated[MassPerMetre | MassPerLink | MassOfTube, Field(discriminator="kind")]


class DesignSpace(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """A serial arm of `joints` revolute joints: base position, joint types and link lengths are searched.

    The first joint sits at the origin O; link j follows joint j along local +z; with all angles 0 the
    links stand in one vertical line. 2 D + 3 parameters.

    actuators: what the joints may have, names of the catalogue or records; with several, each joint's is a parameter.
    None: joints without mass.
    actuator_torque, safety_factor: which torque of theirs counts, divided by what.
    restrict: single parameters by name, fixed (`joint_1: Y`, `origin_z: 0.0`), of fewer choices (`joint_2: [P, R]`)
        or in a narrower range (`link_1: [0.1, 0.2]`).
    """

    name: str = Field(default="paper", min_length=1, max_length=100)
    joints: int = Field(default=4, ge=1, le=8)
    joint_types: tuple[JointType, ...] = Field(default=("R", "P", "Y"), min_length=1)
    joint_range: Range = (-2.4, 2.4)  # [rad]
    origin_x: Range = (-1.0, 1.0)  # [m]
    origin_y: Range = (-1.0, 1.0)  # [m]
    origin_z: Range = (-1.0, 1.0)  # [m]
    link: Range = (0.03, 0.30)  # [m]
    link_radius: float = Field(default=0.015, gt=0.0, le=1.0)  # [m]
    mass: MassModel = MassPerMetre()
    actuators: tuple[ActuatorRecord, ...] = Field(default=(), max_length=MOST_ACTUATORS)
    actuator_torque: TorqueKind = "stall"
    safety_factor: float = Field(default=1.0, gt=0.0, le=100.0)
    restrict: tuple[tuple[str, Restriction], ...] = Field(default=(), max_length=100)

    @field_validator("restrict", mode="before")
    @classmethod
    def _pairs(cls, value: Any) -> Any:
        return tuple(cast("dict[str, Any]", value).items()) if isinstance(value, dict) else value

    @field_serializer("restrict")
    def _as_mapping(self, value: tuple[tuple[str, Restriction], ...]) -> dict[str, Restriction]:
        return dict(value)

    @field_validator("actuators", mode="before")
    @classmethod
    def _look_up(cls, value: Any) -> Any:
        if not isinstance(value, (list, tuple)):
            raise ValueError("actuators is a list of names, or of records with name, mass and stall_torque")
        return [resolved(entry) for entry in cast("list[Any]", value)]

    @field_validator("mass", mode="before")
    @classmethod
    def _check_kind(cls, value: Any) -> Any:
        if isinstance(value, dict) and "kind" not in cast("dict[str, Any]", value):
            raise ValueError("kind is missing: per_metre, per_link or tube")
        return cast("Any", value)

    @model_validator(mode="after")
    def _check_ranges(self) -> Self:
        for name, unit in (
            ("origin_x", "m"),
            ("origin_y", "m"),
            ("origin_z", "m"),
            ("link", "m"),
            ("joint_range", "rad"),
        ):
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(f"{name} = [{low:g}, {high:g}] {unit} is upside down: write the smaller number first")
            if max(abs(low), abs(high)) > LARGEST_LENGTH:
                raise ValueError(f"{name} = [{low:g}, {high:g}] {unit} goes beyond ±{LARGEST_LENGTH:g}")
        if self.link[0] <= 0.0:
            raise ValueError(f"link = [{self.link[0]:g}, {self.link[1]:g}] m: a link must be longer than 0 m")
        low, high = self.joint_range
        if high - low < math.radians(3.0):
            raise ValueError(f"joint_range = [{low:g}, {high:g}] rad is narrower than 3 degrees; a joint must move")
        if max(-low, high) > LARGEST_ANGLE:
            raise ValueError(f"joint_range = [{low:g}, {high:g}] rad goes beyond ±2π, a full turn each way")
        if not low <= 0.0 <= high:
            raise ValueError(f"joint_range = [{low:g}, {high:g}] rad must hold 0, where the inverse kinematics starts")
        _check_restrictions(self)
        names = [record.name for record in self.actuators]
        if len(set(names)) != len(names):
            raise ValueError(f"actuators names one twice: {', '.join(names)}")
        for record in self.actuators:
            record.actuator(self.actuator_torque, self.safety_factor)
        if len(set(self.joint_types)) != len(self.joint_types):
            raise ValueError(f"joint_types names a type twice: {', '.join(self.joint_types)}")
        return self

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters in their fixed order: origin, joint types, link lengths."""
        return _parameters(self)

    def design(self, params: Mapping[str, Any]) -> Design:
        """The design with these values, in the space's order; DesignError where they are not in the space."""
        names = [parameter.name for parameter in self.parameters]
        for name in params:
            if name not in names:
                raise DesignError(
                    f'unknown parameter "{name}". Parameters: {", ".join(names)}.{did_you_mean(name, names)}'
                )
        missing = [name for name in names if name not in params]
        if missing:
            raise DesignError(f"missing: {', '.join(missing)}")
        return Design({parameter.name: parameter.check(params[parameter.name]) for parameter in self.parameters})

    def clipped(
        self, origin: Iterable[float], joints: str, links: Iterable[float], motors: Sequence[str] = ()
    ) -> Design:
        """The design of these numbers, each moved into its range; without motors, the usual ones."""
        values = [*origin, *joints, *links, *(motors or self.usual_motors)]
        return Design({p.name: _clip(p, value) for p, value in zip(self.parameters, values, strict=True)})

    def matrix(self, designs: Sequence[Design]) -> NDArray[np.float64]:
        """(N, P) designs as rows, for work on many at once: a category is its place among the choices."""
        columns = [_column(parameter, designs) for parameter in self.parameters]
        return np.array(columns, dtype=np.float64).T.reshape(len(designs), len(self.parameters))

    def designs(self, matrix: NDArray[np.float64]) -> list[Design]:
        """The designs that the rows of a matrix are."""
        return [
            Design({p.name: _entry(p, value) for p, value in zip(self.parameters, row, strict=True)})
            for row in matrix.tolist()
        ]

    def sample(self, n: int, seed: int) -> list[Design]:
        """`n` designs, uniform in every parameter."""
        rng = np.random.default_rng(seed)
        return [Design({p.name: _draw(p, rng) for p in self.parameters}) for _ in range(n)]

    @property
    def usual_motors(self) -> tuple[str, ...]:
        """One for each joint, where there is a choice: from the strongest at the base to the weakest at the tip."""
        if len(self.actuators) < 2:
            return ()
        ranked = sorted(self.arm_actuators, key=lambda actuator: -actuator.effort)
        return tuple(ranked[len(ranked) * j // self.joints].name for j in range(self.joints))

    @property
    def arm_actuators(self) -> tuple[Actuator, ...]:
        """The actuators as the arm knows them, in the order of the list."""
        return _arm_actuators(self)

    @property
    def is_toy(self) -> bool:
        """Whether even the heaviest arm weighs next to nothing, as the paper's do."""
        heaviest = max((record.mass for record in self.actuators), default=0.0)
        return self.joints * (self.mass.mass(self.link[1]) + heaviest) < TOY_MASS

    @property
    def mass_note(self) -> str:
        """How heavy the links are taken to be, in one sentence; it belongs wherever torques are shown."""
        toy = "; a toy: real arms weigh kilograms, so read its N m as a comparison only" if self.is_toy else ""
        chosen = ", ".join(record.name for record in self.actuators)
        motors = f"; actuators: {chosen}" if self.actuators else ""
        return f"links: {self.mass.words()}{toy}{motors}"

    def arm(self, design: Design) -> Arm:
        """The physical chain that a design builds."""
        if not len(design.joints) == len(design.links) == self.joints:
            self.design(design.params)  # says what is wrong
        lower, upper = self.joint_range
        motors = self._motors(design)
        ends = [0.0 if motor is None else motor.mass for motor in (*motors[1:], None)]
        kinds = cast("list[JointType]", list(design.joints))
        joints = [
            Joint("revolute", JOINT_AXES[kind], lower, upper, motor) for kind, motor in zip(kinds, motors, strict=True)
        ]
        links = [
            replace(uniform_link((0.0, 0.0, length), self.mass.mass(length), self.link_radius), end_mass=end)
            for length, end in zip(design.links, ends, strict=True)
        ]
        return Arm(base=design.origin, joints=tuple(joints), links=tuple(links))

    def _motors(self, design: Design) -> list[Actuator | None]:
        """Of each joint."""
        if not self.actuators:
            return [None] * self.joints
        by_name = {actuator.name: actuator for actuator in self.arm_actuators}
        return [by_name[name] for name in (design.motors or (self.arm_actuators[0].name,) * self.joints)]


def paper_space(joints: int = 4) -> DesignSpace:
    """The design space of the paper, with `joints` joints (4 in its experiments)."""
    content = {"name": "paper" if joints == 4 else f"paper-{joints}", "joints": joints}
    return check_document(content, DesignSpace, SpaceError, "paper_space")


def load_space(path: str | Path) -> DesignSpace:
    """The design space of a YAML file; keys that it leaves out are as in the paper."""
    return read_document(Path(path), DesignSpace, SpaceError)


@cache
def _parameters(space: DesignSpace) -> tuple[Parameter, ...]:
    # Not a cached property: a copy of the space with other ranges would take its value along.
    ranges: dict[str, Range] = {"x": space.origin_x, "y": space.origin_y, "z": space.origin_z}
    origin = [FloatParameter(f"origin_{axis}", *limits, "m") for axis, limits in ranges.items()]
    joints = [CategoricalParameter(f"joint_{j}", space.joint_types) for j in range(1, space.joints + 1)]
    links = [FloatParameter(f"link_{j}", *space.link, "m") for j in range(1, space.joints + 1)]
    names = tuple(record.name for record in space.actuators)
    motors = [CategoricalParameter(f"motor_{j}", names) for j in range(1, space.joints + 1)] if len(names) > 1 else []
    to = dict(space.restrict)
    return tuple(
        _restricted(parameter, to[parameter.name]) if parameter.name in to else parameter
        for parameter in (*origin, *joints, *links, *motors)
    )


def _restricted(parameter: Parameter, to: Restriction) -> Parameter:
    """The parameter as `restrict` leaves it; ValueError where that is not a part of it."""
    asked: tuple[float | str, ...] = (to,) if isinstance(to, (str, float, int)) else to
    if isinstance(parameter, CategoricalParameter):
        for choice in asked:
            if choice not in parameter.choices:
                raise ValueError(
                    f"restrict: {parameter.name} = {choice!r} is not one of {', '.join(parameter.choices)}"
                )
        if not asked:
            raise ValueError(f"restrict: {parameter.name} is left no choice")
        return CategoricalParameter(parameter.name, tuple(c for c in parameter.choices if c in asked))
    numbers = [value for value in asked if not isinstance(value, str)]
    if not 1 <= len(numbers) == len(asked) <= 2:
        raise ValueError(f"restrict: {parameter.name} = {to!r} is no number and no range [{parameter.unit}]")
    low, high = numbers[0], numbers[-1]
    if not parameter.low <= low <= high <= parameter.high:
        raise ValueError(
            f"restrict: {parameter.name} = [{low:g}, {high:g}] {parameter.unit} is not a part of "
            f"[{parameter.low:g}, {parameter.high:g}]"
        )
    return FloatParameter(parameter.name, low, high, parameter.unit)


def _check_restrictions(space: DesignSpace) -> None:
    """ValueError where one is of no parameter, or not a part of it."""
    free = {parameter.name: parameter for parameter in space.model_copy(update={"restrict": ()}).parameters}
    for name, to in space.restrict:
        if name not in free:
            raise ValueError(f'restrict: there is no parameter "{name}".{did_you_mean(name, free)}')
        _restricted(free[name], to)


@cache
def _arm_actuators(space: DesignSpace) -> tuple[Actuator, ...]:
    return tuple(record.actuator(space.actuator_torque, space.safety_factor) for record in space.actuators)


def _clip(parameter: Parameter, value: Any) -> ParameterValue:
    if isinstance(parameter, FloatParameter):
        return min(max(float(value), parameter.low), parameter.high)
    return value if value in parameter.choices else parameter.choices[0]


def _column(parameter: Parameter, designs: Sequence[Design]) -> list[float]:
    values: list[Any] = [design.params[parameter.name] for design in designs]
    return values if isinstance(parameter, FloatParameter) else [parameter.choices.index(value) for value in values]


def _entry(parameter: Parameter, value: float) -> ParameterValue:
    return value if isinstance(parameter, FloatParameter) else parameter.choices[int(value)]


def _draw(parameter: Parameter, rng: np.random.Generator) -> ParameterValue:
    if isinstance(parameter, FloatParameter):
        return float(rng.uniform(parameter.low, parameter.high))
    return parameter.choices[int(rng.integers(len(parameter.choices)))]
