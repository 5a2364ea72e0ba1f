"""What the formats share: the bodies of an arm, their colours, and numbers as text."""

import math
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from armwright.arm import Arm, Link, Vector

AXIS_VECTORS = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
COLOURS = {
    "link": "0.75 0.75 0.78 1",
    "joint_x": "0.84 0.37 0.00 1",
    "joint_y": "0.00 0.45 0.70 1",
    "joint_z": "0.00 0.62 0.45 1",
}

MARKER = 1.4  # a joint's sphere to its link's radius

# MuJoCo refuses a moving body without mass: it is to take these where a link has less.
BOUNDS = {"boundmass": "1e-12", "boundinertia": "1e-14"}  # [kg], [kg m²]


def cylinder_inertia(link: Link) -> tuple[str, str]:
    """(across, around): the moments of a solid cylinder from joint to joint, about its centre of mass [kg m²].

    m (3 r² + l²) / 12 across its axis and m r² / 2 around it. A cylinder without length is a disc, 2 across = around:
    all digits, as MuJoCo refuses what is a rounding below it.
    """
    around = link.mass * link.radius**2 / 2.0
    across = around / 2.0 + link.mass * link.length**2 / 12.0
    return f"{across:.17g}", f"{around:.17g}"


def inertia_tensor(link: Link) -> NDArray[np.float64]:
    """(3, 3) of the cylinder and of what sits at its end, about their common centre of mass, in the link's frame."""
    r2, l2 = link.radius**2, link.length**2
    across = link.mass * (3.0 * r2 + l2) / 12.0
    axis = np.array(link.offset) / link.length if link.length > 0.0 else np.array([0.0, 0.0, 1.0])
    around = np.outer(axis, axis)
    tensor = across * (np.eye(3) - around) + link.mass * r2 / 2.0 * around
    centre = np.array(link.total_com)
    for mass, place in ((link.mass, link.com), (link.end_mass, link.end_place)):
        away = np.array(place) - centre
        tensor += mass * (away @ away * np.eye(3) - np.outer(away, away))
    return tensor


def inertia_frame(link: Link) -> Vector:
    """Roll, pitch, yaw [rad] of the frame that `moments` are in: along the link, where nothing sits at its end."""
    return along(link.offset) if link.end_mass == 0.0 else (0.0, 0.0, 0.0)


def moments(link: Link) -> dict[str, str]:
    """About the centre of mass, in `inertia_frame` [kg m²]."""
    if link.end_mass == 0.0:
        across, around = cylinder_inertia(link)
        return {"ixx": across, "iyy": across, "izz": around, "ixy": "0", "ixz": "0", "iyz": "0"}
    tensor = inertia_tensor(link)
    places = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}
    return {name: f"{tensor[place]:.17g}" for name, place in places.items()}


def along(offset: Vector) -> Vector:
    """Roll, pitch, yaw [rad] of the frame whose z points along `offset`."""
    x, y, z = offset
    return (0.0, math.atan2(math.hypot(x, y), z), math.atan2(y, x))


def tip_place(arm: Arm) -> Vector:
    """Of the tip, from the last joint [m]."""
    (x, y, z), (u, v, w) = arm.links[-1].offset, arm.tool
    return (x + u, y + v, z + w)


def tip_turn(arm: Arm) -> Vector:
    """Roll, pitch, yaw [rad] of the tip's frame in the last link's: z is the tool's axis and x its side."""
    z = np.array(arm.tool_axis) / np.linalg.norm(arm.tool_axis)
    y = np.cross(z, arm.tool_side)
    y = y / np.linalg.norm(y)
    x = np.cross(y, z)
    level = math.hypot(x[0], x[1])
    pitch = math.atan2(-x[2], level)
    # Pointing straight up or down, roll and yaw turn about the same line: it is all yaw.
    roll, yaw = (math.atan2(y[2], z[2]), math.atan2(x[1], x[0])) if level > 1e-9 else (0.0, math.atan2(-y[0], y[1]))
    return (roll + 0.0, pitch + 0.0, yaw + 0.0)  # no -0.0


def middle(link: Link) -> Vector:
    """Half way to the next joint [m]."""
    x, y, z = link.offset
    return (x / 2, y / 2, z / 2)


def marker_radius(link: Link) -> float:
    """Of the sphere that shows a joint: a little more than its link [m]."""
    return MARKER * link.radius


def number(value: float) -> str:
    """Ten digits."""
    return f"{value:.10g}"


def numbers(values: Vector) -> str:
    """Ten digits each."""
    return " ".join(number(value) for value in values)


def text_of(root: ElementTree.Element) -> str:
    """The XML of the whole file, indented."""
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
