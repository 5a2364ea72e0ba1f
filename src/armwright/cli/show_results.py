"""Print the results of runs: fronts, attribution, costs and the paths of the files."""

import math
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from armwright.cli.notes import payload_note, unused_parts
from armwright.cli.streams import format_point, list_files, plain_table
from armwright.problem.ignored_errors import describe_ignored_errors
from armwright.problem.objective import Objective
from armwright.problem.objectives import POSITION_ERROR, TORQUE, TORQUE_SCALE
from armwright.report.style import look
from armwright.runs.assumptions import assumed_values, count_assumed
from armwright.runs.history import FrontMember, History
from armwright.runs.infeasibility import describe_infeasibility
from armwright.runs.path_report import describe_extremes
from armwright.runs.results import REPORT
from armwright.runs.supply_record import supply_of
from armwright.spaces.custom_parameters import describe_custom
from armwright.study.direct_search import FrontRun
from armwright.study.progress import StudyResult
from armwright.study.refine_run import RefinedRun
from armwright.study.time_plan import MAX_DESIGNS

SHORT_NAMES = {POSITION_ERROR: "error [m]", TORQUE: "torque"}
MAX_ROWS = 16  # of the front; front.csv has all
MAX_OBJECTIVES_BESIDE_GEOMETRY = 3  # more of them leave no room for base and links


def show_result(console: Console, run: StudyResult, figures: Sequence[Path]) -> None:
    """Print the front, the hypervolume and the costs of a run."""
    history, summary, problem = run.history, run.summary, run.history.problem
    show_front(console, history, summary)
    if summary["proposer"] is not None:
        console.print(_attribution_table(summary["attribution"]))
    _show_hypervolume(console, history, summary, "more trials")
    more = "" if summary["evaluations"] == summary["n_trials"] else f", {summary['evaluations']:,} evaluations"
    n_infeasible = int((~history.feasible & ~history.failed).sum())
    infeasible = f", {n_infeasible} infeasible" if problem.constraints else ""
    sources = ", ".join(f"{count} {look(source).label}" for source, count in summary["by_source"].items())
    seconds = summary["seconds"]
    parts = ", ".join(f"{part} {seconds[part]:.1f}" for part in ("sampling", "evaluation", "proposing"))
    console.print(f"{summary['n_trials']} trials{more}{infeasible}: {sources}; {seconds['total']:.1f} s ({parts})")
    if any(summary.get("failures", {}).values()):
        _show_failures(console, history, summary["failures"])
    if summary["duplicates"]:
        console.print(
            f"{summary['duplicates']} trials repeated the design of an earlier one and were not evaluated again"
        )
    _show_learned(console, summary.get("surrogate"))
    if summary["proposer"] is not None:
        _show_proposer(console, summary["proposer"])
    is_scaled = TORQUE in problem.objectives
    notes = [f"torque = {TORQUE_SCALE:g} x the sum over the targets of |joint torques|"] if is_scaled else []
    notes += [
        problem.space.mass_note, payload_note(problem.task), describe_ignored_errors(problem), *unused_parts(problem),
    ]  # fmt: skip
    console.print("; ".join(filter(None, notes)))
    _show_assumed(console, summary)
    show_recommended(console, summary.get("recommended", ()))
    _show_files(console, run.folder, figures)


def _show_learned(console: Console, surrogate: Mapping[str, Any] | None) -> None:
    """Print how well the surrogate predicts each objective, by what, and how it corrects the built-in physics."""
    if surrogate is None:
        return
    console.print(f"the surrogate's predictions of {surrogate['designs']} designs, each left out in turn:")
    for one in surrogate["objectives"]:
        console.print(f"  {_describe_learned(one)}", highlight=False)


