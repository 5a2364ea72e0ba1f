"""The user guide: it is built strictly, opens without a network, and tells what the code does."""

import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser
from pydantic import BaseModel, ValidationError

import armwright as aw
from armwright.catalogue import ActuatorRecord, catalogue
from armwright.constraints import QUANTITIES
from armwright.experiment.plan import ExperimentPlan, FigurePlan, MethodPlan
from armwright.masses import MassOfTube, MassPerLink, MassPerMetre
from armwright.objectives import OBJECTIVES
from armwright.obstacles import Box, Cylinder, Ground, Sphere
from armwright.space import DesignSpace
from armwright.targets import Target
from armwright.task import Task
from armwright.workspace import Region
from tests.browser import Tab
from tests.documented import ROOT
from website import commands, keys, reference
from website.links import rewritten, sources
from website.words import taken_apart

# The least record of each model.
LEAST: dict[type[BaseModel], dict[str, Any]] = {
    Task: {"name": "t", "targets": [[0.3, 0.0, 0.2], [0.2, 0.0, 0.2]], "moves": "in_order", "move_time": 1.0},
    Target: {"position": [0.0, 0.0, 0.0], "axis": [0, 0, 1]},
    Region: {"low": [0, 0, 0], "high": [1, 1, 1]},
    Box: {"kind": "box", "center": [0, 0, 0], "size": [1, 1, 1]},
    Sphere: {"kind": "sphere", "center": [0, 0, 0], "radius": 1},
    Cylinder: {"kind": "cylinder", "center": [0, 0, 0], "radius": 1, "height": 1},
    Ground: {"kind": "ground"},
    DesignSpace: {"actuators": ["XL430-W250"]},
    MassPerMetre: {"kind": "per_metre"},
    MassPerLink: {"kind": "per_link"},
    MassOfTube: {"kind": "tube", "density": 2700, "outer_diameter": 0.03, "wall": 1e-6},
    ActuatorRecord: {"name": "a", "mass": 1.0},
    ExperimentPlan: {"name": "e", "tasks": ["target-1"], "methods": {"bbo": {"label": "BBO"}}},
    MethodPlan: {"label": "BBO"},
    FigurePlan: {"title": "All", "methods": ["bbo"]},
}
BOUNDS = re.compile(
    r"(?P<above>above )?(?P<low>[\d.,-]+)(?: to |, at most )(?P<high>[\d.,]+)|within ±(?P<both>[\d.,]+)"
)


def takes(model: type[BaseModel], key: str, value: float) -> bool:
    return takes_record(model, LEAST[model] | {key: value})


def takes_record(model: type[BaseModel], record: dict[str, Any]) -> bool:
    try:
        model.model_validate(record)
    except ValidationError:
        return False
    return True


def numbers() -> Iterator[tuple[type[BaseModel], keys.Key]]:
    """All keys that are a number between two bounds."""
    for model in LEAST:
        for key in keys.keys_of(model):
            if key.kind.startswith(("number", "whole number")) and BOUNDS.fullmatch(key.bounds.split(";")[0]):
                yield model, key


@pytest.mark.parametrize(
    ("model", "key"), list(numbers()), ids=lambda value: getattr(value, "name", "") or value.__name__
)
def test_the_bounds_that_the_reference_tells_hold(model: type[BaseModel], key: keys.Key) -> None:
    found = BOUNDS.fullmatch(key.bounds.split(";")[0])
    assert found is not None
    step = 1 if key.kind.startswith("whole") else 1e-3
    high = float((found["both"] or found["high"]).replace(",", ""))
    low = -high if found["both"] else float(found["low"].replace(",", ""))
    small = step if step == 1 else 1e-3 * high
    kind = int if step == 1 else float
    assert takes(model, key.name, kind(high - (1e-3 if high % 1 else 0)))  # told in four digits
    assert not takes(model, key.name, kind(high + small))
    assert takes(model, key.name, kind(low + (1e-3 if low % 1 else 0))) == (not found["above"])
    assert not takes(model, key.name, kind(low - small))


