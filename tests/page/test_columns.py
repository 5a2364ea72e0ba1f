"""Columns in figures and on the page, where the arm has them."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from playwright.sync_api import Browser

from armwright.page.page import write_report
from armwright.pictures.arm_figures import draw_arm
from armwright.problem.problem import Problem
from armwright.runs.folder import read_run
from armwright.runs.history import History
from armwright.spaces.design_space import DesignSpace
from armwright.study.study import optimize
from armwright.tasks.task import Task
from tests.support.browser import Tab

SPACE = DesignSpace.model_validate(
    {
        "name": "columns",
        "joints": [2, 3],
        "link": [0.1, 0.3],
        "origin_x": [0.1, 0.2],
        "origin_y": [0.05, 0.1],
        "origin_z": [-0.1, 0.3],
        "column": {},
    }
)
TASK = Task(name="near", targets=((0.5, -0.2, 0.5), (-0.2, 0.4, 0.3)), objectives=("worst_error", "mass"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("columns")
    optimize(Problem(TASK, SPACE), proposer="none", n_init=30, n_total=30, out=out, verify=False)
    return out


def drawn(history: History, number: int) -> tuple[Figure, list[np.ndarray]]:
    """The figure of a design, and the corners of the solids on its first panel."""
    figure = draw_arm(history, "arm", history.member(number))
    solids = [one for one in figure.axes[0].collections if isinstance(one, Poly3DCollection)]
    return figure, [np.concatenate(one._faces) for one in solids]


@pytest.mark.slow
def test_figures_draw_the_column_down_to_its_foot(folder: Path) -> None:
    history = read_run(folder)[1]
    seen = set()
    for number in range(10):
        arm = history.problem.arm(history.trials[number].design)
        figure, solids = drawn(history, number)
        seen.add(arm.column is not None)
        assert len(solids) == (arm.column is not None)
        if arm.column is not None:
            low, high = solids[0].min(axis=0), solids[0].max(axis=0)
            x, y, z = arm.base
            assert low == pytest.approx([x - 0.03, y - 0.03, 0.0], abs=1e-6)
            assert high == pytest.approx([x + 0.03, y + 0.03, z], abs=1e-6)
            assert figure.axes[0].get_zlim()[0] <= 0.0
    assert seen == {True, False}


@pytest.mark.slow
def test_page_draws_the_column(folder: Path, browser: Browser) -> None:
    write_report(folder)
    history = read_run(folder)[1]
    tab = Tab(browser, offline=True)
    try:
        tab.open(folder / "report.html")
        for number in range(6):
            arm = history.problem.arm(history.trials[number].design)
            tab.ask(f"armwright.set({{ design: {number}, target: 1 }})")
            tab.ask("armwright.drawArm()")
            found = tab.ask("armwright.drawnColumn()")
            assert (found is None) == (arm.column is None)
            if arm.column is not None:
                x, y, z = arm.base
                assert found["centre"] == pytest.approx([x, y, z / 2], abs=1e-6)
                assert found["half"] == pytest.approx(z / 2, abs=1e-6)
        assert not tab.faults
    finally:
        tab.close()
