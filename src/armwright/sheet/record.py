"""What a data sheet states: one record, from which its HTML, PDF and JSON are written.

All values are in SI units, as `UNITS` lists them; prices are in USD. What is not known is None, never 0.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from armwright.kinematics.reach.reach_outline import Outline
from armwright.problem.facts import Facts
from armwright.problem.over_reach import ReachLine

NOT_STATED = "not stated"
NOT_MODELLED = "housings, cables, brakes, controller, power supply and assembly"
UNITS: Mapping[str, str] = {  # of all keys outside `facts`, which state their own
    "fraction": "of the reach", "distance": "m", "payload": "kg; 10000 if no actuator feels it",
    "mass": "kg", "length": "m", "outer_diameter": "m", "wall": "m", "position_error": "m", "deflection": "m",
    "backlash_error": "m", "price": "USD", "unit_price": "USD", "lower": "rad, or m of a prismatic joint",
    "upper": "as lower", "used": "as lower", "unused": "as lower", "torque": "N m, or N of a prismatic joint",
    "peak_torque": "as torque", "peak_utilisation": "of the peak torque, safety factor included",
    "speed_utilisation": "of the no-load speed",
    "thermal_utilisation": "of the continuous torque, safety factor included", "tilting_moment": "N m",
    "bearing_utilisation": "of what the maker of the actuator allows across its shaft", "base": "m",
    "base_position": "m", "base_yaw": "rad", "points": "m", "targets": "m", "links": "m",
}  # fmt: skip


@dataclass(frozen=True)
class JointLine:
    """A joint that moves, its drive and what the task needs of both."""

    number: int  # its number, from 1; fixed joints count
    name: str  # its name in the URDF
    kind: str  # its type
    axis: str  # its axis, with all joints at 0: x, y, z, the same with a minus, or a unit vector
    actuator: str  # the name of its actuator; empty if not stated
    lower: float  # the lower limit
    upper: float  # the upper limit
    used: tuple[float, float] | None = None  # smallest and largest value at the targets and along the cycle
    unused: tuple[float, float] | None = None  # the parts of the range below and above
    torque: float | None = None  # the largest torque at rest at the targets, and along the cycle
    peak_torque: float | None = None  # the peak of its actuator, at the joint
    # The largest use of it; along a cycle, of the torque that is available at the speed
    peak_utilisation: float | None = None
    speed_utilisation: float | None = None  # the largest use of the speed along the cycle
    thermal_utilisation: float | None = None  # the use of the continuous torque over the cycle
    tilting_moment: float | None = None  # the largest moment across its axis at the targets and along the cycle
    bearing_utilisation: float | None = None  # the largest use of what its actuator may carry across its shaft
    body: str = ""  # the body of its actuator, with all joints at 0, in words; empty if bodies do not count


@dataclass(frozen=True)
class LinkLine:
    """A link, from joint to joint or to the end of the arm."""

    number: int  # its number, from 1; links without length count
    length: float  # its length
    outer_diameter: float | None  # of its tube, if it has one
    wall: float | None  # wall thickness of its tube
    mass: float | None  # its mass, without what it carries


@dataclass(frozen=True)
class MassLine:
    """A part of the mass."""

    part: str
    mass: float


@dataclass(frozen=True)
class Part:
    """A line of the parts list."""

    part: str  # what to buy
    count: int  # how many pieces
    unit_price: float | None = None  # the price of a piece
    price: float | None = None  # the price of all pieces
    detail: str = ""  # such as the lengths to cut
    source: str = ""  # where the data were published
    price_source: str = ""  # where the price was read


@dataclass(frozen=True)
class Drawing:
    """The arm with all joints at 0, or at the nearest limit, and what its tip reaches."""

    base: tuple[float, float, float]  # the position of the first joint
    is_at_zero: bool  # whether all joints are at 0; if not, some are at the limit nearest to it
    # Start and end of each link and of the tool, with the number of the link; 0 for the tool
    links: tuple[tuple[int, tuple[float, float, float], tuple[float, float, float]], ...]
    column: float | None  # the length of the column below the base; None without one
    targets: tuple[tuple[float, float, float], ...]  # the targets of the task
    side: Outline  # the outline of the reach in x and z
    top: Outline  # the outline of the reach in x and y


@dataclass(frozen=True)
class DataSheet:
    """The data sheet of an arm."""

    name: str  # its name
    design: int | None  # the number of the design in its run; None for an existing arm
    joint_letters: str  # the joint types in order
    facts: Facts  # what is known of the arm by quantity, or why it is not
    joints: tuple[JointLine, ...]  # the joints that move
    links: tuple[LinkLine, ...]  # the links
    masses: tuple[MassLine, ...]  # the parts of the mass, which sum up to it; none if it is not known
    over_reach: tuple[ReachLine, ...]  # payload and errors over the reach
    drawing: Drawing  # the drawing
    # The position of its base link on the task, or of a design's first joint
    base_position: tuple[float, float, float] | None = None
    base_yaw: float | None = None  # the turn of its base link about the vertical
    role: str = ""  # why the design is recommended, such as `knee, least price`; empty if it is not
    status: str = ""  # the verdict of the simulation
    survival: str = ""  # which perturbations it holds
    violated: tuple[str, ...] = ()  # the constraints that it violates, or why its evaluation failed
    # What the run evaluated, by name with the unit
    objectives: Mapping[str, tuple[float | None, str]] = field(default_factory=dict[str, tuple[float | None, str]])
    payload: float | None = None  # the largest payload of the task; None without one
    parts: tuple[Part, ...] = ()  # the parts list
    # What the values assume, by what they are about
    assumptions: Mapping[str, str] = field(default_factory=dict[str, str])
    not_modelled: str = NOT_MODELLED  # what neither mass nor price include
