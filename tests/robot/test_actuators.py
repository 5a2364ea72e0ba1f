"""Actuators: their masses as loads and their torques as limits."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pinocchio
import pytest
import yaml

from armwright.exceptions import ArmError, SettingsError, SpaceError
from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.problem.evaluation import evaluate
from armwright.problem.objectives import named_objectives
from armwright.problem.problem import Problem
from armwright.robot.actuators import UNITS, ActuatorRecord, catalogue, catalogue_sources
from armwright.robot.arm import Actuator, Arm, Joint, Link
from armwright.robot.mjcf import to_mjcf
from armwright.robot.urdf_writer import to_urdf
from armwright.spaces.design_space import DesignSpace, load_space
from armwright.tasks.task import Task
from tests import ROOT
from tests.support.arms import LIGHT

BIG = {"name": "big", "mass": 0.165, "stall_torque": 10.6, "rated_torque": 4.0, "speed": 3.1, "price": 400.0}
MID = {"name": "mid", "mass": 0.082, "stall_torque": 4.1, "price": 250.0}
SMALL = {"name": "small", "mass": 0.0572, "stall_torque": 1.5, "price": 50.0}
SPACE = DesignSpace.model_validate(
    {"name": "motors", **LIGHT, "actuators": [BIG, MID, SMALL], "safety_factor": 2.0, "motor_bodies": False}
)
TASK = Task(name="loaded", targets=((0.3, 0.0, 0.2), (0.2, 0.2, 0.3)), payload=0.1)


def with_motors_as_links(arm: Arm) -> Arm:
    """The same arm, its actuators as links of their own without length, fixed to the ends of those that carry them."""
    joints: list[Joint] = []
    links: list[Link] = []
    for joint, link in zip(arm.joints, arm.links, strict=True):
        joints += [joint, Joint("fixed", "x")]
        links += [replace(link, end_mass=0.0), Link((0.0, 0.0, 0.0), link.end_mass, (0.0, 0.0, 0.0), 1e-9)]
    return Arm(arm.base, tuple(joints), tuple(links))


def pinocchio_model(arm: Arm) -> tuple[pinocchio.Model, pinocchio.Data]:
    model = pinocchio.buildModelFromXML(to_urdf(arm))
    return model, model.createData()


def test_actuator_masses_agree_with_pinocchio_and_mujoco() -> None:
    rng = np.random.default_rng(0)
    problem = Problem(TASK.model_copy(update={"payload": 0.0}), SPACE)
    designs = SPACE.sample(20, 3)
    evaluation = problem.physics(designs)
    for row, design in enumerate(designs):
        arm = SPACE.arm(design)
        reference, data = pinocchio_model(with_motors_as_links(arm))
        for t in range(2):
            gravity = pinocchio.computeGeneralizedGravity(reference, data, evaluation.q[row, t])
            assert evaluation.joint_torques[row, t] == pytest.approx(gravity, abs=2e-5)
        ours, ours_data = pinocchio_model(arm)
        simulated = mujoco.MjModel.from_xml_string(to_mjcf(arm))
        state = mujoco.MjData(simulated)
        q, v, a = rng.uniform(-2.0, 2.0, (3, 4))
        expected = pinocchio.rnea(reference, data, q, v, a)
        assert pinocchio.rnea(ours, ours_data, q, v, a) == pytest.approx(expected, abs=1e-8)
        state.qpos[:], state.qvel[:], state.qacc[:] = q, v, a
        mujoco.mj_inverse(simulated, state)
        assert state.qfrc_inverse == pytest.approx(expected, abs=1e-8)


def test_actuation_is_by_the_motion_of_the_joint() -> None:
    """A slide of 0.02 m/rad turns torques into forces, speeds into m/s, and inertia into a mass of equal energy."""
    motor = ActuatorRecord(name="x", mass=0.1, stall_torque=4.0, speed=5.0, voltage=12.0, corner_speed=2.0).actuator()
    joints = (Joint("prismatic", "z", 0.0, 0.3, motor, travel=0.02), Joint("revolute", "y", -1.0, 1.0, motor))
    arms = stack_arms([Arm((0.0, 0.0, 0.0), joints, (Link((0.1, 0.0, 0.0), 0.1, (0.05, 0.0, 0.0), 0.01),) * 2)])
    actuation = arms.actuation
    slide, hinge = (
        {name: values[0, j] for name, values in vars(actuation).items() if values.ndim == 2} for j in (0, 1)
    )
    assert (hinge["peak"], hinge["no_load_speed"]) == (4.0, 5.0)
    assert slide["peak"] == pytest.approx(4.0 / 0.02)  # N
    assert slide["no_load_speed"] == pytest.approx(5.0 * 0.02)  # m/s
    assert slide["backlash"] == pytest.approx(0.02 * hinge["backlash"])  # m
    assert slide["joint_stiffness"] == pytest.approx(hinge["joint_stiffness"] / 0.02**2)  # N/m
    assert slide["corner_speed"] == pytest.approx(0.02 * 2.0)
    for mass, speed in ((slide, 0.1), (hinge, 5.0)):
        assert 0.5 * mass["rotor_inertia"] * speed**2 == pytest.approx(0.5 * motor.rotor_inertia * 25.0)
        assert mass["viscous"] * speed**2 == pytest.approx(motor.viscous_friction * 25.0)  # W


def test_voltages_counts_different_supplies() -> None:
    space = DesignSpace.model_validate({"joints": 3, **LIGHT, "actuators": ["XL330-M288", "XM430-W350", "XM540-W270"]})
    problem = Problem(TASK.model_copy(update={"constraints": ("voltages <= 1",)}), space)
    base = space.sample(1, 0)[0].params
    rows = [("XL330-M288", "XM430-W350", "XM540-W270"), ("XM540-W270", "XM430-W350", "XM540-W270"), ("XL330-M288",) * 3]
    designs = [space.design(base | {f"motor_{j}": m for j, m in enumerate(row, start=1)}) for row in rows]
    assert problem.evaluate(designs).violations[:, 0].tolist() == [1.0, 0.0, 0.0]
    unknown = DesignSpace.model_validate({**LIGHT, "actuators": [MID], "motor_bodies": False})
    with pytest.raises(SettingsError, match="voltages needs the voltage of every actuator"):
        Problem(problem.task, unknown).evaluate(unknown.sample(1, 0))


def test_torque_utilisation_is_the_worst_share_of_peak_torque_with_the_safety_factor() -> None:
    problem = Problem(TASK, SPACE, objectives=named_objectives(["torque_utilisation"]))
    designs = SPACE.sample(30, 5)
    torques = np.abs(problem.physics(designs).joint_torques)
    allowed = {"big": 5.3, "mid": 2.05, "small": 0.75}
    for use, row, design in zip(problem.evaluate(designs).values[:, 0], torques, designs, strict=True):
        shares = [torque / allowed[name] for torque, name in zip(row.max(axis=0), design.motors, strict=True)]
        assert use == pytest.approx(max(shares))


@pytest.mark.parametrize(
    ("space", "words"),
    [
        ({"actuators": ["XM430-W35"]}, 'unknown actuator "XM430-W35".*Did you mean'),
        ({**LIGHT, "actuators": [BIG, dict(BIG)]}, "actuators: expected different ones"),
        ({"actuators": [{"name": "x", "mass": 1.0}]}, "actuator x states no torque; give stall_torque"),
        ({"actuators": [BIG | {"corner_speed": 4.0}]}, "corner_speed is above the no-load speed of 3.1 rad/s"),
        ({"actuators": [MID | {"estimates": ["speed"]}]}, "estimates names speed, which has no value"),
    ],
)
def test_unbuildable_actuator_settings_are_refused(tmp_path: Path, space: dict, words: str) -> None:
    (tmp_path / "space.yaml").write_text(yaml.safe_dump(space), encoding="utf-8")
    with pytest.raises(SpaceError, match=words):
        load_space(tmp_path / "space.yaml")


@pytest.mark.parametrize("wrong", [{"mass": -0.1}, {"peak_torque": 0.0}, {"price": -1.0}, {"speed": float("inf")}])
def test_invalid_actuator_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ArmError, match="an actuator needs"):
        Actuator(**{"name": "x", "mass": 0.1, "peak_torque": 1.0, **wrong})


def test_catalogue_states_a_source_for_each_actuator_and_value_of_its_drives() -> None:
    own = ("gear_ratio", "rotor_inertia", "coulomb_friction", "viscous_friction", "corner_speed", "backlash",
           "position_gain", "damping_gain", "current", "load_friction", "bearing_offset", "tilting_limit",
           "axial_limit", "radial_limit")  # fmt: skip
    for name, record in catalogue().items():
        assert record.source.startswith("https://")
        sources = catalogue_sources()[name]
        stated = {key for key in own if getattr(record, key) is not None}
        assert stated <= sources.keys(), name
        assert all(source.address.startswith("https://") and source.statement for source in sources.values()), name


def test_catalogue_completes_every_actuator_and_counts_assumed_values() -> None:
    records = catalogue().values()
    for record in records:
        completed = record.completed()
        open_ = {"stall_torque", "gear_ratio", "price", "width", "height", "depth", "shaft_offset", "tilting_limit",
                 "axial_limit", "radial_limit"}  # fmt: skip
        assert all(getattr(completed, name) is not None for name in UNITS.keys() - open_), record.name
        stated = [name for name in UNITS if getattr(record, name) is not None and name not in record.estimates]
        assert not set(stated) & set(record.assumed)
        assert completed.rated_torque <= completed.peak_torque, record.name
        assert 0.0 <= completed.corner_speed < completed.speed, record.name
        friction = completed.coulomb_friction + completed.viscous_friction * completed.speed
        assert friction < completed.peak_torque, record.name  # else it would not reach its no-load speed
    n_values = sum(getattr(record.completed(), name) is not None for record in records for name in UNITS)
    n_assumed = sum(len(record.assumed) for record in records)
    n_estimates = sum(len(record.estimates) for record in records)
    guide = (ROOT / "docs" / "spaces.md").read_text(encoding="utf-8")
    stated = f"{n_assumed} of its {n_values} values, {n_assumed - n_estimates} defaults and {n_estimates} estimates"
    assert stated in guide


def test_two_actuators_at_one_joint_are_one_of_twice_the_torque() -> None:
    """They share a shaft, so what adds up doubles, also at other voltages, and the body is twice as long."""
    content = {"name": "s", "link_section": {"material": "aluminium", "tubes": [[0.03, 0.002]]}}
    space = DesignSpace.model_validate({**content, "actuators": ["XM430-W350", {"2x": "XM430-W350"}]})
    again = DesignSpace.model_validate_json(space.model_dump_json())
    assert [record.name for record in again.actuators] == ["XM430-W350", "2x-XM430-W350"]
    assert again.actuators[1].assumed == tuple(n for n in space.actuators[0].assumed if not n.startswith("voltage"))
    for supply in (11.1, 12.0, 14.8):
        one, two = (record.at_supply(supply).actuator() for record in again.actuators)
        for name in (
            "mass",
            "peak_torque",
            "continuous_torque",
            "rotor_inertia",
            "price",
            "current",
            "joint_stiffness",
        ):
            assert getattr(two, name) == pytest.approx(2.0 * getattr(one, name)), name
        assert (two.speed, two.corner_speed, two.backlash) == (one.speed, one.corner_speed, one.backlash)
        assert one.shape is not None
        assert two.shape == replace(one.shape, length=2.0 * one.shape.length)
    with pytest.raises(ValueError, match='unknown actuator "XM43"'):
        DesignSpace.model_validate({**content, "actuators": [{"2x": "XM43"}]})


def test_defaults_are_ratios_of_the_reference_torque() -> None:
    record = ActuatorRecord(name="x", mass=0.1, stall_torque=4.0, speed=5.0, voltage=12.0, backlash=0.01)
    completed = record.completed()
    assert (completed.peak_torque, completed.rated_torque, completed.corner_speed) == (4.0, 1.0, 0.0)
    assert completed.rotor_inertia == pytest.approx(0.047 * 4.0 / 5.0)
    assert completed.damping_gain == pytest.approx(4.0 / 5.0)
    assert completed.current == pytest.approx(1.6 * 4.0 * 5.0 / 12.0)
    assert not {"backlash", "stall_torque", "peak_torque"} & set(record.assumed)
    assert "rotor_inertia" in record.assumed
    rated = ActuatorRecord(name="x", mass=0.1, kind="geared drive", rated_torque=4.0)
    assert rated.completed().peak_torque == 4.0
    assert rated.completed().coulomb_friction == pytest.approx(0.07 * 8.0)
    assert rated.completed().rotor_inertia is None  # needs the speed
    assert "peak_torque" in rated.assumed


def open_manipulator_x() -> Arm:
    """ROBOTIS OpenMANIPULATOR-X from its maker's URDF; the links' masses hold their actuators."""
    motor = catalogue()["XM430-W350"].actuator()
    limits = ((-0.9, 0.9), (-0.57, 0.5), (-0.3, 0.44), (-0.57, 0.65))
    bodies = [
        ((0.0, 0.0, 0.0595), 0.098406837, (-0.000301849, 0.000540437, 0.047433464)),
        ((0.024, 0.0, 0.128), 0.13850917, (0.010308393, 0.000377434, 0.101701970)),
        ((0.124, 0.0, 0.0), 0.13274562, (0.090909590, 0.000389298, 0.000224133)),
        ((0.126, 0.0, 0.0), 0.16327573, (0.048796, 0.0, 0.007822)),  # with both fingers of the gripper, 10 g each
    ]
    joints = [
        Joint("revolute", axis, np.pi * low, np.pi * high, motor)
        for axis, (low, high) in zip("zyyy", limits, strict=True)
    ]
    return Arm(
        (0.012, 0.0, 0.017), tuple(joints), tuple(Link(offset, mass, com, 0.015) for offset, mass, com in bodies)
    )


@pytest.mark.parametrize(("payload", "holds"), [(0.0, True), (0.5, True), (1.0, False)])
def test_open_manipulator_x_carries_its_rated_payload_but_not_twice(payload: float, holds: bool) -> None:
    """0.5 kg at a reach of 0.38 m, by the stall torque of its XM430-W350 at 12 V: the maker's specification."""
    reached = (0.012 + 0.378, 0.0, 0.017 + 0.0595)  # the shoulder's height, 2 mm short of the stretched arm
    evaluation = evaluate([open_manipulator_x()], [reached], payload=payload)
    assert evaluation.position_error[0, 0] < 0.01  # the stretched arm is singular
    (use,) = named_objectives(["torque_utilisation"])[0](evaluation)
    assert (use <= 1.0) == holds
