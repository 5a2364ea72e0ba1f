"""Every format of `armwright export`, loaded by its target program."""

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from typer.testing import CliRunner

from armwright.cli.app import app
from armwright.problem.problem import Problem
from armwright.runs.export import FORMATS
from armwright.runs.folder import read_run
from armwright.runs.history import History
from armwright.spaces.design_space import DesignSpace
from armwright.study.study import optimize
from armwright.tasks.task import Task
from tests.support.exported_arms import Peer, load, peer_of, postures, processed

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


@pytest.mark.parametrize(
    "as_urdf", [lambda run: exported(run, "ros2_control"), lambda run: processed(exported(run, "xacro"))]
)
def test_exports_that_become_urdf_match_the_design(run: Path, history: History, as_urdf: Callable[[Path], str]) -> None:
    arm, peer = history.member(3).arm, Peer(as_urdf(run))
    assert peer.model.name == f"{HOSTILE}-3"
    for q in postures(arm):
        assert np.abs(peer.tip(q) - peer_of(arm).tip(q)).max() < 1e-9
        assert np.abs(peer.gravity(q) - peer_of(arm).gravity(q)).max() < 1e-9 * load(arm)


def test_exported_xacro_follows_the_mass_model(run: Path, history: History) -> None:
    design, space = history.member(3).design, history.problem.space
    longer = space.design({**design.params, "link_2": 0.3})
    peer = Peer(processed(exported(run, "xacro"), link_2_length=0.3))
    assert sum(inertia.mass for inertia in peer.model.inertias) == pytest.approx(
        sum(link.total_mass for link in space.arm(longer).links)
    )
    for q in postures(space.arm(longer)):
        assert np.abs(peer.gravity(q) - peer_of(space.arm(longer)).gravity(q)).max() < 1e-9 * load(space.arm(longer))


def test_exported_sdf_matches_the_design(run: Path, history: History) -> None:
    plant = MultibodyPlant(0.0)
    (model,) = Parser(plant).AddModelsFromString(exported(run, "sdf"), "sdf")
    plant.Finalize()
    assert plant.GetModelInstanceName(model) == f"{HOSTILE}-3"
    for number, joint in enumerate(history.member(3).arm.joints, start=1):
        assert joint.actuator is not None
        assert plant.GetJointActuatorByName(f"joint_{number}").effort_limit() == pytest.approx(
            joint.actuator.peak_torque
        )


def test_exported_srdf_matches_the_urdf(run: Path) -> None:
    urdf, srdf = exported(run, "urdf"), exported(run, "srdf")
    assert ElementTree.fromstring(urdf).get("name") == ElementTree.fromstring(srdf).get("name")
    model = pinocchio.buildModelFromXML(urdf)
    pinocchio.loadReferenceConfigurationsFromXML(model, srdf)
    assert np.array_equal(model.referenceConfigurations["home"], np.zeros(4))


def test_every_export_format_is_listed_and_written(run: Path, tmp_path: Path) -> None:
    told = CliRunner().invoke(app, ["export", "--help"], env={"COLUMNS": "300"}).output
    for kind in FORMATS:
        assert kind in told
        exported(run, kind, "--out", str(tmp_path / "deep" / kind))
        assert (tmp_path / "deep" / kind).read_text(encoding="utf-8") == exported(run, kind)
