"""Dynamics against Pinocchio, MuJoCo, closed forms and finer steps."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio
import pytest
import yaml
from numpy.typing import NDArray
from typer.testing import CliRunner

from armwright.cli.app import app
from armwright.exceptions import RunConflictError, SettingsError
from armwright.kinematics.arm_arrays import FIXED, stack_arms
from armwright.kinematics.dynamics import inverse_dynamics
from armwright.kinematics.forward import forward_kinematics
from armwright.kinematics.jacobian import jacobian_rate, jacobians
from armwright.problem.evaluation import evaluate
from armwright.problem.objectives import MOVE_QUANTITIES, TIMED_QUANTITIES, named_objectives
from armwright.problem.problem import Problem
from armwright.robot.arm import AXES, Actuator, Arm, Joint, Link, MountedTool, uniform_link
from armwright.robot.link_geometry import inertia_tensor
from armwright.robot.mjcf import to_mjcf
from armwright.robot.urdf_writer import to_urdf
from armwright.spaces.design_space import DesignSpace, paper_space
from armwright.tasks.moves import Moves, quintic_rates, sample_moves, time_samples
from armwright.tasks.task import Task
from tests.support.exported_arms import a_body

Array = NDArray[np.float64]
CORNERS = ((0.35, 0.1, 0.3), (0.1, 0.45, 0.2), (0.3, -0.3, 0.3))


def task(**more: Any) -> Task:
    return Task.model_validate({"name": "moves", "targets": CORNERS, "moves": "in_order", **more})


def any_arms(n: int, seed: int) -> list[Arm]:
    """Of all kinds of joints, links in any direction, loads at their ends or off them, and tools."""
    rng, of_tools = np.random.default_rng(seed), np.random.default_rng([seed, 1])

    def vector(size: float) -> tuple[float, float, float]:
        x, y, z = np.round(rng.uniform(-size, size, 3), 3).tolist()
        return (x, y, z)

    def joint(kind: Any) -> Joint:
        axis = AXES[rng.integers(3)]
        limits = {"revolute": (-2.5, 2.0), "prismatic": (-0.1, 0.4), "fixed": (0.0, 0.0)}[kind]
        return Joint(kind, axis, *limits, travel=0.02 if kind == "prismatic" else 1.0)

    def link() -> Link:
        load = {"end_mass": 0.4, "end_shift": vector(0.1)} if rng.random() < 0.5 else {}
        offset = (0.0, 0.0, 0.0) if rng.random() < 0.2 else vector(0.3)
        return Link(offset, round(float(rng.uniform(0.05, 2.0)), 3), vector(0.2), 0.03, **load)

    arms: list[Arm] = []
    for _ in range(n):
        kinds = rng.choice(["revolute", "revolute", "prismatic", "fixed"], int(rng.integers(2, 7))).tolist()
        kinds[0] = kinds[0] if kinds[0] != "fixed" else "revolute"
        joints = tuple(map(joint, kinds))
        arm = Arm(vector(0.5), joints, tuple(link() for _ in kinds))
        arms.append(replace(arm, tool=MountedTool(vector(0.1), **a_body(of_tools))))
    return arms


def motions(arms: Sequence[Arm], k: int, seed: int) -> tuple[Any, Array, Array, Array]:
    """Arms as arrays, and postures, velocities, accelerations (N, k, D) at random; 0 where no joint moves."""
    arrays = stack_arms(arms, "float64")
    rng = np.random.default_rng(seed)
    there = (arrays.motion < FIXED)[:, None]
    q, v, a = (np.where(there, rng.uniform(-size, size, (len(arms), k, arrays.dof)), 0.0) for size in (1.5, 3.0, 9.0))
    return arrays, q, v, a


def loaded(arm: Arm, payload: float) -> Arm:
    """The same with a payload as a link of its own, fixed to the tip."""
    carried = Link(offset=(0.0, 0.0, 0.0), mass=payload, com=(0.0, 0.0, 0.0), radius=1e-9)
    end = Link(offset=arm.tool.tip, mass=0.0, com=(0.0, 0.0, 0.0), radius=1e-9)
    fixed, (x, y, z) = Joint("fixed", "x"), arm.tool.tip
    u, v, w = arm.tool.com
    tool = replace(arm.tool, tip=(0.0, 0.0, 0.0), com=(u - x, v - y, w - z))
    return Arm(arm.base, (*arm.joints, fixed, fixed), (*arm.links, end, carried), tool)


# Inverse dynamics


def test_inertia_equals_exported_files() -> None:
    arms = any_arms(60, 0)
    for precision in ("float32", "float64"):
        inertia = stack_arms(arms, precision).bodies.inertia
        for row, arm in enumerate(arms):
            expected = np.array([inertia_tensor(link) for link in arm.links])
            assert inertia[row, : len(arm.links)] == pytest.approx(expected, rel=1e-12, abs=1e-15)
            assert not inertia[row, len(arm.links) :].any()


def test_torques_agree_with_pinocchio() -> None:
    arms = any_arms(120, 1)
    arrays, q, v, a = motions(arms, 4, 2)
    payload = np.array([0.0, 0.5, 1.0, 2.0])
    ours = inverse_dynamics(arrays, q, v, a, payload)
    kinds = {joint.kind for arm in arms for joint in arm.joints}
    assert kinds == {"revolute", "prismatic", "fixed"}
    for row, arm in enumerate(arms):
        moving = np.array([joint.kind != "fixed" for joint in arm.joints])
        for k, kg in enumerate(payload):
            model = pinocchio.buildModelFromXML(to_urdf(loaded(arm, kg)))
            mine = ours[row, k, : len(arm.joints)]
            of = [some[row, k, : len(arm.joints)][moving] for some in (q, v, a)]
            theirs = pinocchio.rnea(model, model.createData(), *of)
            # Files have ten digits, and small torques are what is left of large forces.
            assert mine[moving] == pytest.approx(theirs, rel=1e-9, abs=1e-9 * max(1.0, np.abs(theirs).max()))
            assert not mine[~moving].any()


def test_torques_agree_with_mujoco() -> None:
    arms = any_arms(30, 3)
    arrays, q, v, a = motions(arms, 1, 4)
    ours = inverse_dynamics(arrays, q, v, a, np.array([0.7]))
    for row, arm in enumerate(arms):
        moving = np.array([joint.kind != "fixed" for joint in arm.joints])
        model = mujoco.MjModel.from_xml_string(to_mjcf(loaded(arm, 0.7)))
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:], data.qacc[:] = (s[row, 0, : len(arm.joints)][moving] for s in (q, v, a))
        mujoco.mj_inverse(model, data)
        mine = ours[row, 0, : len(arm.joints)][moving]
        assert mine == pytest.approx(data.qfrc_inverse, rel=1e-7, abs=1e-7 * max(1.0, np.abs(mine).max()))


def test_power_equals_change_of_energy() -> None:
    """Along any motion: v · torque = d(kinetic + potential)/dt, the energies by hand from the links' own motions."""
    arms = any_arms(20, 5)
    arrays, q, v, a = motions(arms, 1, 6)
    load = np.array([0.4])

    def energy(t: float) -> Array:
        at = q + v * t + 0.5 * a * t**2
        # v' M v / 2 from torques without gravity, of an acceleration v; and height from gravity as the only force
        speed = v + a * t
        kinetic = 0.5 * (speed * inverse_dynamics(arrays, at, 0.0 * v, speed, load, 0.0)).sum(axis=(1, 2))
        frames = forward_kinematics(arrays, at)
        bodies = arrays.rigid_bodies
        heights = (frames.position + (frames.rotation @ bodies.com[:, None, :, :, None])[..., 0])[..., 2]
        potential = 9.81 * ((bodies.mass[:, None] * heights).sum(axis=2) + load * frames.tip[..., 2])
        return kinetic + potential[:, 0]

    h = 1e-5
    change = (energy(h) - energy(-h)) / (2 * h)
    power = (v * inverse_dynamics(arrays, q, v, a, load)).sum(axis=(1, 2))
    assert power == pytest.approx(change, rel=1e-6, abs=1e-5)


