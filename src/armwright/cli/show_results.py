"""Print the results of runs: fronts, attribution, costs and the paths of the files."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from armwright.cli.notes import payload_note, unused_parts
from armwright.cli.streams import list_files
from armwright.cli.tables import Column, Table, numbers, print_table
from armwright.problem.assumptions import count_assumed
from armwright.problem.ignored_errors import describe_ignored_errors
from armwright.problem.objectives import TORQUE_SCALE, position_error, torque
from armwright.proof.infeasibility import describe_infeasibility
from armwright.proof.results import REPORT
from armwright.runs.history import History, source_label
from armwright.spaces.custom_parameters import describe_custom
from armwright.study.front.direct_search import FrontRun
from armwright.study.front.time_plan import MAX_DESIGNS
from armwright.study.progress import StudyResult

SHORT_NAMES = {position_error: "error [m]", torque: "torque"}
MAX_ROWS = 16  # of the front; front.csv has all


def show_result(console: Console, run: StudyResult, figures: Sequence[Path]) -> None:
    """Print the front, the hypervolume and the costs of a run."""
    history, summary, problem = run.history, run.summary, run.history.problem
    show_front(console, history, summary)
    if summary["proposer"] is not None:
        print_table(console, _attribution_table(summary["attribution"]))
    _show_hypervolume(console, history, summary, "more trials")
    n_infeasible = int((~history.feasible & ~history.failed).sum())
    infeasible = f", {n_infeasible} infeasible" if problem.constraints else ""
    sources = ", ".join(f"{count} {source_label(source)}" for source, count in summary["by_source"].items())
    seconds = summary["seconds"]
    parts = ", ".join(f"{part} {seconds[part]:.1f}" for part in ("sampling", "evaluation", "proposing"))
    console.print(f"{summary['n_trials']} trials{infeasible}: {sources}; {seconds['total']:.1f} s ({parts})")
    if any(summary.get("failures", {}).values()):
        _show_failures(console, history, summary["failures"])
    if summary["duplicates"]:
        console.print(
            f"{summary['duplicates']} trial{'s' * (summary['duplicates'] > 1)} repeated the design of an earlier one, "
            "without another evaluation"
        )
    if summary["proposer"] is not None:
        _show_proposer(console, summary["proposer"])
    is_scaled = torque in problem.objectives
    notes = [f"torque = {TORQUE_SCALE:g} x the sum over the targets of |joint torques|"] if is_scaled else []
    notes += [
        problem.space.mass_note, payload_note(problem.task), describe_ignored_errors(problem), *unused_parts(problem),
    ]  # fmt: skip
    console.print("; ".join(filter(None, notes)))
    _show_assumed(console, summary)
    show_recommended(console, summary.get("recommended", ()))
    _show_files(console, run.folder, figures)


def show_front(console: Console, history: History, summary: dict[str, Any]) -> None:
    """Print the front as a table and how much of it is robust; nothing if the front is empty."""
    if not history.front:
        return
    verified = summary["verification"]
    print_table(console, _front_table(history, None if verified is None else set(verified["robust_numbers"])))
    if verified is not None:
        console.print(
            f"recomputed in float64 and with the base or a link 1 mm off: {verified['robust']} robust, "
            f"{verified['sensitive']} sensitive; hypervolume of the robust designs "
            f"{verified['hypervolume_of_robust']:.3f}, of all in their worst case "
            f"{verified['hypervolume_worst_case']:.3f}"
        )


def show_search(console: Console, run: FrontRun, figures: Sequence[Path]) -> None:
    """Print the result of a front search."""
    summary = run.summary
    show_front(console, run.history, summary)
    _show_hypervolume(console, run.history, summary, "a larger --budget")
    search = summary["search"]
    reason = {"budget": "budget spent", "stall": "hypervolume stalled"}[search["ended_by"]]
    infeasible = f", {search['infeasible']:,} infeasible," if run.history.problem.constraints else ""
    console.print(f"{search['evaluations']:,} evaluations{infeasible} in {search['seconds']:.1f} s; {reason}")
    if summary["n_trials"] < min(search["found"], MAX_DESIGNS):
        console.print(
            f"{summary['n_trials']} of {search['found']} distinct designs are kept: there was no time to verify more"
        )
    if tried := search["reduced"]["evaluations"]:
        kept = search["reduced"]["designs"]
        console.print(f"{tried} arms without a joint that never moved were evaluated; {kept} are on the front")
    if screening := search.get("screening"):
        console.print(
            f"considered {screening['considered']:,} designs: bounds discarded {screening['discarded_by_bounds']:,}, "
            f"estimates ranked the rest; {screening['evaluated_though_rejected']:,} evaluated though rejected"
        )
    problem = run.history.problem
    console.print("; ".join(filter(None, (problem.space.mass_note, describe_ignored_errors(problem)))))
    _show_assumed(console, summary)
    show_recommended(console, summary.get("recommended", ()))
    _show_files(console, run.folder, figures)


def _show_assumed(console: Console, summary: dict[str, Any]) -> None:
    """Print how many values of actuators are assumed, if any."""
    if assumed := summary.get("assumed"):
        console.print(f"assumed values of actuators: {count_assumed(assumed)} (listed in summary.json)")


def show_recommended(console: Console, recommended: Sequence[dict[str, Any]]) -> None:
    """Print the recommended designs, whether they are verified in the simulator, and what they survive."""
    roles: dict[str, list[str]] = {}
    for one in recommended:
        demoted = "".join(f"; #{other['design']} was demoted: {other['reason']}" for other in one["demoted"])
        survival = "perturbations not evaluated" if one["survival"] is None else one["survival"]["verdict"]
        roles.setdefault(f"#{one['design']}, {one['status']}; {survival}{demoted}", []).append(one["role"])
    for described, names in roles.items():
        console.print(f"recommended, {', '.join(names)}: {described}")


def _show_failures(console: Console, history: History, failures: dict[str, int]) -> None:
    """Print how many evaluations failed, and the last reason of each kind."""
    latest = {trial.failure.kind: trial for trial in history if trial.failure is not None}
    for kind, count in failures.items():
        if count:
            trial = latest[kind]
            assert trial.failure is not None
            console.print(
                f"{count} of {len(history)} evaluations failed ({kind.replace('_', ' ')}); the last, trial "
                f"{trial.number}: {trial.failure.description}"
            )


def _show_hypervolume(console: Console, history: History, summary: dict[str, Any], remedy: str) -> None:
    """Print the hypervolume and how it compares; remedy: what may help if the front is empty."""
    volume = summary["hypervolume"]
    mean = f"mean over iterations {volume['mean']:.3f}; " if volume.get("mean") is not None else ""
    origins = [
        f" ({origin})" for origin in summary.get("search", {}).get("reference_point_from", ()) if origin != "task"
    ]
    point = volume["reference_point"]
    parts = zip(point, origins or [""] * len(point), strict=True)
    reference = ", ".join(f"{value:.4g}{origin}" for value, origin in parts)
    if volume["final"] is not None:
        console.print(f"hypervolume {volume['final']:.3f} ({mean}reference point {reference})")
    if len(history) and not history.feasible.any():
        reason = describe_infeasibility(history, summary.get("feasibility"))
        advice = "" if history.failed.all() else f" Use {remedy} or looser constraints."
        console.print(f"{reason[0].upper()}{reason[1:]}.{advice}")
    elif volume["final"] == 0.0:
        console.print(
            f"All designs lie beyond the reference point, so none counts. Use {remedy} or another reference point."
        )
    _show_front_gap(console, summary["front_gap"])


def _show_front_gap(console: Console, gap: dict[str, Any] | None) -> None:
    if gap is None:
        return
    console.print(f"{gap['share']:.1%} of the best known hypervolume ({gap['hypervolume']:.3f})")
    if gap["gain"]:
        console.print(f"NEW: the front adds at least {gap['gain']:.4%} to the best known hypervolume")


def _show_files(console: Console, folder: Path | None, figures: Sequence[Path]) -> None:
    if folder is None:
        return
    console.print(f"results: {folder}/ (summary.json, front.csv, designs/NNNN/arm.urdf)")
    if figures:
        console.print(list_files("figures", figures))
        console.print(f"page: {folder / REPORT}")


def show_runs(console: Console, listed: Sequence[dict[str, Any]]) -> None:
    """Print a table with a line per run."""
    if not listed:
        console.print("no runs found")
        return
    columns = (
        Column("run"), Column("task", rank=3, least=10), Column("method", rank=1, least=8),
        *numbers("seed", rank=4), *numbers("trials", rank=2), *numbers("hypervolume", "share"),
        Column("state", least=10),
    )  # fmt: skip
    rows = [
        [
            *(str(run[name]) for name in ("folder", "task", "method", "seed", "trials")),
            "" if run["hypervolume"] is None else f"{run['hypervolume']:.3f}",
            "" if run["share_of_best_known"] is None else f"{run['share_of_best_known']:.1%}",
            str(run["state"]),
        ]
        for run in listed
    ]
    print_table(console, Table(columns, rows, "--json and --csv print all"))


def _front_table(history: History, robust: set[int] | None) -> Table:
    objectives = [SHORT_NAMES.get(o, o.name.replace("_", " ")) for o in history.problem.objectives]
    custom = history.problem.space.custom
    columns = (
        *numbers("#"), Column("source", rank=5), *([] if robust is None else [Column("verdict", rank=1)]),
        *numbers(*objectives), Column("joints"), *([Column("parameters", rank=2)] if custom else []),
        Column("base [m]", rank=4), Column("links [m]", rank=3),
    )  # fmt: skip
    reference = history.reference_point or (math.inf,) * len(objectives)
    inside = [m for m in history.front if all(np.less(m.values, reference))] or history.front
    shown: list[int] = np.unique(np.linspace(0, len(inside) - 1, MAX_ROWS).round().astype(int)).tolist()
    rows = [
        [
            str(member.number),
            source_label(member.source),
            *(() if robust is None else ("robust" if member.number in robust else "sensitive",)),
            *map(format_value, member.values),
            member.design.joints,
            *([describe_custom(custom, member.design.params)] if custom else []),
            " ".join(f"{value:5.2f}" for value in member.design.origin),
            " ".join(f"{value:.2f}" for value in member.design.links),
        ]
        for member in (inside[i] for i in shown)
    ]
    return Table(
        columns,
        rows,
        "front.csv has all",
        title=f"Pareto front of {history.problem.task.name}",
        caption=_describe_left_out(len(history.front) - len(shown), len(history.front) - len(inside)),
        gap=1,
    )


def _describe_left_out(left_out: int, beyond: int) -> str:
    """Return how many designs of the front the table lacks; empty if none."""
    note = f", {beyond} of them beyond the reference point" if beyond else ""
    return f"and {left_out} more{note}" if left_out else ""


def _attribution_table(attribution: dict[str, dict[str, Any]]) -> Table:
    """Return a table of trials and gained hypervolume by source; useful only with a proposer."""
    rows = [
        [
            source_label(source),
            str(share["trials"]),
            str(share["front"]),
            "-" if share["hypervolume_gained"] is None else f"{share['hypervolume_gained']:.3f}",
        ]
        for source, share in attribution.items()
    ]
    columns = (Column("source"), *numbers("trials", "on the front", "hypervolume gained"))
    return Table(columns, rows, "--json prints all", title="Attribution")


def _show_proposer(console: Console, proposer: dict[str, Any]) -> None:
    if proposer["model"] is not None:
        cost = "cost unknown" if proposer["cost_usd"] is None else f"{proposer['cost_usd']:.4f} USD"
        by = "" if proposer["origin"] == "model" else f" (origin: {proposer['origin']})"
        tokens = f"{proposer['input_tokens']:,} tokens in, {proposer['output_tokens']:,} out"
        console.print(
            f"{proposer['model']}{by}: {proposer['calls']} calls, {tokens}, {cost}, {proposer['call_seconds']:.1f} s"
        )
    failures = proposer["failures"]
    if failures:
        kinds = ", ".join(f"{count} {kind}" for kind, count in failures.items())
        console.print(f"{sum(failures.values())} proposals failed and became black-box trials ({kinds})")
    if proposer["flagged"]:
        console.print(
            f"FLAGGED: {proposer['fallback_share']:.0%} of the proposals failed; this run does not represent its "
            "proposer and is left out of its row in tables"
        )
    if proposer.get("differing_prompts"):
        console.print(f"replay: the prompts of {proposer['differing_prompts']} proposals differ from the recorded ones")
    overlap = proposer["overlap"]
    if overlap is not None:
        age = overlap["feedback_age"]
        feedback = "" if age is None else f"; feedback {age['mean']:.1f} trials old on average, {age['max']} at most"
        console.print(
            f"overlap: {overlap['ratio']:.1%} of the trials were proposals (planned: "
            f"{overlap['ratio_planned']:.1%}){feedback}"
        )


def format_value(value: float) -> str:
    """Return a value of a table: three decimals, or two digits of small ones."""
    return f"{value:.3f}" if value >= 0.0095 or value == 0.0 else f"{value:.1e}"
