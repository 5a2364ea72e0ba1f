"""Tables of a comparison: Markdown to read, CSV and JSON for programs, and the paper's table in LaTeX."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any, cast

import numpy as np

from armwright.experiments.compare_runs import LEVELS, Comparison, Contrast, MethodResult
from armwright.experiments.latex import latex_table
from armwright.experiments.run_record import RunSummary, shares_by_source
from armwright.experiments.statistics import Interval, PairedTest, can_reject, least_p
from armwright.files import naming_write_errors, replace_file, to_csv
from armwright.runs.history import source_label
from armwright.text import decimals, percent

WIDE = 4  # up to this many tasks, each has a column, as in the paper
BIASES = {
    "lengths_5_cm": "5 cm",
    "lengths_1_cm": "1 cm",
    "base_on_symmetry_plane": "in plane",
    "equal_neighbours": "equal neighbours",
}
TEST_COLUMNS = ("better", "effect", "p", "p (Holm)")
_INTERVALS = ("e_hv", "final", "share_of_best_known", "difference", "ratio")  # fields


@dataclass(frozen=True)
class Table:
    """A table of a comparison, to read and as records."""

    name: str  # of its CSV file, and its key in JSON; empty if another table has the same records
    records: Sequence[dict[str, Any]]  # with the same keys and all digits
    title: str = ""
    caption: str = ""  # the meaning of its numbers
    head: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()


def write_tables(place: Path, comparison: Comparison, title: str, notes: Sequence[str] = ()) -> list[Path]:
    """Write table.md, table.tex and a CSV file of each table; return the paths, table.md first.

    Only runs.csv holds measured times and folders: equal runs give equal bytes in all other files.

    notes: further remarks, such as missing cells.
    """
    files = {"table.md": markdown(comparison, title, notes), "table.tex": latex(comparison)}
    files |= {f"{table.name}.csv": to_csv(table.records) for table in tables(comparison) if table.name}
    for name, text in files.items():
        with naming_write_errors(place / name, "; the runs are safe"):
            place.mkdir(parents=True, exist_ok=True)
            replace_file(place / name, text.encode())
    return [place / name for name in files]


def markdown(comparison: Comparison, title: str, notes: Sequence[str] = ()) -> str:
    """Return the whole comparison as Markdown."""
    remarks = [*remarks_on(comparison), *notes]
    parts = [
        f"# {title}",
        *(f"## {one.title}\n\n{one.caption}\n\n{_lines(one.head, one.rows)}" for one in sections(comparison)),
        *(["## Notes\n\n" + "\n".join(f"- {note}" for note in remarks)] if remarks else []),
    ]
    return "\n\n".join(parts) + "\n"


def latex(comparison: Comparison) -> str:
    """Return the paper's table, E_hv (σ_hv) of each method and task, in LaTeX (booktabs)."""
    published = comparison.published
    remarks = [f"published: {published.source}"] if published.values and published.source else []
    return latex_table(*_paper_table(comparison), [*remarks, *remarks_on(comparison)])


def sections(comparison: Comparison) -> list[Table]:
    """Return the tables that have rows to read."""
    return [table for table in tables(comparison) if table.rows]


def tables(comparison: Comparison) -> list[Table]:
    """Return all tables of a comparison."""
    return [
        _methods(comparison),
        _finals(comparison),
        _overall(comparison),
        _contrasts(comparison),
        _times(comparison),
        _sources(comparison),
        _proposers(comparison),
        Table("runs", [_run_record(comparison, run) for run in (*comparison.runs, *comparison.excluded)]),
    ]


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


