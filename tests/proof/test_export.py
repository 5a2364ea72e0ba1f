"""Every format of `armwright export`, loaded by its target program."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from armwright.cli.app import app
from armwright.problem.problem import Problem
from armwright.proof.export import FORMATS
from armwright.runs.folder import read_run
from armwright.runs.history import History
from armwright.spaces.design_space import DesignSpace
from armwright.study.study import optimize
from armwright.tasks.task import Task
from tests.support.exported_arms import Peer, load, peer_of, postures

HOSTILE = "a.b-c_" + "9" * 58  # what a task may be called at most


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a space with motors and a mass that grows with length."""
    folder = tmp_path_factory.mktemp("exporting") / "run"
    content = {
        "link_section": {"tubes": [[0.02, 0.0015], [0.03, 0.002]], "material": "aluminium"},
        "actuators": ["XM430-W350", "XL430-W250"],
    }
    task = Task.model_validate({"name": HOSTILE, "targets": [[0.4, 0.0, 0.2]]})
    optimize(Problem(task, space=DesignSpace.model_validate(content)), n_total=2, seed=1, out=folder)
    return folder


@pytest.fixture
def history(run: Path) -> History:
    return read_run(run)[1]


def exported(run: Path, kind: str, *options: str) -> str:
    result = CliRunner().invoke(app, ["export", str(run), "--design", "3", "--format", kind, *options])
    assert result.exit_code == 0, result.output
    return result.output


def test_exported_ros2_control_matches_the_design(run: Path, history: History) -> None:
    arm, peer = history.member(3).arm, Peer(exported(run, "ros2_control"))
    assert peer.model.name == f"{HOSTILE}-3"
    for q in postures(arm):
        assert np.abs(peer.tip(q) - peer_of(arm).tip(q)).max() < 1e-9
        assert np.abs(peer.gravity(q) - peer_of(arm).gravity(q)).max() < 1e-9 * load(arm)


def test_every_export_format_is_listed_and_written(run: Path, tmp_path: Path) -> None:
    told = CliRunner().invoke(app, ["export", "--help"], env={"COLUMNS": "300"}).output
    for kind in FORMATS:
        assert kind in told
        exported(run, kind, "--out", str(tmp_path / "deep" / kind))
        assert (tmp_path / "deep" / kind).read_text(encoding="utf-8") == exported(run, kind)
