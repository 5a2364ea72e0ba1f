"""Edits of YAML texts change what they name, and nothing else."""

from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from armwright.editor.yaml_edits import Edit, edit_text
from armwright.exceptions import TaskError

ROOT = Path(__file__).parents[2]
FILES = sorted([*ROOT.glob("examples/*.yaml"), *ROOT.glob("src/armwright/*/builtin/*.yaml")])
TEXT = """\
# Before everything.
name: one    # the name

targets:     # in metres
  - [0.1, 0.20, 0.3]    # the first
  - {name: two, position: [4e-1, 0, 1]}

# Between.
payload: 0.5   # kg
cycle:
  # inside
  steps:
    - {to: 1}
    - {to: two}   # the last
# After everything.
"""

TRAPS = (
    "on", "no", "1:20", "1e5", "1e-5", "0x1", "2026-11-25", "null", "~", "- a", "a: b", "a #b", "", " x ", "{", "!t",
    "&a", "*a", "'", "\\", "%", "@", "`",
)  # fmt: skip
PATHS = (
    ("payload",), ("new",), ("targets", 0), ("targets", 1, "axis"), ("targets", 2), ("cycle", "steps", 1),
    ("tool", "tip"),
)  # fmt: skip
letters = st.characters(
    codec="utf-8", exclude_categories=["Cs", "Cc", "Cn"], exclude_characters="\u2028\u2029\x85\ufeff"
)
scalars = st.one_of(
    st.booleans(),
    st.integers(-(10**6), 10**6),
    st.floats(-1e6, 1e6),
    st.text(letters, max_size=20),
    st.sampled_from(TRAPS),
)
keys = st.from_regex(r"[a-z_]{1,8}", fullmatch=True)
values = st.recursive(
    scalars,
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(keys, inner, max_size=4)),
    max_leaves=12,
)


def read_yaml(text: str) -> Any:
    return yaml.load(text, Loader=yaml.CSafeLoader)  # five times as fast as SafeLoader


def edited(*edits: Edit, text: str = TEXT) -> str:
    return edit_text(text, edits, "task.yaml")


def changed_lines(before: str, after: str) -> tuple[list[str], list[str]]:
    """The lines that only one of two texts has."""
    old, new = before.splitlines(), after.splitlines()
    return [line for line in old if line not in new], [line for line in new if line not in old]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_an_edit_leaves_other_keys_as_written(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    content = read_yaml(text)
    for key, value in content.items():
        removed = edit_text(text, [Edit(path=(key,), remove=True)], path.name)
        lines = iter(text.splitlines())
        assert all(line in lines for line in removed.splitlines())  # in order
        assert read_yaml(removed) == {k: v for k, v in content.items() if k != key} or removed == ""
        if value and isinstance(value, (list, dict)):
            inner: Any = next(iter(range(len(value)) if isinstance(value, list) else value))
            once = edit_text(text, [Edit(path=(key, inner), value=value[inner])], path.name)
            assert read_yaml(once) == content
            assert once.count("#") == text.count("#")


def test_new_keys_are_written_like_task_files() -> None:
    done = edited(
        Edit(path=("tool", "mass"), value=0.3),
        Edit(path=("obstacles",), value=[{"kind": "box", "center": [0, 0, 0.1], "size": [1, 1, 0.2]}]),
        Edit(path=("targets", 2), value=[1.0, 2.0, 3.0]),
        Edit(path=("cycle", "tolerance", "path"), value=1e-05),
    )
    assert "tool: {mass: 0.3}\n" in done
    assert "obstacles:\n  - {kind: box, center: [0, 0, 0.1], size: [1, 1, 0.2]}\n" in done
    assert "  - [1.0, 2.0, 3.0]\n" in done
    assert yaml.safe_load(done)["cycle"]["tolerance"] == {"path": 1e-05}


def test_comments_below_a_removed_key_stay() -> None:
    assert (
        edited(Edit(path=("targets",), remove=True))
        == TEXT[: TEXT.index("targets:")] + TEXT[TEXT.index("\n# Between") :]
    )
    assert "# After everything." in edited(Edit(path=("cycle",), remove=True))


@given(value=values, path=st.sampled_from(PATHS))
def test_any_value_is_read_back(value: Any, path: tuple[str | int, ...]) -> None:
    before = yaml.safe_load(TEXT)
    after = yaml.safe_load(edited(Edit(path=path, value=value)))
    place = after
    for step in path:
        place = place[step]
    assert place == value
    assert {k: v for k, v in after.items() if k != path[0]} == {k: v for k, v in before.items() if k != path[0]}


@pytest.mark.parametrize(("offset", "indent"), [(0, 1), (1, 2), (2, 4), (4, 3)])
def test_new_and_removed_items_leave_the_other_lines(offset: int, indent: int) -> None:
    dash, key = offset * " " + "- ", indent * " "
    targets = f"targets:  # all\n{dash}[0.1, 0.20, 0.3]   # one\n{dash}{{position: [4e-1, 0, 1]}}\n"
    text = f"{targets}tool:\n{key}mass: 0.10\n{key}tip: [0, 0, 1]\n"
    added = edited(Edit(path=("targets", 2), value=[1, 2, 3]), Edit(path=("tool", "rpy"), value=[0, 0, 1]), text=text)
    assert changed_lines(text, added) == ([], [f"{dash}[1, 2, 3]", f"{key}rpy: [0, 0, 1]"])
    removed = edited(Edit(path=("targets", 1), remove=True), Edit(path=("tool", "tip"), remove=True), text=text)
    assert changed_lines(text, removed) == ([f"{dash}{{position: [4e-1, 0, 1]}}", f"{key}tip: [0, 0, 1]"], [])


@given(st.text(max_size=200) | st.binary(max_size=200).map(lambda data: data.decode("utf-8", "replace")))
def test_any_text_is_edited_or_refused(text: str) -> None:
    try:
        done = edit_text(text, [Edit(path=("payload",), value=2)], "task.yaml")
    except TaskError:
        return
    assert yaml.safe_load(done)["payload"] == 2


@pytest.mark.parametrize(
    ("text", "path"),
    [
        *((TEXT, path) for path in (("targets", 7), ("targets", "x"), ("name", "x"), ("payload", 0))),
        *(("a: &b [1]\nc: *b\n", ("a",)), ("a: 1\na: 2\n", ("a",)), ("- 1\n", (0,))),
        *((text, ("payload",)) for text in ("{payload: 1}\n", "text\n")),
    ],
)
def test_edits_without_a_place_are_refused(text: str, path: tuple[str | int, ...]) -> None:
    with pytest.raises(TaskError, match=r"^task\.yaml"):
        edit_text(text, [Edit(path=path, value=1)], "task.yaml")
