"""The physical chain: a base position, then joints and links in turn. It knows no search."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from armwright.exceptions import ArmError

JointKind = Literal["revolute", "prismatic", "fixed"]
Axis = Literal["x", "y", "z"]
Vector = tuple[float, float, float]

AXES: tuple[Axis, ...] = ("x", "y", "z")
GRAVITY = 9.81  # [m/s²] along -z
UNIT = 1e-6  # by which a unit vector's length may be off


@dataclass(frozen=True, slots=True)
class Actuator:
    """What turns a joint. It sits there and is carried by the link before.

    mass: [kg]. effort: the torque that may be asked of it [N m]. speed: the largest [rad/s], and price: [USD]; None
    where not known.
    """

    name: str
    mass: float
    effort: float
    speed: float | None = None
    price: float | None = None

    def __post_init__(self) -> None:
        said = [self.mass, self.effort, self.speed or 1.0, self.price or 0.0]
        if not all(math.isfinite(v) for v in said) or min(self.mass, self.price or 0.0) < 0.0 or self.effort <= 0.0:
            raise ArmError(f"an actuator needs mass >= 0 kg, effort > 0 and price >= 0, all finite: {self}")


@dataclass(frozen=True, slots=True)
class Joint:
    """One joint about (revolute) or along (prismatic) a local axis.

    lower, upper: the limits [rad] or [m]; a fixed joint has none and does not move.
    actuator: what turns it; None where that is not chosen.
    travel: of a prismatic joint for each radian that its actuator turns [m/rad]; 1 of the others.
    """

    kind: JointKind
    axis: Axis
    lower: float = 0.0
    upper: float = 0.0
    actuator: Actuator | None = None
    travel: float = 1.0

    def __post_init__(self) -> None:
        if self.kind not in get_args(JointKind):
            raise ArmError(f'joint kind "{self.kind}" is not one of {", ".join(get_args(JointKind))}')
        if self.axis not in AXES:
            raise ArmError(f'joint axis "{self.axis}" is not one of {", ".join(AXES)}')
        unit = "m" if self.kind == "prismatic" else "rad"
        if not (math.isfinite(self.lower) and math.isfinite(self.upper)):
            raise ArmError(f"joint limits must be finite: [{self.lower}, {self.upper}] {unit}")
        if self.kind != "fixed" and not self.lower < self.upper:
            raise ArmError(
                f"joint limits are upside down: lower < upper is needed, not {self.lower} and {self.upper} {unit}"
            )
        if not 0.0 < self.travel < math.inf or (self.kind != "prismatic" and self.travel != 1.0):
            raise ArmError(f"travel = {self.travel} m/rad: above 0 of a prismatic joint, 1 of any other")

    @property
    def effort(self) -> float | None:
        """What its actuator can do at the joint: a torque [N m], or a force [N] where it slides; None where unknown."""
        return None if self.actuator is None else self.actuator.effort / self.travel

    @property
    def speed(self) -> float | None:
        """The fastest that its actuator can move it [rad/s] or [m/s]; None where unknown."""
        if self.actuator is None or self.actuator.speed is None:
            return None
        return self.actuator.speed * self.travel


@dataclass(frozen=True, slots=True)
class Link:
    """The rigid body after a joint, in the frame that the joint moves.

    offset: from this joint to the next, or to the tip of the arm [m].
    mass: [kg].  com: centre of mass from this joint [m].  radius: of its round section [m].
    end_mass: of a point that it carries at its end, too, such as the next joint's actuator [kg].
    end_shift: from its end to that point [m].
    """

    offset: Vector
    mass: float
    com: Vector
    radius: float
    end_mass: float = 0.0
    end_shift: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        values = (*self.offset, *self.com, self.mass, self.radius, self.end_mass, *self.end_shift)
        if not all(math.isfinite(v) for v in values):
            raise ArmError(f"a link's numbers must be finite: {self}")
        if min(self.mass, self.end_mass) < 0.0 or self.radius <= 0.0:
            raise ArmError(f"a link needs mass >= 0 kg and radius > 0 m, not {self.mass} kg and {self.radius} m")

    @property
    def total_mass(self) -> float:
        """With what sits at its end [kg]."""
        return self.mass + self.end_mass

    @property
    def total_com(self) -> Vector:
        """The centre of that mass from this joint [m]."""
        if self.end_mass == 0.0:
            return self.com
        (x, y, z), (u, v, w), total = self.com, self.end_place, self.total_mass
        return (
            (self.mass * x + self.end_mass * u) / total,
            (self.mass * y + self.end_mass * v) / total,
            (self.mass * z + self.end_mass * w) / total,
        )

    @property
    def end_place(self) -> Vector:
        """Of `end_mass`, from this joint [m]."""
        (x, y, z), (u, v, w) = self.offset, self.end_shift
        return (x + u, y + v, z + w)

    @property
    def length(self) -> float:
        """From this joint to the next [m]."""
        return math.hypot(*self.offset)


@dataclass(frozen=True, slots=True)
class Arm:
    """A serial arm. With all joints at 0 every local frame stands parallel to the world's.

    base: the first joint's position in the world [m].
    joints, links: joint j moves link j and all that follows it.
    tool: from the end of the last link to the tip, in the frame of that link [m].
    tool_axis, tool_side: the world's directions of the tool's own z and x when all joints are at 0.
    base_mass: of what stands with the base, such as the first joint's actuator [kg].

    Examples:
        >>> import armwright as aw
        >>> joints = aw.Joint("revolute", "z", -2.4, 2.4), aw.Joint("revolute", "y", -2.4, 2.4)
        >>> upright = aw.uniform_link((0.0, 0.0, 0.25), mass=0.1, radius=0.015)
        >>> arm = aw.Arm((0.0, 0.0, 0.0), joints, (upright, upright))
        >>> arm.length, arm.mass
        (0.5, 0.2)
    """

    base: Vector
    joints: tuple[Joint, ...]
    links: tuple[Link, ...]
    tool: Vector = (0.0, 0.0, 0.0)
    tool_axis: Vector = (0.0, 0.0, 1.0)
    tool_side: Vector = (1.0, 0.0, 0.0)
    base_mass: float = 0.0

    def __post_init__(self) -> None:
        if not self.joints or len(self.joints) != len(self.links):
            raise ArmError(
                "an arm needs as many links as joints, at least one: "
                f"{len(self.joints)} joints, {len(self.links)} links"
            )
        if not all(math.isfinite(v) for v in self.base):
            raise ArmError(f"the base position must be finite: {self.base} m")
        if not all(math.isfinite(v) for v in self.tool):
            raise ArmError(f"the tool's offset must be finite: {self.tool} m")
        axis, side = self.tool_axis, self.tool_side
        across = sum(a * b for a, b in zip(axis, side, strict=True))
        if not max(abs(math.hypot(*axis) - 1.0), abs(math.hypot(*side) - 1.0), abs(across)) < UNIT:
            raise ArmError(f"tool_axis = {axis} and tool_side = {side} must be unit vectors at right angles")

    @property
    def mass(self) -> float:
        """Of all, what stands with the base included [kg]."""
        return self.base_mass + sum(link.total_mass for link in self.links)

    @property
    def length(self) -> float:
        """Of all links [m]."""
        return sum(link.length for link in self.links)

    @property
    def reach(self) -> float:
        """The longest distance from the first joint that the tip could have [m]."""
        strokes = sum(max(abs(j.lower), abs(j.upper)) for j in self.joints if j.kind == "prismatic")
        return strokes + self.length + math.hypot(*self.tool)


def uniform_link(offset: Vector, mass: float, radius: float) -> Link:
    """A link of uniform density: its centre of mass lies half way along `offset` [m]."""
    x, y, z = offset
    return Link(offset=offset, mass=mass, com=(x / 2, y / 2, z / 2), radius=radius)
