"""Problems evaluated by simple formulas, equal on every machine, and their histories."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.kinematics.contact.clearance import clearances
from armwright.kinematics.cycle.cycle_path import CyclePaths
from armwright.pareto import default_reference_point
from armwright.problem.arm_quantities import position_error
from armwright.problem.evaluation import Evaluation
from armwright.problem.objective import Objective
from armwright.problem.objectives import PAPER_OBJECTIVES
from armwright.problem.outcomes import Outcomes
from armwright.problem.problem import Problem
from armwright.runs.history import History
from armwright.runs.trial import FinishedTrial
from armwright.spaces.design_space import DesignSpace, paper_space
from armwright.spaces.parameters import Design
from armwright.tasks.motions import CyclePlan
from armwright.tasks.task import Task
from armwright.tasks.workspace import sample_regions


class FixedProblem(Problem):
    """The tip comes a part of the way to each target; joint j turns by j steps; torques fall from base to tip."""

    def physics(
        self, designs: Sequence[Design] | Array | ArmArrays, case: int = 0, entry: Array | None = None
    ) -> Evaluation:
        if case > 0 or isinstance(designs, ArmArrays):
            return super().physics(designs, case, entry)
        rows = designs if isinstance(designs, np.ndarray) else self.space.matrix(designs)
        targets = self.task.target_positions
        built = self.space.designs(rows)
        n, t, d = len(built), len(targets), self.space.max_joints
        reach = np.array([sum(design.links) for design in built])
        base = np.array([design.origin for design in built]).reshape(n, 3)
        away = targets[None] - base[:, None]  # (N, T, 3)
        distance = np.linalg.norm(away, axis=-1)
        part = np.minimum(1.0, reach[:, None] / np.maximum(distance, 1e-9))
        reached = base[:, None] + part[..., None] * away
        lower, upper = self.space.joint_range
        steps = 0.4 * np.arange(1, d + 1) * (1 + np.arange(t)[:, None] % 3) - 1.5  # (T, D)
        q = np.broadcast_to(np.clip(steps, lower, upper), (n, t, d)).copy()
        mass = self.space.max_joints * self.space.heaviest_link
        lever = np.hypot(away[..., 0], away[..., 1])[..., None] * reach[:, None, None]
        torques = 9.81 * mass * lever / (1.0 + np.arange(d)) ** 2 * np.where(np.arange(d) % 2, -1.0, 1.0)
        arms = self.arms(rows)
        error = np.linalg.norm(reached - targets, axis=-1)
        angle = np.zeros_like(error)
        evaluation = Evaluation(
            **vars(self.scenes[0]),
            arms=arms,
            q=q,
            reached=reached,
            position_error=error,
            angle_error=angle,
            joint_torques=torques,
        )
        if evaluation.plan is not None:
            evaluation = replace(evaluation, cycle_paths=_fixed_paths(evaluation, evaluation.plan))
        ways = np.linalg.norm(sample_regions(self.task.workspace) - base[:, None], axis=-1)
        vars(evaluation)["workspace_error"] = np.maximum(0.0, ways - reach[:, None])
        return evaluation

    def _worst_case(self, matrix: Array, measured: Mapping[str, Array]) -> Outcomes:
        return self.outcomes(self.physics(matrix), measured)


def _fixed_paths(evaluation: Evaluation, plan: CyclePlan) -> CyclePaths:
    """Along a motion to a target, all is as at that target, but for a bow of the tip."""
    targets = [plan.targets[motion.step] for motion in plan.motions]
    error = evaluation.position_error[:, targets] + 0.025
    near = clearances(evaluation.arms, evaluation.q, evaluation.obstacles, rules=evaluation.tip_rules)
    own, free = (each[:, targets] for each in near)
    nothing = np.zeros(error.shape)
    worst, entry = np.zeros((*error.shape, 3)), evaluation.q[:, [block.entry for block in plan.blocks]]
    off = np.zeros(len(error), dtype=bool)
    return CyclePaths(plan, entry, (), error, nothing, own, free, nothing, nothing > 0.0, worst, off)


LENGTH = Objective(
    name="length",
    label="Length",
    unit="m",
    symbol="E_length",
    description="the distance of the tip from the world's origin, which stands for the room that the arm takes",
    each=lambda evaluation: np.linalg.norm(evaluation.reached, axis=-1),
)


ONE_OBJECTIVE = (position_error,)
THREE_OBJECTIVES = (*PAPER_OBJECTIVES, LENGTH)


def fixed_history(problem: Problem, n: int = 14, n_init: int = 10, proposals: Sequence[FinishedTrial] = ()) -> History:
    """`n` designs at random, then the given proposals (their numbers and values are filled in)."""
    designs = [*problem.space.sample(n, seed=1), *(trial.design for trial in proposals)]
    outcomes = problem.evaluate(designs)
    values, violations = outcomes.values, outcomes.violations
    reference = problem.reference_point
    if reference is None and len(designs) >= n_init and values.shape[1] == 2:
        reference = default_reference_point(values[:n_init])
    trials = [
        FinishedTrial(
            number,
            "random" if number < n_init else "bbo",
            design,
            tuple(row),
            violations=tuple(violations[number].tolist()),
        )
        for number, (design, row) in enumerate(zip(designs, values.tolist(), strict=True))
    ]
    for place, trial in enumerate(proposals, start=n):
        trials[place] = replace(
            trials[place],
            source="llm",
            proposal=f"llm-{place:04d}",
            reason=trial.reason,
        )
    return History(problem, trials, n_init, reference)


def proposal(design: Design, reason: str = "") -> FinishedTrial:
    return FinishedTrial(0, "llm", design, (), reason=reason)


SIX_AXIS = DesignSpace(
    name="six-axis",
    joints=6,
    joint_types=("Y", "P"),
    joint_range=(-2.8, 2.0),
    origin_x=(-0.25, 0.75),
    origin_y=(0.0, 0.0),
    origin_z=(0.125, 0.125),
    link=(0.05, 0.4),
    link_section={"tubes": [[0.03, 0.002]], "material": {"density": 2700, "youngs": 70e9, "shear": 27e9}},  # type: ignore[arg-type]
)
ONE_JOINT = paper_space(1).model_copy(update={"joint_types": ("P",), "link": (0.2, 0.2)})
SMALL = paper_space(2).model_copy(
    update={"link": (0.0005, 0.004), "origin_x": (-0.001, 0.001), "origin_y": (-0.001, 0.001), "origin_z": (0, 1 / 3)}
)


def grid_task(n: int, name: str = "grid", **more: object) -> Task:
    """`n` points in rows of ten, without a reference point unless one is given."""
    points = tuple((0.3 + 0.02 * (i % 10), 0.05 * (i // 10), 0.4 + 0.01 * (i % 7)) for i in range(n))
    return Task(name=name, targets=points, **more)  # type: ignore[arg-type]
