"""Place an existing arm on a task: search the pose of its base."""

import math
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from scipy.optimize import differential_evolution  # pyright: ignore[reportUnknownVariableType]

from armwright.arrays import Array
from armwright.exceptions import ArmError, SettingsError
from armwright.existing.existing_arm import known_values
from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.pareto import total_violation
from armwright.problem import arm_quantities
from armwright.problem.evaluation import NO_CYCLE, Evaluation
from armwright.problem.problem import POSTURES_AT_ONCE, Problem
from armwright.robot.arm import Arm, Joint
from armwright.robot.mounting import Mounting, mounted, needs_turning
from armwright.robot.urdf_reader import UrdfArm
from armwright.search.encoding import DesignEncoding
from armwright.seeding import derived_seed
from armwright.spaces.parameters import FloatParameter
from armwright.spaces.tool_mount import with_tool

PLACES, GENERATIONS = 30, 50  # of a differential evolution
HARDLY = 0.01  # more torque that is accepted for a base that is not turned
N_PLACES = PLACES * GENERATIONS


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


@dataclass(frozen=True)
class Placement:
    """An existing arm in its place on a task."""

    problem: Problem  # the task, its objectives and constraints
    described: UrdfArm  # arm there, with its tool
    mounting: Mounting  # where its base link stands
    tried: int = 0  # number of places that were tried; 0 if the place was given

    @property
    def description(self) -> str:
        """Where it stands, and why there."""
        why = f"; the best of {self.tried:,} places by errors, constraints and torque" if self.tried else ""
        return f"{self.mounting.description}{why}"


def placed(problem: Problem, described: UrdfArm, seed: int, mounting: Mounting | None = None) -> Placement:
    """Place an existing arm on a task as designs are: with its tool, travel of slides and safety factor.

    Its base link is given at the origin. The mounting says where it stands; None to search within the ranges of the
    problem's space, with the seed.

    Raises:
        SettingsError: If the seed is negative, or the arm cannot be turned as the mounting demands.
        ArmError: If the task has a cycle and a joint of the arm follows another.
    """
    if seed < 0:
        raise SettingsError(f"seed: expected a whole number of at least 0, got {seed}")
    if (coupled := described.arm.couplings) and problem.task.cycle is not None:
        raise ArmError(f'{described.name}: "{described.joints[coupled[0][0]]}" mimics a joint; {NO_CYCLE}')
    arm = with_tool(with_travel(described.arm, problem.space.travel), problem.task.tool)
    equipped = replace(described, arm=replace(arm, safety_factor=problem.space.safety_factor))
    if mounting is not None:
        return Placement(problem, mounted(equipped, mounting), mounting)
    found = search_base(problem, equipped, seed)
    return Placement(problem, mounted(equipped, found), found, N_PLACES)


def search_base(problem: Problem, described: UrdfArm, seed: int) -> Mounting:
    """Return where the base link stands best: by missed targets, then violation, then torque.

    Its position lies within the ranges of the design space. It is turned if that pays, unless a vertical first joint
    makes full turns. Constraints on unknown quantities do not count.
    """
    by_name = {parameter.name: parameter for parameter in problem.space.parameters}
    parameters = [cast("FloatParameter", by_name[f"origin_{axis}"]) for axis in "xyz"]
    if needs_turning(described.arm):
        parameters.append(FloatParameter("yaw", -math.pi, math.pi, "rad"))

    def losses_of(rows: Array) -> Array:
        """Return losses (N,): from 2 if a target is missed, from 1 if a constraint is violated, else by torque."""
        batch = max(1, POSTURES_AT_ONCE[problem.device] // len(problem.task.target_positions))
        losses = np.empty(len(rows))
        for first in range(0, len(rows), batch):
            part = slice(first, first + batch)
            arms = [mounted(described, Mounting.of(row)).arm for row in rows[part].tolist()]
            losses[part] = _losses(problem, problem.physics(stack_arms(arms)))
        return losses

    encoding, rng = DesignEncoding(parameters), np.random.default_rng(derived_seed(seed, 0))

    def in_units(units: Array) -> Array:
        return losses_of(encoding.from_units(units.T))

    settings: Any = {"tol": 0.0, "polish": False, "updating": "deferred", "vectorized": True}
    settings |= {"init": rng.random((PLACES, len(parameters))), "maxiter": GENERATIONS - 1, "rng": rng}
    found: Any = differential_evolution(in_units, [(0.0, 1.0)] * len(parameters), **settings)
    chosen = encoding.from_units(found.x)
    if len(chosen) > 3:
        unturned = np.array([[*chosen[:3], 0.0]])
        if _needs_hardly_more(float(losses_of(unturned)[0]), float(found.fun)):
            chosen = unturned[0]
    return Mounting.of(chosen.tolist())


def _needs_hardly_more(loss: float, least: float) -> bool:
    """Return True if the torque behind a loss is at most HARDLY more than that behind the least loss."""
    return loss <= least or (loss < 1.0 and loss / (1.0 - loss) <= (1.0 + HARDLY) * least / (1.0 - least))


def _losses(problem: Problem, evaluation: Evaluation) -> Array:
    """Return (N,) losses of placed arms, each below 1 if the arm does the task."""
    targets = evaluation.target_arrays
    missed = np.maximum(evaluation.position_error - targets.tolerance, 0.0)
    missed += targets.metres_per_radian * np.maximum(evaluation.angle_error - targets.angle_tolerance, 0.0)
    excess = missed.sum(axis=1)
    violation = total_violation(problem.known_violations(evaluation, known_values))
    torque = np.nan_to_num(known_values(arm_quantities.torque, evaluation)[0])
    met = np.where(violation > 0.0, 1.0 + violation / (1.0 + violation), torque / (1.0 + torque))
    return np.where(excess > 0.0, 2.0 + excess, met)