def test_jacobian_rate_agrees_with_finite_differences() -> None:
    arrays, q, v, _ = motions(any_arms(60, 7), 3, 8)
    h = 1e-6
    difference = (jacobians(arrays, q + h * v) - jacobians(arrays, q - h * v)) / (2 * h)
    assert jacobian_rate(arrays, forward_kinematics(arrays, q), v) == pytest.approx(difference, abs=1e-7)


# Along timed lines


def test_move_starts_and_ends_at_rest_and_covers_its_line() -> None:
    t = np.linspace(0.0, 1.0, 2001)
    s = t**3 * (10 - 15 * t + 6 * t**2)
    speed, acceleration = quintic_rates(s)
    assert speed == pytest.approx(np.gradient(s, t, edge_order=2), abs=1e-5)
    assert acceleration == pytest.approx(np.gradient(speed, t, edge_order=2), abs=1e-3)
    for ends in (speed[[0, -1]], acceleration[[0, -1]]):
        assert not ends.any()
    assert speed.max() == pytest.approx(15 / 8)
    assert acceleration.max() == pytest.approx(10 / np.sqrt(3), rel=1e-5)


def test_short_moves_are_checked_between_samples() -> None:
    moves = Moves(((0, 1), (1, 2)), 0.02, (2.0, 0.5))
    targets = np.array([[0.0, 0, 0], [0.01, 0, 0], [1.01, 0, 0]])
    lines = sample_moves(moves, targets)
    timing = time_samples(moves, lines)
    assert np.array_equal(np.diff(timing.first), [33, 51])
    share = timing.between(lines.share[None, :, None])[0, :, 0]
    for first, end, time in zip(timing.first, timing.first[1:], moves.times, strict=False):
        assert share[first:end] == pytest.approx(np.linspace(0, 1, end - first))
        assert timing.speed[first:end].max() == pytest.approx(15 / 8 / time, rel=1e-3)
        assert timing.acceleration[first:end].max() == pytest.approx(10 / np.sqrt(3) / time**2, rel=1e-2)


