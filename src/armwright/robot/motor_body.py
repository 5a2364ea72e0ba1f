"""Motors as solid bodies: the shape of an actuator, and its body at a joint."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from armwright.exceptions import ArmError
from armwright.robot.axes import AXES, Axis, Vector, unit_vector

BodyShape = Literal["box", "cylinder"]


@dataclass(frozen=True, slots=True)
class ActuatorShape:
    """The shape of an actuator, about its shaft."""

    shape: BodyShape  # box, or a cylinder about its shaft
    length: float  # edge along the shaft [m]
    long: float  # longer edge across the shaft; the diameter of a cylinder [m]
    short: float  # shorter edge across the shaft; the diameter of a cylinder [m]
    shaft_offset: float = 0.0  # distance of the shaft from the middle of the body, along the longer edge [m]

    @property
    def reach(self) -> float:
        """The largest distance from the joint to a face [m]."""
        return max(self.length / 2, self.long / 2 + self.shaft_offset)


@dataclass(frozen=True, slots=True)
class MotorBody:
    """The body of a joint's actuator, fixed to the link before, or to the base.

    Its edges are parallel to the axes of that link's frame.
    """

    shape: BodyShape  # box, or a cylinder along `axis`
    axis: Axis  # axis of its shaft, which is the axis of the joint
    size: Vector  # edges along x, y and z; a cylinder has its diameter across its axis [m]
    centre: Vector = (0.0, 0.0, 0.0)  # middle, from the position of the joint at displacement 0 [m]

    def __post_init__(self) -> None:
        if self.shape not in get_args(BodyShape) or self.axis not in AXES:
            raise ArmError(f"a motor body is a box or a cylinder along x, y or z: {self}")
        if not all(math.isfinite(v) for v in (*self.size, *self.centre)) or min(self.size) <= 0.0:
            raise ArmError(f"a motor body needs edges above 0 m and a finite centre: {self}")
        _, width, depth = shaft_order(self.axis, self.size)
        if self.shape == "cylinder" and width != depth:
            raise ArmError(f"a cylindrical motor body needs equal edges across its axis, not {width} and {depth} m")

    @property
    def length(self) -> float:
        """The edge along the shaft [m]."""
        return self.size[AXES.index(self.axis)]

    @property
    def gyration(self) -> Vector:
        """The moments of inertia about its centre around x, y and z, per mass, at uniform density [m²].

        A box has (b² + c²) / 12 around its edge a, a cylinder d² / 8 around its axis and d² / 16 + l² / 12 across it.
        """
        round_across = [self.shape == "cylinder" and axis != self.axis for axis in AXES]
        x, y, z = (
            edge**2 / (16.0 if is_round else 12.0) for edge, is_round in zip(self.size, round_across, strict=True)
        )
        return (y + z, x + z, x + y)

    @property
    def radius(self) -> float:
        """The radius of a cylinder [m]."""
        return self.size[AXES.index(self.axis) - 1] / 2


def shaft_order(axis: Axis, values: Vector) -> Vector:
    """Return values along x, y and z in the order: along this axis, and along the next two in cyclic order."""
    first = AXES.index(axis)
    return values[first], values[(first + 1) % 3], values[(first + 2) % 3]


def placed_body(shape: ActuatorShape, axis: Axis, carrier: Vector) -> MotorBody:
    """Return the body of an actuator at a joint.

    The shaft is along the joint's axis, and the joint halfway along it. The longer edge across it is along the link
    before, towards which the body extends; if that link is along the shaft, it is along the next axis in cyclic order,
    and the body extends to its negative side.

    carrier: unit vector along an axis, from the start of the link before to the joint; for the first joint away from
    the surface that the arm is mounted on.
    """
    along = AXES.index(axis)
    if carrier[along] != 0.0:
        carrier = unit_vector(AXES[(along + 1) % 3])
    longer = next(i for i, value in enumerate(carrier) if value != 0.0)
    edges = [shape.short] * 3
    edges[along], edges[longer] = shape.length, shape.long
    x, y, z = carrier
    offset = shape.shaft_offset
    return MotorBody(
        shape.shape, axis, (edges[0], edges[1], edges[2]), (0.0 - offset * x, 0.0 - offset * y, 0.0 - offset * z)
    )
