"""The problem: a design space, a task, and what is minimised."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from armwright.arm import Arm
from armwright.arrays import Array
from armwright.batch_builder import stack_designs
from armwright.constraints import Constraint, read_constraints
from armwright.evaluation import Evaluation, evaluate_arrays
from armwright.exceptions import EvaluatorError, SettingsError, TaskError
from armwright.feasibility import ranked
from armwright.kinematics.arm_arrays import ArmArrays
from armwright.kinematics.devices import Device, resolve_device
from armwright.measuring import Evaluator
from armwright.objectives import (
    OF_CLEARANCE,
    OF_MOVES,
    OF_ORIENTATION,
    OF_TIME,
    ORIENTATION_ERROR,
    PAPER_OBJECTIVES,
    UNCOVERED_FRACTION,
    Objective,
    named_objectives,
)  # fmt: skip
from armwright.parameters import Design
from armwright.space import DesignSpace, paper_space
from armwright.task import Task
from armwright.tolerance import moved

NOTHING_MEASURED: Mapping[str, Array] = {}
POSTURES_AT_ONCE: dict[Device, int] = {"cpu": 2**17, "cuda": 2**20}  # arms x targets; enough to keep a device busy


@dataclass(frozen=True)
class Judgement:
    """What one design comes to.

    values: its objectives.  constraints: how far it breaks each, <= 0: not at all.
    failure: why its evaluator gave no values, so that it counts the worst; empty where it gave some.
    """

    values: tuple[float, ...]
    constraints: tuple[float, ...]
    failure: str = ""


@dataclass(frozen=True)
class Problem:
    """Which arm of `space` serves `task` best, by position error and torque.

    tolerance: [m] of a workshop; above 0, a design counts by the worst that comes of it, in each objective, when it is
        built exactly or with its base or one link off by so much (`armwright.tolerance`).
    device: where arms are evaluated; `resolve_device` says which there are.
    objectives: what is minimised, of one's own too; without them, the task's, else the paper's, and the orientation
        error where a target says which way the tool points.
    evaluator: a function of one's own that measures objectives in place of ours (`armwright.measuring`).
    constraints: what a design has to keep, as the task says it.

    Examples:
        >>> import armwright as aw
        >>> problem = aw.Problem(aw.load_task("target-1"), aw.paper_space(joints=4))
        >>> [objective.name for objective in problem.objectives]
        ['position_error', 'torque']
        >>> designs = problem.space.sample(1000, seed=0)
        >>> problem.evaluate(designs).shape
        (1000, 2)
    """

    task: Task
    space: DesignSpace = field(default_factory=paper_space)
    tolerance: float = 0.0
    device: Device = "cpu"
    objectives: tuple[Objective, ...] = ()
    evaluator: Evaluator | None = None
    constraints: tuple[Constraint, ...] = field(default=(), init=False)

    def __post_init__(self) -> None:
        """Settles device, objectives and constraints.

        TaskError where the task's reference point is for other objectives, or a constraint cannot be understood.
        """
        object.__setattr__(self, "constraints", read_constraints(self.task.constraints))
        if not self.objectives:
            names = self.task.objectives
            usual = (*PAPER_OBJECTIVES, ORIENTATION_ERROR) if self.task.goals.oriented else PAPER_OBJECTIVES
            if self.evaluator is not None:
                usual = self.evaluator.objectives
            object.__setattr__(self, "objectives", usual if names is None else named_objectives(names))
        if self.evaluator is not None and self.tolerance > 0.0:
            raise SettingsError(
                f"a tolerance does not go with the evaluator {self.evaluator.name}, which measures an arm as it is"
            )
        for objective in self.objectives:
            if objective in OF_ORIENTATION and not self.task.goals.oriented:
                raise SettingsError(
                    f"objective {objective.name} would be 0 for every design: no target of task {self.task.name} has "
                    "an axis or an orientation. Give one to a target, or take another objective"
                )
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

    def counts(self, quantity: Objective) -> bool:
        """Whether it is an objective, or bounded by a constraint."""
        counted = {o.name for o in self.objectives} | {constraint.quantity.name for constraint in self.constraints}
        return quantity.name in counted

    @property
    def heeds_clearance(self) -> bool:
        """Whether it counts where the arm is in an obstacle or in itself."""
        return any(map(self.counts, OF_CLEARANCE))

    @property
    def heeds_moves(self) -> bool:
        """Whether it counts what the arm does on its moves."""
        return any(map(self.counts, OF_MOVES))

    @property
    def heeds_time(self) -> bool:
        """Whether it counts how fast the moves are."""
        return any(map(self.counts, OF_TIME))

    @property
    def heeds_workspace(self) -> bool:
        """Whether it counts how much of the workspace is covered."""
        return self.counts(UNCOVERED_FRACTION)

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
        return self.evaluate_arrays(stack_designs(self.space, rows))

    def evaluate_arrays(self, arms: ArmArrays, start: Array | None = None) -> Evaluation:
        """The physics of N arms at all targets, with their payloads; start: as of `evaluate_arrays`."""
        return self._of_case(arms, *self.task.cases[0], start)

    def _of_case(self, arms: ArmArrays, points: Array, payloads: Array, start: Array | None = None) -> Evaluation:
        task = self.task
        known = (payloads, task.obstacles, task.goals, task.lines, task.workspace)
        return evaluate_arrays(arms, points, self.device, start, *known)

    def _judged_rows(self, rows: Array, measured: Mapping[str, Array] = NOTHING_MEASURED) -> Array:
        """(n, M + C) of designs as rows: the worst, in each by itself, of the cases that the task may come to.

        measured: (n,) of each objective that an evaluator measures.
        """
        worst, others = self.judged(self.evaluation_of_rows(rows), measured), self.task.cases[1:]
        arms = stack_designs(self.space, rows) if others else None
        for case in others:
            assert arms is not None
            worst = np.maximum(worst, self.judged(self._of_case(arms, *case), measured))
        return worst

    def evaluate_matrix(self, matrix: Array) -> Array:
        """(N, M) as `evaluate`, for designs as rows (`DesignSpace.matrix`): the way for a great many."""
        return self.judge_matrix(matrix)[0]

    def judge_matrix(self, matrix: Array) -> tuple[Array, Array]:
        """(N, M) and (N, C) as `judge`, for designs as rows.

        Only the postures of a chunk of them are in memory at a time.
        """
        matrix = self.space.settled(matrix)
        size = max(1, POSTURES_AT_ONCE[self.device] // self._postures)
        found = np.empty((len(matrix), len(self.objectives) + len(self.constraints)))
        for first in range(0, len(matrix), size):
            rows = slice(first, first + size)
            found[rows] = self._judged_rows(matrix[rows])
            if self.tolerance > 0.0:
                for copies in moved(self.space, matrix[rows], self.tolerance):
                    found[rows] = np.maximum(found[rows], self._judged_rows(copies))
        return self.split(found)

    def ranked_matrix(self, matrix: Array) -> Array:
        """(N, M) of designs as rows: their objectives, or for infeasible ones numbers that lie behind all of these.

        What a search compares designs by, where it knows nothing of constraints.
        """
        values, broken = self.judge_matrix(matrix)
        return ranked(values, broken) if self.constraints else values

    def values(self, evaluation: Evaluation, measured: Mapping[str, Array] = NOTHING_MEASURED) -> Array:
        """(N, M): the objectives of evaluated designs, minimised; SettingsError where one is not a finite number.

        measured: (N,) of each objective that an evaluator measures.
        """
        values = np.column_stack([measured[o.name] if o.name in measured else o(evaluation) for o in self.objectives])
        if not np.all(np.isfinite(values)):
            row, column = np.argwhere(~np.isfinite(values))[0]
            raise SettingsError(
                f"objective {self.objectives[column].name} of a design is {values[row, column]}; it must be a finite "
                "number for every design, a large one for a bad design"
            )
        return values

    def judged(self, evaluation: Evaluation, measured: Mapping[str, Array] = NOTHING_MEASURED) -> Array:
        """(N, M + C): the objectives of evaluated designs, then how far each constraint is broken."""
        values = self.values(evaluation, measured)
        if not self.constraints:
            return values
        broken = np.column_stack([constraint(evaluation) for constraint in self.constraints])
        if not np.all(np.isfinite(broken)):
            row, column = np.argwhere(~np.isfinite(broken))[0]
            raise SettingsError(
                f'constraint "{self.constraints[column].words}" is {broken[row, column]} for a design; it must be a '
                "finite number for every design"
            )
        return np.hstack([values, broken])

    def split(self, judged: Array) -> tuple[Array, Array]:
        """(N, M) and (N, C): the objectives and the constraints of `judged`."""
        return judged[:, : len(self.objectives)], judged[:, len(self.objectives) :]

    def judge(self, designs: Sequence[Design]) -> tuple[Array, Array]:
        """(N, M) and (N, C): the objectives of N designs, and how far they break each constraint, <= 0: not at all.

        With a tolerance, or other cases of the task, the worst of each by itself.
        """
        rows = self.space.matrix(designs)
        found = self._judged_rows(rows, self._measured([self._measurement(design)[0] for design in designs]))
        if self.tolerance > 0.0:
            for copies in moved(self.space, rows, self.tolerance):
                found = np.maximum(found, self._judged_rows(copies))
        return self.split(found)

    def judge_one(self, design: Design) -> Judgement:
        """What one design comes to; EvaluatorError where its evaluator fails and has no `worst`."""
        if self.evaluator is None:
            values, broken = self.judge([design])
            return Judgement(tuple(values[0].tolist()), tuple(broken[0].tolist()))
        measured, failure = self._measurement(design)
        values, broken = self.split(self._judged_rows(self.space.matrix([design]), self._measured([measured])))
        return Judgement(tuple(values[0].tolist()), tuple(broken[0].tolist()), failure)

    def _measurement(self, design: Design) -> tuple[tuple[float, ...], str]:
        """What the evaluator, where there is one, measures of a design, and why it could not."""
        if self.evaluator is None:
            return (), ""
        try:
            return self.evaluator(self.arm(design), self.task), ""
        except EvaluatorError as failure:
            if self.evaluator.worst is None:
                raise
            return self.evaluator.worst, str(failure)

    def _measured(self, rows: Sequence[Sequence[float]]) -> Mapping[str, Array]:
        """The evaluator's numbers of N designs by objective."""
        if self.evaluator is None:
            return NOTHING_MEASURED
        names = [objective.name for objective in self.evaluator.objectives]
        table = np.array(rows, dtype=np.float64).reshape(len(rows), len(names))
        return {name: table[:, column] for column, name in enumerate(names)}

    def evaluate(self, designs: Sequence[Design]) -> Array:
        """(N, M): the objectives of N designs, minimised; of the paper: position error [m], torque [α-scaled]."""
        return self.judge(designs)[0]
