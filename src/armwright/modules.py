"""The joint modules that a design is put together from, and where an arm can stand.

A design says its joints as a word, a letter for each module: `YPRP`. Letters R, P, Y, O, S and F are those of
Kawaharazuka et al. (arXiv:2409.20038).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from armwright.arm import AXES, Axis, JointKind, Vector

JointType = Literal["R", "P", "Y", "O", "X", "T", "S", "F"]
Direction = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Mount = Literal["floor", "ceiling", "wall+x", "wall-x", "wall+y", "wall-y"]


@dataclass(frozen=True, slots=True)
class Module:
    """Joints at one place, of which the last moves the link that follows.

    joints: kind and local axis of each.  words: for a reader who knows nothing of this program.
    """

    joints: tuple[tuple[JointKind, Axis], ...]
    words: str

    @property
    def turns(self) -> bool:
        return self.joints[0][0] == "revolute"

    @property
    def slides(self) -> bool:
        return self.joints[0][0] == "prismatic"

    @property
    def moves(self) -> bool:
        """Whether it needs an actuator for each of its joints."""
        return self.turns or self.slides


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
JOINT_WORDS: Mapping[JointType, str] = {letter: module.words for letter, module in MODULES.items()}

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

# Where the base's own x, y and z point to in the world. The arm's frames are parallel to the world's all the same: an
# axis about which the base turns one way is the world's own, turned the other way.
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
MOUNT_WORDS: Mapping[Mount, str] = {
    "floor": "stands on a floor, local z up",
    "ceiling": "hangs from a ceiling, local z down",
    "wall+x": "on a wall, local z along world +x",
    "wall-x": "on a wall, local z along world -x",
    "wall+y": "on a wall, local z along world +y",
    "wall-y": "on a wall, local z along world -y",
}


def mounted(axis: Axis, mount: Mount) -> tuple[Axis, float]:
    """The world's axis that the base's own `axis` lies along, and 1 where they point the same way, else -1."""
    sign, world = MOUNTS[mount][AXES.index(axis)]
    return AXES[AXES.index(world)], 1.0 if sign == "+" else -1.0  # pyright: ignore[reportArgumentType]


def mounted_vector(vector: Vector, mount: Mount) -> Vector:
    """A vector in the base's axes, in the world's."""
    found = [0.0, 0.0, 0.0]
    for axis, value in zip(AXES, vector, strict=True):
        world, sign = mounted(axis, mount)
        found[AXES.index(world)] = sign * value
    return found[0], found[1], found[2]
