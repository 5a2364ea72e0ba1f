"""The editor's server: its requests, and attacks by other pages, other users and hostile texts."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

import armwright as aw
from armwright.editor.app import MAX_BODY
from tests.support.editor import ServedEditor, served_editor

POSTS = ("/assess", "/points", "/save", "/design", "/stop")


@pytest.fixture
def editor(in_folder: Path) -> Iterator[ServedEditor]:
    with served_editor(in_folder / "my-task.yaml") as served:
        yield served


def texts(editor: ServedEditor) -> dict[str, str]:
    opened = json.loads(editor.get("/opened")[1])
    return {"task": opened["task"], "space": opened["space"]}


def test_edits_are_applied_assessed_and_saved(editor: ServedEditor) -> None:
    edits = [{"path": ["targets", 0], "value": {"name": "left", "position": [0.3, 0, 0.1]}}]
    status, reply = editor.post(
        "/assess", {**texts(editor), "task_edits": edits, "space_edits": [{"path": ["joints"], "value": 5}]}
    )
    assert status == 200
    found = json.loads(reply)
    assert found["scene"]["names"][0] == "left"
    assert found["meaning"]["joints"] == "5"
    assert editor.post("/save", found["texts"])[0] == 204
    assert aw.load_task(editor.task).target_names[0] == "left"
    assert aw.load_space(editor.task.with_name("my-space.yaml")).joints == 5


def test_a_search_needs_a_valid_task_and_writes_nothing_without(editor: ServedEditor) -> None:
    status, reason = editor.post("/design", {**texts(editor), "task": "name: 7", "seconds": 5})
    assert (status, b"my-task.yaml" in reason) == (400, True)
    assert not editor.task.exists()
    assert json.loads(editor.get("/job")[1]) is None


@pytest.mark.parametrize(
    "body", [b"", b"[]", b"\xff", b"[" * 10_000, b'{"task": 1}', b'{"path": "/etc/passwd", "task": "", "space": ""}']
)
def test_bodies_that_the_page_never_sends_are_refused(editor: ServedEditor, body: bytes) -> None:
    for path in POSTS:
        assert editor.post(path, body)[0] == 422
    assert not editor.task.exists()


def test_large_bodies_are_refused(editor: ServedEditor) -> None:
    assert editor.post("/assess", b'{"task": "' + b"#" * MAX_BODY + b'"}')[0] == 413
    assert editor.post("/assess", {**texts(editor), "task_edits": [{"path": ["a"] * 50}]})[0] == 422


def test_no_file_is_served_by_name(editor: ServedEditor) -> None:
    for path in ("/my-task.yaml", "/../my-task.yaml", "/run/%2e%2e/%2e%2e/etc/passwd", "//etc/passwd", "/opened/"):
        assert editor.get(path)[0] in (307, 404)


@pytest.mark.parametrize(
    "task",
    [
        "a: &a [x, x]\nb: [*a, *a]\n",
        "!!python/object/apply:os.system ['true']",
        "targets: " + "[" * 2_000,
        "name: x\x00y",
        "\ud800",
        "#" * 250_000,
        *("", "[]", "null", "targets: 7", "cycle: []"),
    ],
)
def test_hostile_texts_are_assessed(editor: ServedEditor, task: str) -> None:
    status, reply = editor.post("/assess", {"task": task, "space": task, "task_edits": []})
    assert status in (200, 422)
    assert status == 422 or json.loads(reply)["errors"]
    assert editor.post("/assess", {"task": task, "space": "", "task_edits": [{"path": ["payload"], "value": 1}]})[
        0
    ] in (200, 400, 422)
