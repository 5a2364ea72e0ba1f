"""No text of a figure or of the page lies on another or is cut off."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure
from matplotlib.path import Path as Path2D
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox

import armwright as aw
from armwright.existing.compare_arms import compare_arms
from armwright.page.page import write_report
from armwright.pictures import drawing
from armwright.pictures.arm_figures import draw_arm
from armwright.pictures.drawing import write_drawn
from armwright.pictures.figures import chosen_members, draw_samples, write_figures
from armwright.proof.design_record import read_records
from armwright.runs.config import FrontMethod
from armwright.runs.folder import read_run
from tests.support.browser import Tab
from tests.support.robots import robot
from tests.support.text_boxes import TOUCHING, check_texts, overlap

EXAMPLES = Path(__file__).parents[2] / "examples"
WIDTHS = (1280, 390)


def price_run(folder: Path) -> None:
    task, space = aw.load_task(EXAMPLES / "6-price-task.yaml"), aw.load_space(EXAMPLES / "6-price-space.yaml")
    aw.find_front(aw.Problem(task, space), evaluations=200, out=folder)


def paper_run(folder: Path) -> None:
    aw.optimize(aw.Problem(aw.load_task("target-1")), proposer="rules", n_total=30, out=folder)


def infeasible_run(folder: Path) -> None:
    task = aw.load_task("desk-sorting").model_copy(update={"constraints": ("length <= 0.3",)})
    aw.find_front(aw.Problem(task, aw.load_space("desk-sorting")), evaluations=100, out=folder)


def compared_run(folder: Path) -> None:
    task, space = (EXAMPLES / f"7-compare-arms-{part}.yaml" for part in ("task", "space"))
    aw.find_front(aw.Problem(aw.load_task(task), aw.load_space(space)), evaluations=1000, out=folder)
    compare_arms(task, [robot("so101"), robot("ur3_robot")], folder, base=(0.0, 0.0, 0.0))


RUNS = {"three-objectives": price_run, "paper": paper_run, "infeasible": infeasible_run, "compared": compared_run}
PAGES = ("three-objectives", "infeasible")  # that of "compared" holds hidden names of arms beyond its axes


@pytest.fixture(scope="module", params=RUNS)
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("text") / "run"
    RUNS[request.param](folder)
    return folder


@dataclass(frozen=True)
class Drawn:
    """A figure's box, its horizontal and vertical texts with theirs, and the lines of its labels [px]."""

    figure: Bbox
    texts: list[tuple[str, Bbox]]
    lines: list[tuple[str, Path2D]]


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> dict[str, Drawn]:
    """Return each figure that is drawn from now on."""
    found: dict[str, Drawn] = {}
    boxes: list[tuple[str, Bbox]] = []
    lines: list[tuple[str, Path2D]] = []
    draw = Text.draw

    def recorded(self: Text, renderer: Any, *others: Any, **named: Any) -> None:
        draw(self, renderer, *others, **named)
        if self.get_visible() and self.get_text().strip() and self.get_rotation() % 90.0 == 0.0:
            boxes.append((self.get_text(), Text.get_window_extent(self, renderer)))
        if isinstance(self, Annotation) and self.arrow_patch is not None:
            lines.append(
                (self.get_text(), self.arrow_patch.get_transform().transform_path(self.arrow_patch.get_path()))
            )

    def saved(figure: Figure, png: Path) -> str:
        figure.savefig(png, dpi="figure")
        figure.set_layout_engine(None)  # it is settled now, so each text is drawn once
        boxes.clear()
        lines.clear()
        figure.savefig(png, dpi="figure")
        found[png.name] = Drawn(figure.bbox.frozen(), list(boxes), list(lines))
        return png.name

    monkeypatch.setattr(Text, "draw", recorded)
    monkeypatch.setattr(drawing, "_save", saved)
    return found


def figures_of_experiments(run: Path) -> Iterator[tuple[str, Figure]]:
    """Yield the figures that experiments draw of a run."""
    config, history = read_run(run)
    if not isinstance(config.method, FrontMethod):
        yield "samples", draw_samples(history)
    for title, member in chosen_members(history):
        yield f"arm-{member.number}", draw_arm(history, title, member, read_records(run, history, [member.number]))


@pytest.mark.slow
def test_texts_of_figures_are_whole_and_apart(run: Path, drawn: dict[str, Drawn]) -> None:
    write_figures(run)
    write_drawn(run / "of-experiments", figures_of_experiments(run))
    assert len(drawn) >= 4
    for name, one in drawn.items():
        figure, texts = one.figure, one.texts
        assert len(texts) > 5
        for text, box in texts:
            is_inside = box.x0 > -1 and box.y0 > -1 and box.x1 < figure.x1 + 1 and box.y1 < figure.y1 + 1
            assert is_inside, f"{name}: {text!r} is cut off"
        for (text, box), (other, its) in combinations(texts, 2):
            assert overlap(box, its) < TOUCHING, f"{name}: {text!r} lies on {other!r}"
        for (text, path), (other, box) in product(one.lines, texts):
            is_crossed = text != other and path.intersects_bbox(box.padded(-TOUCHING), filled=False)
            assert not is_crossed, f"{name}: the line of {text!r} crosses {other!r}"


@pytest.mark.parametrize("run", PAGES, indirect=True)
def test_texts_of_the_page_are_whole_and_apart(run: Path, tab: Tab) -> None:
    tab.open(write_report(run))
    for width in WIDTHS:
        tab.page.set_viewport_size({"width": width, "height": 900})
        tab.page.reload()
        tab.page.locator("#arm canvas").wait_for()
        check_texts(tab, least=31)