def spatial() -> Arm:
    """Three joints, so that a line leaves none to spare."""
    links = tuple(uniform_link((0.0, 0.0, long), mass, 0.02) for long, mass in ((0.2, 1.0), (0.3, 0.8), (0.3, 0.5)))
    return Arm((0.0, 0.0, 0.0), tuple(Joint("revolute", axis, -3.1, 3.1) for axis in ("z", "y", "y")), links)


def by_differences(step: float, time: float) -> tuple[Array, Array]:
    """Torques that Pinocchio has for the differences of the samples themselves, and ours, at the same moments."""
    arm = spatial()
    targets = np.array([[0.35, 0.1, 0.3], [0.1, 0.45, 0.2]])
    evaluation = evaluate([arm], targets, payload=0.5, moves=Moves(((0, 1),), step, (time,)))
    paths, drives = evaluation.paths, evaluation.drives
    assert paths.error.max() < 1e-4
    model = pinocchio.buildModelFromXML(to_urdf(loaded(arm, 0.5)))
    data, share, q = model.createData(), paths.samples.share, paths.q[0]
    slope = np.gradient(q, share, axis=0, edge_order=2)
    bend = np.zeros(q.shape)
    bend[1:-1] = (q[2:] - 2 * q[1:-1] + q[:-2]) / (share[1] - share[0]) ** 2
    samples = np.flatnonzero(drives.timing.beyond == 0.0)
    speed, faster = drives.timing.speed[samples, None], drives.timing.acceleration[samples, None]
    theirs = [
        pinocchio.rnea(model, data, *one)
        for one in zip(q, slope * speed, slope * faster + bend * speed**2, strict=True)
    ]
    assert drives.speeds[0, samples] == pytest.approx(slope * speed, rel=0.02, abs=0.02 * np.abs(slope * speed).max())
    return np.array(theirs), drives.torques[0, samples]


def test_torques_of_nonredundant_arms_match_finite_differences() -> None:
    """At a speed where gravity is the smaller part; the residual is damping and the samples' 0.1 mm."""
    for step in (0.04, 0.02, 0.01):
        theirs, ours = by_differences(step, 0.25)
        assert np.abs(theirs - ours).max() < 0.005 * np.abs(theirs).max()


@pytest.mark.slow
def test_finer_step_gives_the_same_torques() -> None:
    """This includes redundant arms, whose samples drift: each posture determines its own torques."""
    space = paper_space(6)
    arms = [space.arm(design) for design in space.sample(200, 1)]
    found = []
    for step in (0.02, 0.01, 0.005):
        evaluation = evaluate(arms, CORNERS, moves=Moves(((0, 1),), step, (0.5,)))
        found.append(named_objectives(["dynamic_torque"])[0](evaluation))
        follows = evaluation.paths.error.max(axis=1) < 1e-3
    coarse, fine, finest = (values[follows] for values in found)
    off_coarse, off_fine = (np.median(np.abs(values / finest - 1.0)) for values in (coarse, fine))
    assert follows.sum() > 20
    assert off_fine < off_coarse < 0.05


def timed(arms: Sequence[Arm], *times: float) -> Any:
    return evaluate(arms, CORNERS, payload=0.3, moves=Moves(((0, 1), (1, 2)), 0.02, times))


