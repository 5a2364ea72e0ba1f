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
    "thermal_utilisation": "of the continuous torque, safety factor included", "base": "m",
    "base_position": "m", "base_yaw": "rad", "points": "m", "targets": "m", "links": "m",
}  # fmt: skip


@dataclass(frozen=True)
class JointLine:
    """A joint that moves, its drive and what the task needs of both.

    Attributes:
        number: Its number, from 1; fixed joints count.
        name: Its name in the URDF.
        kind: Its type.
        axis: Its axis, with all joints at 0: x, y or z.
        actuator: The name of its actuator; empty if not stated.
        lower: The lower limit.
        upper: The upper limit.
        used: Smallest and largest value at the targets and along the cycle.
        unused: The parts of the range below and above.
        torque: The largest torque at rest at the targets, and along the cycle.
        peak_torque: The peak of its actuator, at the joint.
        peak_utilisation: The largest use of it; along a cycle, of the torque that is available at the speed.
        speed_utilisation: The largest use of the speed along the cycle.
        thermal_utilisation: The use of the continuous torque over the cycle.
        body: The body of its actuator, with all joints at 0, in words; empty if bodies do not count.
    """

    number: int
    name: str
    kind: str
    axis: str
    actuator: str
    lower: float
    upper: float
    used: tuple[float, float] | None = None
    unused: tuple[float, float] | None = None
    torque: float | None = None
    peak_torque: float | None = None
    peak_utilisation: float | None = None
    speed_utilisation: float | None = None
    thermal_utilisation: float | None = None
    body: str = ""


@dataclass(frozen=True)
class LinkLine:
    """A link, from joint to joint or to the end of the arm.

    Attributes:
        number: Its number, from 1; links without length count.
        length: Its length.
        outer_diameter: Of its tube, if it has one.
        wall: Wall thickness of its tube.
        mass: Its mass, without what it carries.
    """

    number: int
    length: float
    outer_diameter: float | None
    wall: float | None
    mass: float


@dataclass(frozen=True)
class MassLine:
    """A part of the mass."""

    part: str
    mass: float


@dataclass(frozen=True)
class Part:
    """A line of the parts list.

    Attributes:
        part: What to buy.
        count: How many pieces.
        unit_price: The price of a piece.
        price: The price of all pieces.
        detail: Such as the lengths to cut.
        source: Where the data were published.
        price_source: Where the price was read.
    """

    part: str
    count: int
    unit_price: float | None = None
    price: float | None = None
    detail: str = ""
    source: str = ""
    price_source: str = ""


@dataclass(frozen=True)
class Sensitivity:
    """What one change of a design changes; None where a quantity is not known.

    Attributes:
        part: What is changed.
        change: How.
        impossible: Why it cannot be changed so; empty if it can.
        position_error: Change of the largest position error at the targets.
        deflection: Change of the largest deflection at the targets.
        backlash_error: Change of the largest backlash error at the targets.
        mass: Change of the mass.
        price: Change of the price.
        broken: Constraints that the changed design violates and the design does not.
    """

    part: str
    change: str
    impossible: str = ""
    position_error: float | None = None
    deflection: float | None = None
    backlash_error: float | None = None
    mass: float | None = None
    price: float | None = None
    broken: tuple[str, ...] = ()


@dataclass(frozen=True)
class Drawing:
    """The arm with all joints at 0, or at the nearest limit, and what its tip reaches.

    Attributes:
        base: The position of the first joint.
        is_at_zero: Whether all joints are at 0; if not, some are at the limit nearest to it.
        links: Start and end of each link and of the tool, with the number of the link; 0 for the tool.
        column: The length of the column below the base; None without one.
        targets: The targets of the task.
        side: The outline of the reach in x and z.
        top: The outline of the reach in x and y.
    """

    base: tuple[float, float, float]
    is_at_zero: bool
    links: tuple[tuple[int, tuple[float, float, float], tuple[float, float, float]], ...]
    column: float | None
    targets: tuple[tuple[float, float, float], ...]
    side: Outline
    top: Outline


@dataclass(frozen=True)
class DataSheet:
    """The data sheet of an arm.

    Attributes:
        name: Its name.
        base_position: The position of its base link on the task, or of a design's first joint.
        base_yaw: The turn of its base link about the vertical.
        design: The number of the design in its run; None for an existing arm.
        joint_letters: The joint types in order.
        role: Why the design is recommended, such as `knee, least price`; empty if it is not.
        status: The verdict of the simulation.
        survival: Which perturbations it holds.
        violated: The constraints that it violates, or why its evaluation failed.
        objectives: What the run evaluated, by name with the unit.
        payload: The largest payload of the task; None without one.
        facts: What is known of the arm by quantity, or why it is not.
        joints: The joints that move.
        links: The links.
        masses: The parts of the mass, which sum up to it.
        parts: The parts list.
        over_reach: Payload and errors over the reach.
        sensitivities: What changes of the design change.
        drawing: The drawing.
        assumptions: What the values assume, by what they are about.
        not_modelled: What neither mass nor price include.
    """

    name: str
    design: int | None
    joint_letters: str
    facts: Facts
    joints: tuple[JointLine, ...]
    links: tuple[LinkLine, ...]
    masses: tuple[MassLine, ...]
    over_reach: tuple[ReachLine, ...]
    drawing: Drawing
    base_position: tuple[float, float, float] | None = None
    base_yaw: float | None = None
    role: str = ""
    status: str = ""
    survival: str = ""
    violated: tuple[str, ...] = ()
    objectives: Mapping[str, tuple[float | None, str]] = field(default_factory=dict[str, tuple[float | None, str]])
    payload: float | None = None
    parts: tuple[Part, ...] = ()
    sensitivities: tuple[Sensitivity, ...] = ()
    assumptions: Mapping[str, str] = field(default_factory=dict[str, str])
    not_modelled: str = NOT_MODELLED

    @property
    def reach(self) -> float:
        """The horizontal reach of the tip from the first joint [m]."""
        return self.over_reach[-1].distance
