"""The figure of what the surrogate learned."""

import json
from itertools import combinations
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from armwright.arrays import Array
from armwright.problem.problem import Problem
from armwright.report.figures import write_figures
from armwright.report.style import RC
from armwright.report.surrogate_figure import draw_surrogate
from armwright.runs.history import BBO, RANDOM, History
from armwright.runs.trial import FinishedTrial
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task

NAMES = ("position_error", "torque", "length", "mass", "peak_torque")
LONG = [{"name": name, "share": 0.4} for name in ("gain_of_the_outer_loop_1", "reference_velocity", "Y joints")]


def history_of(values: Array) -> History:
    """Return trials with these values (N, M), whatever their designs are."""
    task = load_task("target-1").model_copy(update={"reference_point": None, "objectives": NAMES[: values.shape[1]]})
    problem = Problem(task)
    sources = (RANDOM, BBO, "rules")
    trials = [
        FinishedTrial(i, sources[i % 3], design, tuple(row))
        for i, (design, row) in enumerate(zip(problem.space.sample(len(values), 0), values.tolist(), strict=True))
    ]
    return History(problem, trials, len(trials))


def learned(predicted: Array, log_shift: float | None = None, **changes: Any) -> dict[str, Any]:
    """Return the record of predictions (N, M)."""
    objectives = [
        {"explained": 0.8, "effects": LONG, "predicted": column.tolist(), "log_shift": log_shift} | changes
        for column in predicted.T
    ]
    return {"designs": len(predicted), "trials": list(range(len(predicted))), "objectives": objectives}


def drawn(values: Array, record: dict[str, Any]) -> tuple[Figure, list[Any]]:
    """Return the figure as it is saved, and its panels."""
    with matplotlib.rc_context(RC):
        figure = draw_surrogate(history_of(values), record)
        FigureCanvasAgg(figure).draw()
    return figure, [axes for axes in figure.axes if axes.get_visible()]


def points(axes: Any) -> set[tuple[float, float]]:
    return {tuple(row) for collection in axes.collections for row in collection.get_offsets().tolist()}


def texts(figure: Figure, panels: list[Any]) -> list[Bbox]:
    """Return the boxes of all texts of a figure [px]."""
    found = [text for legend in figure.legends for text in legend.get_texts()]
    for axes in panels:
        found += [axes.title, axes.xaxis.label, axes.yaxis.label]
        found += [*axes.get_xticklabels(), *axes.get_yticklabels(), *axes.texts]
    return [text.get_window_extent() for text in found if text.get_text()]


@pytest.mark.parametrize("log_shift", [None, 0.02])
@pytest.mark.parametrize("n_objectives", [1, 2, 3, 5])
def test_texts_neither_overlap_nor_leave_the_figure(n_objectives: int, log_shift: float | None) -> None:
    values = np.random.default_rng(n_objectives).lognormal(-1.0, 2.0, (30, n_objectives))
    figure, panels = drawn(values, learned(1.3 * values, log_shift))
    assert len(panels) == n_objectives
    boxes = texts(figure, panels)
    assert all(figure.bbox.containsx(x) for box in boxes for x in (box.x0, box.x1))
    assert all(figure.bbox.containsy(y) for box in boxes for y in (box.y0, box.y1))
    assert not [pair for pair in combinations(boxes, 2) if pair[0].overlaps(pair[1])]


def test_each_design_is_a_point_and_the_panel_names_what_predicts() -> None:
    values = np.random.default_rng(0).uniform(1.0, 2.0, (12, 1))
    _, (axes,) = drawn(values, learned(values + 0.01))
    assert points(axes) == {(x, x + 0.01) for x in values[:, 0].tolist()}
    title = axes.get_title().replace("\u00a0", " ").replace("\n", " ")
    assert title.startswith("Position error 80 % of the variance explained most by gain of the outer loop 1, ")
    assert axes.get_xlim() == axes.get_ylim()


def test_failed_and_repeated_trials_are_left_out() -> None:
    values = np.random.default_rng(0).uniform(1.0, 2.0, (12, 1))
    record = learned(values[[0, 3, 7]]) | {"trials": [0, 3, 7]}
    _, (axes,) = drawn(values, record)
    assert points(axes) == {(x, x) for x in values[[0, 3, 7], 0].tolist()}


def test_far_predictions_are_drawn_at_the_edge_and_counted() -> None:
    values = np.random.default_rng(0).uniform(1.0, 2.0, (12, 1))
    predicted = values.copy()
    predicted[3] = 1e300
    _, (axes,) = drawn(values, learned(predicted, 0.05))
    assert axes.get_ylim()[1] < 4.0
    assert max(y for _, y in points(axes)) == pytest.approx(axes.get_ylim()[1])
    assert [text.get_text() for text in axes.texts] == ["beyond the axes: 1"]


def test_zero_has_a_place_on_a_logarithmic_axis() -> None:
    values = np.array([[0.0], [0.0], [0.01], [1.0], [10.0], [100.0]])
    _, (axes,) = drawn(values, learned(values - 0.001, 0.03))
    assert axes.get_xlim()[0] < 0.0
    assert axes.get_xticks()[0] == 0.0


@pytest.mark.parametrize("value", [0.0, 3.0, -2.0])
def test_constant_objective_is_drawn(value: float) -> None:
    values = np.full((12, 1), value)
    _, (axes,) = drawn(values, learned(values, explained=None, effects=[]))
    low, high = axes.get_xlim()
    assert low < value < high
    assert axes.get_title() == "Position error\nconstant"


@pytest.mark.slow
def test_figure_is_redrawn_from_the_run_folder(tmp_path: Path) -> None:
    run = optimize(Problem(load_task("target-1")), proposer="none", n_init=4, n_total=8, out=tmp_path)
    assert tmp_path / "figures" / "surrogate.png" not in write_figures(tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    found = {"relative_error": 0.1, "inputs": "physics", "correction": ""}
    record = learned(run.history.values)
    record["objectives"] = [{"name": name} | found | one for name, one in zip("ab", record["objectives"], strict=True)]
    (tmp_path / "summary.json").write_text(json.dumps(summary | {"surrogate": record}), encoding="utf-8")
    first = {path.name: path.read_bytes() for path in write_figures(tmp_path)}
    assert "surrogate.png" in first
    assert {path.name: path.read_bytes() for path in write_figures(tmp_path)} == first
