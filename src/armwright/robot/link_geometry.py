"""Bodies and limits of an arm, as the file formats state them."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array
from armwright.robot.arm import Arm, Joint, Link
from armwright.robot.axes import Vector, unit_vector
from armwright.robot.link_inertia import point_inertia, tube_inertia
from armwright.robot.motor_body import MotorBody
from armwright.rotations import rpy_from_rotation

MARKER_SCALE = 1.4  # radius of a joint's sphere, relative to its link

# A moving joint must state both. Without an actuator they only have to be large enough.
DEFAULT_EFFORT = 100.0  # [N m] or [N]
DEFAULT_VELOCITY = 10.0  # [rad/s] or [m/s]


@dataclass(frozen=True)
class Segment:
    """A joint and the link after it, as formats list them."""

    number: int  # counted from 1
    joint: Joint
    link: Link  # link that it moves
    parent: str  # name of the link before
    position: Vector  # position of the joint in the frame of that link [m]

    @property
    def name(self) -> str:
        """The name of the link."""
        return f"link_{self.number}"

    @property
    def motor_name(self) -> str:
        """The name of the body of the joint's actuator."""
        return f"motor_{self.number}"


def segments(arm: Arm) -> Iterator[Segment]:
    """Yield the joints and links of an arm, from the base to the tip."""
    parent, position = "base", (0.0, 0.0, 0.0)
    for number, (joint, link) in enumerate(zip(arm.joints, arm.links, strict=True), start=1):
        segment = Segment(number, joint, link, parent, position)
        yield segment
        parent, position = segment.name, link.offset


def moving_joints(arm: Arm) -> Iterator[tuple[int, Joint]]:
    """Yield the number, counted from 1, and the joint for all joints that move."""
    for number, joint in enumerate(arm.joints, start=1):
        if joint.kind != "fixed":
            yield number, joint


def joint_limits(joint: Joint) -> dict[str, float]:
    """Return lower and upper [rad] or [m], effort [N m] or [N] and velocity [rad/s] or [m/s] of a joint."""
    effort = DEFAULT_EFFORT if joint.effort is None else joint.effort
    velocity = DEFAULT_VELOCITY if joint.speed is None else joint.speed
    return {"lower": joint.lower, "upper": joint.upper, "effort": effort, "velocity": velocity}


def home_posture(arm: Arm) -> list[float]:
    """Return for each joint 0, or the limit closest to it [rad] or [m]; coupled joints follow theirs."""
    q = [min(max(0.0, joint.lower), joint.upper) for joint in arm.joints]
    for i, coupling in arm.couplings:
        q[i] = coupling.factor * q[coupling.leader] + coupling.offset
    return q


def inertia_tensor(link: Link) -> Array:
    """Return (3, 3) of the tube and the mass at its end, about their common centre of mass, in the link frame."""
    mass, end_mass, centre = np.array(link.mass), np.array(link.end_mass), np.array(link.total_com)
    own = tube_inertia(mass, np.array(link.offset), np.array(link.section)) + point_inertia(mass, centre - link.com)
    return own + link.end_inertia + point_inertia(end_mass, centre - link.end_mass_position)


def inertia_rpy(link: Link) -> Vector:
    """Return roll, pitch and yaw [rad] of the frame of `inertia_moments`: along the link if it carries no end mass."""
    return rpy_along(link.offset) if link.end_mass == 0.0 else (0.0, 0.0, 0.0)


def inertia_moments(link: Link) -> dict[str, str]:
    """Return the moments about the centre of mass in the frame of `inertia_rpy` [kg m²], by their URDF names.

    A tube without length is a disc, for which 2 across = around holds; all digits are written, since MuJoCo refuses a
    value below it by rounding.
    """
    around = link.mass * link.section / 2.0
    across = around / 2.0 + link.mass * link.length**2 / 12.0
    tensor = inertia_tensor(link) if link.end_mass else np.diag([across, across, around])
    return _moments(tensor)


def tool_moments(arm: Arm) -> dict[str, str]:
    """Return the moments of the tool about its centre of mass [kg m²], by their URDF names."""
    return _moments(np.array(arm.tool.inertia))


def _moments(tensor: Array) -> dict[str, str]:
    return {name: f"{tensor[place]:.17g}" for name, place in TENSOR_INDICES.items()}


TENSOR_INDICES = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}


def rpy_along(offset: Vector) -> Vector:
    """Return roll, pitch and yaw [rad] of a frame whose z axis points along `offset`."""
    x, y, z = offset
    return (0.0, math.atan2(math.hypot(x, y), z), math.atan2(y, x))


def tip_position(arm: Arm) -> Vector:
    """Return the position of the tip in the frame of the last link [m]."""
    (x, y, z), (u, v, w) = arm.links[-1].offset, arm.tool.tip
    return (x + u, y + v, z + w)


def tip_rpy(arm: Arm) -> Vector:
    """Return roll, pitch and yaw [rad] of the tip frame in the last link: z is the tool's axis and x its side."""
    z = np.array(arm.tool.axis) / np.linalg.norm(arm.tool.axis)
    y = np.cross(z, arm.tool.side)
    y = y / np.linalg.norm(y)
    return rpy_from_rotation(np.column_stack([np.cross(y, z), y, z]))


def midpoint(link: Link) -> Vector:
    """Return the point halfway to the next joint [m]."""
    x, y, z = link.offset
    return (x / 2, y / 2, z / 2)


def marker_radius(link: Link) -> float:
    """Return the radius of the sphere that marks a joint [m]."""
    return MARKER_SCALE * link.radius


def body_rpy(body: MotorBody) -> Vector:
    """Return roll, pitch and yaw [rad] of the shape of a motor body: a cylinder of these formats is along z."""
    if body.shape == "box":
        return (0.0, 0.0, 0.0)
    return rpy_along(unit_vector(body.axis))
