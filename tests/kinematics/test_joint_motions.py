"""Joint motions between the targets of a cycle."""

import numpy as np

from armwright.kinematics.cycle.cycle_choice import MAX_STEP
from armwright.problem.problem import Problem
from armwright.spaces.design_space import paper_space
from armwright.tasks.task import Task

TARGETS = ((0.4, 0.0, 0.3), (-0.4, 0.1, 0.2), (0.0, -0.4, 0.5))


def test_long_joint_motions_are_sampled_finely_and_never_jump() -> None:
    task = Task.model_validate(
        {"name": "far", "targets": TARGETS, "cycle": {"time": 1.0, "steps": [{"to": 1}, {"to": 2}, {"to": 3}]}}
    )
    problem = Problem(task, paper_space(joints=5))
    evaluation = problem.physics(problem.space.sample(50, seed=0))
    reached = ~evaluation.unreached.any(axis=1)
    paths = evaluation.paths
    ends = np.concatenate([path.q[:, [0, -1]] for group in paths.groups for path in group.paths])
    assert np.abs(np.diff(ends, axis=1)).max() > 16 * MAX_STEP  # more than the first samples can divide
    assert not paths.jumps.any()
    assert 0 < reached.sum() < 50
    for group in paths.groups:  # arms that miss their targets are not refined
        steps = np.max([path.largest_steps.max(axis=1) for path in group.paths], axis=0)
        assert (steps[reached[group.index]] <= MAX_STEP + 1e-9).all()
