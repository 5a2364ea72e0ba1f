"""Tables of a comparison: records with all digits for programs, and columns of text in Markdown to read."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from armwright.experiments.compare_runs import Comparison, Contrast, MethodResult
from armwright.experiments.run_record import RunSummary, shares_by_source
from armwright.experiments.statistics import can_reject, least_p
from armwright.files import naming_write_errors, replace_file, to_csv
from armwright.runs.history import source_label
from armwright.text import decimals, percent

WIDE = 4  # up to this many tasks, each has a column, as in the paper
BIASES = "lengths_5_cm lengths_1_cm base_on_symmetry_plane equal_neighbours"
INTERVALS = ("e_hv", "final", "share_of_best_known", "difference", "ratio")  # fields, each with its two ends
HEADS = {  # if they are not the keys in words
    "final": "hypervolume at the end",
    "share_of_best_known": "share",
    "baseline": "against",
    "n": "pairs",
    "p_holm": "p (Holm)",
    "gained": "hypervolume",
    "lengths_5_cm": "5 cm",
    "lengths_1_cm": "1 cm",
    "base_on_symmetry_plane": "in plane",
    "cost_usd": "USD",
}
Record = dict[str, Any]


def _p(p: float | None) -> str:
    return "–" if p is None else f"{p:.4f}" if p >= 1e-4 else f"{p:.1e}"


WRITE: Mapping[str, Callable[[Any], str]] = {  # texts of values, by key
    **dict.fromkeys(("final", "best_known"), decimals),
    **dict.fromkeys(("trials", "proposals", "calls"), partial(decimals, places=0)),
    **dict.fromkeys(("front", "gained", *BIASES.split()), percent),
    **dict.fromkeys(("difference", "effect"), "{:+.2f}".format),
    **dict.fromkeys(("p", "p_holm"), _p),
    "share_of_best_known": partial(percent, places=1),
    "ratio": "{:.3f}".format,
    "cost_usd": partial(decimals, places=4),
    "source": source_label,
}
TESTED = "n better effect p p_holm"


@dataclass(frozen=True)
class Table:
    """A table of a comparison, as records and to read."""

    name: str  # of its CSV file, and its key in JSON; empty if another table has the same records
    records: Sequence[Record]  # with the same keys and all digits
    title: str = ""
    caption: str = ""  # the meaning of its numbers
    head: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()


def write_tables(place: Path, comparison: Comparison, title: str, notes: Sequence[str] = ()) -> list[Path]:
    """Write table.md and a CSV file of each table; return the paths, table.md first.

    Only runs.csv holds measured times and folders: equal runs give equal bytes in all other files. The notes are
    further remarks, such as missing cells.
    """
    files = {"table.md": markdown(comparison, title, notes)}
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


def sections(comparison: Comparison) -> list[Table]:
    """Return the tables that have rows to read."""
    return [table for table in tables(comparison) if table.rows]


def tables(comparison: Comparison) -> list[Table]:
    """Return the tables of a comparison."""
    results = [_result_record(comparison, row) for row in comparison.rows]
    overall, contrasts = (_contrast_records(comparison, of) for of in (comparison.overall, comparison.contrasts))
    sources, proposals = list(_source_records(comparison)), list(_proposer_records(comparison))
    differences = _contrast_caption(comparison)
    return [
        _paper_table(comparison, results),
        _table("", "At the end", FINAL, results, "task method runs final share_of_best_known best_known"),
        _table("overall", "Over all tasks", OVERALL, overall, f"method baseline ratio {TESTED}"),
        _table("contrasts", "Differences", differences, contrasts, f"task method baseline difference {TESTED}"),
        _table("sources", "Front by source", SOURCES, sources, "task method source trials front gained"),
        _table("proposers", "Proposals", PROPOSALS, proposals, f"task method proposals {BIASES} calls cost_usd"),
        Table("runs", [_run_record(comparison, run) for run in (*comparison.runs, *comparison.excluded)]),
    ]


def _table(name: str, title: str, caption: str, records: Sequence[Record], shown: str) -> Table:
    """Return a table with a row for each record; shown: its keys with spaces."""
    keys = shown.split()
    head = [HEADS.get(key, key.replace("_", " ")) for key in keys]
    return Table(name, records, title, caption, head, [[_text(record, key) for key in keys] for record in records])


def _text(record: Record, key: str) -> str:
    """Return the text of a value; of a mean with its interval, if that is wider; with that of the black box, if any."""
    write = WRITE.get(key, str)
    text = write(record[key])
    low, high = record.get(f"{key}_low"), record.get(f"{key}_high")
    if low != high:
        unit = " %" if text.endswith(" %") else ""
        return f"{text} [{write(low).removesuffix(unit)}, {write(high).removesuffix(unit)}]"
    return f"{text} ({write(record[f'black_box_{key}'])})" if f"black_box_{key}" in record else text


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


FINAL = "Mean over the runs, with 95 % bootstrap intervals. Share: relative to the best known hypervolume of the task."
OVERALL = (
    "Ratio of a method's E_hv to that of another one; every task counts once. Mean with its 95 % bootstrap "
    "interval over the tasks. Two-sided Wilcoxon signed-rank test of the logarithms over the tasks, corrected for "
    "the number of comparisons (Holm)."
)
SOURCES = (
    "Share of the final front that was found by each source, and share of the final hypervolume that its designs "
    "added when they were evaluated. Means over the runs."
)
PROPOSALS = (
    "Means over the runs. 5 cm, 1 cm: designs whose link lengths are all multiples of it. In plane: bases on a "
    "symmetry plane of the targets. Equal neighbours: pairs of consecutive joints with one type. In brackets: the "
    "black box."
)


def _contrast_caption(comparison: Comparison) -> str:
    caption = (
        "E_hv of a method minus that of another one, paired by seed: mean difference with its 95 % bootstrap interval. "
        "Two-sided Wilcoxon signed-rank test, corrected for the number of comparisons (Holm). "
        "Effect: matched-pairs rank-biserial correlation."
    )
    few = [contrast.test.n for contrast in comparison.contrasts if not can_reject(contrast.test.n)]
    if few:
        caption += (
            "\n\n**With fewer than six seeds, no test can reject at 5 %**, so no p is shown for them (the smallest p "
            f"of {max(few)} {'pair' if max(few) == 1 else 'pairs'} is {least_p(max(few)):.4g})."
        )
    return caption


def _paper_table(comparison: Comparison, records: Sequence[Record]) -> Table:
    """Return the paper's table: a row for each method, E_hv (σ_hv) by task, and one for its published values."""
    caption = (
        "Mean hypervolume E_hv over the counted trials and the runs. In brackets σ_hv: the mean over the trials of the "
        "standard deviation over the runs (ddof = 0). Bold: the largest E_hv of the methods with most runs on a task."
    )
    if comparison.published and comparison.published_in:
        caption += f" Published: {comparison.published_in}."
    rows: list[list[str]] = []
    for method in comparison.methods:
        label = comparison.label(method)
        own = {row["task"]: row for row in records if row["method"] == label and row["e_hv"] is not None}
        if own:
            cells = [_paper_cell(records, own[task]) if task in own else "–" for task in comparison.tasks]
            seeds = list(dict.fromkeys(row["seeds"] for row in own.values()))
            rows.append([label, seeds[0] if len(seeds) == 1 else "differ by task", *cells])
        stated = [comparison.published.get((method, task)) for task in comparison.tasks]
        if any(stated):
            cells = ["–" if pair is None else f"{pair[0]:.2f} ({pair[1]:.2f})" for pair in stated]
            rows.append([f"{method}, published", "–", *cells])
    head = ["method", "seeds", *comparison.tasks]
    if len(comparison.tasks) > WIDE and rows:
        head, *rows = map(list, zip(["task", "seeds", *comparison.tasks], *rows, strict=True))
    return Table("table", records, "Hypervolume over the trials", caption, head, rows)