def _methods(comparison: Comparison) -> Table:
    """Return the paper's table, with published values if there are any."""
    caption = (
        "Mean hypervolume E_hv over the counted trials and the runs. In brackets σ_hv: the mean over the trials of the "
        "standard deviation over the runs (ddof = 0). Bold: the largest E_hv of the methods with most runs on a task."
    )
    published = comparison.published
    if published.source and published.values:
        caption += f" Published: {published.source}."
    records: list[dict[str, Any]] = []
    for row in comparison.rows:
        e_hv, sigma_hv = published.values.get((row.method, row.task), (None, None))
        records.append(
            {"task": row.task, "method": row.method, "runs": len(row.seeds)}
            | _record(row)
            | {
                "best_known": comparison.best_known(row.task),
                "published_e_hv": e_hv,
                "published_sigma_hv": sigma_hv,
                "scripted": any(run.is_scripted for run in comparison.runs_of(row.method, row.task)),
            }
        )
    return Table("table", records, "Hypervolume over the trials", caption, *_paper_table(comparison))


def _paper_table(comparison: Comparison) -> tuple[list[str], list[list[str]]]:
    """Return head and rows of E_hv (σ_hv): a row for each method, and one for its published values."""
    rows: list[list[str]] = []
    for method in comparison.methods:
        own = [row for row in comparison.rows if row.method == method and row.e_hv is not None]
        if own:
            cells = [_paper_cell(comparison, method, task) for task in comparison.tasks]
            rows.append([comparison.label(method), _seeds_of(own), *cells])
        stated = [comparison.published.values.get((method, task)) for task in comparison.tasks]
        if any(stated):
            cells = ["–" if pair is None else f"{pair[0]:.2f} ({pair[1]:.2f})" for pair in stated]
            rows.append([f"{method}, published", "–", *cells])
    if len(comparison.tasks) <= WIDE or not rows:
        return ["method", "seeds", *comparison.tasks], rows
    head, *turned = map(list, zip(["task", "seeds", *comparison.tasks], *rows, strict=True))
    return head, turned


def _paper_cell(comparison: Comparison, method: str, task: str) -> str:
    """Return E_hv (σ_hv), bold if it is the largest E_hv of several methods with as many runs as any."""
    of_task = {row.method: row for row in comparison.rows if row.task == task and row.e_hv is not None}
    if method not in of_task:
        return "–"
    most = max(len(row.seeds) for row in of_task.values())
    rivals = {name: row.e_hv.mean for name, row in of_task.items() if row.e_hv and len(row.seeds) == most}
    e_hv, sigma_hv = of_task[method].e_hv, of_task[method].sigma_hv
    text = decimals(e_hv and e_hv.mean) + ("" if sigma_hv is None else f" ({sigma_hv:.2f})")
    is_best = len(rivals) > 1 and rivals.get(method) == max(rivals.values())
    return f"**{text}**" if is_best else text


def _seeds_of(results: Sequence[MethodResult]) -> str:
    """Return the seeds of a method's results on several tasks."""
    text = _format_seeds(sorted({seed for row in results for seed in row.seeds}))
    return text if len({row.seeds for row in results}) == 1 else f"{text}; fewer on some tasks"


def _finals(comparison: Comparison) -> Table:
    """Return the table of final hypervolumes."""
    caption = (
        "Mean over the runs, with 95 % bootstrap intervals. Share: relative to the best known hypervolume of the task."
    )
    rows: list[list[str]] = []
    for task, results in groupby(comparison.rows, lambda row: row.task):
        for row in results:
            share = _format(row.share_of_best_known, lambda value: percent(value, 1))
            rows.append([task, comparison.label(row.method), str(len(row.seeds)), _format(row.final), share])
        if (known := comparison.best_known(task)) is not None:
            rows.append([task, "best known front", "", decimals(known), "100 %"])
    head = ["task", "method", "runs", "hypervolume at the end", "share"]
    return Table("", [], "At the end", caption, head, rows)


def _overall(comparison: Comparison) -> Table:
    """Return the table over all tasks; empty if there are too few."""
    caption = (
        "Ratio of a method's E_hv to that of another one; every task counts once. Mean with its 95 % bootstrap "
        "interval over the tasks. Two-sided Wilcoxon signed-rank test of the logarithms over the tasks, corrected for "
        "the number of comparisons (Holm)."
    )
    found = comparison.overall
    rows = [_contrast_cells(comparison, over, _format(over.ratio, lambda value: f"{value:.3f}"))[1:] for over in found]
    head = ["method", "against", "ratio", *TEST_COLUMNS]
    return Table("overall", list(map(_record, found)), "Over all tasks", caption, head, rows)


