"""Print the results of runs: fronts, attribution, costs and the paths of the files."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from armwright.cli.notes import payload_note, unused_parts
from armwright.cli.streams import list_files
from armwright.cli.tables import Column, print_table
from armwright.problem.arm_quantities import TORQUE_SCALE, position_error, torque
from armwright.problem.assumptions import count_assumed
from armwright.problem.ignored_errors import describe_ignored_errors
from armwright.proof.infeasibility import describe_infeasibility
from armwright.proof.perturbations import HEAVIER, MOVED, SUPPLY
from armwright.proof.results import REPORT
from armwright.runs.history import FrontMember, History, source_label
from armwright.spaces.custom_parameters import describe_custom
from armwright.study.front.direct_search import FrontRun
from armwright.study.front.time_plan import MAX_DESIGNS
from armwright.study.progress import StudyResult
from armwright.text import decimals

SHORT_NAMES = {position_error: "error [m]", torque: "torque"}
MAX_ROWS = 16  # of the front; front.csv has all
Record = Mapping[str, Any]  # a part of a summary


def show_result(console: Console, run: StudyResult | FrontRun, figures: Sequence[Path]) -> None:
    """Print the front, the hypervolume, the costs and the files of a run."""
    history, summary, problem = run.history, run.summary, run.history.problem
    show_front(console, history, summary)
    search = summary.get("search")
    if summary.get("proposer"):
        console.print("Attribution")
        columns = (
            Column("source", "source"), Column("trials", "trials", str), Column("on the front", "front", str),
            Column("hypervolume gained", "hypervolume_gained", lambda gained: decimals(gained, 3)),
        )  # fmt: skip
        shares = ({"source": source_label(source), **share} for source, share in summary["attribution"].items())
        print_table(console, columns, shares, "--json prints all")
    lines = [
        *_hypervolume_lines(history, summary, "a larger --budget" if search else "more trials"),
        *(_study_lines(history, summary) if search is None else _search_lines(history, summary, search)),
    ]
    for line in lines:
        console.print(line)
    notes = [problem.space.mass_note, payload_note(problem.task), describe_ignored_errors(problem)]
    if torque in problem.objectives:
        notes.insert(0, f"torque = {TORQUE_SCALE:g} x the sum over the targets of |joint torques|")
    console.print("; ".join(filter(None, [*notes, *unused_parts(problem)])))
    if assumed := summary.get("assumed"):
        console.print(f"assumed values of actuators: {count_assumed(assumed)} (listed in summary.json)")
    show_recommended(console, summary.get("recommended", ()))
    if run.folder is not None:
        console.print(f"results: {run.folder}/ (summary.json, front.csv, designs/NNNN/arm.urdf)")
        if figures:
            console.print(list_files("figures", figures))
            console.print(f"page: {run.folder / REPORT}")


def show_front(console: Console, history: History, summary: Record) -> None:
    """Print the front as a table and how much of it is robust or holds; nothing if the front is empty."""
    if not history.front:
        return
    verified, custom = summary["verification"], history.problem.space.custom
    found: Record = {} if verified is None else verified["verdict"]

    def objective(name: str, index: int) -> Column:
        return Column(name, lambda member: member.values[index], format_value)

    names = [SHORT_NAMES.get(one, one.name.replace("_", " ")) for one in history.problem.objectives]
    word = {number: str(found["good"]) for number in found.get("numbers", ())}
    verdict = Column("verdict", lambda member: word.get(member.number, str(found["bad"])), rank=1)
    parameters = Column("parameters", lambda member: describe_custom(custom, member.design.params), rank=2)
    columns = (
        Column("#", "number", str), Column("source", lambda member: source_label(member.source), rank=5),
        *([verdict] if found else []), *(objective(name, i) for i, name in enumerate(names)),
        Column("joints", "design.joints"), *([parameters] if custom else []),
        Column("base [m]", lambda member: " ".join(f"{value:5.2f}" for value in member.design.origin), rank=4),
        Column("links [m]", links_of, rank=3),
    )  # fmt: skip
    reference = history.reference_point or (math.inf,) * len(names)
    inside = [m for m in history.front if all(np.less(m.values, reference))] or history.front
    shown = np.unique(np.linspace(0, len(inside) - 1, MAX_ROWS).round().astype(int)).tolist()
    console.print(f"Pareto front of {history.problem.task.name}")
    print_table(console, columns, [inside[i] for i in shown], "front.csv has all", gap=1)
    if left_out := len(history.front) - len(shown):
        beyond = len(history.front) - len(inside)
        console.print(f"and {left_out} more" + (f", {beyond} of them beyond the reference point" if beyond else ""))
    if found and history.problem.constraints:
        console.print(
            f"{len(found['numbers'])} of {len(history.front)} designs hold: no limit is exceeded, no target missed "
            f"and nothing touched with {HEAVIER} or 10 mm off-centre, {SUPPLY}, or {MOVED}"
        )
    elif verified is not None:
        console.print(
            f"recomputed in float64 and with the base or a link 1 mm off: {verified['robust']} robust, "
            f"{verified['sensitive']} sensitive; hypervolume of the robust designs "
            f"{verified['hypervolume_of_robust']:.3f}, of all in their worst case "
            f"{verified['hypervolume_worst_case']:.3f}"
        )


def links_of(member: FrontMember) -> str:
    """Return the lengths of the links of a design [m]."""
    return " ".join(f"{value:.2f}" for value in member.design.links)


def _study_lines(history: History, summary: Record) -> Iterator[str]:
    """Yield what the trials of a study were, and what they cost."""
    n_infeasible = int((~history.feasible & ~history.failed).sum())
    infeasible = f", {n_infeasible} infeasible" if history.problem.constraints else ""
    sources = ", ".join(f"{count} {source_label(source)}" for source, count in summary["by_source"].items())
    seconds, repeated = summary["seconds"], summary["duplicates"]
    parts = ", ".join(f"{part} {seconds[part]:.1f}" for part in ("sampling", "evaluation", "proposing"))
    yield f"{summary['n_trials']} trials{infeasible}: {sources}; {seconds['total']:.1f} s ({parts})"
    latest = {trial.failure.kind: trial for trial in history if trial.failure is not None}
    for kind, trial in latest.items():
        assert trial.failure is not None
        yield (
            f"{summary['failures'][kind]} of {len(history)} evaluations failed ({kind.replace('_', ' ')}); the last, "
            f"trial {trial.number}: {trial.failure.description}"
        )
    if repeated:
        trials = "trial" if repeated == 1 else "trials"
        yield f"{repeated} {trials} repeated the design of an earlier one, without another evaluation"
    if surrogate := summary.get("surrogate"):
        errors = ", ".join(
            f"{name} {'constant' if error is None else f'{error:.2g}'}" for name, error in surrogate["errors"].items()
        )
        designs = f"{surrogate['designs']} designs"
        yield f"leave-one-out error of the surrogate over {designs}, in standard deviations: {errors}"
    if summary["proposer"] is not None:
        yield from _proposer_lines(summary["proposer"])


def _search_lines(history: History, summary: Record, search: Record) -> Iterator[str]:
    """Yield what a front search evaluated, and why it ended."""
    reason = {"budget": "budget spent", "stall": "hypervolume stalled"}[search["ended_by"]]
    infeasible = f", {search['infeasible']:,} infeasible," if history.problem.constraints else ""
    yield f"{search['evaluations']:,} evaluations{infeasible} in {search['seconds']:.1f} s; {reason}"
    if summary["n_trials"] < min(search["found"], MAX_DESIGNS):
        yield f"{summary['n_trials']} of {search['found']} distinct designs are kept: there was no time to verify more"


def show_recommended(console: Console, recommended: Sequence[Record]) -> None:
    """Print the recommended designs, whether they are verified in the simulator, and what they survive."""
    roles: dict[str, list[str]] = {}
    for one in recommended:
        demoted = "".join(f"; #{other['design']} was demoted: {other['reason']}" for other in one["demoted"])
        demoted = (f"; {one['costs']}" if one["costs"] else "") + demoted
        survival = "perturbations not evaluated" if one["survival"] is None else one["survival"]["verdict"]
        roles.setdefault(f"#{one['design']}, {one['status']}; {survival}{demoted}", []).append(one["role"])
    for described, names in roles.items():
        console.print(f"recommended, {', '.join(names)}: {described}")


def _hypervolume_lines(history: History, summary: Record, remedy: str) -> Iterator[str]:
    """Yield the hypervolume and how it compares; remedy: what may help if the front is empty."""
    volume, gap = summary["hypervolume"], summary["front_gap"]
    mean = f"mean over iterations {volume['mean']:.3f}; " if volume.get("mean") is not None else ""
    point = volume["reference_point"]
    origins = summary.get("search", {}).get("reference_point_from") or ["task"] * len(point)
    parts = (f"{value:.4g}" + (f" ({o})" if o != "task" else "") for value, o in zip(point, origins, strict=True))
    if volume["final"] is not None:
        yield f"hypervolume {volume['final']:.3f} ({mean}reference point {', '.join(parts)})"
    if len(history) and not history.feasible.any():
        reason = describe_infeasibility(history, summary.get("feasibility"))
        advice = "" if history.failed.all() else f" Use {remedy} or looser constraints."
        yield f"{reason[0].upper()}{reason[1:]}.{advice}"
    elif volume["final"] == 0.0:
        yield f"All designs lie beyond the reference point, so none counts. Use {remedy} or another reference point."
    if gap is not None:
        yield f"{gap['share']:.1%} of the best known hypervolume ({gap['hypervolume']:.3f})"
        if gap["gain"]:
            yield f"NEW: the front adds at least {gap['gain']:.4%} to the best known hypervolume"


def _proposer_lines(proposer: Record) -> Iterator[str]:
    """Yield what a proposer cost, and how many of its proposals failed."""
    if proposer["model"] is not None:
        cost = "cost unknown" if proposer["cost_usd"] is None else f"{proposer['cost_usd']:.4f} USD"
        by = "" if proposer["origin"] == "model" else f" (origin: {proposer['origin']})"
        tokens = f"{proposer['input_tokens']:,} tokens in, {proposer['output_tokens']:,} out"
        yield f"{proposer['model']}{by}: {proposer['calls']} calls, {tokens}, {cost}, {proposer['call_seconds']:.1f} s"
    if failures := proposer["failures"]:
        kinds = ", ".join(f"{count} {kind}" for kind, count in failures.items())
        yield f"{sum(failures.values())} proposals failed and became black-box trials ({kinds})"
    if proposer["flagged"]:
        yield (
            f"FLAGGED: {proposer['fallback_share']:.0%} of the proposals failed; this run does not represent its "
            "proposer and is left out of its row in tables"
        )
    if proposer.get("differing_prompts"):
        yield (f"replay: the prompts of {proposer['differing_prompts']} proposals differ from the recorded ones")


def format_value(value: float) -> str:
    """Return a value of a table: three decimals, or two digits of small ones."""
    return f"{value:.3f}" if value >= 0.0095 or value == 0.0 else f"{value:.1e}"
