"""Spaces with slides, fixed and compound joints, link directions, mounts and tools."""

from dataclasses import fields, is_dataclass
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armwright.exceptions import DesignError, SpaceError
from armwright.kinematics.arms.arm_arrays import FIXED, stack_arms
from armwright.kinematics.arms.forward import joint_positions
from armwright.kinematics.arms.rigid_bodies import Bodies
from armwright.kinematics.ik.ik import solve_postures
from armwright.robot.arm import Arm
from armwright.robot.mjcf import to_mjcf
from armwright.search.samplers import BlackBox
from armwright.spaces.arm_builder import stack_designs
from armwright.spaces.design_space import DesignSpace, builtin_spaces, load_space, paper_space
from armwright.spaces.joint_modules import MODULES, MOUNTS
from armwright.tasks.catalogue import load_task
from armwright.tasks.tool import Tool
from tests.support.arms import LIGHT
from tests.support.exported_arms import peer_of

EVERYTHING: dict[str, Any] = {
    "name": "everything",
    "joints": [1, 6],
    "joint_types": list(MODULES),
    "link_directions": ["+x", "-y", "+z", "-z"],
    "mount": list(MOUNTS),
    "stroke": [0.1, 0.6],
    "limit": [0.5, 2.4],
    "travel": 0.004,
    "actuators": ["XL430-W250", "XM430-W350", "XM540-W270"],
    "motor_bodies": False,  # two joints at one place have no room for them
    "link_section": {
        "tubes": [[0.03, 0.002], [0.02, 0.0015], [0.04, 0.02]],
        "material": {"density": 2700, "youngs": 70e9, "shear": 27e9, "price_per_kg": 12.5},
    },
}
ONE_TUBE = {
    "name": "one-tube", "joints": [2, 4], "joint_types": ["R", "O", "S"], "restrict": {"tube": ["20x1", "40x1"]},
    "link_section": {"tubes": [[0.03, 0.002], [0.02, 0.001], [0.04, 0.001]], "per_link": False, "material": "carbon"},
}  # fmt: skip
ON_COLUMN = {
    "name": "on-column",
    "joints": 2,
    "column": {"price_per_metre": 20.0},
    **LIGHT,
    "actuators": ["XL430-W250"],
}
WITH_MOTORS = {
    "name": "with-motors", "joints": [2, 4], "joint_types": ["R", "P", "Y", "S", "F"], "mount": list(MOUNTS),
    "link_directions": ["+x", "-y", "+z"], **LIGHT, "actuators": ["XM430-W350", "RobStride-00"], "bracket_mass": 0.05,
}  # fmt: skip
TOOL = Tool(
    tip=(0.05, -0.02, 0.1), rpy=(0.3, -0.7, 2.0), mass=0.4, center=(0.01, 0.03, 0.06), inertia=(3e-4, 2e-4, 1e-4)
)
MIXED = DesignSpace.model_validate(EVERYTHING)
TARGETS = load_task("target-2").target_positions


def moving_arms(space: DesignSpace, n: int, seed: int) -> list[Arm]:
    """Of designs at random, those that have a joint that moves."""
    arms = [space.arm(design, TOOL) for design in space.sample(n, seed)]
    return [arm for arm in arms if any(joint.kind != "fixed" for joint in arm.joints)]


def assert_equal_arms(one: Any, other: Any, dof: int) -> None:
    """Compare stacked arms, or a part of them; `one` may have room for more joints."""
    names = ("inertia", "total_mass", "total_com") if isinstance(other, Bodies) else [f.name for f in fields(other)]
    for name in names:
        mine, theirs = getattr(one, name), getattr(other, name)
        if theirs is None or is_dataclass(theirs):
            assert type(mine) is type(theirs)
            if theirs is not None:
                assert_equal_arms(mine, theirs, dof)
        elif name == "price":  # added up in another order
            assert np.allclose(mine, theirs, rtol=1e-14, equal_nan=True)
        else:
            mine = mine if mine.shape == theirs.shape else mine[:, :dof]
            assert np.array_equal(mine, theirs, equal_nan=True), name


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize(
    "space",
    [MIXED, *map(DesignSpace.model_validate, (ONE_TUBE, ON_COLUMN, WITH_MOTORS)), *map(load_space, builtin_spaces())],
    ids=lambda space: space.name,
)
@pytest.mark.fast_cases(6)
def test_stacked_designs_equal_stacked_arms_to_the_bit(space: DesignSpace, precision: Any) -> None:
    designs = space.sample(300, 7)
    one = stack_designs(space, space.matrix(designs), TOOL, precision)
    other = stack_arms([space.arm(design, TOOL) for design in designs], precision)
    assert_equal_arms(one, other, other.dof)
    assert (one.motion[:, other.dof :] == FIXED).all()
    assert not one.bodies.total_mass[:, other.dof :].any()


