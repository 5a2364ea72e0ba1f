"""Objectives: functions of an evaluation, all minimised."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import SettingsError, did_you_mean
from armwright.kinematics.arm_arrays import FIXED, Actuation
from armwright.problem.evaluation import Evaluation
from armwright.problem.objective import Objective
from armwright.tasks.targets import REACHED

TORQUE_SCALE = 40.0  # α of the paper
FAR = 1.0  # [m]; a clearance counts as no more
COMFORTABLE = 0.1  # [m] of clearance, beyond which more of it is worth nothing
MOST_OBJECTIVES = 5  # of which the hypervolume is still computed in no time


def _position_error(evaluation: Evaluation) -> Array:
    return evaluation.target_arrays.weight * evaluation.position_error


def _orientation_error(evaluation: Evaluation) -> Array:
    return evaluation.target_arrays.weight * evaluation.angle_error


def _torque_norm(evaluation: Evaluation) -> Array:
    return np.linalg.norm(evaluation.motor_torques, axis=-1)


def _actuation(evaluation: Evaluation, name: str) -> Actuation:
    actuation = evaluation.arms.actuation
    if actuation is None:
        raise SettingsError(f"objective {name} needs actuators: name some in the space file (actuators: [...])")
    return actuation


def _torque_utilisation(evaluation: Evaluation) -> Array:
    effort = _actuation(evaluation, "torque_utilisation").effort
    return evaluation.worst_torques(lambda torques: np.abs(torques / effort[:, None]).max(axis=-1))


def _dynamic_torque(evaluation: Evaluation) -> Array:
    return evaluation.worst_drives(lambda torques, _: np.abs(torques).max(axis=-1))


def _dynamic_utilisation(evaluation: Evaluation) -> Array:
    effort = _actuation(evaluation, "dynamic_utilisation").effort
    return evaluation.worst_drives(lambda torques, _: np.abs(torques / effort[:, None]).max(axis=-1))


def _speed_utilisation(evaluation: Evaluation) -> Array:
    speed = _actuation(evaluation, "speed_utilisation").speed
    if np.isnan(speed).any():
        raise SettingsError(
            "objective speed_utilisation needs the speed of every actuator; the space names one without "
            "(speed [rad/s] in its record)"
        )
    return evaluation.worst_drives(lambda _, speeds: np.abs(speeds / speed[:, None]).max(axis=-1))


def _path_error(evaluation: Evaluation) -> Array:
    return evaluation.paths.with_largest(np.zeros(evaluation.position_error.shape), evaluation.paths.error)


def _max_joint_step(evaluation: Evaluation) -> Array:
    return evaluation.paths.with_largest(np.zeros(evaluation.position_error.shape), evaluation.paths.jumps)


def _price(evaluation: Evaluation) -> Array:
    price = _actuation(evaluation, "price").price
    if np.isnan(price).any():
        raise SettingsError("objective price needs the price of every actuator; the space names one without")
    return price


def _mass(evaluation: Evaluation) -> Array:
    return evaluation.arms.mass.sum(axis=1, dtype=np.float64) + evaluation.arms.base_mass


POSITION_ERROR = Objective(
    name="position_error",
    label="Position error",
    unit="m",
    symbol="E_pos",
    description="the distance between the tip and the target in the kept posture",
    each=_position_error,
)
TORQUE = Objective(
    name="torque",
    label="Torque",
    unit=f"N m x {TORQUE_SCALE:g}",
    symbol="E_torque",
    description=f"{TORQUE_SCALE:g} times the Euclidean norm of the joint torques [N m] that hold the kept posture up "
    "against gravity",
    each=lambda evaluation: TORQUE_SCALE * _torque_norm(evaluation),
)
WORST_ERROR = Objective(
    name="worst_error",
    label="Worst position error",
    unit="m",
    symbol="E_worst",
    description="the distance between the tip and the target in the kept posture",
    each=lambda evaluation: evaluation.position_error,
    over="max",
)
UNREACHED_TARGETS = Objective(
    name="unreached_targets",
    label="Unreached targets",
    unit="targets",
    symbol="E_unreached",
    description=f"1 where the tip misses the target by {1e3 * REACHED:g} mm or more, else 0",
    each=lambda evaluation: evaluation.unreached.astype(np.float64),
)
ORIENTATION_ERROR = Objective(
    name="orientation_error",
    label="Orientation error",
    unit="rad",
    symbol="E_rot",
    description="the angle between the tool's axis (or frame) and the target's in the kept posture; 0 where it has "
    "none",
    each=_orientation_error,
)
WORST_ANGLE = Objective(
    name="worst_angle",
    label="Worst orientation error",
    unit="rad",
    symbol="E_angle",
    description="the angle between the tool's axis (or frame) and the target's in the kept posture; 0 where it has "
    "none",
    each=lambda evaluation: evaluation.angle_error,
    over="max",
)
PEAK_TORQUE = Objective(
    name="peak_torque",
    label="Peak torque",
    unit="N m",
    symbol="E_peak",
    description="the largest of the joint torques' absolute values [N m] that hold the kept posture up against gravity",
    each=lambda evaluation: evaluation.worst_torques(lambda torques: np.abs(torques).max(axis=-1)),
    over="max",
)
RMS_TORQUE = Objective(
    name="rms_torque",
    label="RMS torque",
    unit="N m",
    symbol="E_rms",
    description="the Euclidean norm of the joint torques [N m] that hold the kept posture up against gravity",
    each=_torque_norm,
    over="rms",
)
MASS = Objective(
    name="mass",
    label="Mass",
    unit="kg",
    symbol="E_mass",
    description="the mass of the arm, its actuators included, without its payload",
    each=_mass,
    over="arm",
)
TORQUE_UTILISATION = Objective(
    name="torque_utilisation",
    label="Torque utilisation",
    unit="of allowed",
    symbol="E_util",
    description="the largest share of its actuator's torque that any joint needs to hold the kept posture up against "
    "gravity; above 1 the arm cannot hold it",
    each=_torque_utilisation,
    over="max",
)
PRICE = Objective(
    name="price",
    label="Price",
    unit="USD",
    symbol="E_price",
    description="the price of all actuators",
    each=_price,
    over="arm",
)
JOINTS = Objective(
    name="joints",
    label="Joints",
    unit="joints",
    symbol="E_joints",
    description="the number of joints that move",
    each=lambda evaluation: (evaluation.arms.motion < FIXED).sum(axis=1).astype(np.float64),
    over="arm",
)
LENGTH = Objective(
    name="length",
    label="Length",
    unit="m",
    symbol="E_length",
    description="the sum of the lengths of all links",
    each=lambda evaluation: evaluation.arms.length,
    over="arm",
)
COLLISION = Objective(
    name="collision",
    label="Collision",
    unit="m",
    symbol="E_collision",
    description="how deep the arm in the kept posture is in an obstacle or in itself, at the worst place; 0 where it "
    "is free",
    each=lambda evaluation: np.maximum(0.0, -evaluation.clearance),
)
CLEARANCE_SHORTFALL = Objective(
    name="clearance_shortfall",
    label="Clearance shortfall",
    unit="m",
    symbol="E_shortfall",
    description=f"by how much the arm in the kept posture comes nearer than {COMFORTABLE:g} m to an obstacle or to "
    f"itself; above {COMFORTABLE:g} it is in it",
    each=lambda evaluation: np.maximum(0.0, COMFORTABLE - evaluation.clearance),
    over="max",
)
PATH_ERROR = Objective(
    name="path_error",
    label="Path error",
    unit="m",
    symbol="E_path",
    description="the largest distance between the tip and where it should be on the straight moves that end at the "
    "target; 0 where none does",
    each=_path_error,
    over="max",
)
MAX_JOINT_STEP = Objective(
    name="max_joint_step",
    label="Largest joint step",
    unit="rad",
    symbol="E_step",
    description="the largest change of any joint [rad, of sliding ones m] from one step of the moves that end at the "
    "target to the next, large where the arm flips into another posture on the way; 0 where no move ends there",
    each=_max_joint_step,
    over="max",
)
UNCOVERED_FRACTION = Objective(
    name="uncovered_fraction",
    label="Uncovered fraction",
    unit="fraction",
    symbol="E_uncovered",
    description=f"the share of the workspace's points that the tip misses by {1e3 * REACHED:g} mm or more",
    each=lambda evaluation: (evaluation.workspace_error >= REACHED).mean(axis=1),
    over="arm",
)
ANISOTROPY = Objective(
    name="anisotropy",
    label="Anisotropy",
    unit="fraction",
    symbol="E_anisotropy",
    description="1 less the tip's speed in the direction in which the joints move it worst over that in the best, in "
    "the kept posture: 0 where all directions are alike, 1 where there is one in which the tip cannot move at all",
    each=lambda evaluation: 1.0 - evaluation.dexterity,
    over="max",
)
DYNAMIC_TORQUE = Objective(
    name="dynamic_torque",
    label="Dynamic torque",
    unit="N m",
    symbol="E_dynamic",
    description="the largest absolute torque of any motor along the timed moves that end at the target, gravity and "
    "inertia included",
    each=_dynamic_torque,
    over="max",
)
DYNAMIC_UTILISATION = Objective(
    name="dynamic_utilisation",
    label="Dynamic utilisation",
    unit="of allowed",
    symbol="E_dynutil",
    description="the largest share of any actuator's torque along the timed moves that end at the target; above 1 it "
    "cannot",
    each=_dynamic_utilisation,
    over="max",
)
SPEED_UTILISATION = Objective(
    name="speed_utilisation",
    label="Speed utilisation",
    unit="of allowed",
    symbol="E_speed",
    description="the largest share of any actuator's no-load speed along the timed moves that end at the target; "
    "above 1 it cannot",
    each=_speed_utilisation,
    over="max",
)
PAPER_OBJECTIVES: tuple[Objective, ...] = (POSITION_ERROR, TORQUE)
OF_ORIENTATION = (ORIENTATION_ERROR, WORST_ANGLE)
_ALL = (
    *PAPER_OBJECTIVES, WORST_ERROR, UNREACHED_TARGETS, PEAK_TORQUE, RMS_TORQUE, TORQUE_UTILISATION, MASS, LENGTH,
    PRICE, JOINTS, *OF_ORIENTATION, COLLISION, CLEARANCE_SHORTFALL, PATH_ERROR, MAX_JOINT_STEP, DYNAMIC_TORQUE,
    DYNAMIC_UTILISATION, SPEED_UTILISATION, UNCOVERED_FRACTION, ANISOTROPY,
)  # fmt: skip
OBJECTIVES: Mapping[str, Objective] = {objective.name: objective for objective in _ALL}
RENAMED = {
    "missed": "unreached_targets",
    "unreached": "uncovered_fraction",
    "clumsiness": "anisotropy",
    "closeness": "clearance_shortfall",
    "joint_jump": "max_joint_step",
    "torque_use": "torque_utilisation",
    "dynamic_use": "dynamic_utilisation",
    "speed_use": "speed_utilisation",
}


def _clearance(name: str, description: str, each: Callable[[Evaluation], Array]) -> Objective:
    """Of which more is better, so that it can only be bounded."""
    return Objective(
        name=name,
        label=name.replace("_", " ").capitalize(),
        unit="m",
        symbol=name,
        description=f"{description}; below 0 it is in it, and {FAR:g} where there is nothing near",
        each=lambda evaluation: np.minimum(each(evaluation), FAR),
        over="min",
    )


CLEARANCES: tuple[Objective, ...] = (
    _clearance(
        "clearance", "how far the arm in the kept posture is from obstacles and from itself", lambda e: e.clearance
    ),
    _clearance("self_clearance", "how far the arm in the kept posture is from itself", lambda e: e.self_clearance),
    _clearance("obstacle_clearance", "how far the arm in the kept posture is from obstacles",
               lambda e: e.obstacle_clearance),
)  # fmt: skip
OF_CLEARANCE = (COLLISION, CLEARANCE_SHORTFALL, *CLEARANCES)
# A target's share is the worst of it and of the moves there.
OF_THE_WAY = (*OF_CLEARANCE, PEAK_TORQUE, TORQUE_UTILISATION)
OF_TIME = (DYNAMIC_TORQUE, DYNAMIC_UTILISATION, SPEED_UTILISATION)
OF_MOVES = (*OF_THE_WAY, PATH_ERROR, MAX_JOINT_STEP, *OF_TIME)
MANIPULABILITY = Objective(
    name="manipulability",
    label="Manipulability",
    unit="m³",
    symbol="manipulability",
    description="the square root of det(J J^T) in the kept posture, with the position Jacobian J",
    each=lambda evaluation: evaluation.manipulability,
    over="min",
)
TO_BOUND = (*CLEARANCES, MANIPULABILITY)  # of which more is better: no objectives


def named_objectives(names: Sequence[str], others: Sequence[Objective] = ()) -> tuple[Objective, ...]:
    """Return the objectives of these names; SettingsError if one is unknown or repeated, or there are too many.

    others: that may be named as well.
    """
    known = {objective.name: objective for objective in others} | dict(OBJECTIVES)
    for name in names:
        if name not in known:
            raise SettingsError(
                f'unknown objective "{name}".{did_you_mean(name, known, RENAMED)} Objectives: {", ".join(known)}'
            )
    if not 1 <= len(names) <= MOST_OBJECTIVES or len(set(names)) < len(names):
        raise SettingsError(
            f"objectives: {', '.join(names) or 'none'}; 1 to {MOST_OBJECTIVES} different ones are needed"
        )
    return tuple(known[name] for name in names)
