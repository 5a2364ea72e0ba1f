"""The design space: parameters, arms, validation."""

import math
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from armwright.exceptions import DesignError, SpaceError
from armwright.robot.tubes import MATERIALS
from armwright.spaces.design_space import DesignSpace, load_space, paper_space
from armwright.spaces.link_mass import MassPerLink
from armwright.spaces.link_section import LinkSection
from armwright.spaces.parameters import Design, FloatParameter

GOOD = paper_space().sample(1, 0)[0].params


def test_paper_space_has_the_parameters_of_the_paper() -> None:
    space = paper_space(joints=4)
    names = [parameter.name for parameter in space.parameters]
    joints = [f"joint_{j}" for j in (1, 2, 3, 4)]
    assert names == ["origin_x", "origin_y", "origin_z", *joints, "link_1", "link_2", "link_3", "link_4"]
    assert [(p.low, p.high) for p in space.parameters if isinstance(p, FloatParameter)] == [(-1, 1)] * 3 + [
        (0.03, 0.30)
    ] * 4


def test_design_builds_the_arm_of_its_values() -> None:
    space = paper_space()
    design = space.clipped((0.1, -0.2, 0.3), "YPRP", (0.1, 0.2, 0.05, 0.3))
    arm = space.arm(design)
    assert arm.base == (0.1, -0.2, 0.3)
    assert [joint.axis for joint in arm.joints] == ["z", "y", "x", "y"]
    assert {(joint.kind, joint.lower, joint.upper) for joint in arm.joints} == {("revolute", -2.4, 2.4)}
    assert [link.offset for link in arm.links] == [(0, 0, 0.1), (0, 0, 0.2), (0, 0, 0.05), (0, 0, 0.3)]
    assert [link.mass for link in arm.links] == pytest.approx([0.00121, 0.00242, 0.000605, 0.00363])
    assert arm.links[1].com == (0, 0, 0.1)
    assert arm.reach == pytest.approx(0.65)
    assert (design.origin, design.joints, design.links) == ((0.1, -0.2, 0.3), "YPRP", (0.1, 0.2, 0.05, 0.3))


def test_mass_model_sets_link_masses() -> None:
    design = paper_space().clipped((0, 0, 0), "YPRP", (0.1, 0.2, 0.05, 0.3))
    per_link = paper_space().model_copy(update={"mass": MassPerLink(kind="per_link")})
    assert [link.mass for link in per_link.arm(design).links] == [0.002] * 4
    tubes = LinkSection(tubes=((0.03, 0.002),), material=MATERIALS["aluminium"])
    of_tubes = paper_space().model_copy(update={"link_section": tubes})
    assert of_tubes.link_mass(1.0) == pytest.approx(2700 * math.pi * (0.015**2 - 0.013**2))
    assert "a toy" in paper_space().mass_note
    assert "a toy" not in of_tubes.mass_note


@given(seed=st.integers(0, 2**31), joints=st.integers(1, 8))
def test_samples_lie_in_the_space(seed: int, joints: int) -> None:
    space = paper_space(joints)
    for design in space.sample(3, seed):
        assert space.design(design.params) == design


@given(st.lists(st.floats(-10, 10), min_size=7, max_size=7))
def test_clipped_is_always_in_the_space(values: list[float]) -> None:
    design = paper_space().clipped(values[:3], "YPRP", values[3:])
    assert paper_space().design(design.params) == design


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"link_3": 1.4}, "link_3 = 1.4 m is outside 0.03 <= link_3 <= 0.3 m"),
        ({"origin_x": float("nan")}, "origin_x = nan is not a finite number [m]"),
        ({"origin_x": True}, "origin_x = True is not a finite number [m]"),
        ({"joint_1": ["R"]}, "joint_1 = ['R'] is not one of R, P, Y"),
        ({"origin_x": "0.1"}, "origin_x = '0.1' is not a finite number [m]"),
        ({"joint_1": "Z"}, "joint_1 = 'Z' is not one of R, P, Y"),
        ({"orgin_x": 0.0}, 'unknown parameter "orgin_x".*Did you mean "origin_x"?'),
    ],
)
def test_invalid_values_are_named(change: dict[str, object], message: str) -> None:
    with pytest.raises(DesignError) as refusal:
        paper_space().design({**GOOD, **change})
    for part in message.split(".*"):
        assert part in str(refusal.value)


def test_missing_parameters_are_named() -> None:
    with pytest.raises(DesignError, match="missing: link_4"):
        paper_space().design({name: value for name, value in GOOD.items() if name != "link_4"})


