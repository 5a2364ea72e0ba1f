"""Built-in tasks, task files, and targets from CSV."""

import contextlib
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armwright.exceptions import TaskError
from armwright.problem.problem import Problem
from armwright.tasks.catalogue import builtin_tasks, load_task, random_task
from armwright.tasks.task import Task
from armwright.tasks.task_template import task_template
from armwright.yaml_documents import parse_document


def test_builtin_tasks_are_complete() -> None:
    tasks = builtin_tasks()
    assert list(tasks)[:3] == ["target-1", "target-2", "target-3"]
    published = {"autodesign-1": 4, "autodesign-2": 6, "autodesign-3": 6, "slideopt-wide": 9, "slideopt-arm": 7}
    sizes = {name: len(task.targets) for name, task in tasks.items()}
    assert sizes.items() >= {"target-1": 8, "target-2": 9, "target-3": 8, **published}.items()
    assert len(tasks) >= 24
    for name, task in tasks.items():
        assert task.name == name
        assert task.provenance
        assert task.description
        assert len(set(task.targets)) == len(task.targets)
        assert np.abs(task.target_positions).max() <= 1.3, (
            "within reach of some arm of the paper's space: base ±1 m, 1.2 m long"
        )
        if task.cycle is None and not name.startswith("target-"):
            assert task.reference_point == (0.625 * len(task.targets),) * 2  # target-1's, target by target
    for name in ("target-1", "target-2", "target-3"):
        assert tasks[name].reference_point == (5.0, 5.0)
        assert "reconstruction" in tasks[name].provenance


def test_paper_targets_have_the_stated_symmetries() -> None:
    def points(name: str) -> set[tuple[float, ...]]:
        return {tuple(row) for row in np.round(load_task(name).target_positions, 6).tolist()}

    assert points("target-1") == {(-x, -y, -z) for x, y, z in points("target-1")}  # symmetric about the origin
    assert points("target-2") == {(x, -y + 0.0, z) for x, y, z in points("target-2")}  # about the xz-plane
    assert {z for _, _, z in points("target-2")} == {0.5}  # at one height
    circle = np.linalg.norm(load_task("target-3").target_positions - (0.3, 0.0, 0.3), axis=1)
    assert circle == pytest.approx(np.full(8, 0.55), abs=1e-6)


def test_minimal_task_file_is_accepted(tmp_path: Path) -> None:
    file = tmp_path / "shelf.yaml"
    file.write_text("name: shelf\ntargets: [[0.45, 0.0, 0.1]]\n", encoding="utf-8")
    task = load_task(file)
    assert task.target_positions.tolist() == [[0.45, 0.0, 0.1]]
    assert task.reference_point is None


