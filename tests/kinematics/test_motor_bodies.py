"""Motor bodies: clearances against Coal with the exported geometry, and contacts in MuJoCo."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import coal
import mujoco
import numpy as np
import pinocchio
import pytest
from numpy.typing import NDArray

from armwright.exceptions import SpaceError
from armwright.kinematics.arms.arm_arrays import Precision, stack_arms
from armwright.kinematics.arms.forward import link_lines
from armwright.kinematics.contact.clearance import clearances, straight_motor_clearance
from armwright.problem.evaluation import evaluate
from armwright.problem.problem import Problem
from armwright.problem.scene import Scene
from armwright.proof.simulation_model import to_simulation_mjcf
from armwright.robot.arm import Arm, Column, Joint, uniform_link
from armwright.robot.mjcf import to_mjcf
from armwright.robot.motor_body import MotorBody
from armwright.robot.urdf_writer import to_urdf
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.obstacles import Ground, Obstacle
from armwright.tasks.targets import position_targets
from armwright.tasks.task import Task
from tests.kinematics.test_clearance import SHAPES, agree, apart, capsule, coal_shape, random_obstacle
from tests.support.arms import LIGHT

Array = NDArray[np.float64]
CONTENT: Mapping[str, Any] = {
    "name": "bodies",
    "joints": [3, 6],
    "joint_types": ["R", "P", "Y", "S"],
    "joint_range": [-2.4, 2.4],
    "stroke": [0.05, 0.1],
    "mount": ["floor", "ceiling", "wall+x", "wall-y"],
    "link": [0.06, 0.25],
    "link_directions": ["+z", "-x", "+y"],
    **LIGHT,
    "actuators": ["XM540-W270", "AK60-6", "PH42-020-S300-R", "XL330-M288"],
}
SPACE = DesignSpace.model_validate(CONTENT)
PITCH = DesignSpace.model_validate(
    {"joints": 3, "joint_types": ["P"], "link": [0.02, 0.3], **LIGHT, "actuators": ["XM540-W270"]}
)


class Exported:
    """Motors and column of an arm's URDF in Coal, and its links as capsules, placed by Pinocchio."""

    def __init__(self, arm: Arm) -> None:
        urdf = to_urdf(arm)
        self._arm, self._model = arm, pinocchio.buildModelFromXML(urdf)
        self._geometry = pinocchio.buildGeomFromUrdfString(self._model, urdf, pinocchio.GeometryType.COLLISION)
        self.links: list[tuple[Any, coal.Transform3s]] = []
        self.motors: dict[int, tuple[Any, coal.Transform3s]] = {}
        self.column: tuple[Any, coal.Transform3s] | None = None

    def at(self, q: Array) -> "Exported":
        """Place all in this posture."""
        arm, model, geometry = self._arm, self._model, self._geometry
        data, placed = model.createData(), geometry.createData()
        pinocchio.framesForwardKinematics(model, data, q)
        pinocchio.updateGeometryPlacements(model, data, geometry, placed)
        self.links.clear()
        for n, link in enumerate(arm.links, start=1):
            frame = data.oMf[model.getFrameId(f"link_{n}")]
            self.links.append(capsule(frame.translation, frame.act(np.array(link.offset)), link.radius))
        for solid, at in zip(geometry.geometryObjects, placed.oMg, strict=True):
            if solid.name.startswith("motor_"):
                number = int(solid.name.removeprefix("motor_").removesuffix("_0")) - 1
                self.motors[number] = (solid.geometry, coal.Transform3s(at.rotation, at.translation))
            if solid.name.startswith("column"):
                self.column = (solid.geometry, coal.Transform3s(at.rotation, at.translation))
        return self

    def own_clearance(self) -> float:
        """Of motors from motors and links, of arms whose joints all move; motor j joins the links j - 1 and j."""
        found = np.inf
        for j, motor in self.motors.items():
            others = [other for k, other in self.motors.items() if k > j]
            others += [link for k, link in enumerate(self.links) if k not in (j - 1, j)]
            found = min([found, *(apart(motor, other) for other in others)])
        return found

    def column_clearance(self) -> float:
        """Of the column from links and motors, of arms whose joints all move; the first of both stand on it."""
        if self.column is None:
            return np.inf
        others = [*self.links[1:], *(motor for j, motor in self.motors.items() if j > 0)]
        return min([np.inf, *(apart(self.column, other) for other in others)])

    def obstacle_clearance(self, obstacles: Sequence[Obstacle]) -> float:
        """Of motors from obstacles; the first motor is at rest, so that only overlaps count."""
        found = [(j, apart(motor, coal_shape(one))) for j, motor in self.motors.items() for one in obstacles]
        return min([np.inf, *(distance for j, distance in found if j > 0 or distance < 0.0)])


