"""The problem: a design space, a task, and what is minimised."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from armwright.arm import Arm
from armwright.evaluation import Array, Evaluation, evaluate, evaluate_arrays
from armwright.kinematics.arrays import arrays_of
from armwright.kinematics.devices import Device, resolve_device
from armwright.objectives import PAPER_OBJECTIVES, Objective
from armwright.space import Design, DesignSpace, paper_space
from armwright.task import Task

POSTURES_AT_ONCE: dict[Device, int] = {"cpu": 2**17, "cuda": 2**20}  # arms x targets; enough to keep a device busy


@dataclass(frozen=True)
class Problem:
    """Which arm of `space` serves `task` best, by position error and torque.

    device: where arms are evaluated; `resolve_device` says which there are.
    """

    task: Task
    space: DesignSpace = field(default_factory=paper_space)
    device: Device = "cpu"
    objectives: ClassVar[tuple[Objective, ...]] = PAPER_OBJECTIVES

    @property
    def reference_point(self) -> tuple[float, float] | None:
        """The worst values that count for the hypervolume, where the task states them."""
        return self.task.reference_point

    def arm(self, design: Design) -> Arm:
        """The physical chain that a design builds."""
        return self.space.arm(design)

    def evaluation(self, designs: Sequence[Design]) -> Evaluation:
        """The physics of N designs at all targets."""
        return evaluate([self.arm(design) for design in designs], self.task.points, self.device)

    def evaluate_matrix(self, matrix: Array) -> Array:
        """(N, 2) as `evaluate`, for designs as rows (`DesignSpace.matrix`): the way for a great many.

        Only the postures of a chunk of them are in memory at a time.
        """
        size = max(1, POSTURES_AT_ONCE[resolve_device(self.device, many=True)] // len(self.task.points))
        values = np.empty((len(matrix), len(self.objectives)))
        for first in range(0, len(matrix), size):
            rows = slice(first, first + size)
            arrays = arrays_of(self.space, matrix[rows])
            values[rows] = self.values(evaluate_arrays(arrays, self.task.points, self.device))
        return values

    def values(self, evaluation: Evaluation) -> Array:
        """(N, 2): position error [m] and torque [α-scaled] of evaluated designs; minimised."""
        return np.column_stack([objective(evaluation) for objective in self.objectives])

    def evaluate(self, designs: Sequence[Design]) -> Array:
        """(N, 2): position error [m] and torque [α-scaled] of N designs; minimised."""
        return self.values(self.evaluation(designs))
