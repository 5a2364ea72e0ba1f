"""Bounds and estimates of outcomes, from which a search decides which designs to evaluate."""

import math

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.problem.arm_quantities import joints, length, mass, position_error, unreached_targets, worst_error
from armwright.problem.drive_quantities import price, voltages
from armwright.problem.evaluation import Evaluation, evaluate_arrays
from armwright.problem.objectives import OBJECTIVES
from armwright.problem.outcomes import Outcomes, joined, worst_case
from armwright.problem.problem import Problem
from armwright.problem.scene import Scene

EXACT = (price, mass, length, joints, voltages)  # quantities that an arm has without moving
OF_REACH = (position_error, worst_error, unreached_targets)  # at least what the distance beyond reach implies
ROUNDING = 1e-5  # of a distance relative to the reach, from single precision
AT_ONCE = 500  # designs that are estimated at once: below MANY_ARMS, so that no other kernels are loaded


def lower_bounds(problem: Problem, matrix: Array) -> Outcomes:
    """Return outcomes that no evaluation of the designs (N, P) can fall below.

    Price, mass, length, joints and voltages are exact, and the tip is off a target by at least its distance beyond
    reach. Other objectives are bounded by 0, custom ones and other constraints by nothing.
    """
    evaluation = motionless(problem.scenes[0], problem.arms(problem.space.normalised(matrix)))
    values = np.zeros((len(matrix), len(problem.objectives)))
    for column, objective in enumerate(problem.objectives):
        if objective in (*EXACT, *OF_REACH):
            values[:, column] = objective.minimised(evaluation)
        elif OBJECTIVES.get(objective.name) != objective:
            values[:, column] = -math.inf
    violations = np.full((len(matrix), len(problem.constraints)), -math.inf)
    for column, constraint in enumerate(problem.constraints):
        if constraint.quantity in EXACT or (constraint.quantity in OF_REACH and constraint.relation == "<="):
            violations[:, column] = constraint(evaluation)
    return Outcomes(values, violations)


def estimates(problem: Problem, matrix: Array, near: Array) -> Outcomes:
    """Estimate the outcomes of designs (N, P) by rough paths through the cycle, in each case, without tolerances.

    They start near the postures `near` (N, C, B, D) at the first pose of each block, such as those of similar designs.
    """
    matrix = problem.space.normalised(matrix)
    parts: list[Outcomes] = []
    for first in range(0, len(matrix), AT_ONCE):
        rows = slice(first, first + AT_ONCE)
        arms = problem.arms(matrix[rows])
        rough = (
            evaluate_arrays(arms, scene, problem.device, roughly_near=near[rows, case])
            for case, scene in enumerate(problem.scenes)
        )
        parts.append(worst_case(map(problem.outcomes, rough)))
    return joined(parts)


def motionless(scene: Scene, arms: ArmArrays) -> Evaluation:
    """Return an evaluation of arms that are off each target by its distance beyond their reach."""
    n, t = len(arms), len(scene.targets)
    strokes = np.where(arms.prismatic, np.maximum(np.abs(arms.lower), np.abs(arms.upper)), 0.0)
    reach = np.linalg.norm(arms.offset, axis=2).sum(axis=1) + strokes.sum(axis=1)
    distance = np.linalg.norm(scene.targets - arms.base[:, None], axis=2)
    return Evaluation(
        **vars(scene),
        arms=arms,
        q=np.zeros((n, t, arms.dof)),
        reached=np.zeros((n, t, 3)),
        position_error=np.maximum(0.0, distance * (1.0 - ROUNDING) - reach[:, None] * (1.0 + ROUNDING)),
        angle_error=np.zeros((n, t)),
        joint_torques=np.zeros((n, t, arms.dof)),
    )
