"""The tables and figures of an experiment, from its finished cells."""

from collections.abc import Sequence
from pathlib import Path

from armwright.experiment.outcome import collect, published
from armwright.experiment.plan import Cell, ExperimentPlan
from armwright.report.comparison import Curves, write_comparison_figures
from armwright.report.tables import write_tables


def write_experiment(
    out: Path, plan: ExperimentPlan, cells: Sequence[Cell], notes: Sequence[str], figures: bool
) -> tuple[list[Path], list[Path]]:
    """Writes tables, and figures where these are wanted, into the experiment's folder; the files of both.

    notes: what to say of cells that are missing.
    """
    comparison = collect(plan, cells)
    title = f"Experiment {plan.name}"
    tables = write_tables(out, comparison, title, published(plan), plan.published_in, notes)
    if not figures:
        return tables, []
    labels = {key: method.label for key, method in plan.methods.items()}
    curves = [Curves(key, f.title, [labels[method] for method in f.methods]) for key, f in plan.figures.items()]
    return tables, write_comparison_figures(out, comparison, curves, [labels[key] for key in plan.samples])
