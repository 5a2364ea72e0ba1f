"""Exported models and trajectories of cycles, in MuJoCo."""

import csv
import runpy
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from armwright.kinematics.contact.clearance import clearances
from armwright.kinematics.cycle.trajectory import PERIOD, Trajectory
from armwright.problem.evaluation import Evaluation
from armwright.problem.problem import Problem
from armwright.proof.cycle_export import MODEL, TRAJECTORY, cycle_files, trajectory_of
from armwright.proof.simulation import FAIL, PASS, SimulatedDesign, simulate_design
from armwright.robot.arm import Arm
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.task import Task
from armwright.tasks.tip_rules import APART, TipRules
from tests import ROOT
from tests.support.arms import LIGHT

DESK: dict[str, Any] = {
    "name": "desk",
    "targets": [
        {"name": "bin", "position": [0.25, 0.0, 0.05], "axis": [0, 0, -1]},
        {"name": "tray", "position": [0.2, 0.25, 0.10], "axis": [0, 0, -1], "tolerance": 0.002},
        {"position": [0.1, -0.25, 0.10], "axis": [0, 0, -1], "tolerance": 0.002},
    ],
    "tool": {"tip": [0.0, 0.0, 0.05], "mass": 0.05, "center": [0.0, 0.0, 0.02]},
    "payload": {"mass": 0.1, "center": [0.0, 0.0, 0.02], "size": [0.04, 0.04, 0.02]},
    "cycle": {
        "approach": 0.05,
        "dwell": 0.2,
        "time": 2.8,
        "steps": [{"to": "bin", "do": "pick"}, {"to": "tray", "do": "place", "time": 2.401}, {"to": 3, "by": "line"}],
    },
}
SPACE: dict[str, Any] = {
    "name": "servos",
    "joints": 5,
    "joint_types": ["Y", "P"],
    "restrict": {"joint_1": "Y", **{f"joint_{k}": "P" for k in range(2, 6)}},
    "link": [0.05, 0.3],
    **LIGHT,
    "supply": 12.0,
    "actuators": ["XM540-W270"],
}
LINKS = (0.12, 0.26, 0.22, 0.08, 0.06)
WEAK = {"name": "weak", "mass": 0.165, "stall_torque": 1.2, "speed": 4.0, "width": 0.04, "height": 0.06, "depth": 0.04}
WEDGE = [
    [-0.06, -0.06, 0],
    [0.06, -0.06, 0],
    [0.06, 0.06, 0],
    [-0.06, 0.06, 0],
    [-0.06, -0.06, 0.4],
    [0.06, 0.06, 0.4],
]  # m


class Desk:
    """One arm at the desk: its files and what they should say."""

    def __init__(self, space: Mapping[str, Any] = SPACE, **task: Any) -> None:
        self.problem = Problem(Task.model_validate(DESK | task), DesignSpace.model_validate(space))
        self.design = self.problem.space.clipped((0.0, 0.0, 0.02), "YPPPP", LINKS)
        self.arm: Arm = self.problem.arm(self.design)
        self.evaluation: Evaluation = self.problem.physics([self.design])
        self.files = cycle_files(self.problem, self.arm, self.evaluation, 0, "desk")

    @property
    def names(self) -> tuple[str, ...]:
        return self.problem.task.target_names

    @property
    def trajectory(self) -> Trajectory:
        return trajectory_of(self.arm, self.evaluation, 0)

    def simulate(self) -> SimulatedDesign:
        return simulate_design(0, self.files[MODEL], self.trajectory, self.names)


@pytest.fixture(scope="module")
def desk() -> Desk:
    return Desk()


