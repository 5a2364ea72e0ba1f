"""Rows and cells of the tables of a comparison."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

from armwright.experiments.compare_runs import Comparison, MethodResult
from armwright.experiments.outcome import Published
from armwright.experiments.statistics import Interval, PairedTest

TEST_COLUMNS = ("better", "effect", "p", "p (Holm)")


@dataclass(frozen=True)
class SummaryCell:
    """E_hv and σ_hv of a method on a task.

    is_best: the largest E_hv of several methods that have as many runs on the task as any.
    """

    e_hv: float
    sigma_hv: float | None
    is_best: bool = False


@dataclass(frozen=True)
class SummaryRow:
    """A row of the paper's table, with a cell for each task; None if there is no value."""

    label: str
    seeds: str
    cells: tuple[SummaryCell | None, ...]


def summary_rows(comparison: Comparison, published: Published) -> list[SummaryRow]:
    """Return the rows of the paper's table: each method, followed by its published values."""
    rows: list[SummaryRow] = []
    for method in comparison.methods:
        results = [row for row in comparison.rows if row.method == method and row.e_hv is not None]
        if results:
            cells = [_summary_cell(comparison, method, task) for task in comparison.tasks]
            rows.append(SummaryRow(comparison.label(method), _seeds_of(results), tuple(cells)))
        values = [published.values.get((method, task)) for task in comparison.tasks]
        if any(values):
            cells = [None if pair is None else SummaryCell(*pair) for pair in values]
            rows.append(SummaryRow(f"{method}, published", "–", tuple(cells)))
    return rows


def _summary_cell(comparison: Comparison, method: str, task: str) -> SummaryCell | None:
    results = [row for row in comparison.rows if row.task == task and row.e_hv is not None]
    own = next((row for row in results if row.method == method), None)
    if own is None or own.e_hv is None:
        return None
    most = max(len(row.seeds) for row in results)
    rivals = [row.e_hv.mean for row in results if row.e_hv is not None and len(row.seeds) == most]
    is_best = len(rivals) > 1 and len(own.seeds) == most and own.e_hv.mean == max(rivals)
    return SummaryCell(own.e_hv.mean, own.sigma_hv, is_best)


def _seeds_of(results: Sequence[MethodResult]) -> str:
    """Return the seeds of a method's results on several tasks."""
    text = format_seeds(sorted({seed for row in results for seed in row.seeds}))
    return text if len({row.seeds for row in results}) == 1 else f"{text}; fewer on some tasks"


def format_seeds(seeds: Sequence[int]) -> str:
    """Return ascending seeds as text, three or more in a row as a range."""
    parts: list[str] = []
    for _, group in groupby(enumerate(seeds), key=lambda pair: pair[1] - pair[0]):
        run = [seed for _, seed in group]
        parts += [f"{run[0]} to {run[-1]}"] if len(run) > 2 else map(str, run)
    return ", ".join(parts)


def remarks_on(comparison: Comparison) -> list[str]:
    """Return the notes that the tables need: excluded runs, shared reference points, stand-ins and models."""
    notes = [
        f"{run.method} on {run.task}, seed {run.seed}: excluded, because {run.proposer['fallback_share']:.0%} of its "
        "proposals failed"
        for run in comparison.excluded
    ]
    notes += [
        f"{task}: runs had different reference points; all use the largest values, "
        f"({', '.join(f'{value:.4g}' for value in comparison.reference_point(task))})"
        for task in comparison.widened
    ]
    if any(run.is_scripted for run in comparison.runs):
        notes.append(
            "[scripted]: a scripted stand-in answered instead of a language model; these rows say nothing about models"
        )
    models: dict[str, set[str]] = {}
    for run in comparison.runs:
        if run.proposer.get("model") and not run.is_scripted:
            models.setdefault(run.method, set()).add(str(run.proposer["model"]))
    return notes + [f"{method} used {', '.join(sorted(names))}" for method, names in models.items()]


def format_interval(value: Interval, scale: float = 1.0, unit: str = "", decimals: int = 2, sign: str = "-") -> str:
    """Return a mean and its interval; of a single value, the value alone."""
    mean, low, high = (f"{scale * end:{sign}.{decimals}f}" for end in (value.mean, value.low, value.high))
    return f"{mean}{unit}" if value.low == value.high else f"{mean}{unit} [{low}, {high}]"


def contrast_cells(test: PairedTest, p_holm: float | None) -> list[str]:
    """Return the cells of TEST_COLUMNS."""
    ps = ("–", "–") if p_holm is None else (f"{p:.4f}" if p >= 1e-4 else f"{p:.1e}" for p in (test.p, p_holm))
    return [f"{test.better} of {test.n}", f"{test.effect:+.2f}", *ps]


def format_share(value: float | None) -> str:
    """Return a share in percent."""
    return "–" if value is None else f"{100.0 * value:.0f} %"


def format_number(value: float | None, decimals: int = 0) -> str:
    """Return a number; a dash if there is none."""
    return "–" if value is None else f"{value:.{decimals}f}"