def test_dynamic_torque_grows_with_the_square_of_speed() -> None:
    arms = any_arms(40, 9)
    slow, fast, faster = (timed(arms, time, time) for time in (1e7, 1.0, 0.5))
    (dynamic,) = named_objectives(["dynamic_torque"])
    still = np.abs(slow.paths.joint_torques * slow.arms.travel[:, None]).max(axis=(1, 2))
    assert dynamic(slow) == pytest.approx(still, rel=1e-4, abs=1e-6)
    gravity = slow.drives.timing.between(slow.paths.joint_torques)
    assert faster.drives.torques - gravity == pytest.approx(4 * (fast.drives.torques - gravity), rel=1e-6, abs=1e-9)
    assert faster.drives.speeds == pytest.approx(2 * fast.drives.speeds)
    assert np.all(dynamic(faster) > still), "of arms that move at all, some joint is driven at full weight"


def test_batch_does_not_change_drives() -> None:
    space = paper_space(4)
    arms = [space.arm(design) for design in space.sample(300, 0)]
    many = timed(arms, 1.0, 0.4).drives
    for i in (0, 137, 299):
        one = timed(arms[i : i + 1], 1.0, 0.4).drives
        assert np.array_equal(one.torques[0], many.torques[i])
        assert np.array_equal(one.speeds[0], many.speeds[i])


def test_immobile_arms_need_static_torque_only() -> None:
    stiff = Arm((0.1, 0.0, 0.0), (Joint("fixed", "x"),), (uniform_link((0.0, 0.0, 0.0), 1.0, 0.01),))
    spinning = Arm((0.0, 0.0, 0.0), (Joint("revolute", "z", -2.0, 2.0),), (uniform_link((0.0, 0.0, 0.3), 1.0, 0.01),))
    drives = timed([stiff, spinning], 1.0, 1.0).drives
    assert not drives.torques.any()
    assert not drives.speeds.any()


def test_each_move_has_its_own_time() -> None:
    arms = any_arms(10, 10)
    one, two, mixed = timed(arms, 1.0, 1.0), timed(arms, 0.3, 0.3), timed(arms, 1.0, 0.3)
    first = one.drives.timing.first[1]
    assert np.array_equal(mixed.drives.torques[:, :first], one.drives.torques[:, :first])
    assert np.array_equal(mixed.drives.torques[:, first:], two.drives.torques[:, first:])
    (dynamic,) = named_objectives(["dynamic_torque"])
    shares = dynamic.each(mixed)
    assert not shares[:, 0].any(), "no move ends at the first target"
    most = np.abs(mixed.drives.torques * mixed.arms.travel[:, None]).max(axis=-1)
    assert np.array_equal(shares[:, 1], most[:, :first].max(axis=1))
    assert np.array_equal(shares[:, 2], most[:, first:].max(axis=1))


def test_joint_at_its_limit_stays_there() -> None:
    """A slide at its limit stays there, although it alone could continue along the line."""
    arm = Arm(
        (0.0, 0.0, 0.0),
        (Joint("prismatic", "x", 0.0, 0.2), Joint("prismatic", "z", 0.0, 0.5)),
        (uniform_link((0.1, 0.0, 0.0), 1.0, 0.01), uniform_link((0.1, 0.0, 0.0), 1.0, 0.01)),
    )
    evaluation = evaluate([arm], [[0.25, 0.0, 0.1], [0.55, 0.0, 0.4]], moves=Moves(((0, 1),), 0.01, (1.0,)))
    paths, drives = evaluation.paths, evaluation.drives
    at_end = drives.timing.between((paths.q[..., :1] == paths.q[..., :1].max()).astype(float))[0, :, 0]
    assert 0.3 < at_end.mean() < 0.9
    assert not drives.speeds[0, at_end == 1.0, 0].any()
    assert np.any(drives.speeds[0, at_end == 0.0, 0] > 0.0)


# Actuators


def test_utilisation_is_relative_to_actuator_limits() -> None:
    """A slide of 0.02 m a radian: force and way at its motor."""
    motor, other = Actuator("a", 0.1, 4.0, 5.0), Actuator("b", 0.1, 9.0, 2.0)
    motors = (motor, other, other, motor)
    arms = [
        replace(arm, joints=tuple(replace(j, actuator=motors[i]) for i, j in enumerate(arm.joints)))
        for arm in any_arms(200, 11)
        if len(arm.joints) == 4 and all(joint.kind != "fixed" for joint in arm.joints)
    ]
    assert {joint.kind for arm in arms for joint in arm.joints} == {"revolute", "prismatic"}
    evaluation = timed(arms, 0.5, 0.5)
    travel = np.array([[joint.travel for joint in arm.joints] for arm in arms])[:, None]
    use, speed = named_objectives(["dynamic_utilisation", "speed_utilisation"])
    torques, speeds = evaluation.drives.torques * travel, evaluation.drives.speeds / travel
    assert use(evaluation) == pytest.approx(np.abs(torques / [4.0, 9.0, 9.0, 4.0]).max(axis=(1, 2)))
    assert speed(evaluation) == pytest.approx(np.abs(speeds / [5.0, 2.0, 2.0, 5.0]).max(axis=(1, 2)))
    unknown = replace(arms[0], joints=tuple(replace(j, actuator=replace(motor, speed=None)) for j in arms[0].joints))
    with pytest.raises(SettingsError, match="speed_utilisation needs the speed of every actuator"):
        speed(timed([unknown], 0.5, 0.5))
    assert np.isfinite(use(timed([unknown], 0.5, 0.5))).all()