def test_torques_of_the_trajectory_are_mujocos(desk: Desk) -> None:
    """With the friction of the gears by hand: a share of the torques after them, of those before them in braking."""
    trajectory = trajectory_of(desk.arm, desk.evaluation, 0)
    model = mujoco.MjModel.from_xml_string(desk.files[MODEL])
    flags = mujoco.mjtDisableBit
    model.opt.disableflags |= flags.mjDSBL_FRICTIONLOSS | flags.mjDSBL_CONTACT | flags.mjDSBL_LIMIT
    friction, gear = model.dof_frictionloss.copy(), model.jnt_user[:, 0]
    assert (gear > 0.0).all()
    assert (friction > 0.0).all()
    assert (model.dof_armature > 0.0).all()
    data, payload = mujoco.MjData(model), model.body("payload").id
    mass, inertia = float(model.body_mass[payload]), model.body_inertia[payload].copy()
    assert mass == pytest.approx(0.1)
    assert set(trajectory.payload) == {0.0, mass}
    for row in range(len(trajectory.time)):
        share = trajectory.payload[row] / mass
        model.body_mass[payload], model.body_inertia[payload] = share * mass, share * inertia
        data.qpos[:], data.qvel[:], data.qacc[:] = trajectory.q[row], trajectory.qd[row], trajectory.qdd[row]
        mujoco.mj_inverse(model, data)
        after = data.qfrc_inverse - model.dof_armature * data.qacc - model.dof_damping * data.qvel
        share = np.where(after * data.qvel > 0.0, gear, gear / (1.0 + gear))
        expected = data.qfrc_inverse + (friction + share * np.abs(after)) * np.sign(trajectory.qd[row])
        assert np.abs(trajectory.tau[row] - expected).max() < 1e-6


def test_speeds_and_accelerations_are_derivatives(desk: Desk) -> None:
    """Within motions, where the third derivative is finite: central differences are off by its share of 4 ms²."""
    trajectory = trajectory_of(desk.arm, desk.evaluation, 0)
    for values, rate in ((trajectory.q, trajectory.qd), (trajectory.qd, trajectory.qdd)):
        differences = (values[2:] - values[:-2]) / (2.0 * PERIOD)
        off = np.abs(differences - rate[1:-1])
        assert np.median(off) < 1e-3 * np.abs(rate).max()
        assert off.max() < 0.1 * np.abs(rate).max()


def test_rows_are_from_rest_to_rest_around_the_cycle(desk: Desk) -> None:
    trajectory = desk.trajectory
    assert np.abs(trajectory.q[0] - trajectory.q[-1]).max() < 1e-6
    assert not trajectory.qd[[0, -1]].any()
    loads = desk.evaluation.loads
    assert 0.0 <= trajectory.time[-1] - loads.cycle_time[0] < PERIOD
    rows = np.flatnonzero(trajectory.target >= 0)
    assert [(trajectory.step[r], trajectory.target[r]) for r in rows] == [(2, 1), (3, 2), (1, 0)]
    assert trajectory.payload[rows].tolist() == [0.0, 0.0, 0.1]
    assert trajectory.payload[rows - 1].tolist() == [0.1, 0.0, 0.0]
    assert trajectory.time[rows[0]] <= 2.401 + 0.2 < trajectory.time[rows[0] + 1]


def test_trajectory_file_holds_the_trajectory(desk: Desk) -> None:
    rows = list(csv.DictReader(desk.files[TRAJECTORY].splitlines()))
    for name in ("q", "qd", "qdd", "tau"):
        values = np.array([[row[f"{name}_{k}"] for k in range(1, 6)] for row in rows], dtype=np.float64)
        assert np.allclose(values, getattr(desk.trajectory, name), rtol=1e-8, atol=0.0)
    targets = [desk.names[target] if target >= 0 else "" for target in desk.trajectory.target]
    assert [row["target"] for row in rows] == targets


def test_header_and_names_are_stable(desk: Desk) -> None:
    head = desk.files[TRAJECTORY].partition("\n")[0]
    columns = [f"{quantity}_{k}" for quantity in ("q", "qd", "qdd", "tau") for k in range(1, 6)]
    assert head == ",".join(["time", "step", "target", "payload", *columns])
    model = mujoco.MjModel.from_xml_string(desk.files[MODEL])
    assert [model.joint(i).name for i in range(5)] == [f"joint_{k}" for k in range(1, 6)]
    assert [model.actuator(i).name for i in range(10)] == [f"{a}_{k}" for a in ("servo", "ff") for k in range(1, 6)]
    geoms = {model.geom(i).name for i in range(model.ngeom)}
    assert geoms >= {f"{part}_{k}" for part in ("link", "motor") for k in range(1, 6)}
    assert [model.key(i).name for i in range(model.nkey)] == ["bin", "tray", "3"]