# Bounds that validators hold, and that the reference tells beside the models: what is taken at them, and not beyond.
HELD: dict[tuple[type[BaseModel], str], tuple[list[Any], list[Any]]] = {
    (Task, "targets"): ([[[0, 0, 1000]], [[0, 0, 0.1]] * 10_000], [[], [[0, 0, 1001]], [[0, 0, 0.1]] * 10_001]),
    (Task, "payload"): ([0, 10_000], [-1, 10_001]),
    (Task, "obstacles"): ([[{"kind": "ground"}] * 100], [[{"kind": "ground"}] * 101]),
    (Task, "moves"): ([[[1, 2]]], [[[1, 2], [1, 2]]]),
    (Task, "move_time"): ([1e-3, 10_000], [0, 10_001]),
    (Task, "workspace"): (
        [[LEAST[Region] | {"points": 500}] * 20],
        [[LEAST[Region]] * 21, [LEAST[Region] | {"points": 501}] * 20],
    ),
    (Task, "reference_point"): ([[1e-3, 1e-3]], [[0, 1]]),
    (DesignSpace, "joints"): ([1, 8, [1, 8]], [0, 9, [0, 8], [1, 9]]),
    (DesignSpace, "joint_range"): ([[-6.283, 6.283], [0, 1]], [[-6.284, 1], [0.1, 1]]),
    (DesignSpace, "limit"): ([[0.0262, 6.283]], [[0.0261, 1], [1, 6.284]]),
    (DesignSpace, "stroke"): ([0.003, 1000, [0.003, 1000]], [0.0029, 1001, [0.0029, 1]]),
    (DesignSpace, "link"): ([[1e-3, 1000]], [[0, 1], [1, 1001]]),
    (DesignSpace, "tool"): ([[0, 0, -1000]], [[0, 0, -1001]]),
    (DesignSpace, "origin_x"): ([[-1000, 1000]], [[-1001, 0]]),
    (DesignSpace, "origin_y"): ([[-1000, 1000]], [[-1001, 0]]),
    (DesignSpace, "origin_z"): ([[-1000, 1000]], [[-1001, 0]]),
    (ExperimentPlan, "seeds"): ([1, 10_000, [3, 1]], [0, 10_001, [1, 1]]),
}


@pytest.mark.parametrize("at", list(keys.BOUNDS), ids=lambda at: f"{at[0].__name__}.{at[1]}")
def test_the_bounds_that_validators_hold_are_told(at: tuple[type[BaseModel], str]) -> None:
    model, key = at
    usual = {name: value for name, value in LEAST[model].items() if key != "targets" or "move" not in name}
    taken, refused = HELD[at]
    for value in taken:
        assert takes_record(model, usual | {key: value}), value
    for value in refused:
        assert not takes_record(model, usual | {key: value}), value


def test_there_are_many_such_bounds() -> None:
    assert {key.name for _, key in numbers()} >= {"payload", "target_noise", "restarts", "yaw", "radius", "mass"}


def test_defaults_and_needs_are_those_of_the_models() -> None:
    for model, least in LEAST.items():
        model.model_validate(least)
        for key in keys.keys_of(model):
            assert key.is_needed == model.model_fields[key.name].is_required()
            if key.is_needed:
                without = {name: value for name, value in least.items() if name != key.name}
                assert not takes_record(model, without), key.name


def test_every_key_has_words_and_every_length_its_unit() -> None:
    told = {model: {key.name: key for key in keys.keys_of(model)} for model in keys.TITLES}
    for model, of_model in told.items():
        plain = {"kind", "width", "height", "depth", "price"} if model is not Cylinder else {"kind"}
        assert {name for name, key in of_model.items() if not key.words} <= plain, model
    units = {name: told[Task][name].unit for name in ("payload", "target_noise", "move_step", "move_time", "restarts")}
    assert units == {"payload": "kg", "target_noise": "m", "move_step": "m", "move_time": "s", "restarts": ""}
    assert told[Box]["center"].unit == told[Region]["low"].unit == told[DesignSpace]["link"].unit == "m"
    assert told[Box]["yaw"].unit == told[DesignSpace]["joint_range"].unit == "rad"


