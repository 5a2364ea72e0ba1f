"""Xacro files, processed by xacro."""

import io
from dataclasses import replace
from typing import get_args
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
import yourdfpy

from armwright.robot.arm import Arm, Joint, Link, uniform_link
from armwright.robot.link_geometry import joint_limits
from armwright.robot.urdf_writer import to_urdf
from armwright.robot.xacro import to_xacro
from armwright.runs.export import mass_per_metre
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.link_mass import MassModel
from armwright.spaces.parameters import Design
from tests.support.exported_arms import ARMS, MIXED, Peer, load, moving, peer_of, postures, processed

EVERY_ARM = pytest.mark.parametrize("arm", ARMS)


def assert_same(urdf: str, arm: Arm, prefix: str = "") -> None:
    """Poses, gravity and inertia are those of our URDF of the arm, to the ten digits that it has."""
    peer, ours = Peer(urdf), peer_of(arm)
    assert list(peer.model.names) == ["universe", *(f"{prefix}joint_{number}" for number, _ in moving(arm))]
    for q in postures(arm):
        assert np.abs(peer.tip(q, prefix) - ours.tip(q)).max() < 1e-9 * max(1.0, arm.reach)
        assert np.abs(peer.gravity(q) - ours.gravity(q)).max(initial=0.0) < 1e-9 * load(arm)
        difference = peer.mass_matrix(q) - ours.mass_matrix(q)
        assert np.abs(difference).max(initial=0.0) < 1e-9 * load(arm) * max(1.0, arm.reach)


@EVERY_ARM
@pytest.mark.parametrize("mass_per_metre", [0.0, 0.7])
@pytest.mark.fast_cases(3)
def test_xacro_defaults_to_the_urdf(arm: Arm, mass_per_metre: float) -> None:
    assert_same(processed(to_xacro(arm, mass_per_metre=mass_per_metre)), arm)


@EVERY_ARM
@pytest.mark.fast_cases(3)
def test_xacro_and_urdf_agree_in_yourdfpy_and_mujoco(arm: Arm) -> None:
    text = processed(to_xacro(arm))
    seen, ours = (yourdfpy.URDF.load(io.BytesIO(urdf.encode())).robot for urdf in (text, to_urdf(arm)))
    assert [link.name for link in seen.links] == [link.name for link in ours.links]
    for link, our in zip(seen.links, ours.links, strict=True):
        for mine, theirs in ((link.visuals, our.visuals), (link.collisions, our.collisions)):
            assert len(mine) == len(theirs)
            for one, other in zip(mine, theirs, strict=True):
                assert np.allclose(one.origin, other.origin, atol=1e-8)
                for shape in ("cylinder", "sphere"):
                    sizes = [
                        vars(geometry)
                        for geometry in (getattr(body.geometry, shape) for body in (one, other))
                        if geometry
                    ]
                    assert len(sizes) in (0, 2)
                    assert not sizes or sizes[0] == pytest.approx(sizes[1])
    for number, joint in moving(arm):
        (limit,) = [j.limit for j in seen.joints if j.name == f"joint_{number}"]
        assert vars(limit) == pytest.approx(joint_limits(joint))
    model, our = (mujoco.MjModel.from_xml_string(urdf) for urdf in (text, to_urdf(arm)))
    assert np.allclose(model.body_mass, our.body_mass, rtol=1e-9, atol=1e-12)
    assert np.allclose(model.body_inertia, our.body_inertia, rtol=1e-6, atol=1e-12)
    assert np.allclose(model.jnt_range, our.jnt_range)


@EVERY_ARM
def test_xacro_arguments_change_the_arm(arm: Arm) -> None:
    """Compare with arms built by hand with the same lengths, radii, masses and bases."""
    rng = np.random.default_rng(45)
    slope = 0.3
    arguments: dict[str, float] = {f"base_{axis}": float(rng.uniform(-1.0, 1.0)) for axis in "xyz"}
    base = (arguments["base_x"], arguments["base_y"], arguments["base_z"])
    arguments |= {f"tool_{axis}": float(rng.uniform(-0.2, 0.2)) for axis in "xyz"}
    tool = (arguments["tool_x"], arguments["tool_y"], arguments["tool_z"])
    links: list[Link] = []
    for n, link in enumerate(arm.links, start=1):
        factor, radius, mass, end = (float(v) for v in rng.uniform([0.3, 0.005, 0.1, 0.0], [3.0, 0.05, 2.0, 1.0]))
        length = link.length * factor
        arguments |= {f"link_{n}_length": length, f"link_{n}_radius": radius}
        arguments |= {f"link_{n}_mass": mass, f"link_{n}_mass_per_metre": slope, f"link_{n}_end_mass": end}
        x, y, z = (factor * value for value in link.offset)
        u, v, w = (factor * value if link.length > 0.0 else value for value in link.com)
        links.append(Link((x, y, z), mass + slope * length, (u, v, w), radius, end))
    assert_same(
        processed(to_xacro(arm), **arguments),
        replace(arm, base=base, links=tuple(links), tool=replace(arm.tool, tip=tool)),
    )


