"""Meshes as obstacles: files, hulls that contain them, and tasks that hold what they need."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from armwright.exceptions import TaskError
from armwright.tasks.catalogue import load_task
from armwright.tasks.meshes import MAX_CORNERS, read_hull
from armwright.tasks.obstacles import Box, Mesh
from armwright.tasks.task import Task
from armwright.yaml_documents import dump_document, parse_document

Array = NDArray[np.float64]
BLOCK = np.array([[x, y, z] for x in (0.0, 300.0) for y in (0.0, 200.0) for z in (0.0, 100.0)])  # mm
TASK = """name: near-a-fixture
targets: [[0.4, 0.2, 0.3]]
obstacles:
  - {mesh: cad/fixture.stl, name: fixture, scale: 0.001, position: [0.1, 0.0, 0.0], rpy: [0, 0, 1.5707963267948966]}
"""


def binary_stl(points: Array) -> bytes:
    triangles = points[ConvexHull(points).simplices]
    records = b"".join(struct.pack("<12fH", 0, 0, 0, *triangle.ravel(), 0) for triangle in triangles)
    return b"solid".ljust(80) + struct.pack("<I", len(triangles)) + records


def ascii_stl(points: Array) -> bytes:
    corners = "\n".join(f"    vertex {x} {y} {z}" for x, y, z in points[ConvexHull(points).simplices].reshape(-1, 3))
    return f"solid block\n{corners}\nendsolid".encode()


def obj(points: Array) -> bytes:
    return "\r\n".join(f"v {x} {y} {z} 1.0\nvn 0 0 1" for x, y, z in points).encode()


def sphere(n: int) -> Array:
    points = np.random.default_rng(0).normal(size=(n, 3))
    return 50.0 * points / np.linalg.norm(points, axis=1, keepdims=True)


def task_beside(folder: Path, mesh: bytes, text: str = TASK) -> Task:
    (folder / "cad").mkdir(exist_ok=True)
    (folder / "cad" / "fixture.stl").write_bytes(mesh)
    (folder / "task.yaml").write_text(text)
    return load_task(folder / "task.yaml")


@pytest.mark.parametrize("write", [binary_stl, ascii_stl, obj])
def test_mesh_of_a_block_is_the_turned_block_in_metres(write: Any, tmp_path: Path) -> None:
    obstacle = task_beside(tmp_path, write(BLOCK)).obstacles[0]
    box = Box(kind="box", center=(0.0, 0.15, 0.05), size=(0.3, 0.2, 0.1), yaw=np.pi / 2)
    assert obstacle.describe().startswith("fixture: fixture.stl: convex hull of 8 points, 0.3 x 0.2 x 0.1 m about (")
    assert obstacle.solid.half == pytest.approx(box.solid.half)
    inside = np.random.default_rng(1).uniform(-0.3, 0.4, (500, 3))
    expected = box.solid.signed_distance(inside)
    found = obstacle.solid.signed_distance(inside)
    assert found[expected < 0.0] == pytest.approx(expected[expected < 0.0], abs=1e-6)
    assert np.all((found <= 0.0) == (expected <= 0.0))


def test_hull_with_few_corners_contains_a_mesh_with_many(tmp_path: Path) -> None:
    for stretch in (np.ones(3), np.array([1.0, 10.0, 0.1])):
        points = stretch * sphere(5000)
        (tmp_path / "ball.stl").write_bytes(binary_stl(points))
        corners, source = read_hull(tmp_path / "ball.stl")
        assert len(corners) <= MAX_CORNERS
        assert source.startswith("ball.stl: convex hull of 5,000 points, at most ")
        planes = ConvexHull(corners).equations
        assert np.max(points @ planes[:, :3].T + planes[:, 3]) < 1e-4, "in the file's millimetres, read as float32"
        assert 1.0 < float(source.split()[-2].rstrip("%")) < 5.0


def test_task_of_a_run_holds_the_hull_and_needs_no_file(tmp_path: Path) -> None:
    task = task_beside(tmp_path, binary_stl(BLOCK))
    (tmp_path / "cad" / "fixture.stl").unlink()
    again = parse_document(dump_document(task.model_dump(mode="json")), Task, TaskError, "config.yaml")
    assert again == task


@pytest.mark.parametrize(
    ("mesh", "text", "message"),
    [
        (b"", TASK, "cad/fixture.stl: expected an STL or OBJ file with finite vertices"),
        (b"v 0 0 nan\n", TASK, "cad/fixture.stl: expected an STL or OBJ file with finite vertices"),
        (b"v 0 0\n", TASK, "cad/fixture.stl: expected three numbers for each vertex of a mesh"),
        (obj(BLOCK[:4]), TASK, "expected points around a volume, got 4 that are flat"),
        (b"", TASK.replace("cad/fixture", "cad/other"), "cad/other.stl: No such file"),
        (b"", TASK.replace("cad/fixture.stl", "../fixture.stl"), "expected a file beside a task file or in a folder"),
        (b"", TASK.replace("cad/fixture.stl", "/dev/zero"), "expected a file beside a task file or in a folder"),
        (obj(BLOCK), TASK.replace("scale", "size"), 'unknown key "size"'),
    ],
)
def test_faults_of_meshes_are_one_line(mesh: bytes, text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(TaskError) as fault:
        task_beside(tmp_path, mesh, text)
    assert message in str(fault.value)
    assert "obstacles[0]" in str(fault.value)
    assert "\n" not in str(fault.value)


def test_text_without_a_file_cannot_name_meshes() -> None:
    with pytest.raises(TaskError, match="beside a task file"):
        parse_document(TASK, Task, TaskError, "the answer")


def test_large_files_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("armwright.tasks.meshes.MAX_MESH", 1024)
    with pytest.raises(TaskError, match="expected at most 1 KiB"):
        task_beside(tmp_path, ascii_stl(sphere(1000)))


def test_mesh_has_a_frame_about_the_middle_of_its_box() -> None:
    points = tuple(map(tuple, BLOCK.tolist()))
    solid = Mesh(kind="mesh", mesh="x.stl", points=points, scale=0.001, position=(1.0, 0.0, 0.0)).solid
    assert solid.centre == pytest.approx((1.15, 0.1, 0.05))
    assert solid.hull.corners.min(axis=0) == pytest.approx([-0.15, -0.1, -0.05])
