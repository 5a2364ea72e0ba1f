"""What the command line shows: progress while a study runs, and its result."""

import math
import shlex
import textwrap
import time
from collections import Counter
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
from rich.table import Column, Table
from rich.text import Text

from armwright.experiments.baselines import Baseline, baselines, baselines_of
from armwright.experiments.compare_arms import MEASURES, ArmComparison, ComparedArm
from armwright.experiments.plan import Cell, Skipped
from armwright.experiments.runner import Outcome
from armwright.extras import install_command, missing_packages
from armwright.llm.draft import Draft
from armwright.problem.objectives import (
    OF_CLEARANCE,
    OF_MOVES,
    POSITION_ERROR,
    TORQUE,
    TORQUE_SCALE,
    UNCOVERED_FRACTION,
)
from armwright.problem.problem import Problem
from armwright.robot.actuators import ActuatorRecord
from armwright.runs.history import FrontMember, History
from armwright.runs.results import REPORT, unmet
from armwright.study.cluster import Workers
from armwright.study.front_run import FrontProgress, FrontRun
from armwright.study.refine_run import Polished
from armwright.study.study import Progress as StudyProgress
from armwright.study.study import Run
from armwright.tasks.targets import describe_targets
from armwright.tasks.task import Task as DesignTask

EVERY = 10  # counted trials between two plain lines
SHORT = {POSITION_ERROR: "error [m]", TORQUE: "torque"}  # what the paper's objectives are called in narrow tables
MOST_ROWS = 16  # of the front; front.csv has all
MOST_WITH_PLACES = 3  # objectives beside which there is room for base and links


class Watch(Protocol):
    """Shows a study's progress."""

    def __call__(self, progress: StudyProgress) -> None: ...


@contextmanager
def watching(console: Console) -> Generator[Watch]:
    """A live line in a terminal, plain lines elsewhere."""
    if console.is_terminal:
        with _live(console) as watch:
            yield watch
    else:
        yield _plain(console)


def show_result(console: Console, run: Run, figures: Sequence[Path]) -> None:
    """The front and what the run came to."""
    history = run.history
    summary = run.summary
    show_front(console, history, summary)
    if summary["proposer"] is not None:
        console.print(_credit_table(summary["credit"]))
    volume = summary["hypervolume"]
    reference = ", ".join(f"{value:.4g}" for value in volume["reference_point"])
    broken = f", {(~history.feasible).sum()} infeasible" if history.problem.constraints else ""
    sources = ", ".join(f"{count} {source}" for source, count in summary["by_source"].items())
    console.print(
        f"hypervolume {volume['final']:.3f} (mean over iterations {volume['mean']:.3f}; reference point {reference})"
    )
    _show_emptiness(console, history, volume["final"], "more trials")
    _show_standing(console, summary["best_known"])
    more = "" if summary["evaluations"] == summary["n_trials"] else f", {summary['evaluations']:,} evaluations"
    console.print(f"{summary['n_trials']} trials{more}{broken}: {sources}; {_seconds(summary['seconds'])}")
    if summary["duplicates"]:
        console.print(
            f"{summary['duplicates']} trials repeated the design of an earlier one and were not evaluated again"
        )
    _show_proposer(console, summary["proposer"])
    scaled = TORQUE in history.problem.objectives
    words = f"torque = {TORQUE_SCALE:g} x the sum over the targets of |joint torques|; " if scaled else ""
    problem = history.problem
    notes = f"{_payload_note(problem.task)}{_obstacle_note(problem)}{_move_note(problem)}{_workspace_note(problem)}"
    console.print(f"{words}{problem.space.mass_note}{notes}")
    _show_places(console, run.folder, figures)


def show_front(console: Console, history: History, summary: dict[str, Any]) -> None:
    """The front as a table, and how much of it is solid; nothing of an empty one."""
    if not history.front:
        return
    verified = summary["verification"]
    console.print(_front_table(history, None if verified is None else set(verified["solid_numbers"])))
    if verified is not None:
        console.print(
            f"verified in float64, and with base or links 1 mm off: {verified['solid']} solid, {verified['fragile']} "
            f"fragile ({verified['solid_from_any_start']} hold from other start postures, too); hypervolume of the "
            f"solid {verified['hypervolume_of_solid']:.3f}, of all as a workshop builds them "
            f"{verified['hypervolume_as_built']:.3f}"
        )


