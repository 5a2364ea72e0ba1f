"""The editor's page in a real browser."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml
from playwright.sync_api import Browser, expect

from tests.support.browser import Tab
from tests.support.editor import ServedEditor, served_editor
from tests.support.text_boxes import check_texts

EXAMPLES = Path(__file__).parents[2] / "examples"
TASK = """\
# Our cell.
name: cell
targets:   # measured on Monday
  - {name: left, position: [0.3, 0.2, 0.1], axis: [0, 0, -1]}   # the left tray
  - [0.3, -0.2, 0.1]
obstacles:
  - {kind: ground, z: 0.0}
"""


@pytest.fixture
def editor(in_folder: Path) -> Iterator[ServedEditor]:
    (in_folder / "cell.yaml").write_text(TASK, encoding="utf-8")
    with served_editor(in_folder / "cell.yaml") as served:
        yield served


@contextmanager
def opened(browser: Browser, editor: ServedEditor) -> Iterator[Tab]:
    tab = Tab(browser)
    tab.page.goto(editor.address)
    tab.page.locator("#loading").wait_for(state="hidden")
    yield tab
    assert tab.faults == []
    tab.close()


@pytest.fixture
def tab(browser: Browser, editor: ServedEditor) -> Iterator[Tab]:
    with opened(browser, editor) as found:
        yield found


def settle(tab: Tab) -> None:
    """Wait until all changes so far are answered."""
    tab.ask("armwright.idle()")


def fill(tab: Tab, label: str, value: str) -> None:
    """Type into a field, and leave it."""
    field = tab.page.get_by_label(label, exact=True)
    field.fill(value)
    field.press("Tab")
    settle(tab)


def select(tab: Tab, label: str, value: str) -> None:
    tab.page.get_by_label(label, exact=True).select_option(value)
    settle(tab)


def press(tab: Tab, name: str) -> None:
    tab.page.get_by_role("button", name=name, exact=True).click()
    settle(tab)


def text(tab: Tab, file: str = "task") -> str:
    return str(tab.ask(f"armwright.opened.texts.{file}"))


def content(tab: Tab, file: str = "task") -> Any:
    return yaml.safe_load(text(tab, file))


def test_targets_are_edited_in_millimetres(tab: Tab) -> None:
    fill(tab, "x of target 1", "312,5")
    fill(tab, "y of target 2", "-150")
    select(tab, "Tool direction at target 2", "down")
    select(tab, "Tool direction at target 1", "any")
    fill(tab, "Tolerance of target 1", "2")
    fill(tab, "Name of target 2", "on")
    assert content(tab)["targets"] == [
        {"name": "left", "position": [0.3125, 0.2, 0.1], "tolerance": 0.002},
        {"name": "on", "position": [0.3, -0.15, 0.1], "axis": [0, 0, -1]},
    ]
    assert {"# Our cell.", "# measured on Monday", "# the left tray"} <= {
        f"#{line.partition('#')[2]}" for line in text(tab).splitlines() if "#" in line
    }
    tab.page.get_by_label("Lengths in").select_option("m")
    expect(tab.page.get_by_label("x of target 1", exact=True)).to_have_value("0.3125")
    before = text(tab)
    fill(tab, "x of target 1", "three")
    expect(tab.page.get_by_label("x of target 1", exact=True)).to_have_attribute("aria-invalid", "true")
    assert text(tab) == before


def test_points_are_pasted_with_a_direction(tab: Tab) -> None:
    press(tab, "Paste points")
    tab.page.locator("#paste-text").fill("x\ty\tz\n100\t200\t50\n-100\t200\t50\n")
    tab.page.locator("#paste-unit").select_option("mm")
    tab.page.locator("#paste-way").select_option("down")
    tab.page.get_by_role("button", name="Replace all targets").click()
    expect(tab.page.locator("#paste")).to_be_hidden()
    settle(tab)
    assert content(tab)["targets"] == [
        {"position": [0.1, 0.2, 0.05], "axis": [0, 0, -1]},
        {"position": [-0.1, 0.2, 0.05], "axis": [0, 0, -1]},
    ]
    press(tab, "Paste points")
    tab.page.locator("#paste-text").fill("1, 2")
    tab.page.get_by_role("button", name="Append").click()
    expect(tab.page.locator("#fault")).to_contain_text("line 1")
    tab.page.locator("#paste-text").fill("id;z;y;x\n1;0,05;0,2;0,1\n")
    tab.page.get_by_role("button", name="Append").click()
    expect(tab.page.locator("#paste-note")).to_contain_text("columns not used: 'id'")
    tab.faults.clear()  # the browser reports the refusal


def test_targets_are_dragged_along_the_ground_and_upwards(tab: Tab) -> None:
    def drag(right: int, down: int) -> list[float]:
        x, y = tab.ask("armwright.targetPlaces()")[0]
        tab.page.mouse.move(x, y)
        tab.page.mouse.down()
        tab.page.mouse.move(x + right, y + down, steps=4)
        tab.page.mouse.up()
        settle(tab)
        return list(content(tab)["targets"][0]["position"])

    x, y, z = drag(60, 0)
    assert z == 0.1
    assert (x, y) != (0.3, 0.2)
    tab.page.keyboard.down("Shift")
    moved = drag(0, -40)
    tab.page.keyboard.up("Shift")
    assert moved[:2] == [x, y]
    assert moved[2] > 0.12
    assert "# the left tray" in text(tab)
    expect(tab.page.get_by_label("z of target 1", exact=True)).to_have_value(f"{1e3 * moved[2]:g}")


def test_cycles_obstacles_loads_and_wants_are_written(tab: Tab) -> None:
    select(tab, "Tool direction at target 2", "down")
    press(tab, "Pick and place")
    fill(tab, "Rest after each pick and place [s]", "0.3")
    select(tab, "Motion of step 2", "line")
    press(tab, "Add box")
    fill(tab, "Name of obstacle 2", "box")
    fill(tab, "z of the size of obstacle 2", "80")
    fill(tab, "z of the tip, from the last link's end", "90")
    fill(tab, "Mass of the tool [kg]", "0.15")
    fill(tab, "Payload [kg]", "0.2")
    press(tab, "Add a constraint")
    select(tab, "Quantity of constraint 1", "mass")
    fill(tab, "Bound of constraint 1", "4.5")
    found = content(tab)
    assert found["cycle"] == {
        "dwell": 0.3,
        "approach": 0.05,
        "steps": [{"to": "left", "do": "pick"}, {"to": 2, "do": "place", "by": "line"}],
    }
    assert found["obstacles"][1] == {"kind": "box", "center": [0.3, 0.3, 0.05], "size": [0.1, 0.1, 0.08], "name": "box"}
    assert (found["tool"], found["payload"]) == ({"tip": [0, 0, 0.09], "mass": 0.15}, 0.2)
    assert (found["objectives"], found["constraints"]) == (["cycle_time", "price"], ["mass <= 4.5"])
    assert tab.ask("armwright.opened.assessed.errors") == []


def test_the_space_is_edited_and_motors_are_chosen(tab: Tab) -> None:
    fill(tab, "Largest number of joints", "5")
    fill(tab, "Joint angle, largest", "120")
    fill(tab, "Link length, smallest", "60")
    tab.page.get_by_label("R: roll", exact=True).uncheck()
    settle(tab)
    tab.page.locator("#motor-torque").fill("30")
    tab.page.locator("#motor-voltage").select_option("48")
    expect(tab.page.locator("#motors")).not_to_contain_text("XL430-W250")
    tab.page.get_by_label("RobStride-06", exact=True).check()
    settle(tab)
    tab.page.get_by_label("RobStride-05", exact=True).click()  # goes, as it has less torque than asked for
    settle(tab)
    expect(tab.page.locator("#motors")).not_to_contain_text("RobStride-05")
    found = content(tab, "space")
    assert (found["joints"], found["joint_types"]) == ([4, 5], ["P", "Y"])
    assert found["joint_range"] == [-2.6, pytest.approx(2.0943951)]
    assert found["link"] == [0.06, 0.4]
    assert found["actuators"] == ["RobStride-00", "RobStride-02", "RobStride-06"]


def test_typed_text_is_checked_and_saved(tab: Tab, editor: ServedEditor) -> None:
    field = tab.page.locator("#text")
    field.fill(TASK.replace("[0.3, -0.2, 0.1]", "[300, -200, 100]"))
    expect(tab.page.locator("#verdict")).to_have_text("No search can start yet")
    field.fill(TASK.replace("0.0}", "0.0"))
    expect(tab.page.locator("#findings")).to_contain_text("not valid YAML")
    field.fill(TASK.replace("[0.3, -0.2, 0.1]", "[0.3, -0.25, 0.1]"))
    expect(tab.page.locator("#verdict")).to_contain_text("Ready")
    expect(tab.page.locator("#saved")).to_have_text("not saved")
    field.press("Control+s")
    expect(tab.page.locator("#saved")).to_have_text("saved")
    assert "-0.25" in editor.task.read_text(encoding="utf-8")
    press(tab, "Undo")
    assert "[0.3, -0.25" not in text(tab)


def test_a_file_changed_by_others_is_replaced_only_on_consent(tab: Tab, editor: ServedEditor) -> None:
    questions: list[str] = []
    tab.page.once("dialog", lambda dialog: (questions.append(dialog.message), dialog.dismiss()))
    fill(tab, "x of target 1", "310")
    editor.task.write_text("name: theirs\n", encoding="utf-8")
    press(tab, "Save")
    assert "has changed on disk" in questions[0]
    assert editor.task.read_text(encoding="utf-8") == "name: theirs\n"
    tab.page.once("dialog", lambda dialog: dialog.accept())
    press(tab, "Save")
    assert editor.task.read_text(encoding="utf-8") == text(tab)
    tab.faults.clear()  # the browser reports the refusal


def test_names_are_text_not_markup(browser: Browser, in_folder: Path) -> None:
    mark = "<img src=x onerror=window.hacked=1>"
    content = {"name": "x", "targets": [{"name": mark, "position": [0, 0, 0]}], "description": mark, mark: mark}
    (in_folder / "x.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    with served_editor(in_folder / "x.yaml") as served, opened(browser, served) as tab:
        assert tab.ask("window.hacked") is None
        assert tab.page.locator("#findings li").count()


def test_no_text_is_clipped(browser: Browser, in_folder: Path) -> None:
    for name, part in (("task", "task"), ("task-space", "space")):
        shutil.copy(EXAMPLES / f"2-assembly-{part}.yaml", in_folder / f"{name}.yaml")
    with served_editor(in_folder / "task.yaml") as served, opened(browser, served) as tab:
        settle(tab)
        for width in (1280, 390):
            tab.page.set_viewport_size({"width": width, "height": 900})
            check_texts(tab, least=40)
