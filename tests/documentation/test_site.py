"""The user guide builds strictly, covers every key and public name, and works from file:// without a network."""

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest
from playwright.sync_api import Browser
from pydantic import BaseModel

import armwright as aw
from armwright.experiments.plan import ExperimentPlan, FigurePlan, MethodPlan
from armwright.problem.objectives import QUANTITIES
from armwright.robot.actuators import ActuatorRecord
from armwright.robot.tubes import Material
from armwright.spaces.column import ColumnKeys
from armwright.spaces.custom_parameters import CustomParameter
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.link_mass import MassPerLink, MassPerMetre
from armwright.spaces.link_section import LinkSection
from armwright.tasks.obstacles import Box, Cylinder, Ground, Sphere
from armwright.tasks.targets import Target
from armwright.tasks.task import Task
from armwright.tasks.workspace import Region
from armwright.yaml_documents import document_keys
from tests import ROOT
from tests.support.browser import Tab
from tests.support.documentation import code_spans

KEYS: dict[str, tuple[type[BaseModel], ...]] = {
    "tasks.md": (Task, Target, Region, Box, Sphere, Cylinder, Ground),
    "spaces.md": (
        DesignSpace,
        MassPerMetre,
        MassPerLink,
        LinkSection,
        Material,
        ColumnKeys,
        ActuatorRecord,
        CustomParameter,
    ),
    "experiments.md": (ExperimentPlan, MethodPlan, FigurePlan),
    "language-models.md": (aw.ModelOptions,),
}


def names_in_code(page: str) -> set[str]:
    """Return the words that a page of the guide sets in code."""
    return {word for span in code_spans(f"docs/{page}") for word in re.findall(r"\w+", span)}


@pytest.mark.parametrize("page", KEYS)
def test_file_keys_are_documented(page: str) -> None:
    keys = {key for model in KEYS[page] for key in document_keys(model)}
    assert keys - names_in_code(page) == set()


def test_quantities_are_documented() -> None:
    assert QUANTITIES.keys() - names_in_code("tasks.md") == set()


def test_python_reference_lists_every_public_name_once() -> None:
    listed = re.findall(
        r"^::: armwright\.(\w+)$", (ROOT / "docs/reference/python.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert sorted(listed) == sorted(aw.__all__)


class Loaded(HTMLParser):
    """Addresses that a page loads by itself."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        loads = {"script": "src", "img": "src", "iframe": "src", "source": "src", "link": "href"}
        if tag in loads and given.get(loads[tag]):
            self.found.append(str(given[loads[tag]]))


@pytest.fixture(scope="module")
def guide(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("guide")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(place)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, encoding="utf-8")
    assert done.returncode == 0, done.stdout + done.stderr
    return place


def test_guide_fetches_nothing(guide: Path) -> None:
    pages = list(guide.rglob("*.html"))
    assert len(pages) > 20
    for page in pages:
        for address in Loaded(page.read_text(encoding="utf-8")).found:
            assert not re.match(r"(https?:)?//", address), f"{page}: {address}"
    styles = list(guide.rglob("*.css"))
    assert styles
    for file in styles:
        assert not re.search(r"@import|url\((['\"]?)(https?:)?//", file.read_text(encoding="utf-8")), file


def test_tables_headings_and_fences_are_rendered(guide: Path) -> None:
    """A lost blank line leaves their marks in the text of a paragraph."""
    for page in guide.rglob("*.html"):
        for paragraph in re.findall(r"<p>(.*?)</p>", page.read_text(encoding="utf-8"), re.DOTALL):
            text = re.sub(r"<code>.*?</code>", "", paragraph, flags=re.DOTALL)
            assert not re.search(r"\|\s*:?-+:?\s*\||(^|\s)#{1,6}\s|```", text), f"{page}: {text[:200]}"


def test_command_line_page_lists_every_command(guide: Path) -> None:
    text = (guide / "reference" / "cli.html").read_text(encoding="utf-8")
    for command in ("optimize", "experiment", "compare-arms"):
        assert f'id="armwright-{command}"' in text
    assert "--n-total" in text


def test_guide_is_readable_and_searchable_without_a_server(guide: Path, browser: Browser) -> None:
    tab = Tab(browser)
    tab.page.set_default_timeout(180_000)  # a busy machine builds the search index slowly
    tab.page.goto((guide / "reference" / "cli.html").as_uri())
    tab.page.get_by_role("link", name="Tutorial").first.click()
    tab.page.get_by_role("heading", name="an arm for a feeder").wait_for()
    tab.page.wait_for_load_state("load")  # before, nobody listens to keys
    tab.page.keyboard.press("f")
    tab.page.get_by_text("Type to start searching").wait_for()
    tab.page.locator(".md-search__input").press_sequentially("payload_factors")
    tab.page.locator(".md-search-result__list").get_by_text("Tasks").first.wait_for()
    assert tab.faults == []
    assert all(request.startswith(("file:", "data:", "blob:")) for request in tab.requests)
    tab.close()


def test_guide_fits_a_phone(guide: Path, browser: Browser) -> None:
    tab = Tab(browser, viewport={"width": 390, "height": 800})
    for page in ("index", "tutorial", "suite", "method", "spaces", "reference/python", "reference/cli"):
        tab.page.goto((guide / f"{page}.html").as_uri())
        tab.page.locator("h1").wait_for()
        assert tab.ask("document.documentElement.scrollWidth <= window.innerWidth"), page
    tab.close()
