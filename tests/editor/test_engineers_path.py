"""The path of docs/editor.md in a real browser: from six points to an arm that MuJoCo drives."""

import re
import runpy
from collections.abc import Callable, Iterator
from pathlib import Path

import mujoco
import pytest
from playwright.sync_api import Browser, Page, expect

import armwright as aw
from armwright.proof.results import read_summary
from tests.support.browser import Tab
from tests.support.editor import ServedEditor, served_editor

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "editor.md").read_text(encoding="utf-8")
POINTS = re.findall(r"```csv\n(.*?)```", PAGE, re.DOTALL)[0]
MOTORS = ("STS3215-12V", "STS3250", "XC430-W240", "XM430-W350")
FIELDS = {
    "z of the tip, from the last link's end": "80",
    "Mass of the tool [kg]": "0.15",
    "Payload [kg]": "0.2",
    "Least number of joints": "3",
    "Largest number of joints": "4",
    **{f"Base, {axis}, {end}": value for axis in "xy" for end, value in (("smallest", "-200"), ("largest", "200"))},
    "Base, z, smallest": "20",
    "Base, z, largest": "120",
}


@pytest.fixture
def editor(in_folder: Path) -> Iterator[ServedEditor]:
    with served_editor(in_folder / "shelf.yaml") as served:
        yield served


def draw_task(page: Page) -> None:
    """Fill the page as the document says."""
    page.get_by_role("button", name="Paste points").click()
    page.locator("#paste-text").fill(POINTS)
    page.locator("#paste-unit").select_option("mm")
    page.get_by_role("button", name="Replace all targets").click()
    expect(page.locator("#paste")).to_be_hidden()
    for name in ("Pick and place", "Add ground"):
        page.get_by_role("button", name=name, exact=True).click()
        page.evaluate("armwright.idle()")
    for label, value in FIELDS.items():
        field = page.get_by_label(label, exact=True)
        field.fill(value)
        field.press("Tab")
        page.evaluate("armwright.idle()")
    page.get_by_label("R: roll", exact=True).uncheck()
    page.evaluate("armwright.idle()")
    for name in page.evaluate("[...document.querySelectorAll('#motors input:checked')].map((box) => box.ariaLabel)"):
        page.get_by_label(name, exact=True).uncheck()
        page.evaluate("armwright.idle()")
    for name in MOTORS:
        page.get_by_label(name, exact=True).check()
        page.evaluate("armwright.idle()")


def saved(page: Page, card: str, button: str, folder: Path) -> Path:
    """Download a file of a recommended design."""
    with page.expect_download() as download:
        page.locator(card).get_by_role("button", name=button, exact=True).click()
    path = folder / download.value.suggested_filename
    download.value.save_as(path)
    return path


def test_from_six_points_to_a_simulated_arm(browser: Browser, editor: ServedEditor, tmp_path: Path) -> None:
    tab = Tab(browser)
    tab.page.goto(editor.address)
    tab.page.locator("#loading").wait_for(state="hidden")
    draw_task(tab.page)
    assert tab.ask("armwright.opened.assessed.errors") == []
    expect(tab.page.get_by_label("Budget")).to_have_value("60")
    tab.page.get_by_role("button", name="Save and design arms").click()
    expect(tab.page.locator("#job-state")).to_contain_text("Designing arms into runs/shelf-1")
    expect(tab.page.locator("#job-state")).to_have_text("Finished: runs/shelf-1")
    assert aw.load_task(editor.task).targets[1] == (0.1, 0.35, 0.2)

    with tab.context.expect_page() as opened:
        tab.page.get_by_role("link", name="Open the results").click()
    results = opened.value
    results.locator("#loading").wait_for(state="hidden")
    expect(results.locator("#repeat code")).to_contain_text("armwright design --space shelf-space.yaml --budget 60s")
    summary = read_summary(tmp_path / "runs/shelf-1")
    assert summary is not None
    designs = list(dict.fromkeys(one["design"] for one in summary["recommended"]))
    assert 1 <= len(designs) <= 3
    expect(results.locator("#recommended .card")).to_have_count(len(designs))
    assert summary["recommended"][0]["status"] == "verified"
    expect(results.locator(f"[data-design='{designs[0]}'] .passed").first).to_have_text("Drives its cycle in MuJoCo")

    card = f"[data-design='{designs[0]}']"
    results.locator(card).get_by_role("button", name="Show", exact=True).click()
    before = results.evaluate("armwright.drawn('joint')")
    results.locator("#play").click()
    results.wait_for_function(
        "(before) => JSON.stringify(armwright.drawn('joint')) !== JSON.stringify(before)", arg=before
    )

    urdf, mjcf = (saved(results, card, name, tmp_path) for name in ("URDF", "MJCF"))
    assert mujoco.MjModel.from_xml_path(str(mjcf)).nu
    assert mujoco.MjModel.from_xml_path(str(urdf)).njnt
    check: Callable[[Path], list[str]] = runpy.run_path(str(ROOT / "benchmarks" / "check_simulation.py"))["check"]
    assert check(tmp_path / "runs/shelf-1/designs" / f"{designs[0]:04d}") == []
    assert tab.faults == []
    tab.close()
