"""Actuators: their masses as loads and their torques as limits."""

import json
from dataclasses import fields, replace
from pathlib import Path

import mujoco
import numpy as np
import pinocchio
import pytest
import yaml
from typer.testing import CliRunner

from armwright.cli.app import app
from armwright.exceptions import ArmError, SettingsError, SpaceError
from armwright.kinematics.arms.actuation import Actuation
from armwright.kinematics.arms.arm_arrays import FLOATS, stack_arms
from armwright.problem.evaluation import evaluate
from armwright.problem.objectives import named_objectives
from armwright.problem.problem import Problem
from armwright.robot.actuators import UNITS, ActuatorRecord, catalogue, catalogue_sources
from armwright.robot.arm import Actuator, Arm, Joint, Link
from armwright.robot.mjcf import to_mjcf
from armwright.robot.urdf_writer import to_urdf
from armwright.runs.folder import read_run
from armwright.spaces.batch_builder import stack_designs
from armwright.spaces.design_space import DesignSpace, load_space
from armwright.study.study import optimize
from armwright.tasks.task import Task
from tests import ROOT

BIG = {"name": "big", "mass": 0.165, "stall_torque": 10.6, "rated_torque": 4.0, "speed": 3.1, "price": 400.0}
MID = {"name": "mid", "mass": 0.082, "stall_torque": 4.1, "price": 250.0}
SMALL = {"name": "small", "mass": 0.0572, "stall_torque": 1.5, "price": 50.0}
SPACE = DesignSpace.model_validate(
    {"name": "motors", "actuators": [BIG, MID, SMALL], "safety_factor": 2.0, "motor_bodies": False}
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


def test_stacked_designs_and_arms_have_equal_actuators() -> None:
    designs = SPACE.sample(200, 1)
    one, other = stack_designs(SPACE, SPACE.matrix(designs)), stack_arms([SPACE.arm(design) for design in designs])
    for name in (*FLOATS, "motion", "base_mass"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
    for field in fields(Actuation):
        mine, theirs = (getattr(arms.actuation, field.name) for arms in (one, other))
        assert np.array_equal(mine, theirs, equal_nan=True), field.name
    part = one[3:9]
    assert np.array_equal(part.actuation.peak, one.actuation.peak[3:9])


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


def test_first_actuator_adds_mass_but_no_torque() -> None:
    design = SPACE.sample(1, 0)[0]
    swapped = [SPACE.design({**design.params, "motor_1": name}) for name in ("big", "mid", "small")]
    objectives = named_objectives(["peak_torque", "mass", "price"])
    values = Problem(TASK, SPACE, objectives=objectives).evaluate(swapped).values
    assert np.ptp(values[:, 0]) == 0.0
    assert np.diff(values[:, 1]) == pytest.approx([0.082 - 0.165, 0.0572 - 0.082], abs=1e-6)
    assert np.diff(values[:, 2]).tolist() == [-150.0, -200.0]


def test_actuation_is_by_the_motion_of_the_joint() -> None:
    """A slide of 0.02 m/rad turns torques into forces, speeds into m/s, and inertia into a mass of equal energy."""
    motor = ActuatorRecord(name="x", mass=0.1, stall_torque=4.0, speed=5.0, voltage=12.0).actuator()
    joints = (Joint("prismatic", "z", 0.0, 0.3, motor, travel=0.02), Joint("revolute", "y", -1.0, 1.0, motor))
    arms = stack_arms([Arm((0.0, 0.0, 0.0), joints, (Link((0.1, 0.0, 0.0), 0.1, (0.05, 0.0, 0.0), 0.01),) * 2)])
    actuation = arms.actuation
    slide, hinge = (
        {name: getattr(actuation, name)[0, j] for name in ("peak", "no_load_speed", "rotor_inertia", "viscous")}
        for j in (0, 1)
    )
    assert (hinge["peak"], hinge["no_load_speed"]) == (4.0, 5.0)
    assert slide["peak"] == pytest.approx(4.0 / 0.02)  # N
    assert slide["no_load_speed"] == pytest.approx(5.0 * 0.02)  # m/s
    for mass, speed in ((slide, 0.1), (hinge, 5.0)):
        assert 0.5 * mass["rotor_inertia"] * speed**2 == pytest.approx(0.5 * motor.rotor_inertia * 25.0)
        assert mass["viscous"] * speed**2 == pytest.approx(motor.viscous_friction * 25.0)  # W


def test_voltages_counts_different_supplies() -> None:
    space = DesignSpace.model_validate({"joints": 3, "actuators": ["XL330-M288", "XM430-W350", "XM540-W270"]})
    problem = Problem(TASK.model_copy(update={"constraints": ("voltages <= 1",)}), space)
    base = space.sample(1, 0)[0].params
    rows = [("XL330-M288", "XM430-W350", "XM540-W270"), ("XM540-W270", "XM430-W350", "XM540-W270"), ("XL330-M288",) * 3]
    designs = [space.design(base | {f"motor_{j}": m for j, m in enumerate(row, start=1)}) for row in rows]
    assert problem.evaluate(designs).violations[:, 0].tolist() == [1.0, 0.0, 0.0]
    unknown = DesignSpace.model_validate({"actuators": [MID], "motor_bodies": False})
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


def test_single_actuator_is_not_a_parameter() -> None:
    single = DesignSpace.model_validate({"actuators": [MID], "motor_bodies": False})
    assert len(single.parameters) == 11
    design = single.sample(1, 0)[0]
    assert [joint.actuator.name for joint in single.arm(design).joints] == ["mid"] * 4
    assert stack_designs(single, single.matrix([design])).actuation.peak.tolist() == [[4.1] * 4]


@pytest.mark.parametrize(
    ("space", "words"),
    [
        ({"actuators": ["XM430-W35"]}, 'unknown actuator "XM430-W35".*Did you mean'),
        ({"actuators": [BIG, dict(BIG)]}, "actuators has duplicates"),
        ({"actuators": [{"name": "x", "mass": -1.0}]}, "mass"),
        ({"actuators": [{"name": "x", "mass": 1.0}]}, "actuator x states no torque; give stall_torque"),
        ({"actuators": [MID | {"kind": "hydraulic"}]}, "kind"),
        ({"actuators": [BIG | {"corner_speed": 4.0}]}, "corner_speed is above the no-load speed of 3.1 rad/s"),
        ({"actuators": [MID | {"estimates": ["speed"]}]}, "estimates names speed, which has no value"),
        ({"actuators": "XM430-W350"}, "expected a list of names"),
        ({"actuators": [MID], "safety_factor": 0.0}, "safety_factor"),
    ],
)
def test_unbuildable_actuator_settings_are_refused(tmp_path: Path, space: dict, words: str) -> None:
    (tmp_path / "space.yaml").write_text(yaml.safe_dump(space), encoding="utf-8")
    with pytest.raises(SpaceError, match=words):
        load_space(tmp_path / "space.yaml")


def test_objectives_report_missing_actuators() -> None:
    for name in ("torque_utilisation", "price"):
        problem = Problem(TASK, objectives=named_objectives([name]))
        with pytest.raises(SettingsError, match=f"objective {name} needs actuators"):
            problem.evaluate(problem.space.sample(1, 0))
    unpriced = DesignSpace.model_validate(
        {"actuators": [{"name": "x", "mass": 0.1, "stall_torque": 1.0}], "motor_bodies": False}
    )
    with pytest.raises(SettingsError, match="needs the price of every actuator"):
        Problem(TASK, unpriced, objectives=named_objectives(["price"])).evaluate(unpriced.sample(1, 0))


@pytest.mark.parametrize("wrong", [{"mass": -0.1}, {"peak_torque": 0.0}, {"price": -1.0}, {"speed": float("inf")}])
def test_invalid_actuator_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ArmError, match="an actuator needs"):
        Actuator(**{"name": "x", "mass": 0.1, "peak_torque": 1.0, **wrong})


def test_catalogue_names_a_source_for_each_actuator() -> None:
    records = catalogue()
    assert len(records) >= 14
    for name, record in records.items():
        assert record.name == name
        assert record.source.startswith("https://")
        assert record.mass > 0.0
        assert any((record.stall_torque, record.rated_torque, record.peak_torque)), name
    assert records["XM430-W350"].stall_torque == 4.1
    assert records["XM430-W350"].mass == 0.082


def test_catalogue_states_a_source_for_each_value_of_its_drives() -> None:
    own = ("gear_ratio", "rotor_inertia", "coulomb_friction", "viscous_friction", "corner_speed", "backlash",
           "position_gain", "damping_gain", "current")  # fmt: skip
    for name, record in catalogue().items():
        sources = catalogue_sources()[name]
        stated = {key for key in own if getattr(record, key) is not None}
        assert stated <= sources.keys(), name
        assert all(source.address.startswith("https://") and source.statement for source in sources.values()), name


def test_catalogue_completes_every_actuator_and_counts_assumed_values() -> None:
    records = catalogue().values()
    for record in records:
        completed = record.completed()
        values = [getattr(completed, name) for name in UNITS if name not in ("stall_torque", "gear_ratio", "price")]
        assert all(value is not None for value in values[:-4]), record.name  # sizes may be missing
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
    assert f"{n_assumed} of the catalogue's {n_values} values are assumed" in guide
    assert f"{n_assumed - n_estimates} defaults and {n_estimates} estimates" in guide


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


def test_command_lists_the_sources_of_an_actuator() -> None:
    runner = CliRunner()
    shown = runner.invoke(app, ["actuators", "XL330-M288"], env={"COLUMNS": "300"}).output
    assert "https://github.com/Rhoban/bam" in shown
    assert "assumed: default of a servo" in shown
    listed = json.loads(runner.invoke(app, ["actuators", "STS3215-12V", "--json"]).output)
    assert "rotor_inertia" in listed[0]["assumed"]
    assert listed[0]["rotor_inertia"] == 0.0284
    with pytest.raises(SpaceError, match='Did you mean "XL330-M288"'):
        runner.invoke(app, ["actuators", "XL330-M28"], catch_exceptions=False)


def test_actuators_reach_run_prompt_page_and_exports(tmp_path: Path) -> None:
    """Follow actuators through space file, run, rules, prompt, page, URDF, data sheet and command."""
    task = TASK.model_copy(update={"objectives": ("worst_error", "torque_utilisation", "price")})
    run = optimize(Problem(task, SPACE), proposer="rules", n_init=6, n_step=3, n_total=18, out=tmp_path / "run")
    config, history = read_run(tmp_path / "run")
    assert config.space == SPACE
    assert np.array_equal(history.problem.evaluate([t.design for t in history]).values, history.values)
    assert {len(trial.design.motors) for trial in run.trials} == {4}
    proposed = [trial.design for trial in run.trials if trial.source == "rules"]
    assert proposed[0].motors == ("big", "big", "mid", "small")
    member = run.front[0]
    urdf = pinocchio.buildModelFromXML(to_urdf(member.arm))
    assert urdf.effortLimit.tolist() == [joint.actuator.peak_torque for joint in member.arm.joints]
    simulated = mujoco.MjModel.from_xml_string(to_mjcf(member.arm))
    assert simulated.actuator_ctrlrange[:, 1].tolist() == [joint.actuator.peak_torque for joint in member.arm.joints]
    runner = CliRunner()
    prompt = runner.invoke(app, ["optimize", str(tmp_path / "run"), "--print-prompt", "next"]).output
    assert "- mid: 0.082 kg, 4.1 N m, 250 USD" in prompt
    assert f"MOTORS: ({', '.join(member.design.motors)})" in prompt or "MOTORS: (" in prompt
    sheet = runner.invoke(app, ["datasheet", str(tmp_path / "run"), "--design", str(member.number), "--json"])
    motors = [part for part in json.loads(sheet.output)["parts"] if ", peak " in part["detail"]]
    assert sum(motor["count"] for motor in motors) == 4
    assert sum(motor["price"] for motor in motors) == sum(joint.actuator.price for joint in member.arm.joints)
    picked = runner.invoke(app, ["pick", str(tmp_path / "run"), "--by", "price", "--json"])
    assert json.loads(picked.output)[0]["price"] == min(m.values[2] for m in run.front)
    listed = runner.invoke(app, ["actuators"]).output
    assert "XM430-W350" in listed


def test_actuator_record_round_trips() -> None:
    again = DesignSpace.model_validate(json.loads(SPACE.model_dump_json()))
    assert again == SPACE


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
