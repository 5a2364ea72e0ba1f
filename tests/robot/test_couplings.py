"""Joints of URDFs that mimic others, against Pinocchio, MuJoCo and SciPy."""

from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio
import pytest
from scipy.optimize import least_squares

from armwright.exceptions import ArmError
from armwright.existing.base_placement import placed
from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.kinematics.arms.forward import forward_kinematics, jacobian_of
from armwright.kinematics.cycle.torque_terms import inertia_matrices
from armwright.kinematics.ik.solve import solve
from armwright.kinematics.reach.compliance import Stiffness, tip_displacements, unit_payload
from armwright.kinematics.reach.payload_limits import torques_by_payload
from armwright.kinematics.reach.reach_map import reach_map
from armwright.problem.evaluation import evaluate
from armwright.problem.over_reach import reach_lines
from armwright.problem.problem import Problem
from armwright.proof.task_mjcf import to_mjcf as task_mjcf
from armwright.robot.mjcf import to_mjcf
from armwright.robot.mounting import Mounting, mounted
from armwright.robot.ros2_control import to_ros2_control
from armwright.robot.urdf_reader import UrdfArm, read_urdf
from armwright.robot.urdf_writer import to_urdf
from armwright.sheet.urdf_sheet import urdf_sheet
from armwright.spaces.design_space import default_space
from armwright.tasks.catalogue import load_task
from tests.support.robots import any_arm, robot, with_frames_anyhow
from tests.support.urdf_peers import differences, random_states, seen_by_kernels, seen_by_pinocchio

Array = np.ndarray
N = 7  # joints of the chain
# Each joint that mimics another: that one, multiplier and offset.
PARALLELOGRAM = {"joint_4": ("joint_3", -1.0, 0.0)}
GEARED = {"joint_2": ("joint_4", 0.5, 0.2)}  # the leader comes after it
TWICE = {"joint_3": ("joint_2", -1.0, 0.1), "joint_5": ("joint_3", 0.5, 0.2), "joint_4": ("joint_1", 0.7, -0.1)}
RESOLVED = {**TWICE, "joint_5": ("joint_2", -0.5, 0.25)}  # 0.5 (0.1 - q_2) + 0.2
COUPLED = {"parallelogram": PARALLELOGRAM, "geared": GEARED, "twice": TWICE}
RULES = {"parallelogram": PARALLELOGRAM, "geared": GEARED, "twice": RESOLVED}
LIMITS = {"lower": -2.0, "upper": 2.2, "effort": 90.0, "velocity": 2.0}


def urdf_of(mimics: dict[str, tuple[str, float, float]], seed: int = 0, **limits: dict[str, float]) -> str:
    """A chain of joints about any axes, of which some mimic others; limits: by joint, in place of others."""
    rng = np.random.default_rng(seed)
    rows = ['<link name="base"/>']
    for i in range(1, N + 1):
        inertia = rng.uniform(1e-3, 2e-3, 3)
        rows.append(
            f'<link name="l{i}"><inertial><origin xyz="{numbers(rng.uniform(-0.1, 0.1, 3))}"/><mass value="'
            f'{rng.uniform(0.5, 2.0)}"/><inertia ixx="{inertia[0]}" iyy="{inertia[1]}" izz="{inertia[2]}" ixy="0" '
            'ixz="0" iyz="0"/></inertial></link>'
        )
        name = f"joint_{i}"
        axis = rng.normal(size=3) if i == 3 else np.eye(3)[i % 3] * (-1.0) ** i
        mimic = ""
        if name in mimics:
            leader, multiplier, offset = mimics[name]
            mimic = f'<mimic joint="{leader}" multiplier="{multiplier}" offset="{offset}"/>'
        limit = " ".join(f'{key}="{value}"' for key, value in {**LIMITS, **limits.get(name, {})}.items())
        rows.append(
            f'<joint name="{name}" type="revolute"><parent link="{"base" if i == 1 else f"l{i - 1}"}"/>'
            f'<child link="l{i}"/><origin xyz="{numbers(rng.uniform(0.05, 0.3, 3))}" rpy="0 0 {0.3 * (i == 4)}"/>'
            f'<axis xyz="{numbers(axis)}"/><limit {limit}/>{mimic}</joint>'
        )
    return f'<robot name="coupled">{"".join(rows)}</robot>'