def test_keyframes_are_at_the_targets(desk: Desk) -> None:
    model = mujoco.MjModel.from_xml_string(desk.files[MODEL])
    data = mujoco.MjData(model)
    for t, name in enumerate(desk.names):
        mujoco.mj_resetDataKeyframe(model, data, model.key(name).id)
        mujoco.mj_forward(model, data)
        assert np.linalg.norm(data.site("tip").xpos - desk.evaluation.targets[t]) < 1e-3
        assert np.linalg.norm(data.site("tip").xpos - data.site(f"target_{name}").xpos) < 1e-3


def test_a_feasible_arm_passes_with_the_claimed_torques(desk: Desk) -> None:
    assert (desk.problem.evaluate([desk.design]).violations <= 0.0).all()
    result = desk.simulate()
    assert (result.verdict, result.reasons) == (PASS, ())
    assert [(one.step, one.target) for one in result.targets] == [(2, "tray"), (3, "3"), (1, "bin")]
    for joint in result.joints:
        assert abs(joint.peak_torque - joint.claimed_peak_torque) < 0.15 * max(joint.claimed_peak_torque, 1.06)
    claimed = np.abs(desk.evaluation.loads.torques[0]).max(axis=(0, 1))
    stated = np.array([joint.claimed_peak_torque for joint in result.joints])
    gear = np.array(
        [joint.actuator.load_friction for joint in desk.arm.joints]
    )  # helps in braking, which is not claimed
    assert (stated <= 1.05 * claimed).all()
    assert (stated >= 0.95 * claimed / (1.0 + gear)).all()
    assert all(one.droop > 5.0 * one.tip_error for one in result.targets)


def test_gears_brake_as_the_trajectory_says_on_motions_as_fast_as_possible() -> None:
    """Friction by the lesser of the torques of motor and link, rotor and all, would leave half a millimetre."""
    steps = [{key: value for key, value in step.items() if key != "time"} for step in DESK["cycle"]["steps"]]
    result = Desk(cycle=DESK["cycle"] | {"time": "fastest", "steps": steps}).simulate()
    assert max(one.tip_error for one in result.targets) < 1.5e-4


def test_an_arm_with_weak_motors_fails_at_their_limits() -> None:
    result = Desk(SPACE | {"actuators": [WEAK]}).simulate()
    assert result.verdict == FAIL
    assert any("at its torque limit" in reason for reason in result.reasons)


@pytest.mark.parametrize(
    "shape",
    [
        {"kind": "sphere", "center": [0.25, 0.11, 0.1], "radius": 0.08},
        {"kind": "box", "center": [0.28, 0.13, 0.2], "size": [0.16, 0.02, 0.4], "yaw": 0.4},
        {"kind": "cylinder", "center": [0.28, 0.11, 0.2], "radius": 0.06, "height": 0.4},
        {"kind": "mesh", "mesh": "lamp.stl", "position": [0.28, 0.1, 0.0], "points": WEDGE},
    ],
    ids=lambda shape: shape["kind"],
)
def test_an_arm_with_an_obstacle_in_its_way_fails(shape: Mapping[str, Any]) -> None:
    """Between the bin and the tray."""
    blocked = Desk(obstacles=[{"name": "lamp", **shape}])
    assert blocked.evaluation.obstacle_clearance.min() < 0.0
    result = blocked.simulate()
    assert result.verdict == FAIL
    assert "obstacle_lamp" in {geom for contact in result.contacts for geom in contact.geoms}


def test_contacts_are_the_overlaps_of_our_clearance() -> None:
    """In random postures, with the base on the ground, and a box and a turned mesh nearby."""
    mesh = {"kind": "mesh", "mesh": "x.stl", "points": WEDGE, "position": [0.3, -0.2, 0.1], "rpy": [0.3, -0.5, 1.0]}
    box = {"kind": "box", "center": [0.3, 0.1, 0.1], "size": [0.1, 0.1, 0.2]}
    ground = [{"kind": "ground", "z": 0.02}, box, mesh]
    blocked = Desk(SPACE | {"motor_bodies": False}, obstacles=ground)  # tests/kinematics/test_motor_bodies.py has them
    model = mujoco.MjModel.from_xml_string(blocked.files[MODEL])
    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    q = rng.uniform(model.jnt_range[:, 0], model.jnt_range[:, 1], (400, 5))
    arms = blocked.evaluation.arms
    solids = blocked.problem.task.tip_solids
    rules = TipRules(np.ones(len(q), dtype=np.bool_), np.full((len(q), 3), APART), solids)
    own, clear = (values[0] for values in clearances(arms, q[None], blocked.problem.task.obstacles, rules=rules))
    touching = np.zeros((2, len(q)), dtype=bool)
    for i, values in enumerate(q):
        data.qpos[:] = values
        mujoco.mj_forward(model, data)
        for contact in data.contact:
            names = [model.geom(int(geom)).name for geom in contact.geom]
            touching[int(any(name.startswith("obstacle") for name in names)), i] = True
    near = 1e-5  # [m] that two ways of measuring may differ by
    for distance, touches in zip((own, clear), touching, strict=True):
        assert touches[distance < -near].all()
        assert not touches[distance > near].any()
        assert 5 < touches.sum() < 395


