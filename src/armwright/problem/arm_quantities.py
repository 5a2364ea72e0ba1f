# ruff: noqa: D205, D401 (a docstring here is the description that users and models read)
"""Quantities of arms that take no motors: errors, torques at rest, sizes, obstacles, the cycle, the workspace."""

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import FIXED
from armwright.problem.evaluation import Evaluation
from armwright.problem.objective import quantity
from armwright.tasks.targets import REACHED

TORQUE_SCALE = 40.0  # α of the paper
FAR = 1.0  # [m]; a clearance counts as no more
COMFORTABLE = 0.1  # [m] of clearance, beyond which more of it is worth nothing


# Errors


@quantity("m", symbol="E_pos", excess=lambda e: e.target_arrays.weight * e.excess_error)
def position_error(e: Evaluation) -> Array:
    """The distance between the tip and the target in the kept posture."""
    return e.target_arrays.weight * e.position_error


@quantity("m", over="max", symbol="E_worst", label="Worst position error", excess=lambda e: e.excess_error)
def worst_error(e: Evaluation) -> Array:
    """The distance between the tip and the target in the kept posture."""
    return e.position_error


@quantity("targets", symbol="E_unreached")
def unreached_targets(e: Evaluation) -> Array:
    """1 where the tip misses the target by 1 mm or more, else 0."""
    return e.unreached.astype(np.float64)


@quantity("rad", needs=("orientation",), symbol="E_rot", excess=lambda e: e.target_arrays.weight * e.excess_angle)
def orientation_error(e: Evaluation) -> Array:
    """The angle between the tool's axis (or frame) and the target's in the kept posture; 0 where it has none."""
    return e.target_arrays.weight * e.angle_error


@quantity(
    "rad",
    over="max",
    needs=("orientation",),
    symbol="E_angle",
    label="Worst orientation error",
    excess=lambda e: e.excess_angle,
)
def worst_angle(e: Evaluation) -> Array:
    """The angle between the tool's axis (or frame) and the target's in the kept posture; 0 where it has none."""
    return e.angle_error


# Torques at rest


@quantity(f"N m x {TORQUE_SCALE:g}", needs=("masses",))
def torque(e: Evaluation) -> Array:
    """40 times the Euclidean norm of the joint torques [N m] that hold the kept posture up against gravity."""
    return TORQUE_SCALE * np.linalg.norm(e.motor_torques, axis=-1)


@quantity("N m", over="max", needs=("motions", "masses"), symbol="E_peak")
def peak_torque(e: Evaluation) -> Array:
    """The largest of the joint torques' absolute values [N m] that hold the kept posture up against gravity."""
    return e.worst_torques(lambda torques: np.abs(torques).max(axis=-1))


@quantity("N m", over="rms", needs=("masses",), symbol="E_rms", label="RMS torque")
def rms_torque(e: Evaluation) -> Array:
    """The Euclidean norm of the joint torques [N m] that hold the kept posture up against gravity."""
    return np.linalg.norm(e.motor_torques, axis=-1)


# The arm itself


@quantity("kg", over="arm", needs=("masses",))
def mass(e: Evaluation) -> Array:
    """The mass of the arm, its actuators and tool included, without its payload."""
    return e.arms.mass.sum(axis=1, dtype=np.float64) + e.arms.base_mass


@quantity("m", over="arm")
def length(e: Evaluation) -> Array:
    """The sum of the lengths of all links."""
    return e.arms.length


@quantity("joints", over="arm")
def joints(e: Evaluation) -> Array:
    """The number of joints that move."""
    return (e.arms.motion < FIXED).sum(axis=1).astype(np.float64)


@quantity("fraction", over="max")
def anisotropy(e: Evaluation) -> Array:
    """1 less the tip's speed in the direction in which the joints move it worst over that in the best, in the kept
    posture: 0 where all directions are alike, 1 where there is one in which the tip cannot move at all.
    """
    return 1.0 - e.dexterity


@quantity("m³", over="min", symbol="manipulability", more_is_better=True)
def manipulability(e: Evaluation) -> Array:
    """The square root of det(J J^T) in the kept posture, with the position Jacobian J."""
    return e.manipulability


