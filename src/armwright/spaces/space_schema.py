"""The keys of a space file: what may be varied, and within which ranges."""

import math
from functools import lru_cache
from typing import Any, Self, cast

import numpy as np
from pydantic import BaseModel, Field, field_serializer, field_validator, model_validator

from armwright.robot.actuators import DIMENSIONS, ActuatorRecord, resolve_actuator, value_of
from armwright.robot.arm import Actuator
from armwright.spaces.column import ColumnKeys
from armwright.spaces.custom_parameters import MAX_CUSTOM, CustomParameter, check_names, read_custom
from armwright.spaces.joint_modules import MODULES, Direction, JointType, Mount
from armwright.spaces.link_mass import Length, MassModel, MassPerMetre
from armwright.spaces.link_section import LinkSection
from armwright.spaces.parameters import Design, Range

Restriction = float | str | Range | tuple[str, ...]

MAX_MODULES = 8
MAX_ACTUATORS = 50
MAX_LENGTH = 1000.0  # [m]; beyond it float32 kernels lose the millimetre
MAX_ANGLE = 2 * math.pi  # [rad]
MIN_JOINT_RANGE = math.radians(3.0)  # [rad]
MIN_STROKE = 3e-3  # [m]


class SpaceSchema(
    BaseModel,
    frozen=True,
    extra="forbid",
    allow_inf_nan=False,
    use_attribute_docstrings=True,
    validate_by_name=True,
    validate_by_alias=True,
    serialize_by_alias=True,
):
    """The keys of a space file, with the values of the paper as defaults."""

    name: str = Field(default="paper", min_length=1, max_length=100)
    """Label for tables."""
    joints: int | tuple[int, int] = 4
    """Number of joint modules, or the smallest and the largest number. A pair adds the parameter n_joints."""
    joint_types: tuple[JointType, ...] = Field(default=("R", "P", "Y"), min_length=1)
    """Joint modules to choose from, by letter."""
    joint_range: Range = (-2.4, 2.4)
    """Range of every revolute joint [rad]."""
    limit: Range | None = None
    """Range of the parameters limit_j [rad]: revolute joint j then moves within ±limit_j."""
    stroke: float | Range = 0.3
    """Stroke of every prismatic joint [m]; a range adds the parameters stroke_j. A rail weighs as much as a link."""
    travel: float = Field(default=0.01, gt=0.0, le=10.0)
    """Travel of a prismatic joint per radian of its actuator [m/rad]."""
    origin_x: Range = (-1.0, 1.0)
    """Range of the base position along x [m]."""
    origin_y: Range = (-1.0, 1.0)
    """Range of the base position along y [m]."""
    origin_z: Range = (-1.0, 1.0)
    """Range of the base position along z [m]."""
    mount: tuple[Mount, ...] = Field(default=("floor",), min_length=1)
    """Surface that the arm is mounted on; several choices add the parameter mount."""
    column: ColumnKeys | None = None
    """Tube on which a floor-mounted base stands; {} for the default one."""
    base_on: str = Field(default="", max_length=40)
    """Obstacle of the task on whose top face a floor-mounted base stands."""
    link: Range = (0.03, 0.30)
    """Range of the length of each link [m]."""
    link_directions: tuple[Direction, ...] = Field(default=("+z",), min_length=1)
    """Direction of a link in the frame of its joint; several choices add the parameters direction_j."""
    link_section: LinkSection = LinkSection()
    """Tubes and material of the links; several tubes add the parameters tube_j, or the parameter tube."""
    mass: MassModel | None = None
    """Mass of the links without a material; 0.0121 kg per metre if not stated. A material implies the mass."""
    actuators: tuple[ActuatorRecord, ...] = Field(default=(), max_length=MAX_ACTUATORS)
    """Names from the catalogue, or records; several add the parameters motor_j. Empty: joints without mass."""
    safety_factor: float = Field(default=1.5, gt=0.0, le=100.0)
    """Factor of the torque that the actuators have to deliver."""
    motor_bodies: bool = True
    """Whether the actuators, if there are any, are solid bodies, which count in collisions."""
    bracket_mass: float = Field(default=0.0, ge=0.0, le=1e4)
    """Mass of brackets and screws at each joint that moves, where its actuator is [kg]."""
    restrict: tuple[tuple[str, Restriction], ...] = Field(default=(), max_length=100)
    """Single parameters, fixed (joint_1: Y) or narrowed (joint_2: [P, R], link_1: [0.1, 0.2])."""
    grid: tuple[tuple[str, float], ...] = Field(default=(), max_length=100)
    """Step size of a real parameter (link_1: 0.01) or of all of a kind (link: 0.005)."""
    tie: tuple[tuple[str, str], ...] = Field(default=(), max_length=100)
    """Parameters that always equal another one (link_3: link_2)."""
    custom: tuple[tuple[str, CustomParameter], ...] = Field(default=(), max_length=MAX_CUSTOM, alias="parameters")
    """Custom parameters by name, which do not change the arm: an evaluator reads them."""

    @field_validator("custom", mode="before")
    @classmethod
    def _read_custom(cls, value: Any) -> Any:
        return read_custom(value)

    @field_serializer("custom")
    def _custom_to_mapping(self, value: tuple[tuple[str, CustomParameter], ...]) -> dict[str, Any]:
        return {name: entry.model_dump(mode="json", exclude_defaults=True) for name, entry in value}

    @field_validator("restrict", "grid", "tie", mode="before")
    @classmethod
    def _mapping_to_pairs(cls, value: Any) -> Any:
        return tuple(cast("dict[str, Any]", value).items()) if isinstance(value, dict) else value

    @field_serializer("restrict", "grid", "tie")
    def _pairs_to_mapping(self, value: tuple[tuple[str, Any], ...]) -> dict[str, Any]:
        return dict(value)

    @field_validator("joint_types", "mount", "link_directions", mode="before")
    @classmethod
    def _one_to_list(cls, value: Any) -> Any:
        return (value,) if isinstance(value, str) else value

    @field_validator("actuators", mode="before")
    @classmethod
    def _look_up_actuators(cls, value: Any) -> Any:
        if not isinstance(value, (list, tuple)):
            raise ValueError("expected a list of names, or of records with name, mass and stall_torque")
        return [resolve_actuator(entry) for entry in cast("list[Any]", value)]

    @field_validator("mass", mode="before")
    @classmethod
    def _require_kind(cls, value: Any) -> Any:
        if isinstance(value, dict) and "kind" not in cast("dict[str, Any]", value):
            raise ValueError("kind is missing: expected per_metre or per_link")
        return cast("Any", value)

    @model_validator(mode="after")
    def _check_values(self) -> Self:
        _check_modules(self)
        _check_ranges(self)
        _check_joint_ranges(self)
        _check_duplicates(self)
        _check_motor_bodies(self)
        _check_mass(self)
        _check_support(self)
        check_names(name for name, _ in self.custom)
        return self

    @property
    def min_joints(self) -> int:
        """The number of joint modules that every arm has."""
        return self.joints if isinstance(self.joints, int) else self.joints[0]

    @property
    def max_joints(self) -> int:
        """The number D of joint modules of the longest arm."""
        return self.joints if isinstance(self.joints, int) else self.joints[1]

    @property
    def min_stroke(self) -> float:
        """The stroke of prismatic joints, the shortest if it is a parameter [m]."""
        return self.stroke if isinstance(self.stroke, (int, float)) else self.stroke[0]

    @property
    def has_motor_bodies(self) -> bool:
        """Whether there are actuators, and their bodies count."""
        return bool(self.actuators) and self.motor_bodies

    @property
    def has_bodies(self) -> bool:
        """Whether motors or a column are solid bodies, which may not collide."""
        return self.has_motor_bodies or self.column is not None

    @property
    def arm_actuators(self) -> tuple[Actuator, ...]:
        """The actuators as an arm has them, in the order of the file."""
        return _arm_actuators(self)

    def link_mass(self, length: Length, tube: Any = 0) -> Length:
        """Return the mass of links or rails [kg].

        Args:
            length: Their lengths [m].
            tube: The indices of their tubes.
        """
        if self.link_section.material is None:
            return (self.mass or MassPerMetre()).mass(length)
        return self.tube_values("mass_per_metre")[tube] * length

    @property
    def tube_names(self) -> tuple[str, ...]:
        """The names of the tubes, in the order of the file: `30x2`."""
        return tuple(tube.name for tube in self.link_section.options)

    @property
    def heaviest_link(self) -> float:
        """The mass of the longest link of the heaviest tube [kg]."""
        return max(float(self.link_mass(self.link[1], tube)) for tube in range(len(self.link_section.tubes)))

    @property
    def link_description(self) -> str:
        """The mass of the links in a few words."""
        if self.link_section.material is not None:
            return self.link_section.description
        return (self.mass or MassPerMetre()).description

    def tube_values(self, name: str) -> Any:
        """Return a (K,) value of `LinkTube` for each of the K tubes; NaN where it is None."""
        return _tube_values(self.link_section, name)

    def mount_of(self, design: Design) -> Mount:
        """Return the surface that the arm of a design is mounted on."""
        return cast("Mount", design.mount or self.mount[0])

    @property
    def max_reach(self) -> float:
        """The length of the longest possible arm without a tool, with all slides extended [m]."""
        has_slides = any(MODULES[letter].is_prismatic for letter in self.joint_types)
        stroke = self.stroke if isinstance(self.stroke, (int, float)) else self.stroke[1]
        return self.max_joints * (self.link[1] + (stroke if has_slides else 0.0))