def test_postures_and_torques_agree_with_pinocchio_and_mujoco() -> None:
    arms = moving_arms(MIXED, 30, 3)
    arrays = stack_arms(arms, "float64")
    solved = solve_postures(arrays, TARGETS, precision="float64")
    for i, arm in enumerate(arms):
        own = [j for j, joint in enumerate(arm.joints) if joint.kind != "fixed"]
        for t in range(len(TARGETS)):
            q = solved.q[i, t, own]
            lower = np.array([arm.joints[j].lower for j in own])
            upper = np.array([arm.joints[j].upper for j in own])
            assert np.all((lower <= q) & (q <= upper))
            tip = peer_of(arm).tip(q)[:3, 3]
            assert np.allclose(tip, solved.reached[i, t], atol=1e-9)
            assert np.allclose(tip, joint_positions(arm, solved.q[i, t, : len(arm.joints)])[-1], atol=1e-9)
            held = peer_of(arm).gravity(q)
            assert np.allclose(held, solved.torque[i, t, own], atol=1e-9 * (1.0 + np.abs(held).max()))
        idle = [j for j in range(arrays.dof) if j not in own]
        assert not solved.q[i][:, idle].any()
        assert not solved.torque[i][:, idle].any()
        scene = mujoco.MjModel.from_xml_string(to_mjcf(arm))
        state = mujoco.MjData(scene)
        state.qpos[:] = solved.q[i, 0, own]
        mujoco.mj_forward(scene, state)
        assert np.allclose(state.qfrc_bias, solved.torque[i, 0, own], atol=1e-6 * (1.0 + np.abs(state.qfrc_bias).max()))
        assert np.allclose(state.site("tip").xpos, solved.reached[i, 0], atol=1e-9)


@pytest.mark.parametrize("mount", list(MOUNTS))
def test_mounted_arm_is_the_floor_arm_rotated(mount: Any) -> None:
    content = {"joint_types": ["R", "P", "Y", "O", "X", "T", "S"], "joints": 5, "link_directions": ["+z", "+x"]}
    content |= {f"origin_{axis}": [0.0, 0.0] for axis in "xyz"}
    floor = DesignSpace.model_validate(content)
    other = DesignSpace.model_validate({**content, "mount": mount})
    turn = np.zeros((3, 3))
    for local, world in enumerate(MOUNTS[mount]):
        turn["xyz".index(world[1]), local] = 1.0 if world[0] == "+" else -1.0
    assert np.linalg.det(turn) == pytest.approx(1.0)
    rng = np.random.default_rng(0)
    for design in floor.sample(30, 5):
        standing, turned = floor.arm(design, TOOL), other.arm(design, TOOL)
        mirrored = [1.0 if a.lower == b.lower else -1.0 for a, b in zip(standing.joints, turned.joints, strict=True)]
        q = rng.uniform(0.0, 0.3, len(standing.joints))
        signs = np.array([
            sign if joint.kind == "prismatic" else way_of(mount, before.axis)
            for sign, joint, before in zip(mirrored, turned.joints, standing.joints, strict=True)
        ])  # fmt: skip
        assert np.allclose(joint_positions(turned, signs * q), joint_positions(standing, q) @ turn.T, atol=1e-12)


def way_of(mount: Any, axis: Any) -> float:
    """1 where the mounted arm's axis points along one of the world's, -1 where it points against it."""
    return 1.0 if MOUNTS[mount]["xyz".index(axis)][0] == "+" else -1.0


@given(seed=st.integers(0, 10_000))
def test_designs_round_trip_through_matrix_and_files(seed: int) -> None:
    (design,) = MIXED.sample(1, seed)
    assert MIXED.designs(MIXED.matrix([design])) == [design]
    assert MIXED.design(design.params) == design
    n = int(str(design.params["n_joints"]))
    assert len(design.joints) == len(design.links) == n
    for j, letter in enumerate(design.joints, start=1):
        module = MODULES[letter]  # pyright: ignore[reportArgumentType]
        assert (f"stroke_{j}" in design.params) == module.is_prismatic
        assert (f"limit_{j}" in design.params) == module.is_revolute
        assert (f"motor_{j}" in design.params) == module.is_actuated
    every = {p.name: MIXED.parameters[i] for i, p in enumerate(MIXED.parameters)}
    filled = {**{name: p.choices[0] if hasattr(p, "choices") else p.low for name, p in every.items()}, **design.params}  # pyright: ignore
    assert MIXED.design(filled) == design  # what does not matter may be given, and is left out


def test_sampler_draws_active_parameters_only() -> None:
    box = BlackBox(MIXED, "tpe", 0)
    for number in range(25):
        trial, design = box.draw(number, "random" if number < 10 else "bbo")
        assert MIXED.design(design.params) == design
        assert trial.params == MIXED.free_values(design)
        box.tell(trial, (float(number), 1.0 / (1 + number)))
    (given_design,) = MIXED.sample(1, 99)
    trial, design = box.inject(given_design, 25)
    assert design == given_design
    assert trial.params == MIXED.free_values(design)


def test_samples_respect_ties_and_grids() -> None:
    content = {"tie": {"link_3": "link_2", "joint_4": "joint_1"}, "grid": {"link": 0.01, "origin_z": 0.25}}
    space = DesignSpace.model_validate(content)
    for design in space.sample(50, 0):
        assert design.links[2] == design.links[1]
        assert design.joints[3] == design.joints[0]
        assert design.origin[2] in (-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)
        assert all(length == round(length, 2) for length in design.links)
        assert space.design(design.params) == design
        assert space.from_free_values(space.free_values(design)) == design
        assert "link_3" not in space.free_values(design)
    with pytest.raises(DesignError, match="tied"):
        space.design({**design.params, "link_3": 0.03 if design.links[1] != 0.03 else 0.04})
    with pytest.raises(DesignError, match="grid"):
        space.design({**design.params, "link_1": 0.0351})


def test_built_in_spaces_load_by_name() -> None:
    assert builtin_spaces()[0] == "paper"
    assert {"autodesign", "slideopt", "desk-sorting"} < set(builtin_spaces())
    assert load_space("paper") == paper_space()
    with pytest.raises(SpaceError, match='Did you mean "slideopt"'):
        load_space("slidopt")
