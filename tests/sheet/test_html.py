"""HTML of data sheets: two printed pages, nothing is cut, nothing is run."""

from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from armwright.problem.facts import ASKED
from armwright.robot.arm import Arm, Joint, uniform_link
from armwright.robot.urdf_reader import UrdfArm
from armwright.sheet.html import to_html
from armwright.sheet.record import DataSheet, JointLine, LinkLine, MassLine, Part
from armwright.sheet.tables import number
from armwright.sheet.urdf_sheet import urdf_sheet
from armwright.sheet.writer import write_datasheet

LONG = "XW540-T260-with-a-very-long-name-1234567"


def small_sheet() -> DataSheet:
    joints = tuple(Joint("revolute", axis, -2.0, 2.0) for axis in ("z", "y", "y"))
    links = tuple(uniform_link((0.0, 0.0, length), 0.2, 0.01) for length in (0.1, 0.3, 0.2))
    arm = Arm((0.0, 0.0, 0.1), joints, links)
    return urdf_sheet(UrdfArm("small", arm, "base", "tip", ("a", "b", "c")))


def large_sheet() -> DataSheet:
    """As much as a design can have: eight joints, with long names."""
    joint = JointLine(1, "joint_1", "revolute", "y", LONG, -2.4, 2.4, (-1.0, 1.0), (1.4, 1.4), 12.3, 4.5, 1.2)
    source = "https://example.org/" + "a-long-path/" * 9
    part = Part(LONG, 3, 1234.5, 3703.5, "A maker of coreless servos, 123.4 g each", source, "price of a reseller")
    return replace(
        small_sheet(),
        design=12345,
        joint_letters="YPPRPRPR",
        status="verified",
        survival="holds all but: " + "payload +10 % (thermal_utilisation 1.007 > 1), " * 5,
        objectives=dict.fromkeys(("thermal_utilisation", "mass", "price", "torque", "length"), (1.0, "of allowed")),
        joints=tuple(replace(joint, number=n) for n in range(1, 9)),
        links=tuple(LinkLine(n, 0.123, 0.02, 0.001, 0.1) for n in range(1, 9)),
        masses=tuple(MassLine(name, 0.1) for name in ("actuators", "column", "tool", *(f"link {n}" for n in range(8)))),
        parts=(part,) * 8,
        assumptions={f"assumption {n}": "a sentence about what is assumed of the values, " * 4 for n in range(8)},
    )


@pytest.fixture(scope="module", params=[small_sheet, large_sheet])
def sheet(request: pytest.FixtureRequest) -> DataSheet:
    return request.param()


@pytest.mark.slow
@pytest.mark.parametrize("paper", ["A4", "Letter"])
def test_sheet_prints_on_two_pages(sheet: DataSheet, browser: Browser, tmp_path: Path, paper: str) -> None:
    (tmp_path / "sheet.html").write_text(to_html(sheet), encoding="utf-8")
    page = browser.new_page()
    page.goto((tmp_path / "sheet.html").as_uri())
    printed = page.pdf(format=paper, prefer_css_page_size=paper == "A4")
    page.emulate_media(media="print")
    page.set_viewport_size({"width": 703, "height": 1032})  # what the margins leave of A4, at 96 dpi
    wide = page.evaluate("[...document.querySelectorAll('table')].filter(e => e.scrollWidth > 703).length")
    page.close()
    assert printed.count(b"/Type /Page\n") == 2
    assert not wide, "tables are cut off"


def test_same_sheet_gives_the_same_files(sheet: DataSheet, tmp_path: Path) -> None:
    written = [write_datasheet(sheet, tmp_path / name) for name in "ab"]
    for first, second in zip(*written, strict=True):
        assert first.read_bytes() == second.read_bytes()


def test_html_shows_what_the_space_file_says_as_text(sheet: DataSheet) -> None:
    part = Part("<script>alert(1)</script>", 1, detail='"><img src=x>', source="javascript:alert(1)")
    page = to_html(replace(sheet, parts=(part,), name="<b>", not_modelled="nothing"))
    assert "<script" not in page
    assert "<img src=x>" not in page
    assert "<b>" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page
    assert "http" not in page.split("</head>")[0].replace("http-equiv", "")


def test_html_states_each_key_figure(sheet: DataSheet) -> None:
    page = to_html(sheet)
    assert all(sheet.facts[name].label in page for name in ASKED)
    assert "not stated (a URDF states no price; try --price)" in page


@pytest.mark.parametrize(
    ("value", "factor", "shown"),
    [
        (8.223e-8, 1e3, "0"), (-8e-8, 1.0, "0"), (0.0123456, 1.0, "0.012"), (12.3456, 1.0, "12.3"),
        (0.5279, 1e3, "528"), (12345.6, 1.0, "12,346"), (None, 1.0, "not stated"),
    ],
)  # fmt: skip
def test_numbers_have_sensible_digits(value: float | None, factor: float, shown: str) -> None:
    assert number(value, factor) == shown