def postures(arms: Sequence[Arm], t: int, seed: int) -> Array:
    """(N, T, D) random joint values within the limits; 0 for joints that an arm does not have."""
    rng, arrays = np.random.default_rng(seed), stack_arms(arms)
    q = rng.uniform(arrays.lower[:, None], arrays.upper[:, None], (len(arms), t, arrays.dof))
    return np.where(np.arange(arrays.dof) < arrays.n_joints[:, None, None], q, 0.0)


# Against Coal, with the geometry of the exported URDF placed by Pinocchio


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_motor_clearance_agrees_with_coal(precision: Precision) -> None:
    arms = [SPACE.arm(design) for design in SPACE.sample(40, 1)]
    rng = np.random.default_rng(2)
    obstacles = [random_obstacle(rng, kind, 1.0, 0.6) for kind in (*SHAPES[:3], *SHAPES[:3])]
    q = postures(arms, 4, 3)
    arrays = stack_arms(arms, precision)
    own, clear = clearances(arrays, q, obstacles)
    links_own, links_clear = clearances(replace(arrays, motor_bodies=None), q, obstacles)
    nearer, free, hit = 0, 0, 0
    for n, arm in enumerate(arms):
        exported = Exported(arm)
        for t in range(q.shape[1]):
            exported.at(q[n, t, : len(arm.joints)])
            theirs = min(links_own[n, t], exported.own_clearance())
            nearer += theirs < links_own[n, t]
            free, hit = free + (theirs > 0.0), hit + (theirs < 0.0)
            assert agree(own[n, t], theirs), (own[n, t], theirs)
            assert agree(clear[n, t], min(links_clear[n, t], exported.obstacle_clearance(obstacles)))
    assert nearer > 40
    assert min(free, hit) > 20


@pytest.mark.parametrize("kind", SHAPES)
def test_clearance_of_one_motor_agrees_with_coal(kind: str) -> None:
    """A motor on a link that turns about its own axis, near an obstacle."""
    rng = np.random.default_rng(SHAPES.index(kind))
    n_free = n_hit = 0
    for shape in ("box", "cylinder"):
        for axis in ("x", "y", "z"):
            arms = [turning_motor(rng, shape, axis) for _ in range(25)]
            q = rng.uniform(-3.0, 3.0, (25, 1, 2))
            obstacle = random_obstacle(rng, kind, 0.3)
            found = clearances(stack_arms(arms), q, [obstacle])[1]
            links = clearances(replace(stack_arms(arms), motor_bodies=None), q, [obstacle])[1]
            for n, arm in enumerate(arms):
                theirs = min(links[n, 0], Exported(arm).at(q[n, 0]).obstacle_clearance([obstacle]))
                assert agree(found[n, 0], theirs), (shape, axis, found[n, 0], theirs)
                n_free, n_hit = n_free + (theirs > 0.0), n_hit + (theirs < 0.0)
    assert min(n_free, n_hit) > 10