@lru_cache(maxsize=64)
def _arm_actuators(space: SpaceSchema) -> tuple[Actuator, ...]:
    return tuple(record.actuator() for record in space.actuators)


@lru_cache(maxsize=512)
def _tube_values(section: LinkSection, name: str) -> Any:
    values = [getattr(tube, name) for tube in section.options]
    return np.array([math.nan if value is None else value for value in values])


def _check_mass(space: SpaceSchema) -> None:
    if space.mass is not None and space.link_section.material is not None:
        raise ValueError(
            "mass: expected no value beside link_section.material, which implies the mass of the links; remove one of "
            "the two"
        )


def _check_support(space: SpaceSchema) -> None:
    keys = {"column": space.column is not None, "base_on": bool(space.base_on)}
    for key, stated in keys.items():
        if stated and space.mount != ("floor",):
            raise ValueError(f"{key}: expected mount: floor, got {', '.join(space.mount)}; remove {key} or the mounts")


def _check_modules(space: SpaceSchema) -> None:
    low, high = space.min_joints, space.max_joints
    if not 1 <= low <= high <= MAX_MODULES:
        raise ValueError(
            f"joints = {space.joints}: expected a number from 1 to {MAX_MODULES}, or the smallest and the largest one"
        )
    if not any(MODULES[letter].is_actuated for letter in space.joint_types):
        raise ValueError(f"joint_types = {', '.join(space.joint_types)}: at least one type must move")