def show_search(console: Console, run: FrontRun, figures: Sequence[Path]) -> None:
    """What a search for the whole front came to."""
    summary = run.summary
    show_front(console, run.history, summary)
    volume, search = summary["hypervolume"], summary["search"]
    reference = ", ".join(f"{value:.4g}" for value in volume["reference_point"])
    console.print(f"hypervolume {volume['final']:.3f} (reference point {reference}), {len(run.history)} designs")
    _show_emptiness(console, run.history, volume["final"], "a larger --budget")
    _show_standing(console, summary["best_known"])
    why = {"budget": "the budget is spent", "stall": "the hypervolume hardly grew any more"}[search["ended_by"]]
    broken = f", {search['infeasible']:,} infeasible," if run.history.problem.constraints else ""
    console.print(f"{search['evaluations']:,} evaluations{broken} in {search['seconds']:.1f} s; {why}")
    console.print(f"{run.history.problem.space.mass_note}")
    _show_places(console, run.folder, figures)


def show_polish(console: Console, polished: Polished) -> None:
    """What polishing brought."""
    show_front(console, polished.history, polished.summary)
    final = polished.summary["hypervolume"]["final"]
    before = polished.before.hypervolume
    console.print(
        f"polished {polished.tried} designs by {polished.evaluations:,} evaluations: {polished.added} became better "
        f"and were added; hypervolume {before[-1]:.3f} -> {final:.3f}"
    )
    _show_standing(console, polished.summary["best_known"])


def _show_emptiness(console: Console, history: History, hypervolume: float, more: str) -> None:
    if len(history) and not history.feasible.any():
        console.print(f"{unmet(history)[0].upper()}{unmet(history)[1:]}. Give {more} or looser constraints.")
    elif hypervolume == 0.0:
        console.print(
            f"The front lies wholly outside the reference point: no design counts yet. Give {more} or another one."
        )


def _show_standing(console: Console, standing: dict[str, Any] | None) -> None:
    if standing is None:
        return
    console.print(f"{standing['share']:.1%} of the best known hypervolume ({standing['hypervolume']:.3f})")
    if standing["beyond"]:
        console.print(
            f"NEW: {standing['beyond']} designs lie beyond the best known front and enlarge its hypervolume by "
            f"{standing['gain']:.4%}"
        )


def _show_places(console: Console, folder: Path | None, figures: Sequence[Path]) -> None:
    if folder is None:
        return
    console.print(f"results: {folder}/ (summary.json, front.csv, designs/NNNN/arm.urdf)")
    if figures:
        console.print(f"figures: {figures[0].parent}/ ({', '.join(path.name for path in figures)})")
        console.print(f"page, for any browser: {folder / REPORT}")


