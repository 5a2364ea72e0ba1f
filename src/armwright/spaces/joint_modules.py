"""The joint modules that a design is assembled from, and the ways to mount an arm.

A design states its joints as a word with one letter per module: `YPRP`. Letters R, P, Y, O, S and F are those of
Kawaharazuka et al. (arXiv:2409.20038).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np

from armwright.robot.arm import AXES, Axis, JointKind, Vector
from armwright.robot.axes import as_vector
from armwright.robot.motor_body import MotorBody

JointType = Literal["R", "P", "Y", "O", "X", "T", "S", "F"]
Direction = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Mount = Literal["floor", "ceiling", "wall+x", "wall-x", "wall+y", "wall-y"]


@dataclass(frozen=True, slots=True)
class Module:
    """Joints at one position, followed by a link."""

    joints: tuple[tuple[JointKind, Axis], ...]  # kind and local axis of each joint. The link follows the last one
    description: str  # A description for readers who do not know this program

    @property
    def is_revolute(self) -> bool:
        """True if its joints rotate."""
        return self.joints[0][0] == "revolute"

    @property
    def is_prismatic(self) -> bool:
        """True if its joint translates."""
        return self.joints[0][0] == "prismatic"

    @property
    def is_actuated(self) -> bool:
        """True if it has an actuator for each of its joints."""
        return self.is_revolute or self.is_prismatic


MODULES: Mapping[JointType, Module] = MappingProxyType(
    {
        "R": Module((("revolute", "x"),), "roll, about local x"),
        "P": Module((("revolute", "y"),), "pitch, about local y"),
        "Y": Module((("revolute", "z"),), "yaw, about local z, along the link"),
        "O": Module((("revolute", "x"), ("revolute", "y")), "orthogonal, roll and then pitch at one place"),
        "X": Module((("prismatic", "x"),), "slide along local x"),
        "T": Module((("prismatic", "y"),), "transverse slide, along local y"),
        "S": Module((("prismatic", "z"),), "slide along local z"),
        "F": Module((("fixed", "z"),), "fixed, no joint: its link is a part of the one before"),
    }
)
JOINT_DESCRIPTIONS: Mapping[JointType, str] = {letter: module.description for letter, module in MODULES.items()}

DIRECTIONS: Mapping[Direction, Vector] = MappingProxyType(
    {
        "+x": (1.0, 0.0, 0.0),
        "-x": (-1.0, 0.0, 0.0),
        "+y": (0.0, 1.0, 0.0),
        "-y": (0.0, -1.0, 0.0),
        "+z": (0.0, 0.0, 1.0),
        "-z": (0.0, 0.0, -1.0),
    }
)

# World directions of the base's x, y and z axes. All frames of the arm stay parallel to the world frame: if the base
# turns an axis around, the joint rotates about the world axis with the opposite sign.
MOUNTS: Mapping[Mount, tuple[Direction, Direction, Direction]] = MappingProxyType(
    {
        "floor": ("+x", "+y", "+z"),
        "ceiling": ("+x", "-y", "-z"),
        "wall+x": ("-z", "+y", "+x"),
        "wall-x": ("+z", "+y", "-x"),
        "wall+y": ("+x", "-z", "+y"),
        "wall-y": ("+x", "+z", "-y"),
    }
)
# (mounts, 3) the world axis that each axis of the base lies along, and 1 if it points the same way, else -1
WORLD_AXES = np.array([["xyz".index(world[1]) for world in row] for row in MOUNTS.values()])
SIGNS = np.array([[1.0 if world[0] == "+" else -1.0 for world in row] for row in MOUNTS.values()])
MOUNT_DESCRIPTIONS: Mapping[Mount, str] = {
    "floor": "stands on a floor, local z up",
    "ceiling": "hangs from a ceiling, local z down",
    **{mount: f"on a wall, local z along world {up}" for mount, (_, _, up) in MOUNTS.items() if up[1] != "z"},
}


def mounted_vector(vector: Vector, mount: Mount) -> Vector:
    """Return a vector of the base frame in world axes."""
    row, rotated = tuple(MOUNTS).index(mount), np.zeros(3)
    rotated[WORLD_AXES[row]] = SIGNS[row] * vector
    return as_vector(rotated)


def mounted_body(body: MotorBody, mount: Mount) -> MotorBody:
    """Return a motor body of the base frame in world axes."""
    (x, y, z), (u, v, w) = mounted_vector(body.size, mount), mounted_vector(body.centre, mount)
    axis = AXES[int(WORLD_AXES[tuple(MOUNTS).index(mount), AXES.index(body.axis)])]
    return MotorBody(body.shape, axis, (abs(x), abs(y), abs(z)), (u + 0.0, v + 0.0, w + 0.0))  # no -0.0
