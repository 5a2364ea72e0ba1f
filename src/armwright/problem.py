"""The problem: a design space, a task, and what is minimised."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from armwright.arm import Arm
from armwright.evaluation import Array, Evaluation, evaluate_arrays
from armwright.exceptions import SettingsError, TaskError
from armwright.kinematics.arrays import ArmArrays, arrays_of
from armwright.kinematics.devices import Device, resolve_device
from armwright.objectives import OF_CLEARANCE, OF_MOVES, PAPER_OBJECTIVES, UNREACHED, Objective, named_objectives
from armwright.parameters import Design
from armwright.space import DesignSpace, paper_space
from armwright.task import Task
from armwright.tolerance import moved

POSTURES_AT_ONCE: dict[Device, int] = {"cpu": 2**17, "cuda": 2**20}  # arms x targets; enough to keep a device busy


@dataclass(frozen=True)
class Problem:
    """Which arm of `space` serves `task` best, by position error and torque.

    tolerance: [m] of a workshop; above 0, a design counts by the worst that comes of it, in each objective, when it is
        built exactly or with its base or one link off by so much (`armwright.tolerance`).
    device: where arms are evaluated; `resolve_device` says which there are.
    objectives: what is minimised, of one's own too; without them, the task's, else the paper's.
    """

    task: Task
    space: DesignSpace = field(default_factory=paper_space)
    tolerance: float = 0.0
    device: Device = "cpu"
    objectives: tuple[Objective, ...] = ()

    def __post_init__(self) -> None:
        """Settles device and objectives; TaskError where the task's reference point is for other objectives."""
        if not self.objectives:
            names = self.task.objectives
            object.__setattr__(self, "objectives", PAPER_OBJECTIVES if names is None else named_objectives(names))
        if self.device not in POSTURES_AT_ONCE:
            object.__setattr__(self, "device", resolve_device(self.device, many=True))
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

    @property
    def heeds_clearance(self) -> bool:
        """Whether it counts where the arm is in an obstacle or in itself."""
        return any(objective in OF_CLEARANCE for objective in self.objectives)

    @property
    def heeds_moves(self) -> bool:
        """Whether it counts what the arm does on its moves."""
        return any(objective in OF_MOVES for objective in self.objectives)

    @property
    def heeds_workspace(self) -> bool:
        """Whether it counts how much of the workspace is covered."""
        return UNREACHED in self.objectives

    @property
    def _postures(self) -> int:
        """Of each arm, at most."""
        task = self.task
        return (
            len(task.points)
            + sum(task.lines.steps(task.points))
            + len(task.lines)
            + sum(r.points for r in task.workspace)
        )

    def arm(self, design: Design) -> Arm:
        """The physical chain that a design builds."""
        return self.space.arm(design)

    def evaluation(self, designs: Sequence[Design]) -> Evaluation:
        """The physics of N designs at all targets."""
        return self.evaluation_of_rows(self.space.matrix(designs))

    def evaluation_of_rows(self, rows: Array) -> Evaluation:
        """The same of designs as rows (N, P), which may lie outside the space: what is built knows no ranges."""
        return self.evaluate_arrays(arrays_of(self.space, rows))

    def evaluate_arrays(self, arms: ArmArrays, start: Array | None = None) -> Evaluation:
        """The physics of N arms at all targets, with their payloads; start: as of `evaluate_arrays`."""
        task = self.task
        known = (task.payloads, task.obstacles, task.lines, task.workspace)
        return evaluate_arrays(arms, task.points, self.device, start, *known)

    def evaluate_matrix(self, matrix: Array) -> Array:
        """(N, M) as `evaluate`, for designs as rows (`DesignSpace.matrix`): the way for a great many.

        Only the postures of a chunk of them are in memory at a time.
        """
        matrix = self.space.settled(matrix)
        size = max(1, POSTURES_AT_ONCE[self.device] // self._postures)
        values = np.empty((len(matrix), len(self.objectives)))
        for first in range(0, len(matrix), size):
            rows = slice(first, first + size)
            values[rows] = self.values(self.evaluation_of_rows(matrix[rows]))
            if self.tolerance > 0.0:
                for copies in moved(self.space, matrix[rows], self.tolerance):
                    values[rows] = np.maximum(values[rows], self.values(self.evaluation_of_rows(copies)))
        return values

    def values(self, evaluation: Evaluation) -> Array:
        """(N, M): the objectives of evaluated designs, minimised; SettingsError where one is not a finite number."""
        values = np.column_stack([objective(evaluation) for objective in self.objectives])
        if not np.all(np.isfinite(values)):
            row, column = np.argwhere(~np.isfinite(values))[0]
            raise SettingsError(
                f"objective {self.objectives[column].name} of a design is {values[row, column]}; it must be a finite "
                "number for every design, a large one for a bad design"
            )
        return values

    def evaluate(self, designs: Sequence[Design]) -> Array:
        """(N, M): the objectives of N designs, minimised; of the paper: position error [m], torque [α-scaled]."""
        values = self.values(self.evaluation(designs))
        if self.tolerance > 0.0:
            for copies in moved(self.space, self.space.matrix(designs), self.tolerance):
                values = np.maximum(values, self.values(self.evaluation_of_rows(copies)))
        return values
