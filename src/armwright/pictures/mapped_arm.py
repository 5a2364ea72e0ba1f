"""An arm whose reach is mapped, with what is around it."""

from collections.abc import Sequence
from dataclasses import dataclass

from armwright.arrays import Array
from armwright.robot.arm import Arm
from armwright.tasks.obstacles import Obstacle
from armwright.tasks.task import Task


@dataclass(frozen=True)
class MappedArm:
    """An arm whose reach is mapped, and the task around it."""

    title: str
    arm: Arm
    task: Task | None = None  # whose obstacles and targets are drawn
    conditions: str = ""  # that usable poses satisfy, in words
    read: str = ""  # the tip and the joints that were read from a URDF; empty for a design

    @property
    def targets(self) -> Array | None:
        """(T, 3) targets [m]; the horizontal slice is at their mean height."""
        return None if self.task is None else self.task.target_positions

    @property
    def obstacles(self) -> Sequence[Obstacle]:
        """The obstacles of the task."""
        return () if self.task is None else self.task.obstacles
