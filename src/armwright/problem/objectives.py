"""Objectives: functions of an evaluation, all minimised."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import SettingsError, did_you_mean
from armwright.kinematics.arms.arm_arrays import FIXED
from armwright.problem import compliance_quantities as compliance
from armwright.problem import drive_quantities as drives
from armwright.problem.evaluation import CYCLE_GAP, Evaluation
from armwright.problem.objective import Objective
from armwright.tasks.targets import REACHED

TORQUE_SCALE = 40.0  # α of the paper
FAR = 1.0  # [m]; a clearance counts as no more
COMFORTABLE = 0.1  # [m] of clearance, beyond which more of it is worth nothing
MAX_OBJECTIVES = 5  # the hypervolume of more takes long


def _torque_norm(evaluation: Evaluation) -> Array:
    return np.linalg.norm(evaluation.motor_torques, axis=-1)


POSITION_ERROR = Objective(
    name="position_error",
    unit="m",
    symbol="E_pos",
    description="the distance between the tip and the target in the kept posture",
    each=lambda e: e.target_arrays.weight * e.position_error,
    excess=lambda e: e.target_arrays.weight * e.excess_error,
)
TORQUE = Objective(
    name="torque",
    unit=f"N m x {TORQUE_SCALE:g}",
    description=f"{TORQUE_SCALE:g} times the Euclidean norm of the joint torques [N m] that hold the kept posture up "
    "against gravity",
    each=lambda e: TORQUE_SCALE * _torque_norm(e),
)
WORST_ERROR = Objective(
    name="worst_error",
    label="Worst position error",
    unit="m",
    symbol="E_worst",
    description=POSITION_ERROR.description,
    each=lambda e: e.position_error,
    excess=lambda e: e.excess_error,
    over="max",
)
UNREACHED_TARGETS = Objective(
    name="unreached_targets",
    unit="targets",
    symbol="E_unreached",
    description=f"1 where the tip misses the target by {1e3 * REACHED:g} mm or more, else 0",
    each=lambda e: e.unreached.astype(np.float64),
)
ORIENTATION_ERROR = Objective(
    name="orientation_error",
    unit="rad",
    symbol="E_rot",
    description="the angle between the tool's axis (or frame) and the target's in the kept posture; 0 where it has "
    "none",
    each=lambda e: e.target_arrays.weight * e.angle_error,
    excess=lambda e: e.target_arrays.weight * e.excess_angle,
    needs=("orientation",),
)
WORST_ANGLE = Objective(
    name="worst_angle",
    label="Worst orientation error",
    unit="rad",
    symbol="E_angle",
    description=ORIENTATION_ERROR.description,
    each=lambda e: e.angle_error,
    excess=lambda e: e.excess_angle,
    over="max",
    needs=("orientation",),
)
PEAK_TORQUE = Objective(
    name="peak_torque",
    unit="N m",
    symbol="E_peak",
    description="the largest of the joint torques' absolute values [N m] that hold the kept posture up against gravity",
    each=lambda e: e.worst_torques(lambda torques: np.abs(torques).max(axis=-1)),
    over="max",
    needs=("motions",),
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
    unit="kg",
    description="the mass of the arm, its actuators and tool included, without its payload",
    each=lambda e: e.arms.mass.sum(axis=1, dtype=np.float64) + e.arms.base_mass,
    over="arm",
)
TORQUE_UTILISATION = Objective(
    name="torque_utilisation",
    unit="of allowed",
    symbol="E_util",
    description="the largest share of its actuator's peak torque that any joint needs to hold the kept posture up "
    "against gravity, times the safety factor; above 1 the arm does not hold it with this factor",
    each=drives.torque_utilisation,
    over="max",
    needs=("motions",),
    ratings=("peak",),
)
PRICE = Objective(
    name="price",
    unit="USD",
    description="the price of all actuators, and of links and column if the space states one",
    each=lambda e: e.drives.price + e.arms.structure_price,
    over="arm",
    ratings=("price",),
)
JOINTS = Objective(
    name="joints",
    unit="joints",
    description="the number of joints that move",
    each=lambda e: (e.arms.motion < FIXED).sum(axis=1).astype(np.float64),
    over="arm",
)
LENGTH = Objective(
    name="length",
    unit="m",
    description="the sum of the lengths of all links",
    each=lambda e: e.arms.length,
    over="arm",
)
COLLISION = Objective(
    name="collision",
    unit="m",
    description="how deep the arm in the kept posture is in an obstacle or in itself, at the worst place; 0 where it "
    f"is free, which along a cycle takes a gap of {1e3 * CYCLE_GAP:g} mm",
    each=lambda e: e.penetration,
    needs=("clearance", "motions"),
)
CLEARANCE_SHORTFALL = Objective(
    name="clearance_shortfall",
    unit="m",
    symbol="E_shortfall",
    description=f"by how much the arm in the kept posture comes nearer than {COMFORTABLE:g} m to an obstacle or to "
    f"itself; above {COMFORTABLE:g} it is in it",
    each=lambda e: np.maximum(0.0, COMFORTABLE - e.clearance),
    over="max",
    needs=("clearance", "motions"),
)
PATH_ERROR = Objective(
    name="path_error",
    unit="m",
    symbol="E_path",
    description="the largest distance between the tip and where it should be on the lines of the steps to the target; "
    "0 where there are none",
    each=lambda e: e.largest_on_motions(e.paths.path_error),
    excess=lambda e: e.largest_on_motions(e.paths.path_error - (e.paths.plan.cycle.tolerance.path or 0.0)),
    over="max",
    needs=("cycle",),
)
PATH_ANGLE = Objective(
    name="path_angle",
    label="Angle error on lines",
    unit="rad",
    symbol="E_pathangle",
    description="the largest angle between the tool and the direction that it should have on the lines of the steps "
    "to the target; 0 where there are none",
    each=lambda e: e.largest_on_motions(e.paths.path_angle),
    excess=lambda e: e.largest_on_motions(e.paths.path_angle - (e.paths.plan.cycle.tolerance.angle or 0.0)),
    over="max",
    needs=("cycle",),
)
JUMPS = Objective(
    name="jumps",
    unit="targets",
    symbol="E_jumps",
    description="1 where the joints cannot move continuously on the way to the target, such as where the arm would "
    "have to flip into another posture, else 0",
    each=lambda e: e.largest_on_motions(e.paths.jumps.astype(np.float64)),
    needs=("cycle",),
)
CYCLE_TIME = Objective(
    name="cycle_time",
    unit="s",
    symbol="E_time",
    description="the duration of the cycle, dwells included",
    each=lambda e: e.loads.cycle_time,
    over="arm",
    needs=("cycle", "durations"),
)
UNCOVERED_FRACTION = Objective(
    name="uncovered_fraction",
    unit="fraction",
    symbol="E_uncovered",
    description=f"the share of the workspace's points that the tip misses by {1e3 * REACHED:g} mm or more",
    each=lambda e: (e.workspace_error >= REACHED).mean(axis=1),
    over="arm",
    needs=("workspace",),
)
UNDEXTEROUS_FRACTION = Objective(
    name="undexterous_fraction",
    unit="fraction",
    symbol="E_undexterous",
    description="the share of the workspace's points at which the tool reaches too few of the directions asked for",
    each=lambda e: 1.0 - e.dexterous_volume,
    over="arm",
    needs=("directions",),
)
ANISOTROPY = Objective(
    name="anisotropy",
    unit="fraction",
    description="1 less the tip's speed in the direction in which the joints move it worst over that in the best, in "
    "the kept posture: 0 where all directions are alike, 1 where there is one in which the tip cannot move at all",
    each=lambda e: 1.0 - e.dexterity,
    over="max",
)
DYNAMIC_TORQUE = Objective(
    name="dynamic_torque",
    unit="N m",
    symbol="E_dynamic",
    description="the largest absolute torque of any motor on the way to the target, gravity and inertia included",
    each=drives.dynamic_torque,
    over="max",
    needs=("cycle", "durations"),
)
DYNAMIC_UTILISATION = Objective(
    name="dynamic_utilisation",
    unit="of allowed",
    symbol="E_dynutil",
    description="the largest factor by which any actuator's torque, times the safety factor, and speed together exceed "
    "its torque-speed limit on the way to the target; above 1 it cannot",
    each=drives.dynamic_utilisation,
    over="max",
    needs=("cycle", "durations"),
    ratings=("peak", "corner_speed", "no_load_speed"),
)
SPEED_UTILISATION = Objective(
    name="speed_utilisation",
    unit="of allowed",
    symbol="E_speed",
    description="the largest share of any actuator's no-load speed on the way to the target; above 1 it cannot",
    each=drives.speed_utilisation,
    over="max",
    needs=("cycle", "durations"),
    ratings=("no_load_speed",),
)
THERMAL_UTILISATION = Objective(
    name="thermal_utilisation",
    unit="of allowed",
    symbol="E_thermal",
    description="the largest share of any actuator's continuous torque that its torque takes, as a root mean square "
    "over the cycle with its dwells, times the safety factor; above 1 it overheats",
    each=drives.thermal_utilisation,
    over="arm",
    needs=("cycle", "durations"),
    ratings=("continuous",),
)
PEAK_CURRENT = Objective(
    name="peak_current",
    unit="A",
    symbol="I_peak",
    description="the largest current that all actuators together draw from the supply along the cycle",
    each=lambda e: e.supply.peak,
    over="arm",
    needs=("cycle", "durations"),
    ratings=("peak", "voltage", "current"),
)
MEAN_CURRENT = Objective(
    name="mean_current",
    unit="A",
    symbol="I_mean",
    description="the mean current that all actuators together draw from the supply over the cycle with its dwells",
    each=lambda e: e.supply.mean,
    over="arm",
    needs=("cycle", "durations"),
    ratings=("peak", "voltage", "current"),
)
DEFLECTION = Objective(
    name="deflection",
    unit="m",
    description="how far the arm's own weight and the payload move the tip in the kept posture, because links bend and "
    "twist and joints yield",
    each=compliance.deflection,
    over="max",
    needs=("sections",),
    ratings=("joint_stiffness",),
)
PAYLOAD_DEFLECTION = Objective(
    name="payload_deflection",
    unit="m",
    symbol="E_payload",
    description="how far the payload alone moves the tip in the kept posture, because links bend and twist and joints "
    "yield",
    each=compliance.payload_deflection,
    over="max",
    needs=("sections",),
    ratings=("joint_stiffness",),
)
BACKLASH_ERROR = Objective(
    name="backlash_error",
    unit="m",
    symbol="E_backlash",
    description="how far half of the backlash of all actuators together moves the tip in the kept posture at most",
    each=compliance.backlash_error,
    over="max",
    ratings=("backlash",),
)
PAPER_OBJECTIVES = (POSITION_ERROR, TORQUE)
_ALL = (
    *PAPER_OBJECTIVES, WORST_ERROR, UNREACHED_TARGETS, PEAK_TORQUE, RMS_TORQUE, TORQUE_UTILISATION, MASS, LENGTH,
    PRICE, JOINTS, ORIENTATION_ERROR, WORST_ANGLE, COLLISION, CLEARANCE_SHORTFALL, PATH_ERROR, PATH_ANGLE,
    JUMPS, CYCLE_TIME, DYNAMIC_TORQUE, DYNAMIC_UTILISATION, SPEED_UTILISATION, THERMAL_UTILISATION,
    PEAK_CURRENT, MEAN_CURRENT, UNCOVERED_FRACTION, UNDEXTEROUS_FRACTION, ANISOTROPY, DEFLECTION, PAYLOAD_DEFLECTION,
    BACKLASH_ERROR,
)  # fmt: skip
OBJECTIVES: Mapping[str, Objective] = {objective.name: objective for objective in _ALL}


def _clearance(name: str, description: str, each: Callable[[Evaluation], Array]) -> Objective:
    return Objective(
        name=name,
        unit="m",
        symbol=name,
        description=f"{description}; below 0 it is in it, and {FAR:g} where there is nothing near",
        each=lambda e: np.minimum(each(e), FAR),
        over="min",
        needs=("clearance", "motions"),
    )


_DISTANCE = "how far the arm in the kept posture is from"
CLEARANCES = (
    _clearance("clearance", f"{_DISTANCE} obstacles and from itself", lambda e: e.clearance),
    _clearance("self_clearance", f"{_DISTANCE} itself", lambda e: e.self_clearance),
    _clearance("obstacle_clearance", f"{_DISTANCE} obstacles", lambda e: e.obstacle_clearance),
)
MANIPULABILITY = Objective(
    name="manipulability",
    unit="m³",
    symbol="manipulability",
    description="the square root of det(J J^T) in the kept posture, with the position Jacobian J",
    each=lambda e: e.manipulability,
    over="min",
)
PAYLOAD_CAPACITY = Objective(
    name="payload_capacity",
    unit="kg",
    symbol="payload_capacity",
    description="the largest payload that all actuators hold in the kept posture, with the safety factor",
    each=compliance.payload_capacity,
    over="min",
    ratings=("peak",),
)
DEXTEROUS_VOLUME = Objective(
    name="dexterous_volume",
    unit="fraction",
    symbol="dexterous_volume",
    description="the share of the workspace's points at which the tool reaches the stated share of the directions "
    "asked for",
    each=lambda e: e.dexterous_volume,
    over="arm",
    needs=("directions",),
)
VOLTAGES = Objective(
    name="voltages",
    unit="voltages",
    description="the number of different supply voltages of the actuators",
    each=drives.voltages,
    over="arm",
    ratings=("voltage",),
)
# More of these is better, so constraints can bound them, but they are no objectives.
BENEFITS = (*CLEARANCES, MANIPULABILITY, PAYLOAD_CAPACITY, DEXTEROUS_VOLUME)
QUANTITIES: Mapping[str, Objective] = {**OBJECTIVES, **{q.name: q for q in (*BENEFITS, VOLTAGES)}}


def named_objectives(names: Sequence[str], others: Sequence[Objective] = ()) -> tuple[Objective, ...]:
    """Return the objectives of these names, built in or among `others`.

    Raises:
        SettingsError: One is unknown or repeated, or there are too many.
    """
    known = {objective.name: objective for objective in others} | dict(OBJECTIVES)
    for name in names:
        if name not in known:
            raise SettingsError(
                f'unknown objective "{name}".{did_you_mean(name, known)} Objectives: {", ".join(known)}'
            )
    if not 1 <= len(names) <= MAX_OBJECTIVES or len(set(names)) < len(names):
        raise SettingsError(
            f"objectives: expected 1 to {MAX_OBJECTIVES} different ones, got {', '.join(names) or 'none'}"
        )
    return tuple(known[name] for name in names)
