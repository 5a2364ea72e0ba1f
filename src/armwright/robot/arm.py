"""The physical arm: a base position, then alternating joints and links."""

import math
from dataclasses import dataclass, fields
from typing import Literal, get_args

from armwright.exceptions import ArmError
from armwright.robot.axes import AXES, Axis, Vector, unit_vector
from armwright.robot.motor_body import ActuatorShape, MotorBody
from armwright.robot.tubes import section_square
from armwright.text import listed

JointKind = Literal["revolute", "prismatic", "fixed"]

Tensor = tuple[Vector, Vector, Vector]
NO_INERTIA: Tensor = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
GRAVITY = 9.81  # [m/s²] along -z
UNIT = 1e-6  # tolerance on the length of a unit vector


@dataclass(frozen=True, slots=True)
class Actuator:
    """The actuator of a joint, carried by the link before it. All values are at its output; None if unknown."""

    name: str  # name in the catalogue or the space file
    mass: float  # mass [kg]
    peak_torque: float  # largest torque, at rest and up to the corner speed [N m]
    speed: float | None = None  # speed without load [rad/s]
    price: float | None = None  # price [USD]
    continuous_torque: float | None = None  # torque that it can hold forever [N m]
    corner_speed: float | None = None  # from which on the available torque falls linearly, to 0 at `speed` [rad/s]
    rotor_inertia: float | None = None  # inertia of rotor and gear [kg m²]
    coulomb_friction: float | None = None  # friction at any speed [N m]
    viscous_friction: float | None = None  # friction that is proportional to the speed [N m s/rad]
    load_friction: float | None = None  # friction when it pushes, relative to the torque at its output
    limit_friction: float | None = None  # the same if its torques are stated before this friction, 0 if at its output
    backlash: float | None = None  # backlash of its gear [rad]
    joint_stiffness: float | None = None  # torsional stiffness from its motor to its output [N m/rad]
    position_gain: float | None = None  # gain of its position control [N m/rad]
    damping_gain: float | None = None  # damping of its position control [N m s/rad]
    voltage: float | None = None  # supply voltage [V]
    current: float | None = None  # supply current at the peak torque [A]
    shape: ActuatorShape | None = None
    bearing_offset: float | None = None  # distance of its output bearing from the middle of its body [m]
    tilting_limit: float | None = None  # largest moment across its shaft [N m]; None if its maker states none
    axial_limit: float | None = None  # largest force along its shaft [N]; likewise
    radial_limit: float | None = None  # largest force across its shaft [N]; likewise

    def __post_init__(self) -> None:
        numbers = [getattr(self, field.name) for field in fields(self) if field.name not in ("name", "shape")]
        positive = (self.peak_torque, self.speed, self.joint_stiffness)
        if 0.0 in positive or not all(value is None or 0.0 <= value < math.inf for value in numbers):
            raise ArmError(
                "an actuator needs peak_torque, speed and joint_stiffness > 0, and no value below 0, all finite: "
                f"{self}"
            )


