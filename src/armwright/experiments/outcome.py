"""Collect the finished cells of an experiment, and store its plan."""

from collections.abc import Sequence
from pathlib import Path

import yaml

from armwright.exceptions import FailureError
from armwright.experiments.cells import Cell
from armwright.experiments.compare_runs import Comparison
from armwright.experiments.plan import ExperimentPlan
from armwright.experiments.run_record import read_run_summary
from armwright.files import check_no_links, naming_write_errors, replace_file
from armwright.proof.results import read_summary

PLAN = "experiment.yaml"  # in the experiment's folder


def collect(plan: ExperimentPlan, cells: Sequence[Cell]) -> Comparison:
    """Compare the finished cells, with the labels and in the order of the plan."""
    records = [
        read_run_summary(cell.folder, cell.plan.label) for cell in cells if read_summary(cell.folder) is not None
    ]
    if not records:
        raise FailureError("no cell of the experiment is finished, so there is nothing to compare")
    labels = [method.label for method in plan.methods.values()]
    tasks = list(dict.fromkeys(cell.task_name for cell in cells))
    against = {m.label: [plan.methods[key].label for key in m.against] for m in plan.methods.values() if m.against}
    published = {
        (plan.methods[key].label, task): numbers
        for key, by_task in plan.published.items()
        for task, numbers in by_task.items()
    }
    baseline = plan.methods[plan.baseline or next(iter(plan.methods))].label
    return Comparison(records, labels, tasks, baseline, against, published, plan.published_in)


def write_plan(plan: ExperimentPlan, out: Path) -> None:
    """Store the plan, with the models that were used, next to the results."""
    text = yaml.safe_dump(plan.model_dump(mode="json", exclude_defaults=True), sort_keys=False, allow_unicode=True)
    check_no_links(out)
    with naming_write_errors(out / PLAN):
        out.mkdir(parents=True, exist_ok=True)
        replace_file(out / PLAN, text.encode())
