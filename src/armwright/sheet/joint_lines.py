"""What a task needs of each joint of an arm and of its drive."""

from collections.abc import Iterator, Sequence
from contextlib import suppress

import numpy as np

from armwright.arrays import Array, finite_or_none
from armwright.exceptions import SettingsError
from armwright.kinematics.arms.bearings import bearing_limits
from armwright.kinematics.cycle.cycle_loads import holding_torques
from armwright.kinematics.cycle.drive_limits import torque_speed_utilisation
from armwright.problem.evaluation import Evaluation
from armwright.robot.arm import Arm
from armwright.robot.axes import axis_name
from armwright.robot.motor_body import MotorBody
from armwright.sheet.record import JointLine

ACROSS = ("tilting_moment", "bearing_utilisation")  # of any joint, whatever drives it


def joint_lines(arm: Arm, evaluation: Evaluation | None = None, names: Sequence[str] = ()) -> Iterator[JointLine]:
    """Yield a line for each moving joint, named joint_1, joint_2 and so on by default.

    The evaluation is that of this arm alone in the task; None without a task.
    """
    moving = [j for j, joint in enumerate(arm.joints) if joint.kind != "fixed"]
    need = {} if evaluation is None else _needs(evaluation)
    labels = names or [f"joint_{j + 1}" for j in moving]
    if arm.no_mass:
        need = {name: values for name, values in need.items() if name == "speed_utilisation"}
    for k, j in enumerate(moving):
        joint = arm.joints[j]
        used = None if evaluation is None else _used(evaluation, j)
        drive = "" if joint.actuator is None else joint.actuator.name
        if joint.coupling is not None:
            drive = f"that of {labels[moving.index(joint.coupling.leader)]}"
        yield JointLine(
            number=j + 1,
            name=labels[k],
            kind=joint.kind,
            axis=axis_name(joint.axis),
            actuator=drive,
            lower=joint.lower,
            upper=joint.upper,
            peak_torque=joint.effort,
            used=used,
            unused=None if used is None else (max(0.0, used[0] - joint.lower), max(0.0, joint.upper - used[1])),
            body="" if joint.body is None else _describe_body(joint.body),
            **{key: finite_or_none(values[j]) for key, values in need.items() if not joint.coupling or key in ACROSS},
        )


def _describe_body(body: MotorBody) -> str:
    """Return the edges of a body along x, y and z, and its middle from the joint, with all joints at 0."""
    edges = " x ".join(f"{1e3 * edge:.4g}" for edge in body.size)
    middle = ", ".join(f"{1e3 * value:.4g}" for value in body.centre)
    return f"{body.shape} of {edges} mm along x, y and z, shaft along {body.axis}, middle at ({middle}) mm"


def _used(evaluation: Evaluation, j: int) -> tuple[float, float]:
    """Return the smallest and the largest value of a joint at the targets and along the cycle."""
    values = [evaluation.q[0, :, j]]
    if evaluation.cycle_paths is not None:
        values += [path.q[0, :, j] for path in evaluation.cycle_paths.of_arm(0)[1]]
    return float(min(each.min() for each in values)), float(max(each.max() for each in values))


def _needs(evaluation: Evaluation) -> dict[str, Array]:
    """Return (D,) torque and utilisations of the joints by name; NaN where a rating is unknown."""
    at_rest = np.abs(evaluation.joint_torques[0]).max(axis=0)
    if evaluation.cycle_paths is not None:
        along = holding_torques(evaluation.cycle_paths, evaluation.torque_terms)[0]
        at_rest = np.maximum(at_rest, np.abs(along).max(axis=(0, 1)))
    drives, loads = evaluation.arms.actuation, None
    with suppress(SettingsError):  # no cycle of known duration
        loads = evaluation.loads
    need = {"torque": at_rest}
    if drives is not None:
        need["peak_utilisation"] = drives.safety_factor[0] * at_rest / drives.peak[0]
    if drives is not None and (loads is not None or evaluation.cycle_paths is None):
        across = evaluation.bearing_loads[0].max(axis=0)  # (D, 3)
        need["tilting_moment"] = across[:, 0]
        need["bearing_utilisation"] = np.fmax.reduce(across / bearing_limits(drives)[0], axis=-1)  # NaN without limits
    if loads is None:
        return need
    dof = loads.torques.shape[-1]
    torques, speeds = (values[:1].reshape(1, -1, dof) for values in (loads.torques, loads.speeds))
    need["torque"] = np.maximum(at_rest, np.abs(torques).max(axis=(0, 1)))
    if drives is not None:
        share = drives.safety_factor[0] * need["torque"] / drives.peak[0]
        moving = torque_speed_utilisation(torques, speeds, drives).max(axis=(0, 1))  # NaN without a corner speed
        need["peak_utilisation"] = np.fmax(share, moving)
        need["speed_utilisation"] = np.abs(speeds).max(axis=(0, 1)) / drives.no_load_speed[0]
        need["thermal_utilisation"] = drives.safety_factor[0] * loads.rms_torques[0] / drives.continuous[0]
    return need
