"""Place an existing arm on a task: search the position of its base."""

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import SettingsError
from armwright.kinematics.arm_arrays import stack_arms
from armwright.problem.evaluation import Evaluation
from armwright.problem.objective import Objective
from armwright.problem.objectives import CLEARANCE_QUANTITIES, REACHED, TORQUE
from armwright.problem.problem import POSTURES_AT_ONCE, Problem
from armwright.robot.arm import Arm, Joint, Vector
from armwright.search.cma_es import refine
from armwright.search.encoding import DesignEncoding
from armwright.seeding import derived_seed
from armwright.spaces.parameters import FloatParameter

RANDOM_POSITIONS = 300
REFINED_POSITIONS = 4  # the best of the random ones
EVALUATIONS = 300  # to refine one position
N_POSITIONS = RANDOM_POSITIONS + REFINED_POSITIONS * EVALUATIONS


def with_travel(arm: Arm, travel: float) -> Arm:
    """Return the arm with slides geared like those of designs; their force is unchanged."""

    def geared(joint: Joint) -> Joint:
        if joint.kind != "prismatic":
            return joint
        motor = joint.actuator
        if motor is not None:
            speed = None if motor.speed is None else motor.speed / travel
            motor = replace(motor, peak_torque=motor.peak_torque * travel, speed=speed)
        return replace(joint, actuator=motor, travel=travel)

    return replace(arm, joints=tuple(map(geared, arm.joints)))


def placed_at(arm: Arm, position: Sequence[float]) -> Arm:
    """Return the arm with its base link moved from the origin to a position [m]."""
    x, y, z = (float(a + b) for a, b in zip(arm.base, position, strict=True))
    return replace(arm, base=(x, y, z))


def known_values(quantity: Objective, evaluation: Evaluation, minimised: bool = False) -> Array | None:
    """Return (N,) values of existing arms; None if their URDFs lack drives, prices, or the shape of links.

    Args:
        quantity: The quantity.
        evaluation: Physics of the arms.
        minimised: Return its value as an objective, which ignores errors below stated tolerances.
    """
    if quantity in CLEARANCE_QUANTITIES:
        return None
    try:
        return quantity.minimised(evaluation) if minimised else quantity(evaluation)
    except SettingsError:
        return None


def search_base(problem: Problem, arm: Arm, seed: int) -> Vector:
    """Return the base position with the smallest position error, then violation, then torque [m].

    It lies within the ranges of the design space for the base. Constraints on unknown quantities do not count.
    """
    by_name = {parameter.name: parameter for parameter in problem.space.parameters}
    parameters = [cast("FloatParameter", by_name[f"origin_{axis}"]) for axis in "xyz"]

    def evaluate(positions: Array) -> Array:
        """Return losses (N, 1): from 2 if a target is missed, from 1 if a constraint is violated, else by torque."""
        batch = max(1, POSTURES_AT_ONCE[problem.device] // len(problem.task.target_positions))
        losses = np.empty((len(positions), 1))
        for first in range(0, len(positions), batch):
            part = slice(first, first + batch)
            arms = [placed_at(arm, position) for position in positions[part].tolist()]
            evaluation = problem.physics_of_arms(stack_arms(arms))
            excess = np.maximum(evaluation.position_error - REACHED, 0.0).sum(axis=1)
            violation, torque = _known_violation(problem, evaluation), TORQUE(evaluation)
            placed = np.where(violation > 0.0, 1.0 + violation / (1.0 + violation), torque / (1.0 + torque))
            losses[part, 0] = np.where(excess > 0.0, 2.0 + excess, placed)
        return losses

    positions = DesignEncoding(parameters).random(RANDOM_POSITIONS, np.random.default_rng(derived_seed(seed, 0)))
    losses = evaluate(positions)
    best = np.argsort(losses[:, 0], kind="stable")[:REFINED_POSITIONS]
    refined = refine(parameters, evaluate, positions[best], losses[best], (1.0,), EVALUATIONS, derived_seed(seed, 1))
    x, y, z = refined.matrix[refined.values[:, 0].argmin()].tolist()
    return x, y, z


def _known_violation(problem: Problem, evaluation: Evaluation) -> Array:
    """Return (N,) sums of the violations of constraints on known quantities."""
    violation = np.zeros(len(evaluation))
    for constraint in problem.constraints:
        if known_values(constraint.quantity, evaluation) is not None:
            violation += np.maximum(constraint(evaluation), 0.0)
    return violation
