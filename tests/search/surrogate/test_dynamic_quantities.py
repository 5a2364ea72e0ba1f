"""Dynamic quantities against MuJoCo and Pinocchio, whose models are read from our files."""

import mujoco
import numpy as np
import pinocchio
import pytest

import armwright as aw
from armwright.arrays import Array
from armwright.search.surrogate.dynamic_quantities import dynamic_quantities
from armwright.spaces.design_space import default_space

TARGETS = np.array([[0.3, 0.1, 0.2], [0.1, -0.3, 0.3], [-0.2, 0.2, 0.1]])
SOFT = 1e-5  # of the stiffness that the oracle's springs have, so that they yield in the first order [N m/rad]


def arms_of(task: str, n: int) -> list[aw.Arm]:
    space = default_space(task)
    return [space.arm(design) for design in space.sample(n, seed=4)]


def quantities(arm: aw.Arm) -> tuple[aw.Evaluation, dict[str, float]]:
    evaluation = aw.evaluate(arm, TARGETS)
    return evaluation, {name: float(values[0]) for name, values in dynamic_quantities(evaluation).items()}


def turns(postures: Array) -> Array:
    """(T, J) from target to target, first from the straight arm."""
    return postures - np.vstack([np.zeros_like(postures[:1]), postures[:-1]])


def test_sliding_joints_count_in_the_turns_of_their_motors() -> None:
    lower, upper = (
        aw.Link((0.0, 0.0, 0.3), 0.5, (0.0, 0.0, 0.15), 0.02),
        aw.Link((0.3, 0.0, 0.0), 0.4, (0.15, 0.0, 0.0), 0.02),
    )
    slide = aw.Joint("prismatic", "z", -0.2, 0.2, travel=0.01)
    arm = aw.Arm((0.0, 0.0, 0.0), (slide, aw.Joint("revolute", "z", -2.0, 2.0)), (lower, upper))
    evaluation, found = quantities(arm)
    steps = turns(evaluation.q[0]) / [0.01, 1.0]
    assert found["joint_travel"] == pytest.approx(np.linalg.norm(steps, axis=1).sum())
    assert found["longest_turn"] == pytest.approx(np.abs(steps).max())
    # Both masses move with the slide: 0.9 kg (0.01 m/rad)².
    assert evaluation.motor_inertia[0, :, 0, 0] == pytest.approx([9e-5] * 3, rel=1e-6)


@pytest.mark.parametrize("task", ["target-1", "desk-sorting"])  # without and with motors
def test_inertia_is_that_of_mujoco_with_its_rotors(task: str) -> None:
    for arm in arms_of(task, 12):
        evaluation, found = quantities(arm)
        model = mujoco.MjModel.from_xml_string(aw.to_mjcf(arm))
        rotors = [joint.actuator.rotor_inertia for joint in arm.joints if joint.actuator is not None]
        model.dof_armature[:] = rotors or 0.0
        data = mujoco.MjData(model)
        largest: list[float] = []
        for posture in evaluation.q[0, :, : model.nq]:
            data.qpos[:] = posture
            mujoco.mj_forward(model, data)
            inertia = np.zeros((model.nv, model.nv))
            mujoco.mj_fullM(model, data, inertia)
            largest.append(float(np.linalg.eigvalsh(inertia)[-1]))
        assert found["inertia"] == pytest.approx(sum(largest), rel=1e-5)
        assert found["worst_inertia"] == pytest.approx(max(largest), rel=1e-5)


def test_sag_energy_and_sweep_are_those_of_pinocchio() -> None:
    for arm in arms_of("target-1", 12):
        evaluation, found = quantities(arm)
        model = pinocchio.buildModelFromXML(aw.to_urdf(arm))
        data, frame = model.createData(), model.getFrameId("tip")

        def tip(q: Array, model: pinocchio.Model = model, data: pinocchio.Data = data, frame: int = frame) -> Array:
            pinocchio.framesForwardKinematics(model, data, q)
            return data.oMf[frame].translation.copy()

        sag = energy = sweep = 0.0
        postures = evaluation.q[0, :, : model.nq]
        for posture, turn in zip(postures, turns(postures), strict=True):
            yielding = SOFT * pinocchio.computeGeneralizedGravity(model, data, posture)
            sag += float(np.linalg.norm(tip(posture + yielding) - tip(posture - yielding))) / (2.0 * SOFT)
            sweep += float(np.linalg.norm(tip(posture + SOFT * turn) - tip(posture - SOFT * turn))) / (2.0 * SOFT)
            energy += float(pinocchio.computeKineticEnergy(model, data, posture, turn))
        assert found["sag_at_1_Nm_per_rad"] == pytest.approx(sag, rel=1e-4)
        assert found["tip_sweep"] == pytest.approx(sweep, rel=1e-4)
        assert found["kinetic_energy_at_1_s_a_move"] == pytest.approx(energy, rel=1e-5)


def test_inertia_counts_the_payload_at_each_target() -> None:
    arm = arms_of("target-1", 1)[0]
    by_target = [aw.evaluate(arm, TARGETS, payload=load).motor_inertia for load in (0.0, 0.4, 1.0)]
    mixed = aw.evaluate(arm, TARGETS, payload=[0.0, 0.4, 1.0]).motor_inertia
    expected = np.stack([each[:, i] for i, each in enumerate(by_target)], axis=1)
    assert mixed == pytest.approx(expected, rel=1e-9, abs=1e-12)
