"""Colours, markers and labels of all figures: colour-blind safe (Okabe & Ito) and distinct in grey."""

from typing import Any, NamedTuple

from armwright.runs.history import BBO, FRONT_SEARCH, INITIAL_DESIGN, RANDOM, source_label


class Look(NamedTuple):
    """The marker and colour of the trials of one source."""

    label: str
    colour: str
    marker: str
    size: float  # [pt²]

    @property
    def points(self) -> dict[str, Any]:
        """Arguments of a scatter plot."""
        edge = {"linewidths": 1.0} if self.marker == "x" else {"edgecolors": "white", "linewidths": 0.4}
        return {"s": self.size, "marker": self.marker, "color": self.colour, **edge}


_LOOKS: dict[str, tuple[Any, ...]] = {
    RANDOM: ("#9A9A9A", "x", 22),
    INITIAL_DESIGN: ("#111111", "P", 36),
    BBO: ("#0072B2", "o", 20),
    FRONT_SEARCH: ("#0072B2", "o", 14),
    "rules": ("#D55E00", "^", 44),
    "llm": ("#CC79A7", "^", 44),
    "scripted": ("#CC79A7", "v", 44),
    "manual": ("#E69F00", "s", 36),
}
EXISTING = Look("existing arm", "#56B4E9", "P", 70)
FRONT = "#111111"
MISSED = "#CC0000"
BEST_KNOWN: Any = {"color": MISSED, "linewidth": 1.0, "linestyle": (0, (4, 2))}  # line of the best known hypervolume
TARGET = "#CC79A7"
INFEASIBLE = "#B0B0B0"
LINK = "#5A5A60"
OBSTACLE = "#6E7F91"
JOINT = {"x": "#D55E00", "y": "#0072B2", "z": "#009E73"}
JOINT_LABEL = {"x": "R (roll, x)", "y": "P (pitch, y)", "z": "Y (yaw, z)"}

RC: Any = {  # never modified
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.labelsize": 9,
    "legend.fontsize": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#E6E6E6",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "hatch.linewidth": 0.6,
    "legend.frameon": False,
    "figure.dpi": 100,
    "savefig.dpi": 160,
    "pdf.fonttype": 42,  # embed fonts as text, as journals require
    "svg.hashsalt": "armwright",
    "text.parse_math": False,  # names from users are not markup
}


def look(source: str) -> Look:
    """Return the style of a source; custom proposers are drawn like the built-in rules."""
    return Look(source_label(source), *_LOOKS.get(source, ("#D55E00", "^", 44)))


class Line(NamedTuple):
    """The colour, dash pattern and marker of one method's curve."""

    colour: str
    pattern: Any
    marker: str

    @property
    def curve(self) -> dict[str, Any]:
        """Arguments of a line plot, apart from its marker."""
        return {"color": self.colour, "linestyle": self.pattern, "linewidth": 1.5, "markersize": 4}


_LINES = (
    Line("#0072B2", "-", "o"),
    Line("#D55E00", (0, (6, 2)), "^"),
    Line("#009E73", (0, (2, 1.5)), "s"),
    Line("#CC79A7", (0, (6, 2, 1.5, 2)), "D"),
    Line("#56B4E9", (0, (1, 1)), "v"),
    Line("#E69F00", (0, (8, 2, 2, 2, 2, 2)), "P"),
    Line("#000000", (0, (3, 4)), "X"),
)


def line(number: int) -> Line:
    """Return the style of the method with this number: after seven, each colour comes with another pattern."""
    turn, place = divmod(number, len(_LINES))
    shape = _LINES[(place + 3 * turn) % len(_LINES)]
    return Line(_LINES[place].colour, shape.pattern, shape.marker)
