"""report.html begins with the recommended designs of a task with constraints, or with why there is none."""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armwright as aw
from armwright.page.page import write_report
from armwright.problem.objectives import QUANTITIES
from armwright.proof.results import read_summary
from armwright.runs.folder import read_run
from armwright.runs.history import History
from tests.support.browser import Tab

EXAMPLES = Path(__file__).parents[2] / "examples"


def problem(**changes: Any) -> aw.Problem:
    task = aw.load_task(EXAMPLES / "6-price-task.yaml").model_copy(update=changes)
    return aw.Problem(task, aw.load_space(EXAMPLES / "6-price-space.yaml"))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("page-recommended") / "run"
    aw.find_front(problem(), evaluations=500, out=folder)
    write_report(folder)
    return folder


@pytest.fixture
def history(run: Path) -> History:
    return read_run(run)[1]


@pytest.fixture
def recommended(run: Path) -> list[Mapping[str, Any]]:
    summary = read_summary(run)
    assert summary is not None
    return summary["recommended"]


def sections(tab: Tab) -> list[str]:
    """The visible sections of the page, from top to bottom."""
    return list(tab.ask("[...document.querySelectorAll('main > section:not([hidden])')].map((s) => s.id)"))


def asked(tab: Tab, number: int) -> dict[str, str]:
    """What the card of a design states, by label."""
    rows = tab.page.locator(f'.card[data-design="{number}"] .asked')
    labels = rows.locator("dt").evaluate_all("all => all.map((one) => one.firstChild.textContent)")
    return dict(zip(labels, rows.locator("dd").all_inner_texts(), strict=True))


def test_designs_to_build_come_first_and_state_what_the_kernels_compute(
    run: Path, tab: Tab, history: History, recommended: list[Mapping[str, Any]]
) -> None:
    tab.open(run / "report.html")
    shown = sections(tab)
    assert shown[:3] == ["recommended-box", "front-box", "arm-box"]
    assert shown.index("table-box") < shown.index("curve-box") < shown.index("configuration-box")
    assert "hypervolume" not in tab.text("#facts")
    assert "hypervolume" in tab.text("#research")
    cards = tab.page.locator(".card").evaluate_all("all => all.map((one) => Number(one.dataset.design))")
    assert cards == list(dict.fromkeys(one["design"] for one in recommended))
    for one in recommended:
        text = tab.text(f'.card[data-design="{one["design"]}"]')
        assert ("Drives its cycle in MuJoCo" in text) == (one["status"] == "verified")
        for perturbation in one["survival"]["perturbations"]:
            assert perturbation["name"] in text
            assert f"{perturbation['reserve']:.2f}" in text or perturbation["text"] in text
        assert ("Holds" in text) == one["survival"]["holds"]
        assert one["survival"]["assumed"]["text"] in text
        assert one["costs"][1:] in text
    number = recommended[0]["design"]
    evaluation, stated = history.evaluation([number]), asked(tab, number)
    price, sag = (float(QUANTITIES[name](evaluation)[0]) for name in ("price", "deflection"))
    assert stated["Price"] == f"{price:,.2f} USD"
    assert stated["Deflection"] == f"{1e3 * sag:#.3g} mm"
    assert stated["Mass"] == f"{history.member(number).arm.mass:.3g} kg"
    pictures = tab.page.locator(".card img").evaluate_all("all => all.map((one) => one.src)")
    assert all(picture.startswith("data:image/png") for picture in pictures)
    assert len(set(pictures)) == len(pictures)
    last = recommended[-1]["design"]
    tab.page.locator(f'.card[data-design="{last}"] .picture').click()
    assert tab.ask("armwright.state.design") == last
    assert tab.page.locator(".card.chosen").get_attribute("data-design") == str(last)
    assert tab.text("#design-note").endswith(f"Data sheet: armwright datasheet {run.name} --design {last}")
    assert tab.faults == []


def test_loads_are_those_of_the_exported_trajectory(
    run: Path, tab: Tab, history: History, recommended: list[Mapping[str, Any]]
) -> None:
    number = recommended[0]["design"]
    arm = history.member(number).arm
    with (run / "designs" / f"{number:04d}" / "trajectory.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    tab.open(run / "report.html", f"#design={number}")
    for button, column, factor, limits in (
        ("Torque", "tau", arm.safety_factor, [joint.effort for joint in arm.joints]),
        ("Speed", "qd", 1.0, [joint.speed for joint in arm.joints]),
    ):
        tab.page.locator("#load-kinds button", has_text=button).click()
        drawn = tab.ask("loads.data.map((trace) => Math.max(...trace.y.map(Math.abs)))")
        assert len(drawn) == len(arm.joints)
        for j, limit in enumerate(limits):
            assert limit is not None
            largest = max(abs(float(row[f"{column}_{j + 1}"])) for row in rows)
            assert drawn[j] == pytest.approx(100 * factor * largest / limit, rel=1e-3)
    assert "held forever" not in tab.text("#loads-note")


def test_page_says_first_why_no_design_is_feasible(tmp_path: Path, tab: Tab) -> None:
    aw.find_front(problem(constraints=("deflection <= 1e-6",)), evaluations=200, out=tmp_path / "run")
    tab.open(write_report(tmp_path / "run"))
    assert sections(tab)[0] == "recommended-box"
    assert tab.text("#recommended-box h2") == "No design meets all constraints"
    text = tab.text("#nothing")
    assert "violates deflection <= 1e-06" in text
    assert "bounds that would admit one" in text
    nearest = tab.ask("armwright.content.head.nothing.nearest")
    assert tab.ask("armwright.state.design") == nearest
    violated = read_run(tmp_path / "run")[1].violations
    assert nearest == int(np.argmin(np.maximum(violated, 0.0).sum(axis=1)))
    assert tab.faults == []


def test_search_comes_first_for_tasks_of_the_paper(studied: Path, tab: Tab) -> None:
    tab.open(studied / "report.html")
    shown = sections(tab)
    assert shown[0] == "front-box"
    assert shown.index("curve-box") < shown.index("table-box")
    assert "hypervolume" in tab.text("#facts")