def show_plan(
    console: Console, due: Sequence[Cell], finished: int, skipped: Sequence[Skipped], workers: Workers | None
) -> None:
    """Say what an experiment is about to do."""
    where = "one after another" if workers is None else f"on {workers.description}"
    parts = [f"{len(due)} to run {where}" if due else "nothing to run", f"{finished} finished before"]
    console.print(f"{len(due) + finished + len(skipped)} cells: {', '.join(parts)}, {len(skipped)} skipped")
    if len(due) > 1 and missing_packages("distributed"):
        console.print(f"several at a time: {install_command('distributed')}")
    for note in notes_on_cells(skipped, ()):
        console.print(note)
    asking = [cell for cell in due if cell.plan.asks_a_model and cell.replay is None]
    if asking:
        proposals = sum(-(-cell.n_total // cell.plan.n_step) for cell in asking)
        models = ", ".join(sorted({str(cell.plan.model) for cell in asking}))
        console.print(f"{len(asking)} of them ask {models} for some {proposals:,} proposals in all")


def notes_on_cells(skipped: Sequence[Skipped], failed: Sequence[Outcome]) -> list[str]:
    """What to say of cells that are missing: a line for each method and reason, and one for each failure."""
    reasons = Counter((one.cell.plan.label, one.reason) for one in skipped)
    notes = [
        f"skipped: {label}, {count} {'cell' if count == 1 else 'cells'}: {reason}"
        for (label, reason), count in reasons.items()
    ]
    return notes + [f"FAILED: {outcome.cell.words}: {outcome.fault}" for outcome in failed]


def show_outcome(console: Console, outcome: Outcome, number: int, of: int) -> None:
    """A cell that has ended."""
    if outcome.fault:
        console.print(f"[{number}/{of}] FAILED: {outcome.cell.words}: {outcome.fault}")
    else:
        assert outcome.hypervolume is not None
        console.print(
            f"[{number}/{of}] {outcome.cell.words}: hypervolume {outcome.hypervolume:.3f}, {outcome.seconds:.1f} s"
        )
    console.file.flush()


def show_comparison(console: Console, tables: Sequence[Path], figures: Sequence[Path]) -> None:
    """The readable table, and where all of it lies."""
    console.print()
    console.print(tables[0].read_text(encoding="utf-8"))
    show_files(console, tables, figures)


def show_files(console: Console, tables: Sequence[Path], figures: Sequence[Path]) -> None:
    """Where tables and figures lie."""
    console.print(f"tables: {tables[0].parent}/ ({', '.join(path.name for path in tables)})")
    if figures:
        console.print(f"figures: {figures[0].parent}/ ({', '.join(path.name for path in figures)})")


def show_runs(console: Console, listed: Sequence[dict[str, Any]]) -> None:
    """Runs as a table, a line each."""
    if not listed:
        console.print("no run lies here")
        return
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for name in ("run", "task", "method", "seed", "trials", "hypervolume", "share", "state"):
        table.add_column(name, justify="right" if name in ("seed", "trials", "hypervolume", "share") else "left")
    for run in listed:
        volume, share = run["hypervolume"], run["share_of_best_known"]
        table.add_row(
            *(Text(str(run[name])) for name in ("folder", "task", "method", "seed", "trials")),
            "" if volume is None else f"{volume:.3f}",
            "" if share is None else f"{share:.1%}",
            Text(str(run["state"])),
        )
    console.print(table)


def show_picked(console: Console, run: Path, history: History, picked: Sequence[FrontMember], most: int) -> None:
    """The chosen designs, and how to get their files."""
    console.print(f"{len(picked)} of the front's {len(history.front)} designs meet the conditions")
    for member in picked[:most]:
        values = ", ".join(
            f"{o.label.lower()} {value:.4g} {o.unit}"
            for o, value in zip(history.problem.objectives, member.values, strict=True)
        )
        links = ", ".join(f"{length:.3f}" for length in member.design.links)
        base = ", ".join(f"{value:.3f}" for value in member.design.origin)
        console.print(Text(f"#{member.number}", style="bold") + Text(f" ({member.source}): {values}"))
        motors = f", motors {', '.join(member.design.motors)}" if member.design.motors else ""
        console.print(f"  joints {member.design.joints}, links {links} m, base ({base}) m{motors}")
    first = picked[0].number
    console.print(f"armwright export {shlex.quote(str(run))} --design {first} --format urdf | mjcf | sheet, or another")


def show_tasks(console: Console, tasks: Sequence[DesignTask]) -> None:
    """A line for every task."""
    methods = list(dict.fromkeys(baseline.method for baseline in baselines()))
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("task", no_wrap=True)
    for head in ("targets", *methods):
        table.add_column(head, justify="right")
    table.add_column("")
    for task in tasks:
        shares = {baseline.method: f"{100 * baseline.share:.0f} %" for baseline in baselines_of(task.name)}
        shown = (shares.get(method, "") for method in methods)
        table.add_row(task.name, str(len(task.targets)), *shown, Text(task.description))
    console.print(table)
    console.print(
        f"\n{' and '.join(methods)}: share of the best known hypervolume after 200 counted trials (mean of "
        f"{baselines()[0].runs} runs).\narmwright tasks NAME tells all of one task; random-N is one of a seeded family."
    )


def show_actuators(console: Console, records: Sequence[ActuatorRecord]) -> None:
    """The catalogue; what a data sheet does not say is empty."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("actuator", no_wrap=True)
    table.add_column("maker", no_wrap=True)
    for head in ("V", "g", "stall N m", "rated N m", "peak N m", "rad/s", "USD"):
        table.add_column(head, justify="right")
    table.add_column("source", overflow="fold")
    for record in records:
        numbers = (record.voltage, 1e3 * record.mass, record.stall_torque, record.rated_torque, record.peak_torque)
        shown = ("" if n is None else f"{n:.4g}" for n in (*numbers, record.speed, record.price))
        table.add_row(record.name, Text(record.maker), *shown, Text(record.source))
    console.print(table)


def show_task(console: Console, task: DesignTask, known: float | None, stored: Sequence[Baseline]) -> None:
    """All of one task: its points, where they come from, and what it can be compared with.

    known: its best known hypervolume. stored: its baselines.
    """
    reference = "chosen from the first random trials" if task.reference_point is None else _point(task.reference_point)
    console.print(Text(task.name, style="bold") + Text(f": {task.description}"))
    console.print(f"  {len(task.targets)} targets [m]: " + " ".join(_point(target) for target in task.targets))
    for words in describe_targets(task.target_specs):
        console.print(Text(f"  {words}"))
    if task.restarts:
        console.print(f"  {task.restarts + 1} starts of the inverse kinematics at each")
    if task.objectives is not None:
        console.print(f"  objectives: {', '.join(task.objectives)}")
    if task.constraints:
        console.print(f"  constraints: {', '.join(task.constraints)}")
    if task.payloads.any():
        console.print(f"  payload [kg]: {', '.join(f'{kg:g}' for kg in np.atleast_1d(task.payload))}")
    if task.cases_description:
        console.print(f"  the worst counts of this, {task.cases_description}")
    for obstacle in task.obstacles:
        console.print(f"  obstacle: {obstacle.describe()}")
    if task.straight_moves:
        listed = ", ".join(f"{start + 1} to {end + 1}" for start, end in task.straight_moves.pairs)
        timed = ""
        if task.move_time is not None:
            timed = f"; in {', '.join(f'{time:g}' for time in np.atleast_1d(task.move_time))} s"
        console.print(f"  straight moves between targets: {listed}; a step of {1e3 * task.move_step:g} mm{timed}")
    for region in task.workspace:
        console.print(f"  workspace: {region.describe()}")
    console.print(f"  reference point: {reference}")
    console.print(f"  provenance: {task.provenance}")
    if known is not None:
        console.print(f"  best known hypervolume: {known:.2f}")
    for baseline in stored:
        console.print(
            f"  {baseline.method}, {baseline.runs} runs of 200 counted trials: E_hv {baseline.e_hv:.2f} (σ_hv "
            f"{baseline.sigma_hv:.2f}), at the end {baseline.final:.2f}, {baseline.share:.1%} of the best known"
        )


def show_draft(console: Console, draft: Draft) -> None:
    """What came of somebody's words, what was assumed, and what to do next."""
    show_task(console, draft.task, None, ())
    if draft.space is None:
        console.print("the default design space fits; no space file is needed")
    else:
        console.print("design space, otherwise the default:")
        console.print(textwrap.indent(draft.space_body, "  "), end="")
    console.print(
        "assumed:" if draft.assumed else f"{draft.by} names nothing that it assumed; look for it all the more"
    )
    for line in draft.assumed:
        console.print(f"  - {line}")
    account = draft.account
    cost = "cost not known" if account.cost_usd is None else f"{account.cost_usd:.4f} USD"
    console.print(
        f"{draft.by}: {account.calls} {'call' if account.calls == 1 else 'calls'}, {account.input_tokens:,} tokens in, "
        f"{account.output_tokens:,} out, {cost}, {account.seconds:.1f} s"
    )
    console.print(f"wrote {' and '.join(map(str, draft.files))}: a draft. Check the numbers, edit it, then run:")
    console.print(f"  armwright tasks {shlex.quote(str(draft.files[0]))}\n  {draft.command}")


def show_arms(console: Console, comparison: ArmComparison, drawn: Sequence[Path]) -> None:
    """Arms that exist beside designs, and what was chosen for them."""
    objectives, space = comparison.problem.objectives, comparison.problem.space
    others = [o for o in objectives if o not in MEASURES and o.name != "mass"]
    title = f"Arms on {comparison.problem.task.name}{_payload_note(comparison.problem.task)}"
    table = Table(title=title, title_justify="left", box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("\narm", no_wrap=True)
    measured = [_ARM_COLUMNS[objective.name] for objective in MEASURES]
    for name in ("\njoints", "reach\nm", "mass\nkg", *measured, *(f"{o.name}\n{o.unit}" for o in others)):
        table.add_column(Text(name), justify="right", no_wrap=True)
    for arm in (*comparison.arms, *comparison.designs):
        values = dict(zip((objective.name for objective in objectives), arm.values, strict=True))
        numbers = [*arm.measures.values(), *(values[objective.name] for objective in others)]
        told = ["-" if value is None else _measure(value) for value in numbers]
        table.add_row(arm.name, str(arm.joints), f"{arm.reach:.2f}", f"{arm.mass:.3g}", *told)
    console.print(table)
    console.print(
        f"torque = {TORQUE_SCALE:g} x the sum over the targets of |joint torques|, by each arm's own masses; torque "
        "util. = the largest share of a joint's effort limit"
    )
    if comparison.designs and space.is_toy:
        console.print(f"the designs have toy masses ({space.mass_note}); torques compare only with real ones (`mass:`)")
    if comparison.positions:
        within = " x ".join(f"[{low:g}, {high:g}]" for low, high in (space.origin_x, space.origin_y, space.origin_z))
        console.print(
            f"bases: {comparison.positions:,} positions tried for each arm in {within} m, for the least miss, then the "
            "least torque; --base x,y,z gives one"
        )
    names = ", ".join(objective.name for objective in objectives)
    for arm in comparison.arms:
        broken = f"; violates {', '.join(arm.violated)}" if arm.violated else ""
        stands = (
            broken
            if comparison.run is None or arm.violated
            else f"; {_standing_words(arm, comparison.front)} ({names})"
        )
        console.print(f"{arm.name}: base at {_point(tuple(round(value, 4) for value in arm.base))} m{stands}")
        for note in arm.notes:
            console.print(f"  {note}")
    if drawn:
        console.print(f"drawn anew: {', '.join(map(str, drawn))}")


_ARM_COLUMNS = {
    "position_error": "error\nm",
    "torque": "\ntorque",
    "worst_error": "worst\nm",
    "unreached_targets": "targets\nunreached",
    "peak_torque": "peak\nN m",
    "torque_utilisation": "torque\nutil.",
}


def _measure(value: float) -> str:
    return f"{value:,.0f}" if value >= 1e4 else f"{value:.3g}" if value >= 0.0095 or value == 0.0 else f"{value:.1e}"


def _standing_words(arm: ComparedArm, front: int) -> str:
    if arm.dominates is None:
        return "not comparable with the front"
    return f"dominates {arm.dominates} of the {front} designs of the front, dominated by {arm.dominated_by}"


class _Console(Console):
    """Says where nobody reads any more, as any stream does; rich would end the process without a word."""

    def on_broken_pipe(self) -> None:
        raise BrokenPipeError


def stdout_console() -> Console:
    """Words on stdout, as plain text where stdout is no terminal."""
    return _Console(highlight=False, markup=False, emoji=False, soft_wrap=True)


def stderr_console() -> Console:
    """Words on stderr, where stdout is for a program."""
    return _Console(stderr=True, highlight=False, markup=False, emoji=False, soft_wrap=True)


def _obstacle_note(problem: Problem) -> str:
    """That a task's obstacles count for nothing, where that is so."""
    if not problem.task.obstacles or problem.uses(*OF_CLEARANCE):
        return ""
    return "; the task's obstacles count in none of the objectives (collision and clearance_shortfall heed them)"


def _move_note(problem: Problem) -> str:
    """That a task's moves count for nothing, where that is so."""
    if not problem.task.straight_moves or problem.uses(*OF_MOVES):
        return ""
    names = ", ".join(objective.name for objective in OF_MOVES)
    return f"; the task's moves count in none of the objectives (these heed them: {names})"


def _workspace_note(problem: Problem) -> str:
    """That a task's workspace counts for nothing, where that is so."""
    if not problem.task.workspace or problem.uses(UNCOVERED_FRACTION):
        return ""
    return "; the task's workspace counts in none of the objectives (uncovered_fraction heeds it)"


def _payload_note(task: DesignTask) -> str:
    """What the tip carries; empty where that is nothing."""
    payloads = task.payloads
    if not payloads.any():
        return ""
    low, high = payloads.min(), payloads.max()
    return f"; payload {low:g} kg" if low == high else f"; payloads {low:g} to {high:g} kg"


def _base_words(member: FrontMember) -> str:
    return " ".join(f"{value:5.2f}" for value in member.design.origin)


def _link_words(member: FrontMember) -> str:
    return " ".join(f"{value:.2f}" for value in member.design.links)


def _front_table(history: History, solid: set[int] | None) -> Table:
    title = f"Pareto front of {history.problem.task.name}"
    table = Table(title=title, title_justify="left", box=None, pad_edge=False, padding=(0, 1, 0, 0))
    verdict = () if solid is None else ("verdict",)
    objectives = [SHORT.get(o, o.name.replace("_", " ")) for o in history.problem.objectives]
    places = ("base [m]", "links [m]") if len(objectives) <= MOST_WITH_PLACES else ()
    for name in ("#", "source", *verdict, *objectives, "joints", *places):
        justify = "right" if name in ("#", *objectives) else "left"
        table.add_column(Text(name), justify=justify, no_wrap=name != "links [m]")
    reference = history.reference_point or (math.inf,) * len(objectives)
    inside = [m for m in history.front if all(np.less(m.values, reference))] or history.front
    shown: list[int] = np.unique(np.linspace(0, len(inside) - 1, MOST_ROWS).round().astype(int)).tolist()
    for member in (inside[i] for i in shown):
        table.add_row(
            str(member.number),
            member.source,
            *(() if solid is None else ("solid" if member.number in solid else "fragile",)),
            *map(_value, member.values),
            member.design.joints,
            *((_base_words(member), _link_words(member)) if places else ()),
        )
    left_out = len(history.front) - len(shown)
    if left_out:
        beyond = len(history.front) - len(inside)
        table.caption = f"and {left_out} more" + (f", {beyond} of them beyond the reference point" if beyond else "")
        table.caption_justify = "left"
    return table


def _credit_table(credit: dict[str, dict[str, Any]]) -> Table:
    """Who found what. Black-box runs go without it: of their two sources one is only the beginning."""
    table = Table(title="Who found what", title_justify="left", box=None, pad_edge=False)
    table.add_column("source")
    for name in ("trials", "on the front", "hypervolume gained"):
        table.add_column(name, justify="right", no_wrap=True)
    for source, brought in credit.items():
        gained = f"{brought['hypervolume_gained']:.3f}"
        table.add_row(source, str(brought["trials"]), str(brought["front"]), gained)
    return table


def _show_proposer(console: Console, proposer: dict[str, Any] | None) -> None:
    if proposer is None:
        return
    if proposer["model"] is not None:
        cost = "cost not known" if proposer["cost_usd"] is None else f"{proposer['cost_usd']:.4f} USD"
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
            f"FLAGGED: {proposer['fallback_share']:.0%} of the proposals failed; this run does not stand for its "
            "proposer, and is kept out of its row in tables"
        )
    if proposer.get("differing_prompts"):
        console.print(
            f"replay: the prompts of {proposer['differing_prompts']} proposals differ from the recorded ones; "
            "--replay-strict makes that an error"
        )
    overlap = proposer["overlap"]
    if overlap is not None:
        age = overlap["feedback_age"]
        feedback = "" if age is None else f"; feedback {age['mean']:.1f} trials old on average, {age['max']} at most"
        console.print(
            f"overlap: {overlap['ratio']:.1%} of the trials were proposals (planned: "
            f"{overlap['ratio_planned']:.1%}){feedback}"
        )


def _seconds(seconds: dict[str, float]) -> str:
    parts = ", ".join(f"{part} {seconds[part]:.1f}" for part in ("sampling", "evaluation", "proposing"))
    return f"{seconds['total']:.1f} s ({parts})"


def _value(value: float) -> str:
    return f"{value:.3f}" if value >= 0.0095 or value == 0.0 else f"{value:.1e}"


def _point(point: Sequence[float]) -> str:
    return "(" + ", ".join(f"{value:g}" for value in point) + ")"


def _state(progress: StudyProgress) -> str:
    volume = "-" if progress.hypervolume is None else f"{progress.hypervolume:.3f}"
    faults = sum(progress.faults.values())
    failed = f"  failed {faults}" if faults else ""
    return f"hypervolume {volume}  front {progress.front_size}{failed}"


def _note(progress: StudyProgress) -> str:
    """What the user should be told beside the numbers; empty where that is nothing, or was told before."""
    if progress.fault and progress.note:
        return f"trial {progress.number}: no usable proposal ({progress.note}); a black-box trial took its place"
    return progress.note


@contextmanager
def searching(console: Console) -> Generator[Callable[[FrontProgress], None]]:
    """A live line in a terminal, a plain line every so often elsewhere."""
    if not console.is_terminal:
        yield _plain_search(console)
        return
    columns = (TextColumn("{task.fields[state]}"), BarColumn(24))
    with Progress(*columns, console=console) as bar:
        line = bar.add_task("", total=1.0, state="starting")

        def watch(progress: FrontProgress) -> None:
            bar.update(line, completed=_spent(progress), state=_search_state(progress))

        yield watch


def _plain_search(console: Console) -> Callable[[FrontProgress], None]:
    told = 0.0  # share of the budget

    def watch(progress: FrontProgress) -> None:
        nonlocal told
        if _spent(progress) >= told:
            console.print(_search_state(progress))
            console.file.flush()
            told = _spent(progress) + 0.1

    return watch


def _spent(progress: FrontProgress) -> float:
    """The share of the budget, at most 1."""
    budget = progress.budget
    shares = [progress.evaluations / (budget.evaluations or math.inf), progress.seconds / (budget.seconds or math.inf)]
    return min(1.0, max(shares))


def _search_state(progress: FrontProgress) -> str:
    return (
        f"{progress.evaluations:9,} evaluations  {progress.seconds:6.1f} s  hypervolume {progress.hypervolume:.3f}  "
        f"front {progress.front_size}"
    )


def _plain(console: Console) -> Watch:
    started = time.perf_counter()

    def watch(progress: StudyProgress) -> None:
        if note := _note(progress):
            console.print(note)
        done = progress.iteration
        if progress.doing == "finished" and done > 0 and (done % EVERY == 0 or done == progress.n_total):
            spent = time.perf_counter() - started
            console.print(f"iteration {done}/{progress.n_total}  {_state(progress)}  {progress.source}  {spent:.1f} s")
            console.file.flush()

    return watch


class _TimeLeft(ProgressColumn):
    """The time left at the pace of this session's trials."""

    def render(self, task: Task) -> Text:
        left = task.time_remaining
        return Text("" if left is None else f"{left // 60:.0f}:{left % 60:02.0f} left")


@contextmanager
def _live(console: Console) -> Generator[Watch]:
    bar_columns = [BarColumn(24)] if console.width >= 100 else []
    columns = (
        TextColumn("{task.fields[count]}", table_column=Column(no_wrap=True)),
        *bar_columns,
        TextColumn("{task.fields[state]}", table_column=Column(no_wrap=True)),
        _TimeLeft(table_column=Column(no_wrap=True)),
    )
    with Progress(*columns, console=console, transient=False) as bar:
        line = bar.add_task("", total=None, count="starting", state="")

        def watch(progress: StudyProgress) -> None:
            if note := _note(progress):
                console.print(note)
            asking = f"asking {progress.source} …"
            doing = {"proposing": asking, "paused": "paused"}.get(progress.doing, progress.source)
            if progress.under_way:
                doing += f"  {progress.under_way} asked"
            bar.update(
                line,
                total=progress.n_total,
                completed=progress.iteration,
                count=f"iteration {progress.iteration}/{progress.n_total}",
                state=f"{_state(progress)}  {doing}",
            )

        yield watch