def _check_ranges(space: SpaceSchema) -> None:
    units = {"origin_x": "m", "origin_y": "m", "origin_z": "m", "link": "m", "joint_range": "rad"}
    units |= {} if isinstance(space.stroke, (int, float)) else {"stroke": "m"}
    units |= {} if space.limit is None else {"limit": "rad"}
    for name, unit in units.items():
        low, high = getattr(space, name)
        if low > high:
            raise ValueError(f"{name} = [{low:g}, {high:g}] {unit} is reversed: give the smaller number first")
        if max(abs(low), abs(high)) > MAX_LENGTH:
            raise ValueError(f"{name} = [{low:g}, {high:g}] {unit} exceeds ±{MAX_LENGTH:g}")
    if space.link[0] <= 0.0:
        raise ValueError(f"link = [{space.link[0]:g}, {space.link[1]:g}] m: a link must be longer than 0 m")
    if not MIN_STROKE <= space.min_stroke <= MAX_LENGTH:
        raise ValueError(f"stroke = {space.min_stroke:g} m is outside {MIN_STROKE:g} <= stroke <= {MAX_LENGTH:g} m")


def _check_joint_ranges(space: SpaceSchema) -> None:
    low, high = space.joint_range
    if high - low < MIN_JOINT_RANGE:
        raise ValueError(f"joint_range = [{low:g}, {high:g}] rad is narrower than 3 degrees")
    if max(-low, high) > MAX_ANGLE:
        raise ValueError(
            f"joint_range = [{low:g}, {high:g}] rad exceeds ±2π; angles are in radians: write "
            f"{math.radians(high):.4f} for {high:g}°"
        )
    if not low <= 0.0 <= high:
        raise ValueError(f"joint_range = [{low:g}, {high:g}] rad must contain 0, where the inverse kinematics starts")
    if space.limit is not None and not MIN_JOINT_RANGE / 2 <= space.limit[0] <= space.limit[1] <= MAX_ANGLE:
        raise ValueError(f"limit = {list(space.limit)} rad: expected values from 1.5 degrees to 2π")


def _check_duplicates(space: SpaceSchema) -> None:
    choices: dict[str, tuple[str, ...]] = {
        "joint_types": space.joint_types,
        "mount": space.mount,
        "link_directions": space.link_directions,
        "actuators": tuple(record.name for record in space.actuators),
    }
    for key, names in choices.items():
        if len(set(names)) != len(names):
            raise ValueError(f"{key} has duplicates: {', '.join(names)}")


def _check_motor_bodies(space: SpaceSchema) -> None:
    if not space.has_motor_bodies:
        return
    shared = [letter for letter in space.joint_types if len(MODULES[letter].joints) > 1]
    if shared:
        raise ValueError(
            f"joint_types: expected modules with one actuator each, got {', '.join(shared)} with two at one place, "
            "whose bodies overlap; try R and P, or motor_bodies: false"
        )
    for record in space.actuators:
        missing = [name for name in DIMENSIONS if value_of(record, name) is None]
        if missing:
            raise ValueError(
                f"actuators: expected the dimensions [m] of every body, got none for {record.name}: "
                f"{', '.join(missing)}; add them, leave the actuator out, or try motor_bodies: false"
            )
