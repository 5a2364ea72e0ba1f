"""The keys of a space file: what may be varied, and within which ranges."""

import math
from functools import lru_cache
from typing import Annotated, Any, Self, cast

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, model_validator

from armwright.robot.actuators import DIMENSIONS, ActuatorRecord, resolve_actuator, value_of
from armwright.robot.arm import Actuator
from armwright.spaces.column import ColumnKeys
from armwright.spaces.custom_parameters import MAX_CUSTOM, Custom, check_names
from armwright.spaces.field_types import Choices, Ordered, Pairs
from armwright.spaces.joint_modules import MODULES, Direction, JointType, Mount
from armwright.spaces.link_mass import Length, MassModel, MassPerMetre, link_mass
from armwright.spaces.link_section import LinkSection
from armwright.spaces.parameters import Design, Range

Restriction = float | str | Range | tuple[str, ...]

MAX_MODULES = 8
MAX_ACTUATORS = 50
MAX_LENGTH = 1000.0  # [m]; beyond it float32 kernels lose the millimetre
MAX_ANGLE = 2 * math.pi  # [rad]
MIN_JOINT_RANGE = math.radians(3.0)  # [rad]
MIN_STROKE = 3e-3  # [m]

Count = Annotated[int, Field(ge=1, le=MAX_MODULES)]
Coordinate = Annotated[float, Field(ge=-MAX_LENGTH, le=MAX_LENGTH)]  # [m]
LinkLength = Annotated[float, Field(gt=0.0, le=MAX_LENGTH)]  # [m]
Stroke = Annotated[float, Field(ge=MIN_STROKE, le=MAX_LENGTH)]  # [m]
Limit = Annotated[float, Field(ge=MIN_JOINT_RANGE / 2, le=MAX_ANGLE)]  # [rad]


def _check_joint_range(value: Range) -> Range:
    low, high = value
    if high - low < MIN_JOINT_RANGE:
        raise ValueError(f"[{low:g}, {high:g}] rad is narrower than 3 degrees")
    if max(-low, high) > MAX_ANGLE:
        raise ValueError(
            f"[{low:g}, {high:g}] rad exceeds ±2π; angles are in radians: write {math.radians(high):.4f} for {high:g}°"
        )
    if not low <= 0.0 <= high:
        raise ValueError(f"[{low:g}, {high:g}] rad must contain 0, where the inverse kinematics starts")
    return value


def _check_types(types: tuple[JointType, ...]) -> tuple[JointType, ...]:
    if not any(MODULES[letter].is_actuated for letter in types):
        raise ValueError(f"expected at least one type that moves, got {', '.join(types)}")
    return types