def _contrasts(comparison: Comparison) -> Table:
    """Return the table of paired tests."""
    caption = (
        "E_hv of a method minus that of another one, paired by seed: mean difference with its 95 % bootstrap interval. "
        "Two-sided Wilcoxon signed-rank test, corrected for the number of comparisons (Holm). "
        "Effect: matched-pairs rank-biserial correlation."
    )
    if comparison.is_undecidable:
        most = max(contrast.test.n for contrast in comparison.contrasts if not can_reject(contrast.test.n))
        caption += (
            "\n\n**With fewer than six seeds, no test can reject at 5 %**, so no p is shown for them (the smallest p "
            f"of {most} {'pair' if most == 1 else 'pairs'} is {least_p(most):.4g})."
        )
    found = comparison.contrasts
    rows = [
        _contrast_cells(comparison, one, _format(one.test.difference, lambda value: f"{value:+.2f}")) for one in found
    ]
    head = ["task", "method", "against", "difference", *TEST_COLUMNS]
    return Table("contrasts", list(map(_record, found)), "Differences", caption, head, rows)


def _contrast_cells(comparison: Comparison, one: Contrast, size: str) -> list[str]:
    test, p_holm = one.test, one.p_holm
    ps = ("–", "–") if p_holm is None else (f"{p:.4f}" if p >= 1e-4 else f"{p:.1e}" for p in (test.p, p_holm))
    names = [one.task, comparison.label(one.method), comparison.label(one.baseline)]
    return [*names, size, f"{test.better} of {test.n}", f"{test.effect:+.2f}", *ps]


def _times(comparison: Comparison) -> Table:
    """Return the table of trials needed to reach shares of the best known hypervolume."""
    caption = (
        "Counted trials needed to reach a share of the best known hypervolume (if none is known, of the best of these "
        "runs): median over the runs. In brackets: the number of runs that reached it."
    )
    rows = [
        [
            task,
            comparison.label(method),
            *(f"{decimals(time.median_trials, 0)} ({time.reached} of {time.runs})" for time in times),
        ]
        for (task, method), times in groupby(comparison.times, lambda time: (time.task, time.method))
    ]
    head = ["task", "method", *(f"{level:.0%}" for level in LEVELS)]
    return Table("time-to", list(map(_record, comparison.times)), "Trials to a hypervolume", caption, head, rows)


def _sources(comparison: Comparison) -> Table:
    """Return the table of who found the front and the hypervolume."""
    caption = (
        "Share of the final front that was found by each source. In brackets: the share of the final hypervolume that "
        "its designs added when they were evaluated. Means over the runs."
    )
    found = [(task, method, shares_by_source(runs)) for task, method, runs in _groups(comparison)]
    records: list[dict[str, Any]] = [
        {"task": task, "method": method, "source": source, **share}
        for task, method, shares in found
        for source, share in shares.items()
    ]
    sources = list(dict.fromkeys(record["source"] for record in records))
    rows: list[list[str]] = []
    for task, method, shares in found:
        cells = (shares.get(source) for source in sources)
        texts = ("–" if cell is None else f"{percent(cell['front'])} ({percent(cell['gained'])})" for cell in cells)
        if shares:
            rows.append([task, comparison.label(method), *texts])
    return Table("sources", records, "Front by source", caption, ["task", "method", *map(source_label, sources)], rows)


