"""Arms from URDF files, as the kernels and as Pinocchio compute them."""

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio

from armwright.kinematics.arms.arm_arrays import Precision, stack_arms
from armwright.kinematics.arms.forward import forward_kinematics
from armwright.kinematics.cycle.torque_terms import inertia_matrices
from armwright.kinematics.ik.ik import solve_postures
from armwright.robot.arm import Arm
from armwright.robot.urdf_reader import UrdfArm
from tests.support.dynamics import inverse_dynamics
from tests.support.reference_kinematics import Array


@dataclass(frozen=True)
class Seen:
    """An arm of J joints in T states."""

    tip: Array  # (T, 3) [m]
    rotation: Array  # (T, 3, 3) of the tip frame
    gravity: Array  # (T, J) torques that hold the arm [N m] or [N]
    torque: Array  # (T, J) torques that also move it
    inertia: Array  # (T, J, J) mass matrix


def random_states(arm: Arm, n: int, seed: int) -> Array:
    """(3, n, J) values within the limits, speeds and accelerations."""
    rng, joints = np.random.default_rng(seed), len(arm.joints)
    q = rng.uniform([j.lower for j in arm.joints], [j.upper for j in arm.joints], (n, joints))
    return np.stack([q, rng.uniform(-3.0, 3.0, (n, joints)), rng.uniform(-9.0, 9.0, (n, joints))])


def seen_by_kernels(arm: Arm, states: Array, payload: float = 0.0, precision: Precision = "float64") -> Seen:
    arrays, (q, v, a) = stack_arms([arm], precision), states[:, None]
    n, all_by_independent = q.shape[1], arrays.by_independent(np.eye(len(arm.joints))[None])[0]
    q, v, a = arrays.coupled(q), v @ all_by_independent.T, a @ all_by_independent.T
    held = solve_postures(arrays, np.zeros((n, 3)), 0, initial_q=q, payload=np.full(n, payload), precision=precision)
    frames, loads = forward_kinematics(arrays, q).rotation[0, :, -1], np.full(n, payload)
    z, x = arrays.tool_axis[0], arrays.tool_side[0]
    torque = arrays.by_independent(inverse_dynamics(arrays, q, v, a, loads))[0]
    inertia = arrays.by_independent(inertia_matrices(arrays, q, loads, 1.0))
    inertia = arrays.by_independent(inertia.swapaxes(-1, -2))[0]
    return Seen(held.reached[0], frames @ np.column_stack([x, np.cross(z, x), z]), held.torque[0], torque, inertia)


def seen_by_pinocchio(path: Path, read: UrdfArm, states: Array, payload: float = 0.0) -> Seen:
    """The whole file, with other joints at 0; the payload is a point at the tip.

    Joints that mimic others have the values that those give them; torques and inertia are by the independent ones, 0
    for others.
    """
    c, o = _mimicry(path, read)
    model = pinocchio.buildModelFromUrdf(str(path))
    frame = model.getFrameId(read.tip, pinocchio.FrameType.BODY)
    at_tip = model.frames[frame]
    model.appendBodyToJoint(
        at_tip.parentJoint, pinocchio.Inertia(payload, np.zeros(3), np.zeros((3, 3))), at_tip.placement
    )
    data, joints = model.createData(), [model.joints[model.getJointId(name)] for name in read.joints]
    places, found = [joint.idx_v for joint in joints], []
    for row in states.swapaxes(0, 1) @ c.T + np.stack([o, 0.0 * o, 0.0 * o]):
        q, v, a = pinocchio.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        for joint, value in zip(joints, row[0], strict=True):
            q[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        v[places], a[places] = row[1:]
        pinocchio.framesForwardKinematics(model, data, q)
        pose = data.oMf[frame]
        tip, rotation = pose.translation.copy(), pose.rotation.copy()
        gravity = pinocchio.computeGeneralizedGravity(model, data, q)[places]
        torque = pinocchio.rnea(model, data, q, v, a)[places]
        upper = np.triu(pinocchio.crba(model, data, q))
        inertia = (upper + np.triu(upper, 1).T)[np.ix_(places, places)]
        found.append((tip, rotation, gravity @ c, torque @ c, c.T @ inertia @ c))
    return Seen(*map(np.array, zip(*found, strict=True)))


def _mimicry(path: Path, read: UrdfArm) -> tuple[Array, Array]:
    """(J, J) factors and (J,) offsets that give joint values from those of the joints that mimic none."""
    elements = {joint.get("name"): joint for joint in ElementTree.parse(path).iter("joint")}

    def law(name: str) -> tuple[Array, float]:
        mimic = elements[name].find("mimic")
        if mimic is None:
            return np.eye(len(read.joints))[read.joints.index(name)], 0.0
        factor, (row, offset) = float(mimic.get("multiplier", 1.0)), law(mimic.get("joint", ""))
        return factor * row, factor * offset + float(mimic.get("offset", 0.0))

    rows, offsets = zip(*map(law, read.joints), strict=True)
    return np.array(rows), np.array(offsets)


def differences(ours: Seen, theirs: Seen) -> dict[str, float]:
    """The largest difference of each value, relative to the largest value of the arm."""
    pairs = zip(vars(ours).items(), vars(theirs).values(), strict=True)
    return {name: float(np.abs(a - b).max() / max(np.abs(b).max(), 1e-6)) for (name, a), b in pairs}
