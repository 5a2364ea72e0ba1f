"""The design space: named parameters, and the arm that their values build.

The paper's space (D = 4) is `paper_space()`: the base position O, one of three rotation axes for each
joint, one length for each link. Every number of it can be changed in a YAML file.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any, Self, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, field_serializer, field_validator, model_validator

from armwright.arm import Actuator, Arm, Joint, Link, Vector, uniform_link
from armwright.catalogue import ActuatorRecord, TorqueKind, resolved
from armwright.documents import check_document, parse_document, read_document
from armwright.exceptions import DesignError, SpaceError, did_you_mean
from armwright.masses import MassModel, MassPerMetre
from armwright.modules import DIRECTIONS, MODULES, Direction, JointType, Module, Mount, mounted, mounted_vector
from armwright.parameters import (
    GRID_DIGITS,
    GRID_ERROR,
    CategoricalParameter,
    Design,
    FloatParameter,
    Parameter,
    ParameterValue,
    Range,
)

Restriction = float | str | Range | tuple[str, ...]
Rows = NDArray[np.float64]

TOY_MASS = 0.1  # [kg] of a whole arm
LARGEST_ANGLE = 2 * math.pi  # [rad]
LEAST_TURN = math.radians(3.0)  # of a joint's range
LEAST_STROKE = 3e-3  # [m]
MOST_MODULES = 8
MOST_ACTUATORS = 50
LARGEST_LENGTH = 1000.0  # [m]; beyond it float32 kernels lose the millimetre
MOST_KEPT = 64  # spaces whose parameters are at hand
GRID_KINDS = ("origin", "link", "stroke", "limit")
BUILT_IN = resources.files("armwright") / "spaces"


@dataclass(frozen=True)
class _Column:
    """A parameter, and when it matters: of a module (counted from 1) that the arm has, and that is of one of `types`.

    None: always.
    """

    parameter: Parameter
    module: int | None = None
    types: frozenset[JointType] | None = None


class DesignSpace(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """A serial arm of `joints` joint modules: base position, joint types and link lengths are searched, and more.

    The first joint sits at the origin O; link j follows joint j along local +z; with all joints at 0 the links stand
    in one vertical line. In the paper's space that is all: 2 D + 3 parameters.

    joints: how many modules, or from how many to how many: then `n_joints` is a parameter, and those of modules that
        an arm does not have are not.
    joint_types: letters of `armwright.modules.MODULES`.
    joint_range: of turning joints. limit: with it, each turning joint's range is ±limit_j, a parameter in this range.
    stroke: sliding joints go from 0 to it; with a range each one's is a parameter. Their rails weigh as links do.
    travel: how far a sliding joint goes for each radian that its actuator turns.
    link_directions: where a link can leave to in the frame of its joint; with several, each link's is a parameter.
    mount: where the arm stands; with several, a parameter.
    tool: from the end of the last link to the tip, in that link's frame.
    actuators: what the joints may have, names of the catalogue or records; with several, each module's is a parameter.
        None: joints without mass.
    actuator_torque, safety_factor: which torque of theirs counts, divided by what.
    restrict: single parameters by name, fixed (`joint_1: Y`, `origin_z: 0.0`), of fewer choices (`joint_2: [P, R]`)
        or in a narrower range (`link_1: [0.1, 0.2]`).
    grid: steps of real parameters, single (`link_1: 0.01`) or all of a kind (`link: 0.005`).
    tie: parameters that always have the value of another (`link_3: link_2`).
    """

    name: str = Field(default="paper", min_length=1, max_length=100)  # for tables
    joints: int | tuple[int, int] = 4
    joint_types: tuple[JointType, ...] = Field(default=("R", "P", "Y"), min_length=1)
    joint_range: Range = (-2.4, 2.4)  # [rad]
    limit: Range | None = None  # [rad]
    stroke: float | Range = 0.3  # [m]
    travel: float = Field(default=0.01, gt=0.0, le=10.0)  # [m/rad]
    origin_x: Range = (-1.0, 1.0)  # of the base [m]
    origin_y: Range = (-1.0, 1.0)  # of the base [m]
    origin_z: Range = (-1.0, 1.0)  # of the base [m]
    mount: tuple[Mount, ...] = Field(default=("floor",), min_length=1)
    link: Range = (0.03, 0.30)  # the length of each [m]
    link_directions: tuple[Direction, ...] = Field(default=("+z",), min_length=1)
    link_radius: float = Field(default=0.015, gt=0.0, le=1.0)  # of all links [m]
    tool: Vector = (0.0, 0.0, 0.0)  # [m]
    mass: MassModel = MassPerMetre()  # of links, by their lengths
    actuators: tuple[ActuatorRecord, ...] = Field(default=(), max_length=MOST_ACTUATORS)
    actuator_torque: TorqueKind = "stall"
    safety_factor: float = Field(default=1.0, gt=0.0, le=100.0)
    restrict: tuple[tuple[str, Restriction], ...] = Field(default=(), max_length=100)
    grid: tuple[tuple[str, float], ...] = Field(default=(), max_length=100)
    tie: tuple[tuple[str, str], ...] = Field(default=(), max_length=100)

    @field_validator("restrict", "grid", "tie", mode="before")
    @classmethod
    def _pairs(cls, value: Any) -> Any:
        return tuple(cast("dict[str, Any]", value).items()) if isinstance(value, dict) else value

    @field_serializer("restrict", "grid", "tie")
    def _as_mapping(self, value: tuple[tuple[str, Any], ...]) -> dict[str, Any]:
        return dict(value)

    @field_validator("joint_types", "mount", "link_directions", mode="before")
    @classmethod
    def _as_list(cls, value: Any) -> Any:
        return (value,) if isinstance(value, str) else value

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
    def _check_all(self) -> Self:
        _check_modules(self)
        _check_ranges(self)
        _check_turns(self)
        for key in ("joint_types", "mount", "link_directions"):
            values: tuple[str, ...] = getattr(self, key)
            if len(set(values)) != len(values):
                raise ValueError(f"{key} names one twice: {', '.join(values)}")
        names = [record.name for record in self.actuators]
        if len(set(names)) != len(names):
            raise ValueError(f"actuators names one twice: {', '.join(names)}")
        for record in self.actuators:
            record.actuator(self.actuator_torque, self.safety_factor)
        _check_restrictions(self)
        _check_grid(self)
        _check_ties(self)
        return self

    @property
    def fewest_joints(self) -> int:
        """The modules that every arm has."""
        return self.joints if isinstance(self.joints, int) else self.joints[0]

    @property
    def most_joints(self) -> int:
        """The modules D of the longest arm."""
        return self.joints if isinstance(self.joints, int) else self.joints[1]

    @property
    def longest_reach(self) -> float:
        """The longest that an arm can be, all slides out [m]."""
        slides = any(MODULES[letter].slides for letter in self.joint_types)
        stroke = self.stroke if isinstance(self.stroke, (int, float)) else self.stroke[1]
        return self.most_joints * (self.link[1] + (stroke if slides else 0.0)) + math.hypot(*self.tool)

    @property
    def least_stroke(self) -> float:
        """Of sliding joints; where it is not searched, of them all [m]."""
        return self.stroke if isinstance(self.stroke, (int, float)) else self.stroke[0]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters in their fixed order: origin, joint types, link lengths; tied ones, too."""
        return _parameters(self)

    @property
    def is_settled(self) -> bool:
        """Whether every parameter always matters, and is free: as in the paper's space."""
        return not self.tie and all(column.module is None for column in _columns(self))

    def is_searched(self, name: str, params: Mapping[str, ParameterValue]) -> bool:
        """Whether a parameter is free and matters, where those before it have these values."""
        return name not in dict(self.tie) and self._matters(_column(self, name), params)

    def needs(self, name: str) -> tuple[int, str] | None:
        """What a parameter needs to matter: that an arm has so many modules, the last of one of these types.

        None of one that always matters.
        """
        column = _column(self, name)
        if column.module is None:
            return None
        return column.module, "".join(self.joint_types if column.types is None else sorted(column.types))

    def _matters(self, column: _Column, params: Mapping[str, ParameterValue]) -> bool:
        if column.module is None:
            return True
        if column.module > int(params.get("n_joints", self.most_joints)):
            return False
        return column.types is None or params.get(f"joint_{column.module}") in column.types

    def design(self, params: Mapping[str, Any]) -> Design:
        """The design with these values, in the space's order; DesignError where they are not in the space.

        Tied values may be missing; those of modules that the arm does not have are left out.
        """
        names = [parameter.name for parameter in self.parameters]
        for name in params:
            if name not in names:
                raise DesignError(
                    f'unknown parameter "{name}". Parameters: {", ".join(names)}.{did_you_mean(name, names)}'
                )
        ties = dict(self.tie)
        given = {**{name: params[of] for name, of in ties.items() if of in params}, **params}
        checked: dict[str, ParameterValue] = {}
        missing: list[str] = []
        for column in _columns(self):
            name = column.parameter.name
            if not self._matters(column, checked):
                continue
            if name in given:
                checked[name] = column.parameter.check(given[name])
            else:
                missing.append(name)
        if missing:
            raise DesignError(f"missing: {', '.join(missing)}")
        for name, of in ties.items():
            if name in checked and of in checked and checked[name] != checked[of]:
                raise DesignError(f"{name} = {checked[name]} is tied to {of} = {checked[of]}")
        return Design(checked)

    def searched(self, design: Design) -> dict[str, ParameterValue]:
        """The values of a design that are free."""
        return {name: value for name, value in design.params.items() if name not in dict(self.tie)}

    def completed(self, params: Mapping[str, ParameterValue]) -> Design:
        """The design of its free values."""
        ties = {name: params[of] for name, of in self.tie if of in params}
        given = {**params, **ties}
        return Design({p.name: given[p.name] for p in self.parameters if p.name in given})

    def clipped(
        self, origin: Iterable[float], joints: str, links: Iterable[float], like: Design | None = None
    ) -> Design:
        """The design of these numbers, each moved into its range.

        like: where all other values come from, as far as it has them; else the usual ones: the strongest actuators at
        the base, the first choices, the middles of ranges.
        """
        known = {f"motor_{j}": name for j, name in enumerate(self.usual_motors, start=1)}
        known |= {} if like is None else dict(like.params)
        known |= {f"origin_{axis}": value for axis, value in zip("xyz", origin, strict=True)}
        known |= {f"joint_{j}": kind for j, kind in enumerate(joints, start=1)}
        known |= {f"link_{j}": length for j, length in enumerate(links, start=1)}
        known["n_joints"] = str(min(max(len(joints), self.fewest_joints), self.most_joints))
        values = {p.name: _clip(p, known.get(p.name, _usual(p))) for p in self.parameters}
        return self.designs(_as_row(self.parameters, values))[0]

    def matrix(self, designs: Sequence[Design]) -> Rows:
        """(N, P) designs as rows, for work on many at once: a category is its place among the choices.

        What does not matter has its usual value.
        """
        columns = [_as_column(parameter, designs) for parameter in self.parameters]
        return np.array(columns, dtype=np.float64).T.reshape(len(designs), len(self.parameters))

    def designs(self, matrix: Rows) -> list[Design]:
        """The designs that the rows of a matrix are."""
        columns = list(enumerate(_columns(self)))
        designs: list[Design] = []
        for row in self.settled(matrix).tolist():
            params: dict[str, ParameterValue] = {}
            for i, column in columns:
                if self._matters(column, params):
                    params[column.parameter.name] = _entry(column.parameter, row[i])
            designs.append(Design(params))
        return designs

    def settled(self, matrix: Rows) -> Rows:
        """(N, P) the rows as `matrix` gives them: tied values equal, the usual value for all that does not matter."""
        if self.is_settled:
            return matrix
        rows = matrix.copy()
        at = {parameter.name: i for i, parameter in enumerate(self.parameters)}
        for name, of in self.tie:
            rows[:, at[name]] = rows[:, at[of]]
        for i, column in enumerate(_columns(self)):
            if column.module is not None:
                rows[~self.mattering(rows, column.module, column.types), i] = _as_number(column.parameter, None)
        return rows

    def mattering(self, matrix: Rows, module: int, types: frozenset[JointType] | None = None) -> NDArray[np.bool_]:
        """(N,) which designs have this module (counted from 1), of one of these types."""
        at = {parameter.name: i for i, parameter in enumerate(self.parameters)}
        there = np.ones(len(matrix), dtype=bool)
        if "n_joints" in at:
            there &= module <= matrix[:, at["n_joints"]] + self.fewest_joints
        if types is not None:
            letters = cast("CategoricalParameter", self.parameters[at[f"joint_{module}"]]).choices
            there &= np.array([letter in types for letter in letters])[matrix[:, at[f"joint_{module}"]].astype(np.intp)]
        return there

    def sample(self, n: int, seed: int) -> list[Design]:
        """`n` designs, uniform in every parameter."""
        rng = np.random.default_rng(seed)
        rows = [[_draw(p, rng) for p in self.parameters] for _ in range(n)]
        return self.designs(np.array(rows, dtype=np.float64).reshape(n, len(self.parameters)))

    @property
    def usual_motors(self) -> tuple[str, ...]:
        """One for each module, where there is a choice: from the strongest at the base to the weakest at the tip."""
        if len(self.actuators) < 2:
            return ()
        ranked = sorted(self.arm_actuators, key=lambda actuator: -actuator.effort)
        return tuple(ranked[len(ranked) * j // self.most_joints].name for j in range(self.most_joints))

    @property
    def arm_actuators(self) -> tuple[Actuator, ...]:
        """The actuators as the arm knows them, in the order of the list."""
        return _arm_actuators(self)

    @property
    def is_toy(self) -> bool:
        """Whether even the heaviest arm weighs next to nothing, as the paper's do."""
        heaviest = max((record.mass for record in self.actuators), default=0.0)
        return self.most_joints * (self.mass.mass(self.link[1]) + heaviest) < TOY_MASS

    @property
    def mass_note(self) -> str:
        """How heavy the links are taken to be, in one sentence; it belongs wherever torques are shown."""
        toy = "; a toy: real arms weigh kilograms, so read its N m as a comparison only" if self.is_toy else ""
        chosen = ", ".join(record.name for record in self.actuators)
        motors = f"; actuators: {chosen}" if self.actuators else ""
        return f"links: {self.mass.words()}{toy}{motors}"

    def modules(self, design: Design) -> tuple[Module, ...]:
        """The joint modules of a design, in order."""
        return tuple(MODULES[letter] for letter in cast("list[JointType]", list(design.joints)))

    def joint_modules(self, design: Design) -> tuple[int, ...]:
        """For each joint of a design's arm, the place of its module."""
        return tuple(i for i, module in enumerate(self.modules(design)) for _ in module.joints)

    def arm(self, design: Design) -> Arm:
        """The physical chain that a design builds."""
        if not self.fewest_joints <= len(design.joints) == len(design.links) <= self.most_joints:
            self.design(design.params)  # says what is wrong
        mount = cast("Mount", design.mount or self.mount[0])
        modules = self.modules(design)
        carried = [self._carried(design, number) for number in range(1, len(modules) + 1)]  # at the place of each
        joints = [
            self._joint(design, number, place, mount)
            for number, module in enumerate(modules, start=1)
            for place in range(len(module.joints))
        ]
        links = [
            link
            for number, (module, end) in enumerate(zip(modules, [*carried[1:], 0.0], strict=True), start=1)
            for link in [uniform_link((0.0, 0.0, 0.0), 0.0, self.link_radius)] * (len(module.joints) - 1)
            + [
                replace(
                    self._link(design, number, mount), end_mass=end, end_shift=self._shift(design, number + 1, mount)
                )
            ]
        ]
        return Arm(
            base=design.origin,
            joints=tuple(joints),
            links=tuple(links),
            tool=mounted_vector(self.tool, mount),
            tool_axis=mounted_vector(DIRECTIONS["+z"], mount),
            tool_side=mounted_vector(DIRECTIONS["+x"], mount),
            base_mass=carried[0],
        )

    def stroke_of(self, design: Design, number: int) -> float:
        """How far the sliding joint of module `number` (counted from 1) goes [m]."""
        return float(design.params.get(f"stroke_{number}", self.least_stroke))

    def _joint(self, design: Design, number: int, place: int, mount: Mount) -> Joint:
        """One of a module's joints."""
        module = MODULES[cast("JointType", design.params[f"joint_{number}"])]
        kind, local = module.joints[place]
        axis, sign = mounted(local, mount)
        if kind == "fixed":
            return Joint(kind, axis)
        lower, upper = self.joint_range
        if kind == "prismatic":
            lower, upper = 0.0, self.stroke_of(design, number)
        elif self.limit is not None:
            upper = float(design.params.get(f"limit_{number}", self.limit[0]))
            lower = -upper
        if sign < 0.0:
            lower, upper = 0.0 - upper, 0.0 - lower  # no -0.0
        return Joint(kind, axis, lower, upper, self._motor(design, number), self.travel if kind == "prismatic" else 1.0)

    def _link(self, design: Design, number: int, mount: Mount) -> Link:
        length = float(design.params[f"link_{number}"])
        direction = cast("Direction", design.params.get(f"direction_{number}", self.link_directions[0]))
        x, y, z = mounted_vector(DIRECTIONS[direction], mount)
        return uniform_link((x * length, y * length, z * length), self.mass.mass(length), self.link_radius)

    def _motor(self, design: Design, number: int) -> Actuator | None:
        """Of each joint of a module."""
        if not self.actuators:
            return None
        by_name = {actuator.name: actuator for actuator in self.arm_actuators}
        return by_name[str(design.params.get(f"motor_{number}", self.arm_actuators[0].name))]

    def _carried(self, design: Design, number: int) -> float:
        """What stands where a module begins: its actuators, and the rail that it slides on [kg]."""
        module = MODULES[cast("JointType", design.params[f"joint_{number}"])]
        motor = self._motor(design, number) if module.moves else None
        return self._rail(design, number) + len(module.joints) * (0.0 if motor is None else motor.mass)

    def _rail(self, design: Design, number: int) -> float:
        """[kg]"""
        slides = MODULES[cast("JointType", design.params[f"joint_{number}"])].slides
        return self.mass.mass(self.stroke_of(design, number)) if slides else 0.0

    def _shift(self, design: Design, number: int, mount: Mount) -> Vector:
        """From where a module begins to the centre of what stands there: half way along its rail, for the rail [m]."""
        if f"joint_{number}" not in design.params or not (rail := self._rail(design, number)):
            return (0.0, 0.0, 0.0)
        ((_, axis),) = MODULES[cast("JointType", design.params[f"joint_{number}"])].joints
        way = rail / self._carried(design, number) * (self.stroke_of(design, number) / 2)
        x, y, z = mounted_vector(DIRECTIONS[cast("Direction", f"+{axis}")], mount)
        return (way * x, way * y, way * z)


def paper_space(joints: int = 4) -> DesignSpace:
    """The design space of the paper, with `joints` joints (4 in its experiments).

    Examples:
        >>> import armwright as aw
        >>> space = aw.paper_space(joints=2)
        >>> [parameter.name for parameter in space.parameters]
        ['origin_x', 'origin_y', 'origin_z', 'joint_1', 'joint_2', 'link_1', 'link_2']
        >>> params = {"origin_x": 0, "origin_y": 0, "origin_z": 0.1, "joint_1": "Y", "joint_2": "P", "link_1": 0.2}
        >>> space.design(params | {"link_2": 0.3}).joints
        'YP'
        >>> space.design(params | {"link_2": 0.4})
        Traceback (most recent call last):
        armwright.exceptions.DesignError: link_2 = 0.4 m is outside 0.03 <= link_2 <= 0.3 m
    """
    content = {"name": "paper" if joints == 4 else f"paper-{joints}", "joints": joints}
    return check_document(content, DesignSpace, SpaceError, "paper_space")


def builtin_spaces() -> list[str]:
    """The names of the spaces that come with armwright, the paper's first."""
    return ["paper", *sorted(f.name.removesuffix(".yaml") for f in BUILT_IN.iterdir() if f.name.endswith(".yaml"))]


def load_space(name_or_path: str | Path) -> DesignSpace:
    """A built-in space by its name, or that of a YAML file; keys that it leaves out are as in the paper.

    Examples:
        >>> import armwright as aw
        >>> aw.load_space("slideopt").joint_types
        ('R', 'P', 'Y', 'O', 'S', 'F')
    """
    name = str(name_or_path)
    if name == "paper":
        return paper_space()
    if name in builtin_spaces():
        file = BUILT_IN / f"{name}.yaml"
        return parse_document(file.read_text(encoding="utf-8"), DesignSpace, SpaceError, file.name)
    path = Path(name_or_path)
    if not path.exists() and path.suffix not in (".yaml", ".yml"):
        known = builtin_spaces()
        raise SpaceError(
            f'unknown space "{name}".{did_you_mean(name, known)} Built-in ones: {", ".join(known)}; YAML files are '
            "spaces, too"
        )
    return read_document(path, DesignSpace, SpaceError)


def _column(space: DesignSpace, name: str) -> _Column:
    return _by_name(space)[name]


@lru_cache(maxsize=MOST_KEPT)
def _by_name(space: DesignSpace) -> dict[str, _Column]:
    return {column.parameter.name: column for column in _columns(space)}


@lru_cache(maxsize=MOST_KEPT)
def _parameters(space: DesignSpace) -> tuple[Parameter, ...]:
    return tuple(column.parameter for column in _columns(space))


@lru_cache(maxsize=MOST_KEPT)
def _columns(space: DesignSpace) -> tuple[_Column, ...]:
    # Not a cached property: a copy of the space with other ranges would take its value along.
    steps, to = dict(space.grid), dict(space.restrict)
    found: list[_Column] = []
    for column in _free_columns(space):
        parameter = column.parameter
        if parameter.name in to:
            parameter = _restricted(parameter, to[parameter.name])
        step = steps.get(parameter.name, steps.get(parameter.name.partition("_")[0], 0.0))
        if step > 0.0 and isinstance(parameter, FloatParameter):
            parameter = _stepped(parameter, step)
        found.append(replace(column, parameter=parameter))
    return tuple(found)


@lru_cache(maxsize=MOST_KEPT)
def _free_columns(space: DesignSpace) -> tuple[_Column, ...]:
    """Without restrictions and grids, in their fixed order."""
    ranges: dict[str, Range] = {"x": space.origin_x, "y": space.origin_y, "z": space.origin_z}
    found = [_Column(FloatParameter(f"origin_{axis}", *limits, "m")) for axis, limits in ranges.items()]
    if len(space.mount) > 1:
        found.append(_Column(CategoricalParameter("mount", space.mount)))
    few, most = space.fewest_joints, space.most_joints
    if few < most:
        found.append(_Column(CategoricalParameter("n_joints", tuple(str(n) for n in range(few, most + 1)))))

    def of_modules(kind: str, what: tuple[str, ...] | Range, unit: str = "", types: str = "") -> list[_Column]:
        """One for each module; types: letters of those that it matters for, all where empty."""
        letters = frozenset[JointType](letter for letter in space.joint_types if letter in types) if types else None
        return [
            _Column(
                FloatParameter(f"{kind}_{j}", float(what[0]), float(what[1]), unit)
                if unit
                else CategoricalParameter(f"{kind}_{j}", cast("tuple[str, ...]", what)),
                None if j <= few and (letters is None or len(letters) == len(space.joint_types)) else j,
                letters,
            )
            for j in range(1, most + 1)
            if letters is None or letters
        ]

    turning = "".join(letter for letter, module in MODULES.items() if module.turns)
    sliding = "".join(letter for letter, module in MODULES.items() if module.slides)
    found += of_modules("joint", space.joint_types)
    found += of_modules("link", space.link, "m")
    if len(space.link_directions) > 1:
        found += of_modules("direction", space.link_directions)
    if len(space.actuators) > 1:
        found += of_modules("motor", tuple(record.name for record in space.actuators), "", turning + sliding)
    if not isinstance(space.stroke, (int, float)):
        found += of_modules("stroke", space.stroke, "m", sliding)
    if space.limit is not None:
        found += of_modules("limit", space.limit, "rad", turning)
    return tuple(found)


def _check_modules(space: DesignSpace) -> None:
    few, most = space.fewest_joints, space.most_joints
    if not 1 <= few <= most <= MOST_MODULES:
        raise ValueError(f"joints = {space.joints}: from 1 to {MOST_MODULES}, one number or the fewest and the most")
    if all(not MODULES[letter].moves for letter in space.joint_types):
        raise ValueError(f"joint_types = {', '.join(space.joint_types)}: an arm must have joints that move")


def _check_ranges(space: DesignSpace) -> None:
    ranges = {"origin_x": "m", "origin_y": "m", "origin_z": "m", "link": "m", "joint_range": "rad"}
    ranges |= {} if isinstance(space.stroke, (int, float)) else {"stroke": "m"}
    ranges |= {} if space.limit is None else {"limit": "rad"}
    for name, unit in ranges.items():
        low, high = getattr(space, name)
        if low > high:
            raise ValueError(f"{name} = [{low:g}, {high:g}] {unit} is upside down: write the smaller number first")
        if max(abs(low), abs(high)) > LARGEST_LENGTH:
            raise ValueError(f"{name} = [{low:g}, {high:g}] {unit} goes beyond ±{LARGEST_LENGTH:g}")
    if space.link[0] <= 0.0:
        raise ValueError(f"link = [{space.link[0]:g}, {space.link[1]:g}] m: a link must be longer than 0 m")
    shortest = space.least_stroke
    if not LEAST_STROKE <= shortest <= LARGEST_LENGTH:
        raise ValueError(f"stroke = {shortest:g} m is outside {LEAST_STROKE:g} <= stroke <= {LARGEST_LENGTH:g} m")
    if max(abs(value) for value in space.tool) > LARGEST_LENGTH:
        raise ValueError(f"tool = {list(space.tool)} m goes beyond ±{LARGEST_LENGTH:g}")


def _check_turns(space: DesignSpace) -> None:
    low, high = space.joint_range
    if high - low < LEAST_TURN:
        raise ValueError(f"joint_range = [{low:g}, {high:g}] rad is narrower than 3 degrees; a joint must move")
    if max(-low, high) > LARGEST_ANGLE:
        raise ValueError(f"joint_range = [{low:g}, {high:g}] rad goes beyond ±2π, a full turn each way")
    if not low <= 0.0 <= high:
        raise ValueError(f"joint_range = [{low:g}, {high:g}] rad must hold 0, where the inverse kinematics starts")
    if space.limit is not None and not LEAST_TURN / 2 <= space.limit[0] <= space.limit[1] <= LARGEST_ANGLE:
        raise ValueError(f"limit = {list(space.limit)} rad: from 1.5 degrees to a full turn, 2π")


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


def _stepped(parameter: FloatParameter, step: float) -> FloatParameter:
    """The parameter on a grid; its highest value is the grid's last."""
    steps = math.floor((parameter.high - parameter.low) / step + GRID_ERROR)
    return replace(parameter, high=round(parameter.low + steps * step, GRID_DIGITS), step=step)


def _check_restrictions(space: DesignSpace) -> None:
    """ValueError where one is of no parameter, or not a part of it."""
    free = {column.parameter.name: column.parameter for column in _free_columns(space)}
    for name, to in space.restrict:
        if name not in free:
            raise ValueError(f'restrict: there is no parameter "{name}".{did_you_mean(name, free)}')
        _restricted(free[name], to)


def _check_grid(space: DesignSpace) -> None:
    """ValueError where one is of no real parameter."""
    reals = [c.parameter.name for c in _free_columns(space) if isinstance(c.parameter, FloatParameter)]
    known = [*GRID_KINDS, *reals]
    for name, step in space.grid:
        if name not in known:
            raise ValueError(f'grid: there is no real parameter "{name}".{did_you_mean(name, known)}')
        if not GRID_ERROR < step <= LARGEST_LENGTH:
            raise ValueError(f"grid: {name} = {step:g}: a step above 0 is needed")


def _check_ties(space: DesignSpace) -> None:
    """ValueError where one is of no parameter, goes round, or is to one that may not be there."""
    columns, ties = {column.parameter.name: column for column in _columns(space)}, dict(space.tie)
    for name, of in ties.items():
        for word in (name, of):
            if word not in columns:
                raise ValueError(f'tie: there is no parameter "{word}".{did_you_mean(word, columns)}')
        if of in ties:
            raise ValueError(f"tie: {name} is tied to {of}, which is tied itself; tie both to one that is free")
        tied, free = columns[name], columns[of]
        if tied.parameter != replace(free.parameter, name=name):
            raise ValueError(f"tie: {name} and {of} have different ranges or choices")
        if free.types is not None or (free.module or 0) > (tied.module or 0):
            raise ValueError(f"tie: {of} may not be there where {name} is; tie it the other way round")


@lru_cache(maxsize=MOST_KEPT)
def _arm_actuators(space: DesignSpace) -> tuple[Actuator, ...]:
    return tuple(record.actuator(space.actuator_torque, space.safety_factor) for record in space.actuators)


def _usual(parameter: Parameter) -> ParameterValue:
    """The middle of a range, the first of the choices."""
    if isinstance(parameter, CategoricalParameter):
        return parameter.choices[0]
    return parameter.settled((parameter.low + parameter.high) / 2)


def _clip(parameter: Parameter, value: Any) -> ParameterValue:
    if isinstance(parameter, FloatParameter):
        return parameter.settled(value)
    return value if value in parameter.choices else parameter.choices[0]


def _as_number(parameter: Parameter, value: ParameterValue | None) -> float:
    """A value as a matrix has it; the usual one for None."""
    value = _usual(parameter) if value is None else value
    return value if isinstance(parameter, FloatParameter) else parameter.choices.index(value)  # pyright: ignore[reportReturnType, reportArgumentType]


def _as_row(parameters: Sequence[Parameter], values: Mapping[str, ParameterValue]) -> Rows:
    return np.array([[_as_number(parameter, values[parameter.name]) for parameter in parameters]], dtype=np.float64)


def _as_column(parameter: Parameter, designs: Sequence[Design]) -> list[float]:
    return [_as_number(parameter, design.params.get(parameter.name)) for design in designs]


def _entry(parameter: Parameter, value: float) -> ParameterValue:
    return value if isinstance(parameter, FloatParameter) else parameter.choices[int(value)]


def _draw(parameter: Parameter, rng: np.random.Generator) -> float:
    if isinstance(parameter, FloatParameter):
        return parameter.settled(float(rng.uniform(parameter.low, parameter.high)))
    return float(rng.integers(len(parameter.choices)))