LINKS: dict[str, dict[str, object]] = {
    "per_metre": {"mass": {"kind": "per_metre", "kg": 0.8}},
    "per_link": {"mass": {"kind": "per_link", "kg": 0.2}},
    "tubes": {"link_section": {"tubes": [[0.02, 0.0015], [0.03, 0.002]], "material": "aluminium"}},
}


def test_xacro_cases_cover_all_mass_models() -> None:
    models = get_args(get_args(MassModel)[0])
    assert {get_args(model.model_fields["kind"].annotation)[0] for model in models} == LINKS.keys() - {"tubes"}


@pytest.mark.parametrize("kind", LINKS)
def test_xacro_length_matches_the_design_space(kind: str) -> None:
    """A design's xacro with the lengths and the base of another is the arm that the space builds of that other."""
    space = DesignSpace.model_validate({**LINKS[kind], "actuators": ["XM430-W350"], "joints": 5})
    one, other = space.sample(2, 46)
    same = [name for name in one.params if name.startswith(("joint_", "tube_"))]
    other = Design({**other.params, **{name: one.params[name] for name in same}})
    text = to_xacro(space.arm(one), "arm", mass_per_metre(space, one))
    arguments: dict[str, object] = {f"link_{n}_length": length for n, length in enumerate(other.links, start=1)}
    arguments |= {f"base_{axis}": value for axis, value in zip("xyz", other.origin, strict=True)}
    assert_same(processed(text), space.arm(one))
    assert_same(processed(text, **arguments), space.arm(other))


def test_mass_proportional_to_length_leaves_no_remainder() -> None:
    """Otherwise rounding would create a separate link of 1e-18 kg."""
    for length in np.random.default_rng(47).uniform(0.01, 1.0, 200).tolist():
        arm = Arm((0.0, 0.0, 0.0), (Joint("fixed", "x"),), (uniform_link((0.0, 0.0, length), 0.7 * length, 0.02),))
        (argument,) = [
            e for e in ElementTree.fromstring(to_xacro(arm, "arm", 0.7)).iter() if e.get("name") == "link_1_mass"
        ][:1]
        assert argument.get("default") == "0.0"


def test_prefix_applies_to_all_names_except_world() -> None:
    text = processed(to_xacro(MIXED), prefix="left_")
    assert_same(text, MIXED, "left_")
    robot = ElementTree.fromstring(text)
    names = [element.attrib["name"] for kind in ("link", "joint") for element in robot.findall(kind)]
    assert [name for name in names if not name.startswith("left_")] == ["world"]


def test_link_length_may_become_zero_or_positive() -> None:
    text = processed(to_xacro(MIXED), link_1_length=0, link_3_length=0.2)
    first = replace(MIXED.links[0], offset=(0.0, 0.0, 0.0), com=(0.0, 0.0, 0.0))
    third = replace(MIXED.links[2], offset=(0.0, 0.0, 0.2))
    assert_same(text, replace(MIXED, links=(first, MIXED.links[1], third, *MIXED.links[3:])))


def test_links_without_length_load_in_mujoco() -> None:
    """The inertia of a disc is at the limit of validity; rounding must not exceed it."""
    joint = Joint("revolute", "y", -1.0, 1.0)
    for mass, radius in np.random.default_rng(48).uniform([0.001, 0.001], [5.0, 0.1], (50, 2)).tolist():
        arm = Arm((0.0, 0.0, 0.0), (joint,), (Link((0.0, 0.0, 0.0), mass, (0.0, 0.0, 0.0), radius),))
        assert mujoco.MjModel.from_xml_string(processed(to_xacro(arm))).nv == 1


NAMES = [
    '<arm> & "friends"',
    "it's",
    "Ärmchen",
    "a]]>b",
    "$(find x)",
    "${1 / 0}",
    "$${x}",
    "$",
    "a$$b",
    "$(arg prefix)",
]


@pytest.mark.parametrize("name", [*NAMES, "1.0", "a{b}", "${'$'}", "${xacro.load_yaml('x')}"])
def test_names_are_escaped_and_never_evaluated(name: str) -> None:
    text = processed(to_xacro(MIXED, name), prefix="left_")
    assert ElementTree.fromstring(text).get("name") == name
    assert Peer(text).model.name == name


def test_export_is_deterministic() -> None:
    assert to_xacro(MIXED) == to_xacro(MIXED)