def _paper_cell(records: Sequence[Record], own: Record) -> str:
    """Return E_hv (σ_hv), bold if it is the largest E_hv of several methods with as many runs as any."""
    of_task = [row for row in records if row["task"] == own["task"] and row["e_hv"] is not None]
    most = max(row["runs"] for row in of_task)
    rivals = [row["e_hv"] for row in of_task if row["runs"] == most]
    text = decimals(own["e_hv"]) + ("" if own["sigma_hv"] is None else f" ({own['sigma_hv']:.2f})")
    is_best = len(rivals) > 1 and own["runs"] == most and own["e_hv"] == max(rivals)
    return f"**{text}**" if is_best else text


def _flat(result: MethodResult | Contrast) -> Record:
    """Return a result without parts: of an interval its mean and its two ends."""
    record: Record = {}
    values = asdict(result)
    for name, value in (values | values.pop("test", {})).items():
        if name in INTERVALS:
            ends = value or {"mean": None, "low": None, "high": None}
            record |= {name: ends["mean"], f"{name}_low": ends["low"], f"{name}_high": ends["high"]}
        else:
            record[name] = value
    return record


def _result_record(comparison: Comparison, row: MethodResult) -> Record:
    e_hv, sigma_hv = comparison.published.get((row.method, row.task), (None, None))
    return _flat(row) | {
        "method": comparison.label(row.method),
        "runs": len(row.seeds),
        "seeds": _format_seeds(row.seeds),
        "best_known": comparison.best_known(row.task),
        "published_e_hv": e_hv,
        "published_sigma_hv": sigma_hv,
    }


def _contrast_records(comparison: Comparison, contrasts: Sequence[Contrast]) -> list[Record]:
    """Return paired tests; p is None with too few pairs."""
    return [
        _flat(one)
        | {"method": comparison.label(one.method), "baseline": comparison.label(one.baseline)}
        | ({"p": None} if one.p_holm is None else {})
        for one in contrasts
    ]


def _source_records(comparison: Comparison) -> Iterator[Record]:
    """Yield who found the front and the hypervolume."""
    for task, method, runs in _groups(comparison):
        for source, share in shares_by_source(runs).items():
            yield {"task": task, "method": comparison.label(method), "source": source, **share}


def _proposer_records(comparison: Comparison) -> Iterator[Record]:
    """Yield the proposals and their biases, as means over the runs in which they are known."""
    for task, method, runs in _groups(comparison):
        each = [_proposals(run) for run in runs if run.proposer]
        if each:
            known = {name: [one[name] for one in each if one[name] is not None] for name in each[0]}
            means = {name: float(np.mean(values)) if values else None for name, values in known.items()}
            yield {"task": task, "method": comparison.label(method), "runs": len(each), **means}


def _proposals(run: RunSummary) -> Record:
    proposer = run.proposer
    found: Record = {
        "proposals": run.summary["attribution"].get(proposer["name"], {"trials": 0})["trials"],
        "calls": proposer["calls"],
        "failures": sum(proposer["failures"].values()),
        "tokens": proposer["tokens"],
        "cost_usd": proposer["cost_usd"],
    }
    for prefix, who in (("", "proposer"), ("black_box_", "black_box")):
        found |= {f"{prefix}{bias}": (run.summary["proposer_bias"][who] or {}).get(bias) for bias in BIASES.split()}
    return found


def _run_record(comparison: Comparison, run: RunSummary) -> Record:
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