@dataclass(frozen=True, slots=True)
class Coupling:
    """How a joint follows another one of its arm, such as by a parallelogram, a belt or gears.

    Its value is q = factor q_leader + offset. The leader's drive moves both; the coupled joint has none of its own.
    """

    leader: int  # index of the joint that it follows, which follows none
    factor: float  # travel for each unit of the leader's travel [rad/rad], [m/m], [m/rad] or [rad/m]
    offset: float = 0.0  # value at which the leader is at 0 [rad] or [m]

    def __post_init__(self) -> None:
        if not (math.isfinite(self.factor) and math.isfinite(self.offset)) or self.factor == 0.0:
            raise ArmError(f"a coupling needs a finite factor other than 0 and a finite offset, not {self}")


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint about (revolute) or along (prismatic) a local axis."""

    kind: JointKind  # type; a fixed joint has no limits and does not move
    axis: Axis | Vector  # local axis by its name, or a unit vector along it
    lower: float = 0.0  # lower limit [rad] or [m]
    upper: float = 0.0  # upper limit [rad] or [m]
    actuator: Actuator | None = None  # actuator; None if not chosen
    travel: float = 1.0  # travel of a prismatic joint per radian of its actuator [m/rad]; 1 for other joints
    body: MotorBody | None = None  # body of its actuator, if it counts
    coupling: Coupling | None = None  # how it follows another joint; None if it moves independently

    def __post_init__(self) -> None:
        if self.kind not in get_args(JointKind):
            raise ArmError(f'joint kind "{self.kind}" is not one of {", ".join(get_args(JointKind))}')
        if self.axis not in AXES and not abs(math.hypot(*unit_vector(self.axis)) - 1.0) < UNIT:
            raise ArmError(f'joint axis "{self.axis}" is not one of {", ".join(AXES)}, nor a vector of length 1')
        if self.kind == "fixed" and self.body is not None:
            raise ArmError("a fixed joint has no actuator, so no body of one")
        if self.coupling is not None and (self.kind == "fixed" or self.actuator is not None or self.body is not None):
            raise ArmError("a coupled joint moves and has no actuator: that of the joint that it follows moves both")
        if self.body is not None and self.body.axis != self.axis:
            raise ArmError(f"motor body: expected its shaft along the joint's axis {self.axis}, got {self.body.axis}")
        unit = "m" if self.kind == "prismatic" else "rad"
        if not (math.isfinite(self.lower) and math.isfinite(self.upper)):
            raise ArmError(f"joint limits must be finite: [{self.lower}, {self.upper}] {unit}")
        if self.kind != "fixed" and not self.lower < self.upper:
            raise ArmError(f"joint limits: expected lower < upper, got {self.lower} and {self.upper} {unit}")
        if not 0.0 < self.travel < math.inf or (self.kind != "prismatic" and self.travel != 1.0):
            raise ArmError(
                f"travel = {self.travel} m/rad: expected a value above 0 for a prismatic joint, 1 for any other"
            )

    @property
    def direction(self) -> Vector:
        """The unit vector along its axis."""
        return unit_vector(self.axis)

    @property
    def nearest_axis(self) -> Axis:
        """The coordinate axis nearest to its axis, by which it is coloured."""
        sizes = [abs(value) for value in self.direction]
        return AXES[sizes.index(max(sizes))]

    @property
    def effort(self) -> float | None:
        """The peak of its actuator at the joint: a torque [N m], or a force [N] if prismatic; None if unknown."""
        return None if self.actuator is None else self.actuator.peak_torque / self.travel

    @property
    def speed(self) -> float | None:
        """The speed of the joint without load [rad/s] or [m/s]; None if unknown."""
        if self.actuator is None or self.actuator.speed is None:
            return None
        return self.actuator.speed * self.travel


@dataclass(frozen=True, slots=True)
class Link:
    """The rigid body after a joint, in the frame that the joint moves."""

    offset: Vector  # vector from this joint to the next, or to the end of the arm [m]
    mass: float  # mass without the end mass [kg]
    com: Vector  # centre of mass, from this joint [m]
    radius: float  # radius of its round section [m]
    end_mass: float = 0.0  # mass that it carries at its end, such as the next joint's actuator [kg]
    end_shift: Vector = (0.0, 0.0, 0.0)  # vector from its end to the centre of that mass [m]
    end_inertia: Tensor = NO_INERTIA  # (3, 3) of that mass about its centre [kg m²]
    # Young's modulus times the second moment of area of its section, EI [N m²]; infinite if rigid, None if unknown
    bending_stiffness: float | None = None
    torsional_stiffness: float | None = None  # shear modulus times the polar second moment of area, GJ [N m²]; likewise
    wall: float | None = None  # wall thickness of its tube [m], at most the radius; None if unknown
    price: float = 0.0  # price of its tube [USD]
    without_mass: tuple[str, ...] = ()  # names of its parts whose mass is not known, and counts as 0

    def __post_init__(self) -> None:
        values = (*self.offset, *self.com, self.mass, self.radius, self.end_mass, *self.end_shift, self.price)
        values = (*values, *sum(self.end_inertia, ()))
        if not all(math.isfinite(v) for v in values):
            raise ArmError(f"a link's numbers must be finite: {self}")
        if min(self.mass, self.end_mass) < 0.0 or self.radius <= 0.0:
            raise ArmError(f"a link needs mass >= 0 kg and radius > 0 m, not {self.mass} kg and {self.radius} m")
        stiffness = [value for value in (self.bending_stiffness, self.torsional_stiffness) if value is not None]
        if not all(value > 0.0 for value in stiffness):
            raise ArmError(f"stiffness of a link: expected values above 0 N m², or None if unknown, got {stiffness}")
        if self.wall is not None and not 0.0 < self.wall <= self.radius:
            raise ArmError(
                f"wall of a link: expected more than 0 and at most its radius of {self.radius} m, got {self.wall} m"
            )
        if self.price < 0.0:
            raise ArmError(f"price of a link: expected at least 0 USD, got {self.price} USD")

    @property
    def total_mass(self) -> float:
        """The mass including the end mass [kg]."""
        return self.mass + self.end_mass

    @property
    def total_com(self) -> Vector:
        """The centre of the total mass, from this joint [m]."""
        if self.end_mass == 0.0:
            return self.com
        both = zip(self.com, self.end_mass_position, strict=True)
        x, y, z = ((self.mass * own + self.end_mass * carried) / self.total_mass for own, carried in both)
        return x, y, z

    @property
    def end_mass_position(self) -> Vector:
        """The position of the end mass, from this joint [m]."""
        (x, y, z), (u, v, w) = self.offset, self.end_shift
        return (x + u, y + v, z + w)

    @property
    def section(self) -> float:
        """The sum of the squares of outer and inner radius [m²]; a solid bar if its wall is unknown."""
        return section_square(self.radius, self.wall)

    @property
    def length(self) -> float:
        """The distance from this joint to the next [m]."""
        return math.hypot(*self.offset)


@dataclass(frozen=True, slots=True)
class Column:
    """An upright round tube below the base, which carries the arm and does not move."""

    length: float  # from its foot to the first joint [m]
    outer_diameter: float  # [m]
    wall: float  # wall thickness [m]
    mass: float  # [kg]
    price: float = 0.0  # [USD]

    def __post_init__(self) -> None:
        if not 0.0 < self.length < math.inf or not 0.0 < self.wall <= self.outer_diameter / 2 < math.inf:
            raise ArmError(f"a column needs a length above 0 m and a wall of at most half its diameter, not {self}")
        if not (0.0 <= self.mass < math.inf and 0.0 <= self.price < math.inf):
            raise ArmError(f"a column needs mass >= 0 kg and price >= 0 USD, not {self.mass} kg and {self.price} USD")

    @property
    def radius(self) -> float:
        """The outer radius [m]."""
        return self.outer_diameter / 2

    @property
    def middle(self) -> Vector:
        """The point halfway up, from the base [m]."""
        return (0.0, 0.0, -self.length / 2)


@dataclass(frozen=True, slots=True)
class MountedTool:
    """A tool, in a frame at the end of the last link that is parallel to the world frame with all joints at 0."""

    tip: Vector = (0.0, 0.0, 0.0)  # position of the tip [m]
    axis: Vector = (0.0, 0.0, 1.0)  # direction of the z axis of the tip frame
    side: Vector = (1.0, 0.0, 0.0)  # direction of the x axis of the tip frame
    mass: float = 0.0  # [kg]
    com: Vector = (0.0, 0.0, 0.0)  # centre of mass [m]
    # (3, 3) about the centre of mass [kg m²]
    inertia: Tensor = NO_INERTIA

    def __post_init__(self) -> None:
        if not all(math.isfinite(v) for v in (*self.tip, self.mass, *self.com, *sum(self.inertia, ()))):
            raise ArmError(f"a tool's numbers must be finite: {self}")
        if self.mass < 0.0:
            raise ArmError(f"a tool needs mass >= 0 kg, not {self.mass} kg")
        axis, side = self.axis, self.side
        across = sum(a * b for a, b in zip(axis, side, strict=True))
        if not max(abs(math.hypot(*axis) - 1.0), abs(math.hypot(*side) - 1.0), abs(across)) < UNIT:
            raise ArmError(f"tool: axis = {axis} and side = {side} must be unit vectors at right angles")


@dataclass(frozen=True, slots=True)
class Arm:
    """A serial arm. With all joints at 0, every local frame is parallel to the world frame.

    Examples:
        >>> import armwright as aw
        >>> joints = aw.Joint("revolute", "z", -2.4, 2.4), aw.Joint("revolute", "y", -2.4, 2.4)
        >>> upright = aw.uniform_link((0.0, 0.0, 0.25), mass=0.1, radius=0.015)
        >>> arm = aw.Arm((0.0, 0.0, 0.0), joints, (upright, upright))
        >>> arm.length, arm.mass
        (0.5, 0.2)
    """

    base: Vector  # position of the first joint in the world [m]
    joints: tuple[Joint, ...]  # joint j moves link j and everything after it
    links: tuple[Link, ...]  # links, one after each joint
    tool: MountedTool = MountedTool()  # tool on the end of the last link
    base_mass: float = 0.0  # mass that does not move, such as the first joint's actuator [kg]
    safety_factor: float = 1.0  # factor of the torque that its actuators have to deliver
    column: Column | None = None  # what the base stands on; None if it stands on the ground or a surface

    def __post_init__(self) -> None:
        if not self.joints or len(self.joints) != len(self.links):
            raise ArmError(
                "an arm needs as many links as joints, at least one: "
                f"{len(self.joints)} joints, {len(self.links)} links"
            )
        if not all(math.isfinite(v) for v in self.base):
            raise ArmError(f"the base position must be finite: {self.base} m")
        independent = {i for i, joint in enumerate(self.joints) if joint.kind != "fixed" and joint.coupling is None}
        if not {coupling.leader for _, coupling in self.couplings} <= independent:
            raise ArmError("a coupled joint follows a joint of its arm that moves and follows none")

    @property
    def couplings(self) -> list[tuple[int, Coupling]]:
        """The index of each joint that follows another, and how."""
        return [(i, joint.coupling) for i, joint in enumerate(self.joints) if joint.coupling is not None]

    @property
    def mass(self) -> float:
        """The total mass, including what stands below the arm and the tool [kg]."""
        return self.standing_mass + sum(link.total_mass for link in self.links) + self.tool.mass

    @property
    def no_mass(self) -> str:
        """Why its mass is not known; empty if it is."""
        names = [name for link in self.links for name in link.without_mass]
        return f"no mass is stated for {listed(names)}" if names else ""

    @property
    def structure_price(self) -> float:
        """The price of all links and of the column [USD]."""
        return sum(link.price for link in self.links) + (0.0 if self.column is None else self.column.price)

    @property
    def standing_mass(self) -> float:
        """The mass that does not move, the column included [kg]."""
        return self.base_mass + (0.0 if self.column is None else self.column.mass)

    @property
    def length(self) -> float:
        """The total length of the links [m]."""
        return sum(link.length for link in self.links)

    @property
    def has_motor_bodies(self) -> bool:
        """True if the bodies of actuators count."""
        return any(joint.body is not None for joint in self.joints)

    @property
    def reach(self) -> float:
        """The largest possible distance of the tip from the first joint [m]."""
        strokes = sum(max(abs(j.lower), abs(j.upper)) for j in self.joints if j.kind == "prismatic")
        return strokes + self.length + math.hypot(*self.tool.tip)


def uniform_link(offset: Vector, mass: float, radius: float) -> Link:
    """Return a link of uniform density, with its centre of mass halfway along `offset` [m]."""
    x, y, z = offset
    return Link(offset=offset, mass=mass, com=(x / 2, y / 2, z / 2), radius=radius)
