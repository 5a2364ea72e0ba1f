"""Tool and payload as bodies: clearances against Coal with the exported geometry, and what they may touch."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

import coal
import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.kinematics.arms.forward import forward_kinematics
from armwright.kinematics.contact.clearance import clearances
from armwright.problem.evaluation import evaluate
from armwright.problem.scene import Scene
from armwright.proof.simulation_model import to_simulation_mjcf
from armwright.robot.arm import Arm, Joint, Link
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.tool_mount import with_tool
from armwright.tasks.obstacles import Box, Obstacle
from armwright.tasks.payload import Payload
from armwright.tasks.targets import position_targets
from armwright.tasks.task import Task
from armwright.tasks.tip_rules import APART, TipRules, tip_solids
from armwright.tasks.tool import Tool
from tests.kinematics.test_clearance import agree, apart, coal_shape, random_obstacle
from tests.kinematics.test_motor_bodies import CONTENT, postures

Array = NDArray[np.float64]
LOAD = Payload(mass=1.0, center=(0.02, -0.01, 0.05), size=(0.05, 0.08, 0.12))
TOOLS = (
    Tool(tip=(0.02, 0.0, 0.1), rpy=(0.3, -0.5, 0.2), center=(0.0, 0.01, 0.04), size=(0.05, 0.03, 0.09)),
    Tool(tip=(0.03, -0.02, 0.12), radius=0.02, mass=0.2),
)
SPACE = DesignSpace.model_validate({**CONTENT, "joint_types": ["R", "P", "Y", "S", "F"]})
SOLIDS = {
    int(mujoco.mjtGeom.mjGEOM_BOX): lambda size: coal.Box(*(2.0 * size)),
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): lambda size: coal.Cylinder(size[0], 2.0 * size[1]),
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): lambda size: coal.Capsule(size[0], 2.0 * size[1]),
}


class ExportedTip:
    """Tool and payload of the exported simulation in Coal, and the parts of the arm that they may not touch."""

    def __init__(self, arm: Arm, tool: Tool, obstacles: Sequence[Obstacle]) -> None:
        self._moves = [joint.kind != "fixed" for joint in arm.joints]
        rules = TipRules(np.ones(1, dtype=np.bool_), np.empty((1, 0)), tip_solids(tool, LOAD))
        scene = Scene(np.zeros((1, 3)), np.ones(1), position_targets(1), tuple(obstacles), tip_rules=rules)
        n = sum(self._moves)
        text = to_simulation_mjcf(arm, scene, ("one",), np.zeros((1, len(arm.joints))), np.ones(n))
        self.model = mujoco.MjModel.from_xml_string(text)
        self._data = mujoco.MjData(self.model)
        excluded = ElementTree.fromstring(text).findall("contact/exclude")
        self.excluded = {one.attrib["body2"] for one in excluded if one.attrib["body1"] == "payload"}

    def at(self, q: Array) -> dict[str, tuple[str, tuple[Any, coal.Transform3s]]]:
        """Place all in a posture, and return the solid of each geom with the name of its body."""
        self._data.qpos[:] = q[self._moves]
        mujoco.mj_kinematics(self.model, self._data)
        found: dict[str, Any] = {}
        for g in range(self.model.ngeom):
            geom, place = self.model.geom(g), self._data.geom(g)
            if int(geom.type[0]) in SOLIDS and not geom.name.startswith("obstacle"):
                at = coal.Transform3s(place.xmat.reshape(3, 3), place.xpos)
                found[geom.name] = self.model.body(geom.bodyid[0]).name, (SOLIDS[int(geom.type[0])](geom.size), at)
        return found

    def clearances(self, q: Array, obstacles: Sequence[Obstacle], carries: bool, allowed: Array) -> tuple[float, float]:
        """Of tool and payload from the arm and from obstacles, by the rules of docs/method.md §13."""
        solids = self.at(q)
        tips = [name for name in ("tool", "payload") if name in solids and (name == "tool" or carries)]
        own = [
            apart(solids[tip][1], solid)
            for tip in tips
            for name, (body, solid) in solids.items()
            if name not in ("tool", "payload") and body not in self.excluded
        ]
        free = [
            apart(solids[tip][1], coal_shape(one)) + max(depth, 0.0)
            for tip in tips
            for one, depth in zip(obstacles, allowed, strict=True)
            if depth < 0.0 or apart(solids[tip][1], coal_shape(one)) + depth < 0.0
        ]
        return min(own, default=np.inf), min(free, default=np.inf)


@pytest.mark.parametrize("tool", TOOLS, ids=["box", "cylinder"])
def test_clearance_of_tool_and_payload_agrees_with_coal(tool: Tool) -> None:
    arms = [with_tool(SPACE.arm(design), tool) for design in SPACE.sample(25, 1)]
    rng = np.random.default_rng(2)
    obstacles = [random_obstacle(rng, kind, 1.0, 0.8) for kind in ("box", "sphere", "cylinder", "mesh")]
    q = postures(arms, 6, 3)
    allowed = rng.choice([APART, 0.0, 0.01, np.inf], (6, 4), p=[0.6, 0.2, 0.1, 0.1])
    rules = TipRules(rng.random(6) < 0.7, allowed, tip_solids(tool, LOAD))
    arrays = stack_arms(arms, "float64")
    own, clear = clearances(arrays, q, obstacles, rules=rules)
    bare_own, bare_clear = clearances(arrays, q, obstacles)
    nearer = np.zeros(2)
    for n, arm in enumerate(arms):
        exported = ExportedTip(arm, tool, obstacles)
        for t in range(q.shape[1]):
            theirs = exported.clearances(
                q[n, t, : len(arm.joints)], obstacles, bool(rules.carries[t]), rules.allowed[t]
            )
            assert agree(own[n, t], min(bare_own[n, t], theirs[0])), (n, t, own[n, t], theirs)
            assert agree(clear[n, t], min(bare_clear[n, t], theirs[1])), (n, t, clear[n, t], theirs)
            nearer += theirs[0] < bare_own[n, t], theirs[1] < bare_clear[n, t]
    assert nearer.min() > 10


def test_depths_up_to_what_is_allowed_do_not_count() -> None:
    """A payload reaches 10 mm, the tool 0 mm into a ceiling, 85 mm above the last link."""
    space = DesignSpace.model_validate({"joints": 2, "joint_types": ["P"], "link": [0.2, 0.2], "motor_bodies": False})
    arm = replace(space.arm(space.sample(1, 0)[0]), base=(0.0, 0.0, 0.0))
    tool = Tool(tip=(0.0, 0.0, 0.1), radius=0.01)
    arrays = stack_arms([with_tool(arm, tool)], "float64")
    solids = tip_solids(tool, Payload(mass=1.0, size=(0.02, 0.02, 0.02)))
    top = sum(link.length for link in arm.links) + 0.1 + 0.5
    ceiling = Box(kind="box", center=(0.0, 0.0, top), size=(1.0, 1.0, 1.0))
    allowed = np.array([[APART], [0.0], [0.005], [0.02], [np.inf]])
    for held, wanted in ((True, [-0.01, -0.01, -0.005, 0.085, 0.085]), (False, [0.0, 0.085, 0.085, 0.085, 0.085])):
        rules = TipRules(np.full(5, held), allowed, solids)
        found = clearances(arrays, np.zeros((1, 5, arrays.dof)), [ceiling], rules=rules)[1][0]
        assert found == pytest.approx(wanted, abs=2e-5)


def test_payload_that_passes_an_obstacle_between_samples_collides() -> None:
    """A ball of 1 mm is in the middle of a payload of 10 mm, halfway between two samples, 20 mm apart."""
    links = [Link((0.0, 0.0, length), 0.01, (0.0, 0.0, length / 2), 0.02) for length in (0.2, 0.4, 0.35)]
    arm = Arm((0.0, 0.0, 0.0), tuple(Joint("revolute", axis, -1.5, 1.5) for axis in "zyy"), tuple(links))
    payload = {"mass": 0.1, "center": [0.0, 0.0, 0.05], "size": [0.01, 0.01, 0.01]}
    cycle = {"closed": False, "time": 1.0, "steps": [{"to": 1, "do": "pick"}, {"to": 2}]}
    content = {"targets": [[0.45, -0.35, 0.3], [0.45, 0.35, 0.3]], "payload": payload, "cycle": cycle}
    bare, (path,) = evaluate(arm, Task.model_validate({"name": "bare", **content})).paths.of_arm(0)
    steps = path.q.shape[1] - 1
    share = np.array([(steps // 2 + 0.5) / steps])
    frames = forward_kinematics(bare, path.at(share))
    middle = frames.tip[0, 0] + frames.rotation[0, 0, -1] @ payload["center"]
    ball = {"kind": "sphere", "center": middle.tolist(), "radius": 0.001}
    found = evaluate(arm, Task.model_validate({"name": "ball", "obstacles": [ball], **content}))
    assert found.paths.obstacle_clearance[0, 0] == pytest.approx(-0.006, abs=5e-4)
    assert found.paths.worst[0, 0, 2] == pytest.approx(share[0], abs=1 / 64 / steps)
    empty = {**content, "payload": 0.1}
    assert evaluate(arm, Task.model_validate({"name": "empty", "obstacles": [ball], **empty})).clearance.min() > 0.0
