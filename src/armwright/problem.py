"""The problem: a design space, a task, and what is minimised."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from armwright.arm import Arm
from armwright.evaluation import Array, Evaluation, evaluate, evaluate_arrays
from armwright.exceptions import TaskError
from armwright.kinematics.arrays import arrays_of
from armwright.objectives import PAPER_OBJECTIVES, Objective
from armwright.space import Design, DesignSpace, paper_space
from armwright.task import Task


@dataclass(frozen=True)
class Problem:
    """Which arm of `space` serves `task` best, by position error and torque."""

    task: Task
    space: DesignSpace = field(default_factory=paper_space)
    objectives: ClassVar[tuple[Objective, ...]] = PAPER_OBJECTIVES

    def __post_init__(self) -> None:
        """TaskError where the task's reference point is for other objectives."""
        point, names = self.reference_point, [objective.name for objective in self.objectives]
        if point is not None and len(point) != len(names):
            given = ", ".join(f"{value:g}" for value in point)
            raise TaskError(
                f"task {self.task.name} has a reference_point of {len(point)} values ({given}); the problem minimises "
                f"{len(names)}: {', '.join(names)}. Give one value each, or none: then it is found from the first "
                "random trials"
            )

    @property
    def reference_point(self) -> tuple[float, ...] | None:
        """The worst values that count for the hypervolume, where the task states them."""
        return self.task.reference_point

    def arm(self, design: Design) -> Arm:
        """The physical chain that a design builds."""
        return self.space.arm(design)

    def evaluation(self, designs: Sequence[Design]) -> Evaluation:
        """The physics of N designs at all targets."""
        return evaluate([self.arm(design) for design in designs], self.task.points)

    def evaluate_matrix(self, matrix: Array) -> Array:
        """(N, M) as `evaluate`, for designs as rows (`DesignSpace.matrix`): the way for a great many."""
        return self.values(evaluate_arrays(arrays_of(self.space, matrix), self.task.points))

    def values(self, evaluation: Evaluation) -> Array:
        """(N, M): objectives of evaluated designs, minimised; of the paper: position error [m], torque [α-scaled]."""
        return np.column_stack([objective(evaluation) for objective in self.objectives])

    def evaluate(self, designs: Sequence[Design]) -> Array:
        """(N, M): the objectives of N designs, minimised; of the paper: position error [m], torque [α-scaled]."""
        return self.values(self.evaluation(designs))