def test_what_a_docstring_says_of_names() -> None:
    words = "First line.\n\nlow, high: of a range [m].  step: between\n    two of them.\nNote: no name.\n\nLast: words."
    left, told = taken_apart(words, ("low", "high", "step"))
    assert told == {"low": "of a range [m].", "high": "of a range [m].", "step": "between two of them. Note: no name."}
    assert left == "First line.\n\nLast: words."


def test_links_of_the_repository_lead_to_pages() -> None:
    assert rewritten("[a](docs/page.md#live)", "index.md") == "[a](page.md#live)"
    assert rewritten("[a](../README.md) [b](method.md)", "spaces.md") == "[a](index.md) [b](method.md)"
    text = "[a](../src/armwright/space.py) [b](https://example.org/) [c](#here) [d](nowhere.md)"
    assert rewritten(text, "method.md") == text.replace("../src/armwright/space.py", "source/src/armwright/space.py.md")
    assert sources(text, "method.md") == {"src/armwright/space.py"}


def test_commands_names_and_tables_are_told_in_full() -> None:
    cli = commands.page()
    for name, command in commands.commands().items():
        section = cli.split(f"\n## {name}\n")[1].split("\n## ")[0]
        shown = {option for p in command.params if not p.hidden for option in p.opts if option.startswith("--")}
        assert {option for option in shown - {"--help"} if f"`{option}`" not in section} == set()
    task, space = reference.task_page(), reference.space_page()
    assert all(f"| `{name}` |" in task for name in (*OBJECTIVES, *QUANTITIES))
    assert all(f"| `{name}` |" in space for name in catalogue())
    assert all(f".{name}\n" in reference.python_page() for name in aw.__all__)


class Loaded(HTMLParser):
    """The addresses that a page loads by itself."""

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
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return place


def test_the_guide_is_built_and_fetches_nothing(guide: Path) -> None:
    pages = list(guide.rglob("*.html"))
    assert len(pages) > 30
    for page in pages:
        text = page.read_text(encoding="utf-8")
        for address in Loaded(text).found:
            assert not re.match(r"(https?:)?//", address), f"{page}: {address}"
    for file in guide.rglob("*.css"):
        assert not re.search(r"@import|url\((['\"]?)(https?:)?//", file.read_text(encoding="utf-8")), file


def test_a_browser_reads_and_searches_it_without_a_server(guide: Path, browser: Browser) -> None:
    tab = Tab(browser)
    tab.page.set_default_timeout(180_000)  # a busy machine makes the index of the search slowly
    tab.page.goto((guide / "reference" / "task.html").as_uri())
    tab.page.get_by_role("link", name="Tutorial").first.click()
    tab.page.get_by_role("heading", name="an arm for a feeder").wait_for()
    tab.page.wait_for_load_state("load")  # before, nobody listens to keys
    tab.page.keyboard.press("f")
    tab.page.get_by_text("Type to start searching").wait_for()
    tab.page.locator(".md-search__input").press_sequentially("payload_factors")
    tab.page.locator(".md-search-result__list").get_by_text("Task files").first.wait_for()
    assert tab.faults == []
    assert all(request.startswith(("file:", "data:", "blob:")) for request in tab.requests)
    tab.close()


def test_it_fits_a_phone(guide: Path, browser: Browser) -> None:
    tab = Tab(browser, viewport={"width": 390, "height": 800})
    for page in ("index", "tutorial", "suite", "method", "reference/space", "reference/python", "reference/cli"):
        tab.page.goto((guide / f"{page}.html").as_uri())
        tab.page.locator("h1").wait_for()
        assert tab.ask("document.documentElement.scrollWidth <= window.innerWidth"), page
    tab.close()