def turning_motor(rng: np.random.Generator, shape: Any, axis: Any) -> Arm:
    x, y, z = rng.uniform(0.02, 0.3, 3).tolist()
    if shape == "cylinder":
        x, y, z = {"x": (x, y, y), "y": (x, y, x), "z": (x, x, z)}[axis]
    body = MotorBody(shape, axis, (x, y, z), tuple(rng.uniform(-0.05, 0.05, 3).tolist()))
    joints = (Joint("revolute", rng.choice(["x", "y", "z"]), -3.1, 3.1), Joint("revolute", axis, -3.1, 3.1, body=body))
    links = (uniform_link((0.1, 0.0, 0.1), 0.1, 0.01), uniform_link((0.0, 0.0, 0.001), 0.1, 0.001))
    return Arm(tuple(rng.uniform(-0.2, 0.2, 3).tolist()), joints, links)


def test_depth_of_overlapping_boxes_is_the_least_translation_apart() -> None:
    """Two boxes on a slide: their overlap shrinks as the second is moved out."""
    bodies = MotorBody("box", "x", (0.06, 0.05, 0.04)), MotorBody("box", "x", (0.04, 0.06, 0.05))
    joints = tuple(Joint("prismatic", "x", 0.0, 1.0, body=body) for body in bodies)
    arm = Arm((0.0, 0.0, 0.0), joints, (uniform_link((0.0, 0.0, 0.01), 0.1, 0.001),) * 2)
    shifts = np.array([0.0, 0.01, 0.02, 0.04, 0.05, 0.1, 0.2])
    q = np.stack([shifts, np.zeros_like(shifts)], axis=1)[None]
    found = clearances(stack_arms([arm]), q)[0][0]
    assert found == pytest.approx([-0.035, -0.035, -0.03, -0.01, 0.0, 0.05, 0.15], abs=1e-5)


# What must hold whatever the arm


def test_motors_may_not_overlap_in_the_straight_posture() -> None:
    """Boxes of 20 x 100 mm, 80 mm apart, overlap by 20 mm if the arm is straight, and are 20 mm apart if it is bent."""
    joint = Joint("revolute", "y", -2.0, 2.0, body=MotorBody("box", "y", (0.02, 0.02, 0.1)))
    links = uniform_link((0.0, 0.0, 0.08), 0.1, 0.01), uniform_link((0.0, 0.0, 0.2), 0.1, 0.01)
    arm = Arm((0.0, 0.0, 0.0), (joint, joint), links)
    bent = np.array([[[0.5 * np.pi, 0.0]]])
    assert clearances(stack_arms([arm]), bent)[0][0, 0] == pytest.approx(0.02, abs=2e-5)
    assert straight_motor_clearance(stack_arms([arm])) == pytest.approx([-0.02], abs=1e-5)
    target = link_lines(arm, bent[0, 0])[-1][1]
    evaluation = evaluate([arm], [target])
    assert evaluation.position_error[0, 0] < 1e-3
    assert evaluation.self_clearance[0, 0] == pytest.approx(-0.02, abs=1e-5)
    plain = replace(arm, joints=tuple(replace(joint, body=None) for joint in arm.joints))
    assert evaluate([plain], [target]).self_clearance[0, 0] == np.inf


@pytest.mark.parametrize("export", [to_urdf, to_mjcf])
def test_bodies_and_columns_do_not_change_dynamics_in_mujoco(export: Callable[[Arm], str]) -> None:
    for design in SPACE.sample(5, 12):
        arm = SPACE.arm(design)
        joints = tuple(replace(joint, body=None) for joint in arm.joints)
        forces = []
        for exported in (arm, replace(arm, joints=joints), replace(arm, column=Column(0.5, 0.06, 0.003, 1.0))):
            model = mujoco.MjModel.from_xml_string(export(exported))
            model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
            data = mujoco.MjData(model)
            data.qpos[:], data.qvel[:], data.qacc[:] = np.random.default_rng(13).uniform(-1.0, 1.0, (3, model.nv))
            mujoco.mj_inverse(model, data)
            forces.append(data.qfrc_inverse.copy())
        assert forces == [pytest.approx(forces[0], rel=1e-6, abs=1e-6)] * 3


