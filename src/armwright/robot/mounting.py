"""Where an existing arm stands: its base link moved, and turned about the vertical."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import SettingsError
from armwright.robot.arm import Arm, Link, Tensor
from armwright.robot.axes import Vector, as_vector, axis_along
from armwright.robot.urdf_reader import UrdfArm
from armwright.rotations import rotation_about


@dataclass(frozen=True, slots=True)
class Mounting:
    """The pose of a base link."""

    position: Vector = (0.0, 0.0, 0.0)  # origin [m]
    yaw: float = 0.0  # turn about the vertical axis through its origin [rad]

    @classmethod
    def of(cls, numbers: Sequence[float]) -> Self:
        """Return the mounting of x, y, z [m] and perhaps a yaw [rad]; SettingsError for other numbers."""
        if len(numbers) not in (3, 4) or not all(map(math.isfinite, numbers)):
            raise SettingsError(f"expected three finite numbers for the base [m], or four with its yaw, got {numbers}")
        x, y, z, *yaw = map(float, numbers)
        return cls((x, y, z), *yaw)

    @property
    def description(self) -> str:
        """The pose in words."""
        point = ", ".join(f"{value:.4g}" for value in self.position)
        turned = f", turned by {math.degrees(self.yaw):.3g}°" if self.yaw else ""
        return f"base at ({point}) m{turned}"


def needs_turning(arm: Arm) -> bool:
    """Return True if a turn of the base changes what the arm reaches: its first joint makes no full vertical turn."""
    first = arm.joints[0]
    return first.kind != "revolute" or abs(first.direction[2]) < 1.0 or first.upper - first.lower < math.tau


def mounted(described: UrdfArm, mounting: Mounting) -> UrdfArm:
    """Return an arm whose base link was at the origin with the base link elsewhere."""
    arm = described.arm
    if mounting.yaw:
        arm = turned(arm, rotation_about(np.array([0.0, 0.0, 1.0]), mounting.yaw))
    x, y, z = (at + shift for at, shift in zip(arm.base, mounting.position, strict=True))
    return replace(described, arm=replace(arm, base=(x, y, z)))


def turned(arm: Arm, rotation: Array) -> Arm:
    """Return an arm turned about the origin with its base, its joint values unchanged; rotation: (3, 3)."""

    def vector(v: Vector) -> Vector:
        return as_vector(rotation @ v)

    def tensor(rows: Tensor) -> Tensor:
        x, y, z = map(as_vector, rotation @ rows @ rotation.T)
        return x, y, z

    def link(each: Link) -> Link:
        turns = {name: vector(getattr(each, name)) for name in ("offset", "com", "end_shift")}
        return replace(each, **turns, end_inertia=tensor(each.end_inertia))

    tool = {name: vector(getattr(arm.tool, name)) for name in ("tip", "axis", "side", "com")}
    return replace(
        arm,
        base=vector(arm.base),
        joints=tuple(replace(joint, axis=axis_along(vector(joint.direction))) for joint in arm.joints),
        links=tuple(map(link, arm.links)),
        tool=replace(arm.tool, **tool, inertia=tensor(arm.tool.inertia)),
    )
