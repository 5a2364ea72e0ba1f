"""Records of a comparison, one per row of its CSV tables."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from armwright.experiments.compare_runs import Comparison, Contrast, OverallContrast
from armwright.experiments.outcome import NOTHING_PUBLISHED, Published
from armwright.experiments.run_record import RunSummary, shares_by_source
from armwright.experiments.statistics import Interval, least_p
from armwright.experiments.table_cells import format_seeds

# Biases of proposers that tables show.
BIASES = ("lengths_5_cm", "lengths_1_cm", "base_on_symmetry_plane", "equal_neighbours")


def row_records(comparison: Comparison, published: Published = NOTHING_PUBLISHED) -> Iterable[dict[str, Any]]:
    """Yield one record per method and task."""
    for row in comparison.rows:
        e_hv, sigma_hv = published.values.get((row.method, row.task), (None, None))
        yield {
            "task": row.task,
            "method": row.method,
            "runs": len(row.seeds),
            "seeds": format_seeds(row.seeds),
            **_flat("e_hv", row.e_hv),
            "sigma_hv": row.sigma_hv,
            **_flat("final", row.final),
            **_flat("share_of_best_known", row.share),
            "best_known": comparison.best_known(row.task),
            "published_e_hv": e_hv,
            "published_sigma_hv": sigma_hv,
            "scripted": any(run.is_scripted for run in comparison.runs_of(row.method, row.task)),
        }


def contrast_records(comparison: Comparison) -> Iterable[dict[str, Any]]:
    """Yield one record per pair of methods on a task."""
    for contrast in comparison.contrasts:
        yield {
            "task": contrast.task,
            "method": contrast.method,
            "baseline": contrast.baseline,
            "pairs": contrast.test.n,
            **_flat("difference", contrast.test.difference),
            **_test_fields(contrast),
            "least_p": least_p(contrast.test.n),
        }


def overall_records(comparison: Comparison) -> Iterable[dict[str, Any]]:
    """Yield one record per pair of methods over all tasks."""
    for over in comparison.overall:
        yield {
            "method": over.method,
            "baseline": over.baseline,
            "tasks": over.test.n,
            **_flat("ratio", over.ratio),
            **_test_fields(over),
        }


def source_records(comparison: Comparison) -> Iterable[dict[str, Any]]:
    """Yield one record per task, method and source of trials: means over the runs."""
    for task in comparison.tasks:
        for method in comparison.methods:
            for share in shares_by_source(comparison.runs_of(method, task)):
                yield {"task": task, "method": method, **asdict(share)}


def proposer_records(comparison: Comparison) -> list[dict[str, Any]]:
    """Return one record per task and method that used a proposer: means over its runs."""
    records: list[dict[str, Any]] = []
    for task in comparison.tasks:
        for method in comparison.methods:
            runs = [run for run in comparison.runs_of(method, task) if run.proposer]
            if runs:
                records.append({"task": task, "method": method, **_proposer_means(runs)})
    return records


def run_records(comparison: Comparison) -> Iterable[dict[str, Any]]:
    """Yield one record per run."""
    best = {task: comparison.best_known(task) for task in comparison.tasks}
    for run in [*comparison.runs, *comparison.excluded]:
        known = best.get(run.task)
        yield {
            "task": run.task,
            "method": run.method,
            "seed": run.seed,
            "e_hv": float(run.curve.mean()) if len(run.curve) else None,
            "final": run.final,
            "share_of_best_known": run.final / known if known else None,
            "flagged": run.is_flagged,
            "origin": run.proposer.get("origin"),
            "seconds": run.seconds,
            "folder": str(run.folder),
        }


def _flat(name: str, value: Interval | None) -> dict[str, float | None]:
    if value is None:
        return {name: None, f"{name}_low": None, f"{name}_high": None}
    return {name: value.mean, f"{name}_low": value.low, f"{name}_high": value.high}


def _test_fields(contrast: Contrast | OverallContrast) -> dict[str, float | None]:
    test, p_holm = contrast.test, contrast.p_holm
    return {"better": test.better, "effect": test.effect, "p": None if p_holm is None else test.p, "p_holm": p_holm}


def _proposer_means(runs: Sequence[RunSummary]) -> dict[str, Any]:
    each: list[dict[str, Any]] = []
    for run in runs:
        summary, name = run.summary, run.proposer["name"]
        found: dict[str, Any] = {
            "proposals": summary["attribution"].get(name, {"trials": 0})["trials"],
            "calls": run.proposer["calls"],
            "failures": sum(run.proposer["failures"].values()),
            "tokens": run.proposer["tokens"],
            "cost_usd": run.proposer["cost_usd"],
        }
        for prefix, who in (("", "proposer"), ("black_box_", "black_box")):
            bias: dict[str, Any] = summary["proposer_bias"][who] or {}
            found |= {f"{prefix}{key}": bias.get(key) for key in BIASES}
        each.append(found)
    return {"runs": len(runs)} | {key: _mean([found[key] for found in each]) for key in each[0]}


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None