def _proposers(comparison: Comparison) -> Table:
    """Return the table of the proposals and their biases."""
    caption = (
        "Means over the runs. 5 cm, 1 cm: designs whose link lengths are all multiples of it. In plane: bases on a "
        "symmetry plane of the targets. Equal neighbours: pairs of consecutive joints with one type. In brackets: the "
        "black box."
    )
    records: list[dict[str, Any]] = [
        {"task": task, "method": method, **_proposer_means(proposing)}
        for task, method, runs in _groups(comparison)
        if (proposing := [run for run in runs if run.proposer])
    ]
    rows = [
        [
            record["task"],
            comparison.label(record["method"]),
            decimals(record["proposals"], 0),
            *(f"{percent(record[bias])} ({percent(record[f'black_box_{bias}'])})" for bias in BIASES),
            decimals(record["calls"], 0),
            decimals(record["cost_usd"], 4),
        ]
        for record in records
    ]
    head = ["task", "method", "proposals", *BIASES.values(), "calls", "USD"]
    return Table("proposers", records, "Proposals", caption, head, rows)


def _proposer_means(runs: Sequence[RunSummary]) -> dict[str, Any]:
    each: list[dict[str, Any]] = []
    for run in runs:
        summary, proposer = run.summary, run.proposer
        found: dict[str, Any] = {
            "proposals": summary["attribution"].get(proposer["name"], {"trials": 0})["trials"],
            "calls": proposer["calls"],
            "failures": sum(proposer["failures"].values()),
            "tokens": proposer["tokens"],
            "cost_usd": proposer["cost_usd"],
        }
        for prefix, who in (("", "proposer"), ("black_box_", "black_box")):
            found |= {f"{prefix}{bias}": (summary["proposer_bias"][who] or {}).get(bias) for bias in BIASES}
        each.append(found)
    known = {key: [found[key] for found in each if found[key] is not None] for key in each[0]}
    return {"runs": len(runs)} | {key: float(np.mean(values)) if values else None for key, values in known.items()}


def _run_record(comparison: Comparison, run: RunSummary) -> dict[str, Any]:
    known = comparison.best_known(run.task) if run.task in comparison.tasks else None
    return {
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


def _groups(comparison: Comparison) -> Iterator[tuple[str, str, list[RunSummary]]]:
    """Yield the runs by task and method."""
    for task in comparison.tasks:
        for method in comparison.methods:
            yield task, method, comparison.runs_of(method, task)


def _record(result: object) -> dict[str, Any]:
    """Return a result as a flat record: intervals and tests become several fields, seeds a text."""
    record: dict[str, Any] = {}
    for name, value in vars(result).items():
        if isinstance(value, PairedTest):
            record |= _record(value)
        elif isinstance(value, tuple):
            record[name] = _format_seeds(cast("tuple[int, ...]", value))
        elif name in _INTERVALS:
            low, high = (value.low, value.high) if value else (None, None)
            record |= {name: value and value.mean, f"{name}_low": low, f"{name}_high": high}
        else:
            record[name] = value
    if isinstance(result, Contrast) and result.p_holm is None:
        record["p"] = None  # too few pairs
    return record


def _format(value: Interval | None, write: Callable[[float], str] = decimals) -> str:
    """Return a mean and its interval; of a single value, the value alone."""
    if value is None:
        return "–"
    unit = " %" if write(value.mean).endswith(" %") else ""
    low, high = (write(end).removesuffix(unit) for end in (value.low, value.high))
    return write(value.mean) if value.low == value.high else f"{write(value.mean)} [{low}, {high}]"


def _format_seeds(seeds: Sequence[int]) -> str:
    """Return ascending seeds as text, three or more in a row as a range."""
    parts: list[str] = []
    for _, group in groupby(enumerate(seeds), key=lambda pair: pair[1] - pair[0]):
        run = [seed for _, seed in group]
        parts += [f"{run[0]} to {run[-1]}"] if len(run) > 2 else map(str, run)
    return ", ".join(parts)


def _lines(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table whose columns also line up in plain text."""
    cells = [[text.replace("|", "\\|") for text in row] for row in (head, *rows)]
    columns: list[list[str]] = []
    for name, *others in zip(*cells, strict=True):
        width = max(3, len(name), *map(len, others))
        columns.append([f"{text:<{width}}" for text in (name, "-" * width, *others)])
    return "\n".join(f"| {' | '.join(row)} |" for row in zip(*columns, strict=True))
