"""URDF files in Pinocchio and MuJoCo."""

from collections.abc import Callable
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio
import pytest

from armwright.robot.arm import Arm, Joint, Link
from armwright.robot.mjcf import to_mjcf
from armwright.robot.urdf_writer import to_urdf
from tests.support import reference_kinematics as reference
from tests.support.arms import general_arms, paper_arms
from tests.support.exported_arms import BARE, moving

ARMS = [*paper_arms(2, 4, 21), *general_arms(2, 3, 22), *general_arms(2, 8, 23)]
EVERY_ARM = pytest.mark.parametrize("arm", [*ARMS, BARE])


def cylinder_inertia(link: Link) -> np.ndarray:
    """(3, 3) about the centre of mass [kg m²]: m r²/2 along the offset, m (3 r² + l²)/12 across it."""
    along = np.array(link.offset) / link.length if link.length > 0.0 else np.array([0.0, 0.0, 1.0])
    about = link.mass * link.radius**2 / 2.0
    across = link.mass * (3.0 * link.radius**2 + link.length**2) / 12.0
    return across * np.eye(3) + (about - across) * np.outer(along, along)


@EVERY_ARM
def test_urdf_in_pinocchio_matches_the_arm(arm: Arm) -> None:
    """Masses (with all that is fixed to a joint), limits and axes; no root joint is needed."""
    model = pinocchio.buildModelFromXML(to_urdf(arm))
    assert list(model.names)[1:] == [f"joint_{number}" for number, _ in moving(arm)]
    assert np.allclose(model.lowerPositionLimit, [joint.lower for _, joint in moving(arm)])
    assert np.allclose(model.upperPositionLimit, [joint.upper for _, joint in moving(arm)])
    kinds = {"revolute": "JointModelR", "prismatic": "JointModelP"}
    assert [j.shortname() for j in model.joints[1:]] == [kinds[j.kind] + j.axis.upper() for _, j in moving(arm)]
    assert sum(inertia.mass for inertia in model.inertias) == pytest.approx(sum(link.mass for link in arm.links))
    assert model.existFrame("base")
    assert model.existFrame("tip")


@EVERY_ARM
def test_urdf_in_mujoco_matches_the_arm(arm: Arm) -> None:
    """base and tip are bodies of their own; mass, centre and inertia of each link, limits and axes."""
    model = mujoco.MjModel.from_xml_string(to_urdf(arm))
    bodies = [model.body(i).name for i in range(model.nbody)]
    assert bodies == ["world", "base", *(f"link_{n}" for n in range(1, len(arm.links) + 1)), "tip"]
    assert np.allclose(model.body("base").pos, arm.base)
    assert np.allclose(model.body("tip").pos, arm.links[-1].offset)
    assert np.allclose(model.opt.gravity, [0.0, 0.0, -reference.GRAVITY])
    for number, link in enumerate(arm.links, start=1):
        body = model.body(f"link_{number}")
        assert body.mass[0] == pytest.approx(link.mass, abs=1e-9)
        assert np.allclose(body.ipos, link.com)
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, body.iquat)
        R = turn.reshape(3, 3)
        assert np.allclose(R @ np.diag(body.inertia) @ R.T, cylinder_inertia(link), rtol=1e-6, atol=1e-10)
    for number, joint in moving(arm):
        seen = model.joint(f"joint_{number}")
        assert np.allclose(seen.range, [joint.lower, joint.upper])
        assert np.allclose(seen.axis, np.eye(3)["xyz".index(joint.axis)])
    assert model.body_mass.sum() == pytest.approx(sum(link.mass for link in arm.links))


def test_links_without_length_load_in_mujoco() -> None:
    """The inertia of a disc is at the limit of validity; rounding must not exceed it."""
    rng = np.random.default_rng(24)
    joint = Joint("revolute", "y", -1.0, 1.0)
    for mass, radius in rng.uniform([0.001, 0.001], [5.0, 0.1], (200, 2)).tolist():
        link = Link((0.0, 0.0, 0.0), mass, (0.0, 0.0, 0.0), radius)
        assert mujoco.MjModel.from_xml_string(to_urdf(Arm((0.0, 0.0, 0.0), (joint,), (link,)))).nv == 1


def test_massless_arm_has_no_mass_in_any_parser() -> None:
    """Without a stated inertia, MuJoCo assumes the density of water and scikit-robot 1 g per link."""
    links = (Link((0.0, 0.0, 0.2), 0.0, (0.0, 0.0, 0.1), 0.015), Link((0.0, 0.0, 0.0), 0.0, (0.0, 0.0, 0.0), 0.015))
    arm = Arm((0.0, 0.0, 0.0), (Joint("revolute", "y", -1.0, 1.0),) * 2, links)
    assert mujoco.MjModel.from_xml_string(to_urdf(arm)).body_mass.sum() < 1e-9
    assert sum(inertia.mass for inertia in pinocchio.buildModelFromXML(to_urdf(arm)).inertias) == 0.0


@pytest.mark.parametrize("write", [to_urdf, to_mjcf])
@pytest.mark.parametrize("name", ['<arm> & "friends"', "it's", "Ärmchen", "a]]>b", "", "two\nlines", "x" * 5000])
def test_names_are_escaped(name: str, write: Callable[[Arm, str], str]) -> None:
    text = write(ARMS[0], name)
    root = ElementTree.fromstring(text)
    assert root.get("name" if write is to_urdf else "model") == name
    assert mujoco.MjModel.from_xml_string(text).nv == 4