def test_constraints_on_dynamic_quantities() -> None:
    space = DesignSpace.model_validate({"joints": 4, "actuators": ["XM430-W350"]})
    names = ("dynamic_torque", "dynamic_utilisation", "speed_utilisation")
    designs = space.sample(30, 0)
    values = Problem(task(move_time=0.5, objectives=names), space).evaluate(designs).values
    sentences = [f"{name} <= {np.median(column):.6g}" for name, column in zip(names, values.T, strict=True)]
    problem = Problem(task(move_time=0.5, constraints=sentences), space)
    broken = problem.evaluate(designs).violations
    assert problem.uses(*MOVE_QUANTITIES)
    assert problem.uses(*TIMED_QUANTITIES)
    assert np.array_equal((broken <= 0.0).sum(axis=0), [15, 15, 15])
    assert np.array_equal(broken > 0.0, values > np.median(values, axis=0))


@pytest.mark.parametrize("objective", [objective.name for objective in TIMED_QUANTITIES])
def test_dynamic_objectives_require_timed_moves(objective: str) -> None:
    space = DesignSpace.model_validate({"joints": 4, "actuators": ["XM430-W350"]})
    with pytest.raises(SettingsError, match=r"move_time: 1\.5"):
        Problem(task(objectives=[objective]), space).evaluate(space.sample(1, 0))
    with pytest.raises(SettingsError, match="need moves in the task; try moves: in_order"):
        Problem(task(objectives=[objective], moves=()), space).evaluate(space.sample(1, 0))


# From the file on


def test_move_time_is_one_value_or_one_per_move() -> None:
    assert task(move_time=2).straight_moves.times == (2.0, 2.0)
    assert task(move_time=[2, 0.5]).straight_moves.times == (2.0, 0.5)
    assert task().straight_moves.times == ()


@pytest.mark.parametrize(
    ("how", "words"),
    {
        "{move_time: 0}": "move_time: expected above 0 and at most 10000 s, got 0 s",
        "{move_time: [1, -2]}": "move_time: expected above 0 and at most 10000 s, got -2 s",
        "{move_time: [1, 2, 3]}": "move_time: expected 1 or 2 values [s], got 3",
        "{move_time: .nan}": "move_time",
        "{move_time: 1, moves: []}": "move_time needs moves; try moves: in_order",
        "{move_time: soon}": "move_time",
    }.items(),
)
def test_invalid_move_times_are_refused(in_folder: Path, how: str, words: str) -> None:
    content = {"name": "x", "targets": [list(point) for point in CORNERS], "moves": "in_order", **yaml.safe_load(how)}
    (in_folder / "it.yaml").write_text(yaml.safe_dump(content))
    told = CliRunner().invoke(app, ["tasks", "it.yaml"])
    assert told.exit_code != 0
    assert words in str(told.exception)
    assert "\n" not in str(told.exception)


@pytest.mark.slow
def test_move_time_on_the_command_line(in_folder: Path) -> None:
    text = f"name: line\ntargets: {[list(point) for point in CORNERS]}\nmoves: in_order\n"
    text += "objectives: [position_error, dynamic_torque]\n"
    (in_folder / "line.yaml").write_text(f"{text}move_time: 1.5\n")
    words = ["optimize", "line.yaml", "--proposer", "rules", "--n-total", "15", "--out", "run"]
    told = CliRunner().invoke(app, words)
    assert told.exit_code == 0, told.output
    assert "durations 1.5 s" in CliRunner().invoke(app, ["tasks", "line.yaml"]).output
    prompt = CliRunner().invoke(app, ["prompt", "line.yaml"]).output
    assert "from rest to rest" in prompt
    (in_folder / "line.yaml").write_text(f"{text}move_time: 2\n")
    again = CliRunner().invoke(app, words)
    assert isinstance(again.exception, RunConflictError)
    assert "move_time: 1.5 stored, 2.0 requested" in str(again.exception)