# Obstacles and the arm itself in its way


@quantity("m", needs=("clearance", "motions"))
def collision(e: Evaluation) -> Array:
    """How deep the arm in the kept posture is in an obstacle or in itself, at the worst place; 0 where it is free,
    which along a cycle takes a gap of 0.1 mm.
    """
    return e.penetration


@quantity("m", over="max", needs=("clearance", "motions"), symbol="E_shortfall")
def clearance_shortfall(e: Evaluation) -> Array:
    """By how much the arm in the kept posture comes nearer than 0.1 m to an obstacle or to itself; above 0.1 it is in
    it.
    """
    return np.maximum(0.0, COMFORTABLE - e.clearance)


@quantity("m", over="min", needs=("clearance", "motions"), symbol="clearance", more_is_better=True)
def clearance(e: Evaluation) -> Array:
    """How far the arm in the kept posture is from obstacles and from itself; below 0 it is in it, and 1 where there is
    nothing near.
    """
    return np.minimum(e.clearance, FAR)


@quantity("m", over="min", needs=("clearance", "motions"), symbol="self_clearance", more_is_better=True)
def self_clearance(e: Evaluation) -> Array:
    """How far the arm in the kept posture is from itself; below 0 it is in it, and 1 where there is nothing near."""
    return np.minimum(e.self_clearance, FAR)


@quantity("m", over="min", needs=("clearance", "motions"), symbol="obstacle_clearance", more_is_better=True)
def obstacle_clearance(e: Evaluation) -> Array:
    """How far the arm in the kept posture is from obstacles; below 0 it is in it, and 1 where there is nothing near."""
    return np.minimum(e.obstacle_clearance, FAR)


# The cycle


@quantity(
    "m",
    over="max",
    needs=("cycle",),
    symbol="E_path",
    excess=lambda e: e.largest_on_motions(e.paths.path_error - (e.paths.plan.cycle.tolerance.path or 0.0)),
)
def path_error(e: Evaluation) -> Array:
    """The largest distance between the tip and where it should be on the lines of the steps to the target; 0 where
    there are none.
    """
    return e.largest_on_motions(e.paths.path_error)


@quantity(
    "rad",
    over="max",
    needs=("cycle",),
    symbol="E_pathangle",
    label="Angle error on lines",
    excess=lambda e: e.largest_on_motions(e.paths.path_angle - (e.paths.plan.cycle.tolerance.angle or 0.0)),
)
def path_angle(e: Evaluation) -> Array:
    """The largest angle between the tool and the direction that it should have on the lines of the steps to the
    target; 0 where there are none.
    """
    return e.largest_on_motions(e.paths.path_angle)


@quantity("targets", needs=("cycle",), symbol="E_jumps")
def jumps(e: Evaluation) -> Array:
    """1 where the joints cannot move continuously on the way to the target, such as where the arm would have to flip
    into another posture, else 0.
    """
    return e.largest_on_motions(np.where(e.paths.is_off[:, None], np.nan, e.paths.jumps))


@quantity("s", over="arm", needs=("cycle", "durations"), symbol="E_time")
def cycle_time(e: Evaluation) -> Array:
    """The duration of the cycle, dwells included."""
    return e.loads.cycle_time


# The workspace


@quantity("fraction", over="arm", needs=("workspace",), symbol="E_uncovered")
def uncovered_fraction(e: Evaluation) -> Array:
    """The share of the workspace's points that the tip misses by 1 mm or more."""
    return (e.workspace_error >= REACHED).mean(axis=1)


@quantity("fraction", over="arm", needs=("directions",), symbol="E_undexterous")
def undexterous_fraction(e: Evaluation) -> Array:
    """The share of the workspace's points at which the tool reaches too few of the directions asked for."""
    return 1.0 - e.dexterous_volume


@quantity("fraction", over="arm", needs=("directions",), symbol="dexterous_volume", more_is_better=True)
def dexterous_volume(e: Evaluation) -> Array:
    """The share of the workspace's points at which the tool reaches the stated share of the directions asked for."""
    return e.dexterous_volume


CLEARANCES = (clearance, self_clearance, obstacle_clearance)
