"""Motor bodies and columns in figures and on the page, motors at the places of Pinocchio."""

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from armwright.kinematics.arms.forward import motor_solids
from armwright.page.page import write_report
from armwright.pictures.arm_figures import draw_arm
from armwright.problem.problem import Problem
from armwright.proof.design_record import compute_records
from armwright.robot.arm import Arm
from armwright.robot.urdf_writer import to_urdf
from armwright.runs.folder import read_run
from armwright.spaces.design_space import DesignSpace
from armwright.study.study import optimize
from armwright.tasks.task import Task
from tests.support.arms import LIGHT
from tests.support.browser import Tab

CONTENT: dict[str, Any] = {
    "name": "bodies",
    "joints": [2, 4],
    "joint_types": ["R", "P", "Y", "S", "F"],
    "link": [0.1, 0.3],
    "link_directions": ["+z", "-x"],
    **LIGHT,
    "actuators": ["XM540-W270", "AK60-6"],
}
SPACE = DesignSpace.model_validate({**CONTENT, "mount": ["floor", "wall+x"]})
WITH_COLUMN = DesignSpace.model_validate({**CONTENT, "origin_z": [-0.1, 0.3], "column": {}})
TASK = Task(name="near", targets=((0.3, 0.0, 0.3), (0.2, 0.2, 0.3)), objectives=("worst_error", "mass"))


def exported_motors(arm: Arm, q: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Middle and edges along x, y and z of the world of each motor of the URDF, placed by Pinocchio."""
    urdf = to_urdf(arm)
    model: Any = pinocchio.buildModelFromXML(urdf)
    geometry: Any = pinocchio.buildGeomFromUrdfString(model, urdf, pinocchio.GeometryType.COLLISION)
    data, placed = model.createData(), geometry.createData()
    moves = [joint.kind != "fixed" for joint in arm.joints]
    pinocchio.updateGeometryPlacements(model, data, geometry, placed, q[moves])
    found = {}
    for solid, at in zip(geometry.geometryObjects, placed.oMg, strict=True):
        if solid.name.startswith("motor_"):
            shape = solid.geometry
            half = shape.halfSide if hasattr(shape, "halfSide") else [shape.radius, shape.radius, shape.halfLength]
            found[solid.name] = (at.translation, np.abs(at.rotation) @ half)
    return [found[name] for name in sorted(found)]


def test_drawn_solids_are_those_of_the_exported_arm() -> None:
    rng = np.random.default_rng(0)
    for design in SPACE.sample(40, 0):
        arm = SPACE.arm(design)
        q = np.array([rng.uniform(joint.lower, joint.upper) for joint in arm.joints])
        solids = [solid for _, solid in motor_solids(arm, q)]
        expected = exported_motors(arm, q)
        assert len(solids) == len(expected) == sum(joint.kind != "fixed" for joint in arm.joints)
        for solid, (middle, size) in zip(solids, expected, strict=True):
            assert solid.centre == pytest.approx(middle, abs=1e-8)
            assert np.abs(solid.rotation) @ solid.half == pytest.approx(size, abs=1e-8)
            assert np.linalg.det(solid.rotation) == pytest.approx(1.0)


@pytest.mark.slow
def test_page_and_figures_draw_motors_and_columns(tmp_path: Path, tab: Tab) -> None:
    """A column stands on the ground, below the base, where the arm has one."""
    optimize(Problem(TASK, WITH_COLUMN), proposer="none", n_init=30, n_total=30, out=tmp_path, verify=False)
    write_report(tmp_path)
    history = read_run(tmp_path)[1]
    tab.open(tmp_path / "report.html")
    has_column = set()
    for number in range(10):
        arm, evaluation = history.member(number).arm, history.evaluation([number])
        tab.ask(f"armwright.set({{ design: {number}, target: 1 }}); armwright.drawArm()")
        motors = [solid.centre for _, solid in motor_solids(arm, evaluation.q[0, 1, : len(arm.joints)])]
        assert tab.centres("motor") == pytest.approx(np.array(motors), abs=1e-5)
        x, y, z = arm.base
        column, foot = np.array(tab.ask("armwright.drawn('column')")), [x - 0.03, y - 0.03, 0.0]
        axes = draw_arm(history, "arm", history.member(number), compute_records(history, [number])).axes[0]
        corners = [np.concatenate(one._faces) for one in axes.collections if isinstance(one, Poly3DCollection)]
        feet = [low for low in (one.min(axis=0) for one in corners) if np.allclose(low, foot, atol=1e-6)]
        assert (len(column) == 1) == (arm.column is not None) == bool(feet)
        if len(column):
            assert column[0].min(axis=0) == pytest.approx(foot, abs=1e-6)
            assert column[0].max(axis=0) == pytest.approx([x + 0.03, y + 0.03, z], abs=1e-6)
            assert axes.get_zlim()[0] <= 0.0
        has_column.add(len(column) > 0)
    assert has_column == {True, False}
    assert not tab.faults
