"""A figure of what the surrogate learned: the values of each objective over their predictions from other designs."""

import math
import textwrap
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.report.drawing import legend_below, legend_mark, several_panels
from armwright.report.style import FRONT, look
from armwright.runs.history import History

PER_ROW = 3  # panels
PANEL, LINE, LEGEND = 3.1, 0.17, 0.4  # size of a panel, height of a line of its title, and of the legend [inch]
TITLE_LETTERS = 38  # of a line that is as wide as the axes
UNBROKEN = "\u00a0"  # space within a name
MARGIN = 0.05  # of the range of an axis
FAR = 0.3  # of the range of the values; predictions that are farther off are drawn at the edge
MIN_TICKS, MAX_TICKS = 3, 6
# Logarithmic ticks: multiples of every n-th power of ten. The first that give few ticks are used.
STEPS = (((1.0, 2.0, 5.0), 1), ((1.0, 3.0), 1), ((1.0,), 1), ((1.0,), 2), ((1.0,), 3))


def draw_surrogate(history: History, learned: Mapping[str, Any]) -> Figure:
    """Draw each objective as evaluated and as predicted with the design left out.

    Args:
        history: the trials of the run.
        learned: `surrogate` of its summary.
    """
    numbers: list[int] = learned["trials"]
    sources = np.array([history.trials[number].source for number in numbers])
    columns, rows = min(PER_ROW, len(learned["objectives"])), -(-len(learned["objectives"]) // PER_ROW)
    titles = [_title(o.label, one) for o, one in zip(history.problem.objectives, learned["objectives"], strict=True)]
    height = PANEL + LINE * (1 + max(title.count("\n") for title in titles))
    figure = several_panels(max(1.3, columns) * PANEL, rows * height + LEGEND)
    panels: list[Any] = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
    for k, (objective, one) in enumerate(zip(history.problem.objectives, learned["objectives"], strict=True)):
        _draw_objective(panels[k], one, history.values[numbers, k], sources)
        unit = objective.unit_in_brackets.replace(" x ", " × ")
        panels[k].set(xlabel=f"Evaluated{unit}", ylabel=f"Predicted from the other designs{unit}")
        panels[k].set_title(titles[k])
    for axes in panels[len(titles) :]:
        axes.set_visible(False)
    marks = [look(source) for source in dict.fromkeys(sources.tolist())]
    line = Line2D([], [], color=FRONT, linewidth=0.8, label="prediction = evaluation")
    legend_below(figure, [*(legend_mark(m.label, m.marker, m.colour, markersize=5) for m in marks), line])
    return figure


def _title(label: str, one: Mapping[str, Any]) -> str:
    """Return the name of an objective, how well it is predicted, and by what."""
    explained = one["explained"]
    lines = [label, "constant" if explained is None else f"{100.0 * explained:.0f} % of the variance explained"]
    if one["effects"]:
        names = [effect["name"].replace("_", UNBROKEN).replace(" ", UNBROKEN) for effect in one["effects"]]
        lines.append(f"most by {', '.join(names)}")
    return "\n".join(textwrap.fill(line, TITLE_LETTERS) for line in lines)


def _draw_objective(axes: Any, one: Mapping[str, Any], values: Array, sources: NDArray[np.str_]) -> None:
    """Draw the values (N,) of an objective and their predictions, by the sources (N,) of the designs."""
    predicted = np.array(one["predicted"])
    low, high = _frame(axes, values, predicted, one["log_shift"])
    axes.plot([low, high], [low, high], color=FRONT, linewidth=0.8, zorder=1)
    drawn = np.clip(predicted, low, high)
    for source in dict.fromkeys(sources.tolist()):
        own = sources == source
        axes.scatter(values[own], drawn[own], **look(source).points, zorder=3, clip_on=False)
    if n_beyond := int(np.sum(drawn != predicted)):
        axes.annotate(f"beyond the axes: {n_beyond}", (0.98, 0.03), xycoords="axes fraction", ha="right", fontsize=8)


def _frame(axes: Any, values: Array, predicted: Array, log_shift: float | None) -> tuple[float, float]:
    """Scale both axes alike, as the values are predicted, and return their limits.

    Logarithms of shifted values are drawn as inverse hyperbolic sines, which have a place for 0.

    Args:
        axes: the panel.
        values: (N,) evaluated.
        predicted: (N,) of these; they may be far off.
        log_shift: added before the logarithm; None without one.
    """
    if log_shift is None:
        low, high = _limits(values, predicted)
    else:
        low, high = (log_shift * np.sinh(_limits(*(np.arcsinh(x / log_shift) for x in (values, predicted))))).tolist()
        axes.set_xscale("asinh", linear_width=log_shift)
        axes.set_yscale("asinh", linear_width=log_shift)
    axes.set(xlim=(low, high), ylim=(low, high), box_aspect=1.0)
    ticks = _ticks(low, high, log_shift)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_ticks(ticks, [f"{tick:.6g}" for tick in ticks])
        axis.set_ticks([], minor=True)
    return low, high


def _limits(values: Array, predicted: Array) -> Array:
    """Return (2,) limits around all values (N,), and around the predictions (N,) that are not far off."""
    reach = FAR * float(np.ptp(values))
    near = np.clip(predicted, values.min() - reach, values.max() + reach)
    both = np.concatenate([values, near])
    margin = MARGIN * float(np.ptp(both)) or MARGIN * abs(float(values[0])) or 1.0
    return np.array([both.min() - margin, both.max() + margin])


def _ticks(low: float, high: float, log_shift: float | None) -> list[float]:
    """Return the ticks of an axis, at most six or so."""
    if log_shift is not None:
        least = max(low, log_shift)
        decades = range(math.floor(math.log10(least)), math.ceil(math.log10(high)) + 1)
        for steps, every in STEPS:
            found = [step * 10.0**decade for decade in decades if decade % every == 0 for step in steps]
            found = [tick for tick in found if least <= tick <= high]
            if MIN_TICKS <= len(found) <= MAX_TICKS:
                return [0.0, *found] if low <= 0.0 else found
    return [float(tick) for tick in MaxNLocator(MAX_TICKS).tick_values(low, high) if low <= tick <= high]