POINT = "name: a\ntargets: [[0, 0, 0]]\n"
TARGET = "name: a\ntargets:\n  - [0, 0, 1]\n  - "
SOLID = POINT + "obstacles: [{center: [0, 0, 0], "
CUBE = "name: a\nworkspace: [{low: [0, 0, 0.5], high: [1, 1, 1]"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name: a\ntargets: []", "targets: expected at least 1 entry, got 0"),
        ("name: a\ntargets: [[0, 0, .nan]]", "targets[0][2]"),
        ("name: a\ntargets: [[0, 0]]", "targets[0]: expected three numbers x, y, z [m], got 2: [0, 0]"),
        ("name: a\ntargets: [[0, 0, 1, 2]]", "got 4: [0, 0, 1, 2]; write decimals with a point"),
        ("name: a\ntargets: [[450, 0, 2000]]", "more than 1000 m away"),
        (POINT + "reference_point: [0, 5]", "reference_point[0]: expected a number above 0, got 0"),
        (POINT + "resolution: 0.1", "resolution: expected objectives and their resolutions"),
        (POINT + "resolution: {torque: 0}", "resolution[0][1]: expected a number above 0, got 0"),
        (POINT + "resolutions: {torque: 1}", 'Did you mean "resolution"?'),
        (POINT + "tool: [0, 0, 0.1]", "tool: expected a record with the keys tip, rpy, mass, center, inertia"),
        (POINT + "tool: {center: [0, 0, 0.05]}", "tool: center needs a mass above 0 kg"),
        (POINT + "tool: {inertia: [1, 1, 1]}", "tool: inertia needs a mass above 0 kg"),
        (POINT + "tool: {mass: 0.3, inertia: [1, 1, 3]}", "at most the sum of the other two"),
        (POINT + "payload: -1", "payload: expected a number of at least 0 kg, got -1"),
        (POINT + "payload: [1, 2]", "payload"),
        (POINT + "payload: .nan", "payload"),
        (POINT + "payload_factors: [-1]", "payload_factors"),
        (POINT + "target_noise: -0.1", "target_noise"),
        (POINT + "target_noise: 5", "target_noise"),
        (POINT + "payload: {mass: 1, size: [1, 1, 1], inertia: [1, 1, 1]}", "expected size or inertia, got both"),
        (
            POINT + "payload: {mass: 0.5, inertia: [1, 1, 3]}",
            "payload.inertia: no body has moments of [1.0, 1.0, 3.0] kg m²",
        ),
        (TARGET + "{position: [0, 0, 1], axis: [0, 0, 0]}", "targets[1].axis: expected a direction"),
        (TARGET + "{position: [0, 0, 1], axis: [0, 0, 1], orientation: [0, 0, 1]}", "expected axis or orientation"),
        (TARGET + "{position: [0, 0, 1], orientation: [0, 0, 90]}", "targets[1]: orientation: expected roll, pitch"),
        (TARGET + "{position: [0, 0, 1], angle_tolerance: 0.1}", "targets[1]: angle_tolerance needs an axis"),
        (TARGET + "{position: [0, 0,4, 1]}", "targets[1].position: expected three numbers x, y, z [m], got 4"),
        (POINT + "obstacles: [{kind: ground, name: '{{ evil }}'}]", "obstacles[0].name"),
        (SOLID + "kind: box, size: [1, 1, 1], yaw: 1, rpy: [0, 0, 1]}]", "obstacles[0]: expected yaw or rpy, got both"),
        (SOLID + "kind: cylinder, radius: 1, height: 1, axis: [0, 0, 0]}]", "obstacles[0].axis: expected a direction"),
        ("name: a\nworkspace: everything", "workspace: expected {low: [x, y, z], high"),
        ("name: a\nworkspace: []", "targets"),
        (CUBE + ", directions: {axis: [0, 0, 0]}}]", "workspace[0].directions.axis: expected a direction"),
        (CUBE + ", directions: {half_angle: 45}}]", "directions.half_angle: expected a number of at most 3.14159 rad"),
        (CUBE + ", points: 600, directions: {count: 100}}]", "at most 50000 points x directions"),
        (CUBE + ", points: 6000}, {low: [0, 0, 0], high: [1, 1, 1], points: 6000}]", "at most 10000 points"),
        (CUBE.replace("0.5", "2") + "}]", "workspace: expected low z <= high z, got 2 m and 1 m"),
    ],
)
def test_invalid_task_files_are_refused_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "task.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(TaskError) as refusal:
        load_task(file)
    assert words in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 400


def test_unknown_task_names_get_suggestions(tmp_path: Path) -> None:
    with pytest.raises(TaskError, match=r'unknown task "targt-1".*Did you mean "target-1"'):
        load_task("targt-1")
    with pytest.raises(TaskError, match=r"no file .*armwright init"):
        load_task(tmp_path / "nothing.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(TaskError, match="UTF-8"):
        load_task(tmp_path / "binary.yaml")


@given(st.text(max_size=200))
def test_arbitrary_text_is_read_or_refused(text: str) -> None:
    with contextlib.suppress(TaskError):
        assert isinstance(parse_document(text, Task, TaskError, "it"), Task)


def test_task_template_and_each_part_that_it_comments_out_are_valid() -> None:
    """Points given to it are kept, and a name of digits is text."""
    text = task_template(Path("12.yaml"), ((0.1, 0.2345678, 0.3), (0.4, 0.1, 0.2)))
    given = parse_document(text, Task, TaskError, "it")
    assert (given.name, given.targets) == ("12", ((0.1, 0.2345678, 0.3), (0.4, 0.1, 0.2)))
    text = task_template(Path("mine.yaml"))
    parts = re.findall(rf"^# (?:{'|'.join(Task.model_fields)}):.*(?:\n#   .*)*", text, re.MULTILINE)
    assert len(parts) >= 15
    for part in parts:
        written = re.sub("^# (?! *approach)", "", part, flags=re.MULTILINE)  # which needs a direction of the tool
        assert Problem(parse_document(f"{text}{written}\n", Task, TaskError, "it")).objectives


def test_random_tasks_follow_their_recipe() -> None:
    for seed in range(20):
        task = random_task(seed)
        assert task == random_task(seed)
        assert 6 <= len(task.targets) <= 12
        assert np.all(np.ptp(task.target_positions, axis=0) <= 1.2)
    assert random_task(0) != random_task(1)
