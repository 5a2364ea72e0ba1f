"""The outline of the reach, against closed forms and Pinocchio's kinematics of random postures."""

import numpy as np
import pinocchio
import pytest

from armwright.kinematics.reach.reach_outline import N_SECTORS, reach_outline
from armwright.robot.arm import Arm, Joint, uniform_link
from armwright.robot.urdf_writer import to_urdf
from tests.support.arms import moving_arms
from tests.support.exported_arms import MIXED

SIDE, TOP = (0, 2), (0, 1)


def planar(*limits: float) -> Arm:
    """A turret, a shoulder and an elbow with links of 0.1, 0.3 and 0.2 m."""
    joints = tuple(Joint("revolute", axis, *limits) for axis in ("z", "y", "y"))
    links = tuple(uniform_link((0.0, 0.0, length), 0.2, 0.01) for length in (0.1, 0.3, 0.2))
    return Arm((0.4, -0.2, 0.3), joints, links)


def radii(arm: Arm, view: tuple[int, int]) -> np.ndarray:
    base = np.array([arm.base[axis] for axis in view])
    return np.linalg.norm(np.array(reach_outline(arm, view).points) - base, axis=1)


def test_outline_of_a_planar_arm_is_a_circle_about_its_shoulder() -> None:
    arm = planar(-6.2, 6.2)
    assert radii(arm, TOP) == pytest.approx(np.full(N_SECTORS, 0.5), rel=1e-3)
    points = np.array(reach_outline(arm, SIDE).points) - (0.4, 0.4)
    assert np.linalg.norm(points, axis=1) == pytest.approx(np.full(N_SECTORS, 0.5), rel=1e-3)


def test_outline_respects_joint_limits() -> None:
    arm = planar(-0.5, 0.5)
    points = np.array(reach_outline(arm, SIDE).points)
    widest = 0.3 * np.sin(0.5) + 0.2 * np.sin(1.0)
    assert 0.9 * widest < points[:, 0].max() - 0.4 < 1.001 * widest
    assert points[:, 1].max() == pytest.approx(0.9, rel=1e-3)


@pytest.mark.parametrize("view", [SIDE, TOP])
@pytest.mark.parametrize("arm", [MIXED, *moving_arms(3, 5, 4)])
def test_no_posture_of_pinocchio_is_outside(arm: Arm, view: tuple[int, int]) -> None:
    model = pinocchio.buildModelFromXML(to_urdf(arm))
    data, frame = model.createData(), model.getFrameId("tip")
    rng = np.random.default_rng(3)
    outline, base = radii(arm, view), np.array([arm.base[axis] for axis in view])
    for q in rng.uniform(model.lowerPositionLimit, model.upperPositionLimit, (500, model.nq)):
        pinocchio.framesForwardKinematics(model, data, q)
        x, y = data.oMf[frame].translation[list(view)] - base
        sector = min(int((np.arctan2(y, x) + np.pi) / (2.0 * np.pi) * N_SECTORS), N_SECTORS - 1)
        assert np.hypot(x, y) <= 1.02 * outline[sector]
