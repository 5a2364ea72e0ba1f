"""What the page says about two texts is what `armwright check` says about the files."""

import json
from pathlib import Path

import numpy as np
import pytest

from armwright.editor.assessment import assess
from armwright.editor.edited_files import EditedFiles, Texts
from tests.support.command_line import armwright

EXAMPLES = Path(__file__).parents[2] / "examples"
PAIRS = [
    ("2-assembly-task", "2-assembly-space"), ("3-long-shelf-task", "3-long-shelf-space"),
    ("5-obstacle-reach", "5-obstacle-reach-space"), ("8-stiffness-task", "8-stiffness-space"),
]  # fmt: skip


def texts_of(task: str, space: str) -> Texts:
    return Texts(
        **{
            key: (EXAMPLES / f"{name}.yaml").read_text(encoding="utf-8")
            for key, name in (("task", task), ("space", space))
        }
    )


@pytest.fixture
def files(tmp_path: Path) -> EditedFiles:
    return EditedFiles(tmp_path / "my-task.yaml")


@pytest.mark.parametrize(("task", "space"), PAIRS)
def test_findings_and_meaning_are_those_of_check(files: EditedFiles, task: str, space: str) -> None:
    texts = texts_of(task, space)
    files.save(texts)
    found = assess(texts, files)
    checked = json.loads(armwright("check", files.task, "--space", files.space, "--no-picture", "--json").stdout)
    assert not found["errors"]
    assert found["findings"] == checked["findings"]
    assert found["meaning"]["constraints, stated and implied"].split(", ") == checked["constraints"]
    assert found["scene"] is not None
    assert np.allclose(
        found["scene"]["targets"],
        [np.array(t.get("position") if isinstance(t, dict) else t) for t in checked["task"]["targets"]],
    )
    assert len(found["scene"]["obstacles"]) == len(checked["task"]["obstacles"])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("payload: {mass: 0.2", "payload: {mass: two", "payload.mass"),
        ("[0.33, -0.15, 0.12]", "[5, 0, 0.1]", "reach"),
        ("targets:", "targets: [", "not valid YAML"),
    ],
)
def test_nonsense_is_an_error_with_its_place(files: EditedFiles, old: str, new: str, message: str) -> None:
    texts = texts_of(*PAIRS[0])
    assert old in texts.task
    found = assess(Texts(task=texts.task.replace(old, new, 1), space=texts.space), files)
    assert any(message in error for error in found["errors"]), found["errors"]
    assert str(files.task) in found["errors"][0] or "target" in found["errors"][0]


def test_a_fault_of_the_space_leaves_the_scene(files: EditedFiles) -> None:
    texts = texts_of(*PAIRS[0])
    found = assess(Texts(task=texts.task, space="joints: many\n"), files)
    assert len(found["errors"]) == 1
    assert str(files.space) in found["errors"][0]
    assert found["scene"] is not None
    assert found["scene"]["bases"] is None
    assert found["meaning"] == {}