@pytest.mark.slow
def test_the_independent_check_gives_the_same_verdicts(desk: Desk, tmp_path: Path) -> None:
    check: Callable[[Path], list[str]] = runpy.run_path(str(ROOT / "benchmarks" / "check_simulation.py"))["check"]
    for name, one in (("good", desk), ("weak", Desk(SPACE | {"actuators": [WEAK]}))):
        for file, text in one.files.items():
            (tmp_path / name).mkdir(exist_ok=True)
            (tmp_path / name / file).write_text(text, encoding="utf-8")
        result = one.simulate()
        assert (not check(tmp_path / name)) == (result.verdict == PASS)


def test_joints_without_actuators_are_driven() -> None:
    passive = Desk({key: value for key, value in SPACE.items() if key != "actuators"})
    assert all(joint.actuator is None for joint in passive.arm.joints)
    assert passive.simulate().verdict == PASS


def test_a_task_without_cycle_has_no_further_files() -> None:
    assert Desk(cycle=None, payload=0.1).files == {}


@pytest.mark.slow
def test_torques_between_the_instants_of_loads_are_not_higher() -> None:
    """Except where a joint meets its limit within a line: speeds jump there, so the line counts as a jump."""
    cycle = DESK["cycle"] | {"time": "fastest", "steps": [{"to": "bin"}, {"to": "tray"}, {"to": 3, "by": "line"}]}
    near = {"origin_x": [-0.1, 0.1], "origin_y": [-0.1, 0.1], "origin_z": [0.0, 0.05]}
    problem = Problem(Task.model_validate(DESK | {"cycle": cycle}), DesignSpace.model_validate(SPACE | near))
    designs = problem.space.sample(300, seed=1)
    evaluation = problem.physics(designs)
    smooth = ~evaluation.paths.jumps.any(axis=1) & ~evaluation.unreached.any(axis=1)
    on_limit = evaluation.paths.jumps.any(axis=1) & (evaluation.paths.limit_distance.min(axis=1) <= 0.0)
    assert smooth.sum() > 20
    assert on_limit.any()
    loads, actuation = evaluation.loads, evaluation.arms.actuation
    assert actuation is not None
    for row, design in enumerate(designs):
        if smooth[row]:
            claimed = np.abs(loads.torques[row]).max(axis=(0, 1))
            peak = np.abs(trajectory_of(problem.arm(design), evaluation, row).tau).max(axis=0)
            assert (peak - claimed < 0.05 * np.maximum(claimed, 0.1 * actuation.peak[row])).all()


def test_payload_may_touch_what_its_target_allows_and_nothing_else(desk: Desk) -> None:
    """The payload reaches 30 mm below the tip in the bin: it is 1 mm, or 15 mm in a plate."""
    targets = [target.model_dump() | {"tolerance": 0.002} for target in desk.problem.task.targets]
    payload = {"mass": 0.5, "size": [0.02, 0.02, 0.06]}
    for deep, excess in ((0.001, 0.0), (0.015, 0.013)):
        plate = {"kind": "box", "name": "plate", "center": [0.25, 0.0, 0.02 + deep - 0.005], "size": [0.06, 0.06, 0.01]}
        held = Desk(targets=targets, payload=payload, obstacles=[plate])
        assert held.trajectory.allowed.min() == APART
        assert held.trajectory.allowed.max() == pytest.approx(0.002)
        clear = held.evaluation.obstacle_clearance.min()
        touching = {contact.geoms: contact.depth for contact in held.simulate().contacts}
        if excess:
            assert clear == pytest.approx(-excess, abs=1e-4)
            assert touching["obstacle_plate", "payload"] == pytest.approx(deep, abs=1e-3)
        else:
            assert clear > 0.0
            assert not touching
