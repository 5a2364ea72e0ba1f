"""Where an existing arm stands: its base link moved, and turned about the vertical.

Frames of an `Arm` are parallel to the world frame with all joints at 0, so the base cannot be turned by itself. If the
first joint is vertical, a turn of the base is a shift of that joint's limits. Of a joint that makes more than a full
turn, what is then beyond ±2π is not used.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from armwright.exceptions import SettingsError
from armwright.robot.arm import Arm, Vector
from armwright.robot.urdf_reader import MAX_ANGLE, UrdfArm


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


def can_turn(arm: Arm) -> bool:
    """Return True if the first joint is vertical and revolute, so that the base can be turned."""
    first = arm.joints[0]
    return first.kind == "revolute" and first.axis == "z"


def needs_turning(arm: Arm) -> bool:
    """Return True if a turn of the base changes what the arm reaches: its first joint makes no full turn."""
    return can_turn(arm) and arm.joints[0].upper - arm.joints[0].lower < math.tau


def mounted(described: UrdfArm, mounting: Mounting) -> UrdfArm:
    """Return an arm whose base link was at the origin with the base link elsewhere.

    Raises:
        SettingsError: If a yaw is given and the first joint is not vertical.
    """
    arm, yaw = described.arm, mounting.yaw
    x, y, z = arm.base
    if yaw != 0.0:
        if not can_turn(arm):
            raise SettingsError(
                f"base turned by {math.degrees(yaw):g}°: expected an arm whose first joint turns about the vertical, "
                f'which "{described.joints[0]}" of {described.name} does not; leave the turn out'
            )
        first = arm.joints[0]
        middle = (first.lower + first.upper) / 2.0
        shift = math.remainder(middle + yaw, math.tau) - middle  # the joint's range stays around 0
        lower, upper = max(first.lower + shift, -MAX_ANGLE), min(first.upper + shift, MAX_ANGLE)
        arm = replace(arm, joints=(replace(first, lower=lower, upper=upper), *arm.joints[1:]))
        zero = described.zeros[0] - described.signs[0] * shift
        notes = described.notes
        if upper - lower < first.upper - first.lower:
            notes = (*notes, f"not the whole range of {described.joints[0]} is used, because the base is turned")
        described = replace(described, zeros=(zero, *described.zeros[1:]), notes=notes)
        cos, sin = math.cos(yaw), math.sin(yaw)
        x, y = cos * x - sin * y, sin * x + cos * y
    across, along, up = mounting.position
    return replace(described, arm=replace(arm, base=(x + across, y + along, z + up)))
