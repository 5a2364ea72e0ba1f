"""The tables and figures of an experiment, from its finished cells."""

from collections.abc import Sequence
from pathlib import Path

from armwright.comparison import Comparison
from armwright.experiment.outcome import published
from armwright.experiment.plan import ExperimentPlan
from armwright.report.comparison import Curves, write_comparison_figures
from armwright.report.tables import write_tables


def write_experiment_tables(out: Path, plan: ExperimentPlan, found: Comparison, notes: Sequence[str]) -> list[Path]:
    """Writes the tables into the experiment's folder; the files, the readable one first.

    notes: what to say of cells that are missing.
    """
    return write_tables(out, found, f"Experiment {plan.name}", published(plan), plan.published_in, notes)


def write_experiment_figures(out: Path, plan: ExperimentPlan, found: Comparison) -> list[Path]:
    """Draws the figures that the plan names, and the usual ones, into the experiment's folder; the .png files."""
    labels = {key: method.label for key, method in plan.methods.items()}
    curves = [Curves(key, f.title, [labels[method] for method in f.methods]) for key, f in plan.figures.items()]
    return write_comparison_figures(out, found, curves, [labels[key] for key in plan.samples])