def test_space_file_keeps_defaults_of_missing_keys(tmp_path: Path) -> None:
    file = tmp_path / "space.yaml"
    file.write_text(
        "name: six\njoints: 6\nlink: [0.1, 0.5]\norigin_z: [0, 0]\n"
        "link_section: {tubes: [[0.03, 0.002]], material: aluminium}\n",
        encoding="utf-8",
    )
    space = load_space(file)
    assert (space.joints, space.link, space.origin_z, space.origin_x) == (6, (0.1, 0.5), (0.0, 0.0), (-1.0, 1.0))
    assert space.design(space.sample(1, 0)[0].params).params["origin_z"] == 0.0
    assert DesignSpace.model_validate(space.model_dump(mode="json")) == space


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("joints: 9", "joints: expected a number of at most 8, got 9"),
        ("link: [0.3, 0.03]", "link: [0.3, 0.03] is reversed"),
        ("link: [0, 0.3]", "link[0]: expected a number above 0 m"),
        ("joints: [3, 2]", "joints: [3, 2] is reversed"),
        ("joint_types: [F]", "at least one type that moves"),
        ("stroke: [0.3, 0.1]\njoint_types: [S]", "is reversed"),
        ("tie: {link_9: link_1}", 'unknown parameter "link_9"'),
        ("tie: {link_2: origin_x}", "different ranges"),
        ("tie: {link_2: link_3, link_3: link_4}", "tied itself"),
        ("tie: {link_2: link_3}\njoints: [2, 3]", "reverse the tie"),
        ("grid: {joint_1: 1.0}", "unknown parameter"),
        ("restrict: {joint_1: S}", "joint_1 = 'S' is not one of R, P, Y"),
        ("restrict: {joint_1: []}", "joint_1 has no choice left"),
        ("restrict: {link_9: 0.1}", 'unknown parameter "link_9". Did you mean'),
        ("restrict: {link_1: [0.2, 0.1]}", "is outside"),
        ("restrict: {link_1: Y}", "neither a number nor a range"),
        ("joint_range: [0.5, 2.4]", "must contain 0"),
        ("joint_range: [0, 0.01]", "narrower than 3 degrees"),
        ("joint_types: [R, R]", "joint_types: expected different ones, got R, R"),
        ("joint_range: [-7, 2.4]", "exceeds ±2π"),
        ("link_section: {tubes: [[0.03, 0.02]]}", "expected a wall of at most the radius, 0.015 m"),
        ("link_section: {tubes: [[20, 1.5]]}", "got 20 m; lengths are in metres: write 0.02 for 20 mm"),
        ("link_section: {tubes: [[0.03, 0.002], [0.03, 0.002]]}", "duplicates among 30x2, 30x2"),
        ("link_section: {material: {density: 1, youngs: 70, shear: 27}}", "got 70 Pa; 70 GPa is 70.0e+9"),
        ("link_section: {material: steel}\nmass: {kind: per_link}", "beside link_section.material"),
        ("column: {outer_diameter: 60}", "column: expected an outer diameter of at most 1 m, got 60 m"),
        ("column: {wall: 0.04}", "column: expected a wall of at most the radius, 0.03 m"),
        ("column: {}\nmount: wall+x", "column: expected mount: floor, got wall+x"),
        ("base_on: table\nmount: [floor, ceiling]", "base_on: expected mount: floor, got floor, ceiling"),
        ("origin_x: [-2000, 1]", "origin_x[0]: expected a number of at least -1000 m"),
        ("parameters: {link_3: {range: [1, 2]}}", '"link_3" is the name of a built-in parameter; try "my_link"'),
        ("parameters: {gear_1: {range: [1, 2]}}", 'without a number at its end, got "gear_1"; try per: joint'),
        ("parameters: {Kp: {range: [1, 2]}}", "lowercase letters"),
        ("parameters: {kp: {range: [1, 2], choices: [a]}}", "kp: expected a range or choices"),
        ("parameters: {kp: {range: [2, 1], unit: N m}}", "kp: range: [2, 1] is reversed"),
        ("parameters: {kp: {range: [0, 1], scale: log}}", "expected values above 0 with scale: log"),
        ("parameters: {kp: {range: [0.5, 1], integer: true}}", "expected whole numbers"),
        ("parameters: {belt: {choices: [a, A]}}", "expected different names"),
        ("parameters: {belt: {choices: [a b]}}", "belt: choices[0]: expected text of the form"),
        ("parameters: {belt: {choices: [a], unit: m}}", "expected no scale, integer or unit"),
        ("- a\n- list", "keys and values"),
        ("joints: 4\njoints: 5", "duplicate key"),
    ],
)
def test_invalid_space_files_are_refused_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "space.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(SpaceError) as refusal:
        load_space(file)
    assert words in str(refusal.value)
    assert str(file) in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_copied_space_has_its_own_parameters() -> None:
    space = paper_space()
    assert len(space.parameters) == 11
    assert len(space.model_copy(update={"joints": 2}).parameters) == 7


def test_order_of_parameter_values_is_irrelevant() -> None:
    turned = Design(dict(reversed(GOOD.items())))
    assert turned == Design(GOOD)
    assert hash(turned) == hash(Design(GOOD))
    assert paper_space().arm(turned) == paper_space().arm(Design(GOOD))


def test_design_of_another_space_is_refused() -> None:
    with pytest.raises(DesignError, match="joint_5"):
        paper_space().arm(paper_space(5).sample(1, 0)[0])
    with pytest.raises(DesignError, match="joint_1 = 'S' is not one of R, P, Y"):
        paper_space().arm(Design(GOOD | {"joint_1": "S"}))
    with pytest.raises(SpaceError, match="at most 8"):
        paper_space(9)


RESTRICTED = {"joint_1": "Y", "joint_2": ["P", "R"], "origin_z": 0.0, "link_1": [0.1, 0.2]}


def test_restrict_fixes_or_narrows_parameters(tmp_path: Path) -> None:
    (tmp_path / "space.yaml").write_text(yaml.safe_dump({"restrict": RESTRICTED}), encoding="utf-8")
    space = load_space(tmp_path / "space.yaml")
    designs = space.sample(200, 1)
    assert {design.joints[0] for design in designs} == {"Y"}
    assert {design.joints[1] for design in designs} == {"P", "R"}
    assert {design.joints[2] for design in designs} == {"R", "P", "Y"}
    assert {design.origin[2] for design in designs} == {0.0}
    assert 0.1 <= min(design.links[0] for design in designs) <= max(design.links[0] for design in designs) <= 0.2
    assert space.designs(space.matrix(designs)) == designs
    assert DesignSpace.model_validate_json(space.model_dump_json()) == space
    moved = space.clipped((0.0, 0.0, 0.7), "RYPY", (0.3, 0.3, 0.3, 0.3))
    assert (moved.joints, moved.origin[2], moved.links[0]) == ("YRPY", 0.0, 0.2)