def numbers(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)


@pytest.fixture(params=COUPLED)
def path(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    file = tmp_path / f"{request.param}.urdf"
    file.write_text(urdf_of(COUPLED[request.param]), encoding="utf-8")
    return file


def read(path: Path) -> UrdfArm:
    return read_urdf(path, tip=f"l{N}")


@pytest.mark.parametrize(("name", "tip"), [("romeo", "LFinger13Link"), ("pr2", "r_gripper_l_finger_tip_link")])
def test_fingers_of_real_robots_agree_with_pinocchio(name: str, tip: str) -> None:
    file = robot(name)
    arm = read_urdf(file, tip)
    assert arm.arm.couplings
    states = random_states(arm.arm, 20, 0)
    off = differences(seen_by_kernels(arm.arm, states), seen_by_pinocchio(file, arm, states))
    assert max(off.values()) < 1e-9


class Reduced:
    """Pinocchio's model of all joints of a file, projected on the independent ones: q = C s + o."""

    def __init__(self, path: Path, arm: UrdfArm) -> None:
        rules = RULES[path.stem]
        self.model = pinocchio.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        self.tip = self.model.getFrameId(arm.tip, pinocchio.FrameType.BODY)
        names = [f"joint_{n}" for n in range(1, N + 1)]
        assert list(arm.joints) == names == list(self.model.names)[1:]
        self.columns = [j for j, name in enumerate(names) if name not in rules]  # the joint of each coordinate
        self.c, self.o = np.zeros((N, len(self.columns))), np.zeros(N)
        for j, name in enumerate(names):
            leader, multiplier, self.o[j] = rules.get(name, (name, 1.0, 0.0))
            self.c[j, self.columns.index(names.index(leader))] = multiplier

    def frame(self, s: Array) -> Array:
        pinocchio.framesForwardKinematics(self.model, self.data, self.c @ s + self.o)
        return self.data.oMf[self.tip].homogeneous.copy()

    def seen(self, s: Array, sd: Array, sdd: Array) -> tuple[Array, ...]:
        """Tip, torques at rest and in motion, mass matrix, and Jacobian of the tip."""
        model, data, c = self.model, self.data, self.c
        q = c @ s + self.o
        gravity = c.T @ pinocchio.computeGeneralizedGravity(model, data, q)
        torque = c.T @ pinocchio.rnea(model, data, q, c @ sd, c @ sdd)
        upper = np.triu(pinocchio.crba(model, data, q))
        place = pinocchio.LOCAL_WORLD_ALIGNED
        jacobian = pinocchio.computeFrameJacobian(model, data, q, self.tip, place)[:3] @ c
        return self.frame(s)[:3, 3], gravity, torque, c.T @ (upper + np.triu(upper, 1).T) @ c, jacobian


def states_of(arm: UrdfArm, n: int, seed: int = 0) -> tuple[Array, Array, Array]:
    """(n, N) values, speeds and accelerations that keep all couplings, those of followers computed one by one."""
    rng, joints = np.random.default_rng(seed), arm.arm.joints
    q = rng.uniform([j.lower for j in joints], [j.upper for j in joints], (n, len(joints)))
    v, a = rng.uniform(-3.0, 3.0, q.shape), rng.uniform(-9.0, 9.0, q.shape)
    for j, joint in enumerate(joints):
        if (one := joint.coupling) is not None:
            q[:, j] = one.factor * q[:, one.leader] + one.offset
            v[:, j], a[:, j] = one.factor * v[:, one.leader], one.factor * a[:, one.leader]
    return q, v, a


def test_coupled_arm_agrees_with_pinocchio(path: Path) -> None:
    arm = read(path)
    theirs, (q, v, a) = Reduced(path, arm), states_of(arm, 20)
    arrays, keep = stack_arms([arm.arm], "float64"), theirs.columns
    ours = seen_by_kernels(arm.arm, np.stack([q, v, a]))
    torque = arrays.by_independent(ours.torque[None])[0]
    half = arrays.by_independent(ours.inertia[None])
    inertia = arrays.by_independent(half.swapaxes(-1, -2))[0]
    frames = forward_kinematics(arrays, q[None])
    jacobian = jacobian_of(arrays, frames)[0]
    found = [theirs.seen(*state) for state in zip(q[:, keep], v[:, keep], a[:, keep], strict=True)]
    tip, gravity, moving, mass, columns = map(np.array, zip(*found, strict=True))
    for mine, other in (
        (ours.tip, tip),
        (frames.tip[0], tip),
        (ours.gravity[:, keep], gravity),
        (torque[:, keep], moving),
        (inertia[:, keep][:, :, keep], mass),
        (jacobian[..., keep], columns),
        (torques_by_payload(arrays, frames)[0][:, keep], 9.81 * columns[:, 2]),
    ):
        assert np.abs(mine - other).max() < 1e-9 * np.abs(other).max()
    followers = [j for j, _ in arm.arm.couplings]
    assert not ours.gravity[:, followers].any()
    assert not inertia[:, followers].any()
    single = seen_by_kernels(arm.arm, np.stack([q, v, a]), precision="float32")
    assert np.abs(single.gravity[:, keep] - gravity).max() < 1e-5 * np.abs(gravity).max()


def test_projection_is_what_pinocchio_does_with_mimic(tmp_path: Path) -> None:
    """Which it does for joints that mimic one before them that moves by itself."""
    file = tmp_path / "parallelogram.urdf"
    file.write_text(urdf_of(PARALLELOGRAM), encoding="utf-8")
    theirs, model = Reduced(file, read(file)), pinocchio.buildModelFromUrdf(str(file), mimic=True)
    data, state = model.createData(), tuple(np.random.default_rng(0).uniform(-1.0, 1.0, (3, N - 1)))
    assert pinocchio.rnea(model, data, *state) == pytest.approx(theirs.seen(*state)[2], abs=1e-9)


@pytest.mark.parametrize("kind", ["points", "axes", "orientations"])
def test_solve_reaches_what_an_optimisation_reaches(path: Path, kind: str) -> None:
    """Targets come from postures; Pinocchio, with the independent joints alone, confirms each that is found."""
    arm = read(path)
    theirs, (q, _, _) = Reduced(path, arm), states_of(arm, 24, 1)
    poses = np.array([theirs.frame(s) for s in q[:, theirs.columns]])
    there: dict[str, Array] = {"orientations": poses[:, :3, :3]} if kind == "orientations" else {}
    there |= {"axes": poses[:, :3, 2]} if kind == "axes" else {}
    found = solve(arm, poses[:, :3, 3], restarts=60, **there)
    assert found.reached.mean() > 0.9
    values = found.q[0]
    for j, one in arm.arm.couplings:
        assert values[:, j] == pytest.approx(one.factor * values[:, one.leader] + one.offset, abs=1e-6)
    low, high = ([getattr(joint, end) for joint in arm.arm.joints] for end in ("lower", "upper"))
    assert np.all((values > np.array(low) - 1e-6) & (values < np.array(high) + 1e-6))
    for row, pose, is_there in zip(values, poses, found.reached[0], strict=True):
        seen = theirs.frame(row[theirs.columns])
        if is_there:
            assert seen[:3, 3] == pytest.approx(pose[:3, 3], abs=1e-3)
            if kind != "points":
                assert seen[:3, 2] == pytest.approx(pose[:3, 2], abs=2e-3)


def test_solve_finds_what_scipy_finds(path: Path) -> None:
    """Every point around the arm that an optimisation over the independent joints finds to be within its reach."""
    arm = read(path)
    theirs, near = Reduced(path, arm), np.random.default_rng(3).normal(scale=0.05, size=(12, 3))
    points = near + [theirs.frame(s)[:3, 3] for s in states_of(arm, 12, 5)[0][:, theirs.columns]]
    bounds = [[getattr(arm.arm.joints[j], end) for j in theirs.columns] for end in ("lower", "upper")]
    errors, found = solve(arm, points, restarts=40).position_error[0], 0
    for point, error in zip(points, errors, strict=True):
        starts = np.random.default_rng(4).uniform(*bounds, (12, len(theirs.columns)))
        tries = [
            least_squares(lambda s, to=point: theirs.frame(s)[:3, 3] - to, start, bounds=bounds) for start in starts
        ]
        best = min(np.linalg.norm(one.fun) for one in tries)
        if best < 1e-6:
            found += 1
            assert error < 1e-3
    assert found > 4


def test_limits_speeds_and_drive_are_those_of_both(tmp_path: Path) -> None:
    """q_2 = 0.5 q_4 + 0.2 within ±0.9 rad and 0.6 rad/s: q_4 within -2.2 and 1.4 rad, at 1.2 rad/s."""
    file = tmp_path / "arm.urdf"
    file.write_text(urdf_of(GEARED, joint_2={"lower": -0.9, "upper": 0.9, "velocity": 0.6, "effort": 1e3}), "utf-8")
    arm = read(file)
    leader, follower = arm.arm.joints[3], arm.arm.joints[1]
    assert (leader.lower, leader.upper) == pytest.approx((-2.0, 1.4))
    assert leader.speed == pytest.approx(1.2)
    assert (leader.effort, follower.effort, follower.actuator) == (90.0, None, None)
    assert "joint_2 = 0.5 joint_4 +0.2, so the drive of joint_4 moves both" in arm.notes
    drives = stack_arms([arm.arm]).actuation
    assert drives is not None
    assert drives.peak.tolist() == [[90.0, np.inf, *[90.0] * 5]]
    file.write_text(urdf_of(PARALLELOGRAM, joint_4={"lower": -1.0, "upper": 0.3}), "utf-8")
    assert (read(file).arm.joints[2].lower, read(file).arm.joints[2].upper) == pytest.approx((-0.3, 1.0))


def test_bar_that_follows_the_arm_beside_it_is_stated(tmp_path: Path) -> None:
    bar = (
        '<link name="bar"/><joint name="rocker" type="revolute"><parent link="l2"/><child link="bar"/><limit '
        'lower="-1" upper="1"/><mimic joint="joint_3" multiplier="-1"/></joint>'
    )
    file = tmp_path / "arm.urdf"
    file.write_text(urdf_of(PARALLELOGRAM).replace("</robot>", f"{bar}</robot>"), encoding="utf-8")
    arm = read(file)
    assert arm.notes[0].endswith("left out, at 0: rocker")
    assert "joints that mimic those of the chain, but stay at 0 with their masses: rocker" in arm.notes


REFUSED = {
    "another chain": (
        {"joint_4": ("finger", 1.0, 0.0)},
        '"joint_4" mimics "finger", moving 1 times as far; expected',
    ),
    "a cycle": (
        {"joint_4": ("joint_2", 1.0, 0.0), "joint_2": ("joint_4", 1.0, 0.0)},
        "expected an independent joint of the chain",
    ),
    "itself": ({"joint_4": ("joint_4", 1.0, 0.0)}, "expected an independent joint of the chain"),
    "nothing": ({"joint_4": ("joint_44", 1.0, 0.0)}, "expected an independent joint of the chain"),
    "no motion": (
        {"joint_4": ("joint_2", 0.0, 0.4)},
        "moving 0 times as far; .*not 0 times; for the part before it, try --tip l3",
    ),
    "a fixed joint": ({"joint_4": ("plate", 2.0, 0.4)}, 'mimics "plate", moving 2 times'),
    "far limits": (
        {"joint_4": ("joint_2", 1.0, 9.0)},
        'limits of "joint_2" and "joint_4", which mimics it, exclude',
    ),
    "words": ({"joint_4": ("joint_2", "a", 0.0)}, 'multiplier: expected 1 finite number, got "a"'),
}


@pytest.mark.parametrize("name", REFUSED)
def test_couplings_that_cannot_be_computed_are_refused(tmp_path: Path, name: str) -> None:
    mimics, words = REFUSED[name]
    more = (  # a finger and a plate at the end
        '<link name="f"/><joint name="finger" type="revolute"><parent link="l7"/><child link="f"/><limit '
        'upper="1"/></joint><link name="p"/><joint name="plate" type="fixed"><parent link="l7"/><child link="p"/>'
        "</joint>"
    )
    file = tmp_path / "arm.urdf"
    file.write_text(urdf_of(mimics).replace("</robot>", f"{more}</robot>"), encoding="utf-8")  # type: ignore[arg-type]
    with pytest.raises(ArmError, match=words) as refusal:
        read(file)
    assert '"joint_4"' in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_exports_keep_the_coupling(path: Path, tmp_path: Path) -> None:
    """The URDF is read back; ROS 2 gets no command for a joint that follows; MuJoCo has no motor on it."""
    arm = read(path)
    copy = tmp_path / "copy.urdf"
    copy.write_text(to_urdf(arm.arm), encoding="utf-8")
    again = read_urdf(copy, tip="tip")
    assert [joint.coupling for joint in again.arm.joints] == [joint.coupling for joint in arm.arm.joints]
    q, v, a = states_of(arm, 5)
    one, other = (seen_by_kernels(each.arm, np.stack([q, v, a])) for each in (arm, again))
    assert one.gravity == pytest.approx(other.gravity, abs=1e-8)
    followers = {f"joint_{j + 1}" for j, _ in arm.arm.couplings}
    control = ElementTree.fromstring(to_ros2_control(arm.arm)).find("ros2_control")
    assert control is not None
    assert {
        joint.get("name") for joint in control.findall("joint") if joint.find("command_interface") is None
    } == followers
    assert all(len(joint.findall("state_interface")) == 3 for joint in control.findall("joint"))
    starts = [float(start.text or "") for start in control.iter("param") if start.get("name") == "initial_value"]
    assert starts == pytest.approx([RULES[path.stem].get(f"joint_{n}", (0, 0, 0.0))[2] for n in range(1, N + 1)])
    model = mujoco.MjModel.from_xml_string(to_mjcf(arm.arm))
    assert {model.joint(int(at)).name for at in model.actuator_trnid[:, 0]} == {
        f"joint_{n}" for n in range(1, N + 1)
    } - followers


def test_mujoco_holds_the_coupling_and_needs_the_drive_torque(path: Path) -> None:
    """While drives swing the arm; the inverse dynamics of the file's tree, by Cᵀ, are what `by_independent` says."""
    arm = read(path)
    model = mujoco.MjModel.from_xml_string(to_mjcf(arm.arm))
    data, couplings = mujoco.MjData(model), arm.arm.couplings
    (q, v, a), arrays = states_of(arm, 8, 2), stack_arms([arm.arm], "float64")
    torque = arrays.by_independent(seen_by_kernels(arm.arm, np.stack([q, v, a])).torque[None])[0]
    for row, speeds, accelerations, expected in zip(q, v, a, torque, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = row, speeds, accelerations
        mujoco.mj_inverse(model, data)
        needed = data.qfrc_inverse + data.qfrc_constraint - data.qfrc_passive
        for j, one in couplings:
            needed[one.leader] += one.factor * needed[j]
            needed[j] = 0.0
        assert needed == pytest.approx(expected, abs=1e-6 * np.abs(torque).max())
    data.qpos[:], data.qvel[:] = q[0] * 0.2, 0.0
    for j, one in couplings:
        data.qpos[j] = one.factor * data.qpos[one.leader] + one.offset
    started, moved = data.qpos.copy(), 0.0
    for step in range(1000):
        data.ctrl[:] = data.qfrc_bias[model.jnt_dofadr[model.actuator_trnid[:, 0]]] + np.sin(0.02 * step)
        mujoco.mj_step(model, data)
        moved = max(moved, float(np.abs(data.qpos - started).max()))
        for j, one in couplings:
            assert data.qpos[j] == pytest.approx(one.factor * data.qpos[one.leader] + one.offset, abs=1e-3)
    assert moved > 0.3


def test_coupled_and_independent_arms_keep_their_bits_together(path: Path, tmp_path: Path) -> None:
    """In one batch, whose kernels are those of coupled arms."""
    arm, other = read(path), tmp_path / "other.urdf"
    other.write_text(with_frames_anyhow(any_arm(3), 3, off=3.0), encoding="utf-8")
    free = read_urdf(other)
    points = np.random.default_rng(0).uniform(-0.7, 0.7, (9, 3))
    both = solve([arm, free], points, restarts=2)
    for n, one in enumerate((arm, free)):
        alone = solve(one, points, restarts=2).q[0]
        assert both.q[n, :, : alone.shape[1]].tobytes() == alone.tobytes()


def test_coupled_arm_on_a_task(path: Path) -> None:
    """Placed, turned, evaluated and stated; with a cycle refused by the name of the joint."""
    arm = read(path)
    task = load_task("target-1")
    problem = Problem(task, default_space(task.name))
    place = placed(problem, arm, 0, Mounting((0.1, 0.0, 0.2), 0.7))
    evaluation = problem.physics(stack_arms([place.described.arm]))
    j, one = arm.arm.couplings[0]
    q = evaluation.q[0]
    assert q[:, j] == pytest.approx(one.factor * q[:, one.leader] + one.offset, abs=1e-6)
    assert not evaluation.joint_torques[0][:, j].any()
    moved = q.copy()
    moved[:, one.leader] += 1e-6
    rises = 1e6 * (forward_kinematics(evaluation.arms, moved[None]).tip - evaluation.frames.tip)[0]
    assert evaluation.jacobian[0, :, :, one.leader] == pytest.approx(rises, abs=1e-4)
    c = evaluation.arms.by_independent(np.eye(N)[None])[0]
    masses = inertia_matrices(evaluation.arms, evaluation.q, np.zeros(len(q)), 0.0)[0]
    assert evaluation.motor_inertia[0] == pytest.approx(c.T @ masses @ c, abs=1e-6)
    sheet = urdf_sheet(arm)
    line = sheet.joints[j]
    assert (line.actuator, line.torque, line.peak_torque) == (f"that of {arm.joints[one.leader]}", None, None)
    assert sheet.over_reach[-1].distance > 0.3
    assert any(each.payload for each in sheet.over_reach)
    cycle = load_task("desk-sorting")
    with pytest.raises(ArmError, match=f'coupled: "{arm.joints[j]}" mimics a joint; paths of cycles'):
        placed(Problem(cycle, default_space(cycle.name)), arm, 0)
    with pytest.raises(ArmError, match="joints that follow others; paths of cycles"):
        evaluate(arm.arm, cycle)
    with pytest.raises(ArmError, match="servos are not modelled"):
        task_mjcf(arm.arm, task)


def test_drives_that_yield_move_the_tip_by_the_joints_that_they_hold(path: Path) -> None:
    """A payload of 1 kg lowers the tip by J K⁻¹ Jᵀ F."""
    arm = read(path)
    theirs, (q, v, a) = Reduced(path, arm), states_of(arm, 5, 6)
    arrays, keep = stack_arms([arm.arm], "float64"), theirs.columns
    frames, soft = forward_kinematics(arrays, q[None]), np.full((1, N), np.inf)
    soft[0, keep] = np.random.default_rng(0).uniform(10.0, 50.0, len(keep))
    rigid = np.full((1, N), np.inf)
    moved = tip_displacements(arrays, frames, unit_payload(arrays, frames), Stiffness(rigid, rigid, soft))[0]
    for row, s, sd, sdd in zip(moved, q[:, keep], v[:, keep], a[:, keep], strict=True):
        jacobian = theirs.seen(s, sd, sdd)[-1]
        assert row == pytest.approx(jacobian @ (jacobian.T @ [0.0, 0.0, -9.81] / soft[0, keep]), abs=1e-9)


def test_reach_of_a_coupled_arm_is_that_of_its_postures(path: Path) -> None:
    arm = read(path)
    theirs = Reduced(path, arm)
    found = reach_map(arm, spacing=0.4, n_directions=4, payload=0.1)
    assert found.bare.covered.any()
    for point, direction in np.argwhere(found.bare.reached)[::7]:
        seen = theirs.frame(found.bare.q[point, direction][theirs.columns])
        assert np.linalg.norm(seen[:3, 3] - found.points[point]) < 2e-3
        assert seen[:3, 2] == pytest.approx(found.directions[direction], abs=3e-3)


def test_payload_over_the_reach_is_held_by_the_drives(tmp_path: Path) -> None:
    """The drive of a leader holds both joints: half the effort holds less, and a follower's effort changes nothing."""

    def payload(**limits: dict[str, float]) -> list[float | None]:
        file = tmp_path / "arm.urdf"
        file.write_text(urdf_of(PARALLELOGRAM, **limits), encoding="utf-8")
        return [line.payload for line in reach_lines(mounted(read(file), Mounting()).arm, 0.0)]

    strong = {f"joint_{n}": {"effort": 1e4} for n in (1, 2, 5, 6, 7)}
    own, weak = payload(**strong, joint_3={"effort": 100.0}), payload(**strong, joint_3={"effort": 50.0})
    assert own == payload(**strong, joint_3={"effort": 100.0}, joint_4={"effort": 1.0})
    assert all(a is None or a > b for a, b in zip(own, weak, strict=True))