def _describe_learned(objective: Mapping[str, Any]) -> str:
    """Return what the surrogate learned of an objective in one sentence."""
    explained, error, name = objective["explained"], objective["relative_error"], objective["name"]
    if explained is None:
        return f"{name}: constant"
    by = ", ".join(effect["name"].replace("_", " ") for effect in objective["effects"])
    parts = [f"{name}: {100 * explained:.0f} % of the variance explained" + (f", most by {by}" if by else "")]
    parts += [] if error is None else [f"median error {100 * error:.2g} %"]
    return "; ".join([*parts, *filter(None, [objective["correction"]])])


def show_front(console: Console, history: History, summary: dict[str, Any]) -> None:
    """Print the front as a table and how much of it is robust; nothing if the front is empty."""
    if not history.front:
        return
    verified = summary["verification"]
    console.print(_front_table(history, None if verified is None else set(verified["robust_numbers"])))
    if verified is not None:
        console.print(
            f"recomputed in float64 and with the base or a link 1 mm off: {verified['robust']} robust, "
            f"{verified['sensitive']} sensitive ({verified['robust_from_any_start']} also robust from other initial "
            f"postures); hypervolume of the robust designs {verified['hypervolume_of_robust']:.3f}, of all in their "
            f"worst case {verified['hypervolume_worst_case']:.3f}"
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
    for one in recommended:
        demoted = "".join(f"; #{other['design']} was demoted: {other['reason']}" for other in one["demoted"])
        survival = "perturbations not evaluated" if one["survival"] is None else one["survival"]["verdict"]
        console.print(f"recommended, {one['role']}: #{one['design']}, {one['status']}; {survival}{demoted}")


def show_refined(console: Console, refined: RefinedRun) -> None:
    """Print what refinement added to a run."""
    show_front(console, refined.history, refined.summary)
    final = refined.summary["hypervolume"]["final"]
    before = refined.before.hypervolume
    console.print(
        f"refined {refined.tried} designs in {refined.evaluations:,} evaluations: added {refined.added} improved "
        f"designs; hypervolume {before[-1]:.3f} -> {final:.3f}"
    )
    _show_front_gap(console, refined.summary["front_gap"])


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
        reason = describe_infeasibility(history, summary.get("feasibility", {}).get("conflict"))
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
    if gap["beyond"]:
        console.print(
            f"NEW: {gap['beyond']} designs dominate or extend the best known front; they add "
            f"{gap['gain']:.4%} to its hypervolume"
        )


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
    numbers = ("seed", "trials", "hypervolume", "share")
    table = plain_table("run", "task", "method", *numbers, "state", right=numbers)
    for run in listed:
        volume, share = run["hypervolume"], run["share_of_best_known"]
        table.add_row(
            *(Text(str(run[name])) for name in ("folder", "task", "method", "seed", "trials")),
            "" if volume is None else f"{volume:.3f}",
            "" if share is None else f"{share:.1%}",
            Text(str(run["state"])),
        )
    console.print(table)


def show_picked(
    console: Console,
    run: Path,
    history: History,
    picked: Sequence[FrontMember],
    survival: Mapping[int, Mapping[str, Any]],
    most: int,
) -> None:
    """Print the chosen designs and the command that exports the first.

    Args:
        console: The console.
        run: The run folder.
        history: Its trials.
        picked: The chosen designs.
        survival: Records of their survival by number.
        most: Number of designs to print.
    """
    console.print(f"{len(picked)} of the front's {len(history.front)} designs meet the conditions")
    for member in picked[:most]:
        values = ", ".join(map(_format_objective, history.problem.objectives, member.values))
        links = ", ".join(f"{length:.3f}" for length in member.design.links)
        console.print(Text(f"#{member.number}", style="bold") + Text(f" ({look(member.source).label}): {values}"))
        motors = f", motors {', '.join(member.design.motors)}" if member.design.motors else ""
        tubes = f", tubes {', '.join(member.design.tubes)}" if member.design.tubes else ""
        base = format_point([round(value, 3) for value in member.design.origin])
        console.print(f"  joints {member.design.joints}, links {links} m, base {base} m{motors}{tubes}")
        if custom := describe_custom(history.problem.space.custom, member.design.params):
            console.print(f"  {custom}")
        evaluation = history.evaluation([member.number])
        if along := describe_extremes(evaluation, 0):
            console.print(f"  worst along its cycle: {along}")
        if supply := supply_of(evaluation, 0):
            console.print(f"  supply along its cycle: {supply.description}")
        if assumed := assumed_values(history.problem, [member.arm]):
            console.print(f"  assumed values of actuators: {count_assumed(assumed)} (listed in its design.json)")
        if member.number in survival:
            console.print(f"  perturbed: {survival[member.number]['verdict']}")
    first = picked[0].number
    console.print(f"armwright export {shlex.quote(str(run))} --design {first} --format urdf | mjcf | sheet, or another")


def _format_objective(objective: Objective, value: float) -> str:
    if objective == TORQUE:  # scaled, as in the paper
        return f"torque {value:.4g} = {TORQUE_SCALE:g} x {value / TORQUE_SCALE:.4g} N m"
    return f"{objective.label.lower()} {value:.4g} {objective.unit}"


def _front_table(history: History, robust: set[int] | None) -> Table:
    verdict = () if robust is None else ("verdict",)
    objectives = [SHORT_NAMES.get(o, o.name.replace("_", " ")) for o in history.problem.objectives]
    geometry = ("base [m]", "links [m]") if len(objectives) <= MAX_OBJECTIVES_BESIDE_GEOMETRY else ()
    table = plain_table(
        "#", "source", *verdict, *objectives, "joints", *geometry,
        right=("#", *objectives), title=f"Pareto front of {history.problem.task.name}", gap=1,
    )  # fmt: skip
    for column in table.columns:
        column.no_wrap = str(column.header) not in geometry
    reference = history.reference_point or (math.inf,) * len(objectives)
    inside = [m for m in history.front if all(np.less(m.values, reference))] or history.front
    shown: list[int] = np.unique(np.linspace(0, len(inside) - 1, MAX_ROWS).round().astype(int)).tolist()
    for member in (inside[i] for i in shown):
        base_and_links = (
            " ".join(f"{value:5.2f}" for value in member.design.origin),
            " ".join(f"{value:.2f}" for value in member.design.links),
        )
        table.add_row(
            str(member.number),
            look(member.source).label,
            *(() if robust is None else ("robust" if member.number in robust else "sensitive",)),
            *map(_format_value, member.values),
            member.design.joints,
            *(base_and_links if geometry else ()),
        )
    left_out = len(history.front) - len(shown)
    if left_out:
        beyond = len(history.front) - len(inside)
        table.caption = f"and {left_out} more" + (f", {beyond} of them beyond the reference point" if beyond else "")
        table.caption_justify = "left"
    return table


def _attribution_table(attribution: dict[str, dict[str, Any]]) -> Table:
    """Return a table of trials and gained hypervolume by source; useful only with a proposer."""
    numbers = ("trials", "on the front", "hypervolume gained")
    table = plain_table("source", *numbers, right=numbers, title="Attribution")
    for source, share in attribution.items():
        gained = "-" if share["hypervolume_gained"] is None else f"{share['hypervolume_gained']:.3f}"
        table.add_row(look(source).label, str(share["trials"]), str(share["front"]), gained)
    return table


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
        console.print(
            f"replay: the prompts of {proposer['differing_prompts']} proposals differ from the recorded ones; "
            "the model option `replay_strict: true` makes that an error"
        )
    overlap = proposer["overlap"]
    if overlap is not None:
        age = overlap["feedback_age"]
        feedback = "" if age is None else f"; feedback {age['mean']:.1f} trials old on average, {age['max']} at most"
        console.print(
            f"overlap: {overlap['ratio']:.1%} of the trials were proposals (planned: "
            f"{overlap['ratio_planned']:.1%}){feedback}"
        )


def _format_value(value: float) -> str:
    return f"{value:.3f}" if value >= 0.0095 or value == 0.0 else f"{value:.1e}"
