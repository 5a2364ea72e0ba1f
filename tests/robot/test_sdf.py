"""SDFormat in Drake (libsdformat), against the URDF in Pinocchio."""

from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from armwright.exceptions import ArmError
from armwright.kinematics.forward import joint_positions
from armwright.robot.arm import Arm, Joint, Link, uniform_link
from armwright.robot.link_geometry import joint_limits
from armwright.robot.sdf import to_sdf
from tests.support import reference_kinematics as reference
from tests.support.exported_arms import ARMS, MIXED, full, load, moving, peer_of, postures
from tests.support.reference_kinematics import Array

EVERY_ARM = pytest.mark.parametrize("arm", ARMS)


class Loaded:
    """A model as it stands in Drake; what its parser only warns of is an error."""

    def __init__(self, arm: Arm, name: str = "arm") -> None:
        self.plant: Any = MultibodyPlant(0.0)
        parser: Any = Parser(self.plant)
        parser.SetStrictParsing()
        (self.instance,) = parser.AddModelsFromString(to_sdf(arm, name), "sdf")
        self.plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -reference.GRAVITY])
        self.plant.Finalize()
        self.context: Any = self.plant.CreateDefaultContext()

    def put(self, q: Array) -> None:
        self.plant.SetPositions(self.context, q)

    def pose(self, frame: str) -> Array:
        """(4, 4) in the world."""
        return self.plant.GetFrameByName(frame).CalcPoseInWorld(self.context).GetAsMatrix4()


@EVERY_ARM
def test_names_axes_limits_and_masses(arm: Arm) -> None:
    plant = Loaded(arm).plant
    kinds = {"revolute": "revolute", "prismatic": "prismatic", "fixed": "weld"}
    assert plant.GetJointByName("world_to_base").type_name() == "weld"
    for number, joint in enumerate(arm.joints, start=1):
        assert plant.GetJointByName(f"joint_{number}").type_name() == kinds[joint.kind]
    assert plant.num_positions() == len(moving(arm))
    for number, joint in moving(arm):
        seen, limits = plant.GetJointByName(f"joint_{number}"), joint_limits(joint)
        axis = seen.revolute_axis() if joint.kind == "revolute" else seen.translation_axis()
        assert np.allclose(axis, np.eye(3)["xyz".index(joint.axis)])
        assert seen.position_lower_limits() == pytest.approx(limits["lower"])
        assert seen.position_upper_limits() == pytest.approx(limits["upper"])
        assert seen.velocity_upper_limits() == pytest.approx(limits["velocity"])
        motor = plant.GetJointActuatorByName(f"joint_{number}")
        assert motor.joint().name() == f"joint_{number}"
        assert motor.effort_limit() == pytest.approx(limits["effort"])
    for number, link in enumerate(arm.links, start=1):
        assert plant.GetBodyByName(f"link_{number}").default_mass() == pytest.approx(
            link.total_mass, rel=1e-9, abs=2e-12
        )


@EVERY_ARM
def test_sdf_joints_and_tip_match_the_arm(arm: Arm) -> None:
    loaded, peer = Loaded(arm), peer_of(arm)
    for q in postures(arm):
        loaded.put(q)
        places = joint_positions(arm, full(arm, q))
        for number in range(1, len(arm.links) + 1):
            assert np.abs(loaded.pose(f"link_{number}")[:3, 3] - places[number - 1]).max() < 1e-9
        assert np.abs(loaded.pose("tip") - peer.tip(q)).max() < 1e-9


@EVERY_ARM
def test_sdf_gravity_and_inertia_match_the_urdf(arm: Arm) -> None:
    loaded, peer = Loaded(arm), peer_of(arm)
    for q in postures(arm):
        loaded.put(q)
        assert np.abs(-loaded.plant.CalcGravityGeneralizedForces(loaded.context) - peer.gravity(q)).max(
            initial=0.0
        ) < 1e-9 * load(arm)
        difference = loaded.plant.CalcMassMatrix(loaded.context) - peer.mass_matrix(q)
        assert np.abs(difference).max(initial=0.0) < 1e-9 * load(arm) * max(1.0, arm.reach)


def test_sdf_states_collisions_and_visuals() -> None:
    """A cylinder for each link that has a length, from its joint to the next; a ball for each joint."""
    model = ElementTree.fromstring(to_sdf(MIXED)).find("model")
    assert model is not None
    cylinders = model.findall("link/collision/geometry/cylinder/length")
    assert [float(c.text or "") for c in cylinders] == pytest.approx([x.length for x in MIXED.links if x.length > 0.0])
    assert len(model.findall("link/visual/geometry/sphere")) == len(MIXED.links)
    names = [element.get("name") for element in model.iter() if element.get("name") is not None]
    assert len(set(names)) == len(names)


def test_degenerate_links_load() -> None:
    """Links with zero or tiny mass or length have positive mass and inertia in the file."""
    rng = np.random.default_rng(44)
    edge = [(0.0, 0.02, 0.0), (1e-13, 0.02, 0.1), (1.0, 1e-9, 0.1), (1.0, 0.02, 1e-15)]
    links = [Link((0.0, 0.0, 0.1), 0.0, (0.0, 0.0, 0.05), 0.02, end_mass=0.5)]
    for mass, radius, length in [*rng.uniform([0.001, 0.001, 0.0], [5.0, 0.1, 0.0], (50, 3)).tolist(), *edge]:
        links += [uniform_link((x * length, 0.0, z * length), mass, radius) for x, z in ((0.0, 1.0), (0.6, -0.8))]
    for link in links:
        arm = Arm((0.0, 0.0, 0.0), (Joint("revolute", "y", -1.0, 1.0),), (link,))
        assert Loaded(arm).plant.num_positions() == 1
        inertials = ElementTree.fromstring(to_sdf(arm)).findall("model/link/inertial")
        assert inertials
        for inertial in inertials:
            least = min(float(inertial.findtext(f"inertia/{moment}", "")) for moment in ("ixx", "iyy", "izz"))
            assert least >= 1e-14
            assert float(inertial.findtext("mass", "")) >= 1e-12


def test_immobile_arm_loads() -> None:
    loaded = Loaded(Arm((0.0, 0.0, 1.0), (Joint("fixed", "x"),), (uniform_link((0.0, 0.1, 0.2), 1.0, 0.02),)))
    assert loaded.plant.num_positions() == 0
    assert np.allclose(loaded.pose("tip")[:3, 3], [0.0, 0.1, 1.2])


@pytest.mark.parametrize("name", ['<arm> & "friends"', "it's", "Ärmchen", "a]]>b", "$(x) ${y}", "tip", "base"])
def test_names_are_escaped(name: str) -> None:
    loaded = Loaded(MIXED, name)
    assert loaded.plant.GetModelInstanceName(loaded.instance) == name


@pytest.mark.parametrize("name", ["", " ", "world", "a::b", "__model__"])
def test_names_reserved_by_sdformat_are_refused(name: str) -> None:
    with pytest.raises(ArmError, match=f'name = "{name}"'):
        to_sdf(MIXED, name)


def test_export_is_deterministic() -> None:
    assert to_sdf(MIXED) == to_sdf(MIXED)
    assert to_sdf(MIXED).startswith('<?xml version="1.0"?>\n<sdf version="1.9">')
