"""Reach maps of designs on the page, in a real browser."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from armwright.cli.app import app
from armwright.page.reach_maps import IN_ALL, IN_NO_DIRECTION, _levels, read_reach_maps
from armwright.problem.problem import Problem
from armwright.runs.folder import read_run
from armwright.spaces.design_space import DesignSpace
from armwright.study.study import optimize
from armwright.tasks.task import Task
from tests.support.arms import LIGHT
from tests.support.browser import Tab

SPACE = DesignSpace.model_validate(
    {"name": "five", "joints": 5, "link": [0.15, 0.3], **LIGHT, "actuators": ["XL430-W250"]}
)
TASK = Task(name="near", targets=((0.3, 0.0, 0.2), (0.0, 0.3, 0.3)), payload=0.05)
SMALL = ("--spacing", "0.2", "--directions", "12")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a run with a reach map of design 3, and one with conditions of design 5."""
    out = tmp_path_factory.mktemp("reach") / "run"
    optimize(Problem(TASK, SPACE), proposer="none", n_init=10, n_total=10, out=out, verify=False)
    for design, options in ((3, ()), (5, ("--payload", "0.1", "--clearance", "0"))):
        done = CliRunner().invoke(app, ["reach-map", str(out), "--design", str(design), *SMALL, *options])
        assert done.exit_code == 0, done.output
        assert "report.html" in done.output
    return out


@pytest.fixture
def tab(folder: Path, tab: Tab) -> Iterator[Tab]:
    tab.open(folder / "report.html")
    yield tab
    assert not tab.faults


def stored(folder: Path, design: int) -> dict[str, Any]:
    with np.load(folder / "reach-maps" / f"{design:04d}.npz") as arrays:
        return dict(arrays)


def grid(arrays: dict[str, Any], name: str) -> np.ndarray:
    return arrays[name].reshape(arrays["shape"])


def shares(texts: list[str]) -> np.ndarray:
    """Return the shares that the page states [%]; -1: reached in none of the directions, -2: not reached."""
    known = {"not reached": -2.0, "reached, but in none of the directions": -1.0}
    return np.array([known[text] if text in known else float(text.split(" ")[0]) for text in texts])


@pytest.mark.slow
def test_slices_show_the_shares_of_the_map(folder: Path, tab: Tab) -> None:
    tab.ask("armwright.set({ design: 2 })")
    assert tab.ask("document.getElementById('reach-box').hidden")
    for design, prefix in ((3, ""), (5, "usable_"), (5, "")):
        tab.ask(f"armwright.set({{ design: {design} }})")
        arrays = stored(folder, design)
        use = tab.page.locator("#reach-use")
        assert tab.page.locator("#reach-use-label").is_visible() == (design == 5)
        if design == 5:
            use.set_checked(prefix == "usable_")
        expected = np.where(
            grid(arrays, f"{prefix}covered"),
            np.where(grid(arrays, f"{prefix}share") > 0.0, 100.0 * grid(arrays, f"{prefix}share"), -1.0),
            -2.0,
        )
        for axis in range(3):
            tab.page.locator("#reach-axis").select_option(str(axis))
            for index in {0, int(arrays["shape"][axis]) // 2, int(arrays["shape"][axis]) - 1}:
                tab.page.locator("#reach-at").fill(str(index))
                trace = tab.ask("(({ x, y, text }) => ({ x, y, text }))(document.getElementById('reach').data[0])")
                plane = np.moveaxis(expected, axis, 0)[index]
                assert shares(trace["text"]) == pytest.approx(plane.ravel(), abs=0.7)
                across = np.moveaxis(arrays["points"].reshape(*arrays["shape"], 3), axis, 0)[index]
                right, up = [k for k in range(3) if k != axis]
                assert trace["x"] == pytest.approx(across[..., right].ravel())
                assert trace["y"] == pytest.approx(across[..., up].ravel())
                value = tab.page.locator("#reach-value").inner_text()
                assert float(value.split(" ")[2]) == pytest.approx(across[0, 0, axis], abs=6e-4)


@pytest.mark.slow
def test_maps_of_other_arms_and_damaged_files_are_left_out(folder: Path, tmp_path: Path) -> None:
    history, maps = read_run(folder)[1], tmp_path / "reach-maps"
    shutil.copytree(folder / "reach-maps", maps)
    params = history.problem.space.matrix([trial.design for trial in history])

    def shown() -> list[int]:
        return sorted(read_reach_maps(tmp_path, len(params), params.__getitem__))

    assert shown() == [3, 5]
    whole, arrays = (maps / "0003.npz").read_bytes(), stored(folder, 3)
    (maps / "0004.npz").write_bytes(whole)  # the map of design 3: the numbers of designs changed since
    (maps / "0999.npz").write_bytes(whole)
    (maps / "mine.npz").write_bytes(whole)
    assert shown() == [3, 5]
    for content in (b"", b"nothing", whole[: len(whole) // 2]):
        (maps / "0003.npz").write_bytes(content)
        assert shown() == [5]
    wrong = {
        "shape": np.array([1, 1, 1]),
        "spacing": np.array(np.nan),
        "share": arrays["share"][1:],
        "design": np.array(""),
    }
    for name, value in wrong.items():
        np.savez_compressed(maps / "0003.npz", **{**arrays, name: value})
        assert shown() == [5]
        np.savez_compressed(maps / "0003.npz", **{key: kept for key, kept in arrays.items() if key != name})
        assert shown() == [5]
    (maps / "0003.npz").write_bytes(whole)
    assert shown() == [3, 5]


def test_only_full_coverage_is_shown_as_full() -> None:
    n = 1000
    share = np.arange(n + 1) / n
    levels = _levels(np.ones(n + 1, dtype=bool), share, n + 1)
    assert np.flatnonzero(levels == IN_ALL).tolist() == [n]
    assert np.flatnonzero(levels == IN_NO_DIRECTION).tolist() == [0]
    assert np.all(np.diff(levels.astype(int)) >= 0)