def test_motor_bodies_may_not_collide() -> None:
    task = Task(name="near", targets=((0.3, 0.0, 0.2),), obstacles=(Ground(kind="ground"),))
    problem = Problem(task, PITCH)
    assert [constraint.description for constraint in problem.constraints] == ["collision <= 0"]
    short, low, free = (
        PITCH.clipped((0.0, 0.0, height), "PPP", (length, 0.2, 0.2))
        for height, length in ((0.05, 0.05), (0.03, 0.15), (0.05, 0.15))
    )
    violations = problem.evaluate([short, low, free]).violations[:, 0]
    assert violations[0] >= 0.0084
    assert violations[1] == pytest.approx(0.01175, abs=1e-5)
    assert violations[2] == 0.0
    bounded = task.model_copy(update={"constraints": ("clearance >= 0.01",)})
    assert [constraint.description for constraint in Problem(bounded, PITCH).constraints] == ["clearance >= 0.01"]


def touching_solids(arm: Arm, q: Array, obstacles: tuple[Obstacle, ...] = ()) -> list[list[set[str]]]:
    """For each of (T, J) postures the names of the solids that touch each other in the exported simulation."""
    moves = [joint.kind != "fixed" for joint in arm.joints]
    scene = Scene(np.zeros((1, 3)), np.zeros(1), position_targets(1), obstacles)
    text = to_simulation_mjcf(arm, scene, ("one",), np.zeros((1, len(moves))), np.ones(sum(moves)))
    model = mujoco.MjModel.from_xml_string(text)
    data, found = mujoco.MjData(model), []
    for row in q:
        data.qpos[:] = row[moves]
        mujoco.mj_forward(model, data)
        found.append([{model.geom(g).name for g in data.contact[c].geom} for c in range(data.ncon)])
    return found


def test_contacts_in_mujoco_agree_with_the_clearance() -> None:
    """The motors and links that touch in the exported simulation are those of a negative clearance."""
    ground: tuple[Obstacle, ...] = (Ground(kind="ground", z=-0.3),)
    space = DesignSpace.model_validate(
        {**CONTENT, "joint_types": ["R", "P", "Y", "F"], "mount": ["floor"], "origin_z": [0.2, 0.5]}
    )
    touching = 0
    for design in space.sample(40, 8):
        arm = space.arm(design)
        q, arrays = postures([arm], 10, 9), stack_arms([arm], "float64")
        nearest = np.min(clearances(arrays, q, ground), axis=0)[0]
        without = np.min(clearances(replace(arrays, motor_bodies=None), q, ground), axis=0)[0]
        names = touching_solids(arm, q[0], ground)
        for t in np.flatnonzero((without > 1e-4) & (np.abs(nearest) > 1e-4)):
            motors = [pair for pair in names[t] if any(name.startswith("motor") for name in pair)]
            assert bool(motors) == (nearest[t] < 0.0), (design, nearest[t], names[t])
            touching += bool(motors)
    assert touching > 20


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"actuators": ["XM430-W350", "FHA-14C-100"]}, "none for FHA-14C-100: width, height, depth"),
        ({"actuators": [{"name": "own", "mass": 0.1, "stall_torque": 1.0, "width": 0.02, "depth": 0.03}]},
         "none for own: height"),
        ({"joint_types": ["P", "O"]}, "got O with two at one place"),
    ],
)  # fmt: skip
def test_spaces_that_cannot_have_bodies_are_refused(content: dict[str, Any], message: str) -> None:
    with pytest.raises((SpaceError, ValueError), match=message):
        DesignSpace.model_validate({**LIGHT, "actuators": ["XM430-W350"], **content})


def test_bracket_mass_adds_to_each_joint_that_moves() -> None:
    content = {
        "joints": 3,
        "restrict": {"joint_2": "F"},
        "joint_types": ["P", "F"],
        **LIGHT,
        "actuators": ["XL330-M288"],
    }
    plain = DesignSpace.model_validate(content)
    heavy = DesignSpace.model_validate({**content, "bracket_mass": 0.05})
    for design in plain.sample(20, 2):
        joints = sum(joint.kind != "fixed" for joint in plain.arm(design).joints)
        assert heavy.arm(design).mass - plain.arm(design).mass == pytest.approx(0.05 * joints)