def _look_up_actuators(value: Any) -> Any:
    if not isinstance(value, (list, tuple)):
        raise ValueError("expected a list of names, or of records with name, mass and stall_torque")
    return [resolve_actuator(entry) for entry in cast("list[Any]", value)]


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
    joints: Count | Ordered[Count] = 4
    """Number of joint modules, or the smallest and the largest number. A pair adds the parameter n_joints."""
    joint_types: Annotated[Choices[JointType], AfterValidator(_check_types)] = ("R", "P", "Y")
    """Joint modules to choose from, by letter."""
    joint_range: Annotated[Range, AfterValidator(_check_joint_range)] = (-2.4, 2.4)
    """Range of every revolute joint [rad]."""
    limit: Ordered[Limit] | None = None
    """Range of the parameters limit_j [rad]: revolute joint j then moves within ±limit_j."""
    stroke: Stroke | Ordered[Stroke] = 0.3
    """Stroke of every prismatic joint [m]; a range adds the parameters stroke_j. A rail weighs as much as a link."""
    travel: float = Field(default=0.01, gt=0.0, le=10.0)
    """Travel of a prismatic joint per radian of its actuator [m/rad]."""
    origin_x: Ordered[Coordinate] = (-1.0, 1.0)
    """Range of the base position along x [m]."""
    origin_y: Ordered[Coordinate] = (-1.0, 1.0)
    """Range of the base position along y [m]."""
    origin_z: Ordered[Coordinate] = (-1.0, 1.0)
    """Range of the base position along z [m]."""
    mount: Choices[Mount] = ("floor",)
    """Surface that the arm is mounted on; several choices add the parameter mount."""
    column: ColumnKeys | None = None
    """Tube on which a floor-mounted base stands; {} for the default one."""
    base_on: str = Field(default="", max_length=40)
    """Obstacle of the task on whose top face a floor-mounted base stands."""
    link: Ordered[LinkLength] = (0.03, 0.30)
    """Range of the length of each link [m]."""
    link_directions: Choices[Direction] = ("+z",)
    """Direction of a link in the frame of its joint; several choices add the parameters direction_j."""
    link_section: LinkSection = LinkSection()
    """Tubes and material of the links; several tubes add the parameters tube_j, or the parameter tube."""
    mass: MassModel | None = None
    """Mass of the links without a material; 0.0121 kg per metre if not stated. A material implies the mass."""
    actuators: Annotated[tuple[ActuatorRecord, ...], BeforeValidator(_look_up_actuators)] = Field(
        default=(), max_length=MAX_ACTUATORS
    )
    """Names from the catalogue, or records; several add the parameters motor_j. Empty: joints without mass."""
    safety_factor: float = Field(default=1.5, gt=0.0, le=100.0)
    """Factor of the torque that the actuators have to deliver."""
    motor_bodies: bool = True
    """Whether the actuators, if there are any, are solid bodies, which count in collisions."""
    supply: float | None = Field(default=None, gt=0.0, le=1e4)
    """Voltage of the supply of all actuators [V]; if not stated, the highest that those of a design have in common."""
    bracket_mass: float | None = Field(default=None, ge=0.0, le=1e4)
    """Mass of brackets and screws at each joint that moves, where its actuator is [kg]; by default that of its record:
    a quarter of the mass of the actuator, at least 10 g."""
    restrict: Pairs[Restriction] = ()
    """Single parameters, fixed (joint_1: Y) or narrowed (joint_2: [P, R], link_1: [0.1, 0.2])."""
    grid: Pairs[float] = ()
    """Step size of a real parameter (link_1: 0.01) or of all of a kind (link: 0.005)."""
    tie: Pairs[str] = ()
    """Parameters that always equal another one (link_3: link_2)."""
    custom: Custom = Field(default=(), max_length=MAX_CUSTOM, alias="parameters")
    """Custom parameters by name, which do not change the arm: an evaluator reads them."""

    @model_validator(mode="after")
    def _check_values(self) -> Self:
        check_names(name for name, _ in self.custom)
        if self.mass is not None and self.link_section.material is not None:
            raise ValueError(
                "mass: expected no value beside link_section.material, which implies the mass of the links; remove one "
                "of the two"
            )
        for key, stated in (("column", self.column is not None), ("base_on", bool(self.base_on))):
            if stated and self.mount != ("floor",):
                raise ValueError(
                    f"{key}: expected mount: floor, got {', '.join(self.mount)}; remove {key} or the mounts"
                )
        names = [record.name for record in self.actuators]
        if len(set(names)) < len(names):
            raise ValueError(f"actuators: expected different ones, got {', '.join(names)}")
        if self.actuators and self.mass is None and self.link_section.material is None:
            raise ValueError(
                "actuators: expected links of a material, or a mass, got neither: the default of 12 g per metre is a "
                "toy's; try link_section: {tubes: [[0.03, 0.002]], material: aluminium}"
            )
        for record in self.actuators:
            low, high = record.supply_range
            if self.supply is not None and not low <= self.supply <= high:
                raise ValueError(
                    f"actuators: {record.name} takes {low:g} to {high:g} V, not the supply of {self.supply:g} V; leave "
                    "it out, or change the supply"
                )
        if self.has_motor_bodies:
            _check_motor_bodies(self)
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
        """The actuators at the supply, or each at the highest voltage that its maker states, in the file's order."""
        return _arm_actuators(self)

    @property
    def bracket_masses(self) -> tuple[float, ...]:
        """The mass of the brackets of each actuator, or of any joint without actuators [kg]."""
        if self.bracket_mass is not None or not self.actuators:
            return (self.bracket_mass or 0.0,) * max(len(self.actuators), 1)
        return tuple(record.completed().bracket_mass or 0.0 for record in self.actuators)

    def link_mass(self, length: Length, tube: Any = 0) -> Length:
        """Return the mass of links or rails [kg], from their lengths [m] and the indices of their tubes."""
        if self.link_section.material is None:
            return link_mass(self.mass or MassPerMetre(), length)
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
        model = self.mass or MassPerMetre()
        each = "per metre of link" if model.kind == "per_metre" else "for each link, whatever its length"
        return f"{model.kg:g} kg {each}"

    def tube_values(self, name: str) -> Any:
        """Return a (K,) value of `LinkTube` for each of the K tubes; NaN where it is None."""
        return _tube_values(self.link_section, name)

    def mount_of(self, design: Design) -> Mount:
        """Return the surface that the arm of a design is mounted on."""
        return cast("Mount", design.mount or self.mount[0])


@lru_cache(maxsize=64)
def _arm_actuators(space: SpaceSchema) -> tuple[Actuator, ...]:
    return tuple(record.at_supply(space.supply or record.stated_supply).actuator() for record in space.actuators)


@lru_cache(maxsize=512)
def _tube_values(section: LinkSection, name: str) -> Any:
    values = [getattr(tube, name) for tube in section.options]
    return np.array([math.nan if value is None else value for value in values])


def _check_motor_bodies(space: SpaceSchema) -> None:
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
