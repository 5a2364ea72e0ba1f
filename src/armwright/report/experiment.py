"""Tables and figures of an experiment, from its finished cells."""

from collections.abc import Sequence
from pathlib import Path

from armwright.experiments.compare_runs import Comparison
from armwright.experiments.outcome import published
from armwright.experiments.plan import ExperimentPlan
from armwright.report.comparison_figures import Curves, write_comparison_figures
from armwright.report.tables import write_tables


def write_experiment_tables(out: Path, plan: ExperimentPlan, found: Comparison, notes: Sequence[str]) -> list[Path]:
    """Write the tables into the experiment's folder and return their paths, table.md first.

    Args:
        out: Folder of the experiment.
        plan: The experiment.
        found: Its finished runs.
        notes: Remarks on missing cells.
    """
    return write_tables(out, found, f"Experiment {plan.name}", published(plan), plan.published_in, notes)


def write_experiment_figures(out: Path, plan: ExperimentPlan, found: Comparison) -> list[Path]:
    """Draw the standard figures and those named in the plan; return the PNG files."""
    labels = {key: method.label for key, method in plan.methods.items()}
    curves = [Curves(key, f.title, [labels[method] for method in f.methods]) for key, f in plan.figures.items()]
    return write_comparison_figures(out, found, curves, [labels[key] for key in plan.samples])
