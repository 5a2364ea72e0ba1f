"""Motor bodies in figures and on the page, at the places of Pinocchio."""

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest
from playwright.sync_api import Browser

from armwright.kinematics.arms.forward import motor_solids
from armwright.page.page import write_report
from armwright.pictures.figures import write_figures
from armwright.problem.problem import Problem
from armwright.robot.arm import Arm
from armwright.robot.urdf_writer import to_urdf
from armwright.runs.folder import read_run
from armwright.spaces.design_space import DesignSpace
from armwright.study.study import optimize
from armwright.tasks.task import Task
from tests.support.browser import Tab

SPACE = DesignSpace.model_validate(
    {
        "name": "bodies",
        "joints": [2, 4],
        "joint_types": ["R", "P", "Y", "S", "F"],
        "mount": ["floor", "wall+x"],
        "link": [0.1, 0.3],
        "link_directions": ["+z", "-x"],
        "actuators": ["XM540-W270", "AK60-6"],
    }
)
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
def test_page_and_figures_draw_motors(tmp_path: Path, browser: Browser) -> None:
    optimize(Problem(TASK, SPACE), proposer="none", n_init=30, n_total=30, out=tmp_path, verify=False)
    assert "arms.png" in {path.name for path in write_figures(tmp_path)}
    write_report(tmp_path)
    history = read_run(tmp_path)[1]
    number = history.front[0].number
    arm, evaluation = history.member(number).arm, history.evaluation([number])
    tab = Tab(browser, offline=True)
    try:
        tab.open(tmp_path / "report.html")
        tab.ask(f"armwright.set({{ design: {number}, target: 1 }})")
        tab.ask("armwright.drawArm()")
        drawn = np.array(tab.ask("armwright.drawnMotors()"))
        assert not tab.faults
    finally:
        tab.close()
    solids = motor_solids(arm, evaluation.q[0, 1, : len(arm.joints)])
    assert drawn == pytest.approx(np.array([solid.centre for _, solid in solids]), abs=1e-5)
