"""armwright reach-map on URDF files and on runs."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import armwright as aw
from armwright.cli.app import app
from armwright.robot.arm import Arm, Joint, uniform_link

SMALL = ("--spacing", "0.25", "--directions", "12")


@pytest.fixture
def urdf(in_folder: Path) -> Path:
    """Return the URDF of an arm of three joints."""
    joints = tuple(Joint("revolute", axis, -2.5, 2.5) for axis in ("z", "y", "y"))
    links = tuple(uniform_link((0.0, 0.0, length), 0.5, 0.02) for length in (0.2, 0.3, 0.3))
    file = in_folder / "bare.urdf"
    file.write_text(aw.to_urdf(Arm((0.0, 0.0, 0.0), joints, links)), encoding="utf-8")
    return file


def stored(file: Path) -> dict[str, Any]:
    with np.load(file) as arrays:
        return dict(arrays)


def test_urdf_is_mapped_into_arrays_and_a_figure(urdf: Path) -> None:
    done = CliRunner().invoke(
        app, ["reach-map", urdf.name, *SMALL, "--payload", "0.5", "--out", "maps/mine.npz", "--json"]
    )
    assert done.exit_code == 0, done.output
    record = json.loads(done.stdout)
    assert record["conditions"] == "holding 0.5 kg"
    file, figure = (Path(name) for name in record["files"])
    assert file == Path("maps/mine.npz")
    assert figure.read_bytes().startswith(b"\x89PNG")
    arrays = stored(file)
    n = record["points"]
    assert arrays["points"].shape == (n, 3)
    assert arrays["shape"].prod() == n
    assert arrays["reached"].shape == (n, 12)
    assert arrays["q"].shape == (n, 12, 3)
    assert np.array_equal(arrays["share"], arrays["reached"].mean(axis=1))
    assert np.all(arrays["covered"][arrays["usable_covered"]])
    assert record["within_limits"]["volume"] == pytest.approx(0.25**3 * arrays["covered"].sum())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--design", "3"), "--design 3 is for a run"),
        (("--axis", "down"), '--axis "down": expected three numbers with commas, such as 0,0,-1'),
        (("--box", "1,2"), '--box "1,2": expected six numbers'),
        (("--out", "map.png"), "--out map.png: expected a name that ends in .npz"),
        (("--obstacles",), "--obstacles: expected a task; try --task TASK"),
        (("--obstacles", "--task", "target-1"), "--obstacles: expected obstacles in the task, which has none"),
        (("--cone", "200"), "half_angle"),
    ],
)
def test_invalid_options_are_refused(urdf: Path, options: tuple[str, ...], message: str) -> None:
    refused = CliRunner().invoke(app, ["reach-map", urdf.name, *options])
    assert message in str(refused.exception)


@pytest.mark.slow
def test_design_of_a_run_is_mapped_among_its_obstacles(in_folder: Path) -> None:
    (in_folder / "bench.yaml").write_text(
        "name: bench\ntargets: [[0.3, 0.1, 0.2], [0.3, -0.1, 0.3]]\nobstacles: [{kind: ground, z: 0}]\n",
        encoding="utf-8",
    )
    CliRunner().invoke(app, ["optimize", "bench.yaml", "--n-total", "20", "--no-figures", "--out", "run"])
    done = CliRunner().invoke(app, ["reach-map", "run", "--obstacles", *SMALL])
    assert done.exit_code == 0, done.output
    assert "clear of itself and obstacles" in done.output
    assert "in all directions [m³]" in done.output
    (file,) = (in_folder / "run" / "reach-maps").glob("*.npz")
    arrays = stored(file)
    assert arrays["covered"].sum() >= arrays["usable_covered"].sum()
    assert not arrays["usable_covered"][arrays["points"][:, 2] < 0.0].any()
    for options in (("--design", "99"), ("--tip", "x"), ("--task", "target-1")):
        assert CliRunner().invoke(app, ["reach-map", "run", *options]).exit_code != 0
