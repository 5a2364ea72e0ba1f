"""A comparison of runs as tables: CSV for programs, Markdown for people, LaTeX for papers."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from armwright.comparison import Comparison, Row, Run
from armwright.exceptions import RunFolderError
from armwright.files import replace_file
from armwright.results import as_csv
from armwright.statistics import Interval, least_p

Published = Mapping[tuple[str, str], tuple[float, float]]  # (method, task): (E_hv, σ_hv)

WIDE = 4  # tasks up to which a table has a column for each, as the paper's
DECIMALS = 2


def write_tables(
    place: Path,
    comparison: Comparison,
    title: str,
    published: Published | None = None,
    published_in: str = "",
    notes: Sequence[str] = (),
) -> list[Path]:
    """Writes table.csv, table.md and table.tex, and the tables behind them; the files, the readable one first.

    notes: what else the reader must know, such as cells that are missing.
    """
    published = published or {}
    files = {
        "table.md": markdown(comparison, title, published, published_in, notes),
        "table.csv": as_csv(_row_records(comparison, published)),
        "table.tex": latex(comparison, published, published_in),
        "contrasts.csv": as_csv(_contrast_records(comparison)),
        "overall.csv": as_csv(_overall_records(comparison)),
        "time-to.csv": as_csv(_time_records(comparison)),
        "proposers.csv": as_csv(_proposer_records(comparison)),
        "runs.csv": as_csv(_run_records(comparison)),
    }
    written: list[Path] = []
    for name, text in files.items():
        path = place / name
        try:
            place.mkdir(parents=True, exist_ok=True)
            replace_file(path, text.encode())
        except OSError as fault:
            raise RunFolderError(f"cannot write {path}: {fault.strerror or fault}; the runs are safe") from fault
        written.append(path)
    return written


def markdown(
    comparison: Comparison,
    title: str,
    published: Published | None = None,
    published_in: str = "",
    notes: Sequence[str] = (),
) -> str:
    """All of it in words and tables."""
    parts = [f"# {title}", *_summary_part(comparison, published or {}, published_in), _final_part(comparison)]
    parts += [_overall_part(comparison), _contrast_part(comparison)]
    parts += [_time_part(comparison), _proposer_part(comparison)]
    said = [*_marks(comparison), *notes]
    if said:
        parts.append("## Notes\n\n" + "\n".join(f"- {note}" for note in said))
    return "\n\n".join(part for part in parts if part) + "\n"


def _summary_part(comparison: Comparison, published: Published, published_in: str) -> list[str]:
    """The paper's table, and ours beside it."""
    ours = {(row.method, row.task): row for row in comparison.rows if row.e_hv is not None}
    if not ours:
        return []
    words = (
        "Mean hypervolume E_hv over the counted trials and the runs, and in brackets σ_hv: the mean over the trials of "
        "the standard deviation over the runs (ddof = 0)."
    )
    best = _best(comparison)
    methods = [method for method in comparison.methods if any((method, task) in ours for task in comparison.tasks)]

    def cell(method: str, task: str) -> str:
        row = ours.get((method, task))
        text = "–" if row is None else _pair(row)
        return f"**{text}**" if best.get(task) == method else text

    lines: list[list[str]] = []
    if len(comparison.tasks) <= WIDE:
        head = ["method", *comparison.tasks]
        for method in methods:
            lines.append([comparison.marked(method), *(cell(method, task) for task in comparison.tasks)])
            theirs = [published.get((method, task)) for task in comparison.tasks]
            if any(theirs):
                lines.append(
                    [f"{method}, published", *("–" if t is None else f"{t[0]:.2f} ({t[1]:.2f})" for t in theirs)]
                )
    else:
        head = ["task", *(comparison.marked(method) for method in methods)]
        lines = [[task, *(cell(method, task) for method in methods)] for task in comparison.tasks]
    source = f" Published: {published_in}." if published_in and published else ""
    return [f"## Hypervolume over the trials\n\n{words}{source}", _table(head, lines)]


def _final_part(comparison: Comparison) -> str:
    """The end of the runs."""
    words = "Mean over the runs, with 95 % bootstrap intervals. Share: of the best known hypervolume of the task."
    lines = [
        [
            row.task,
            comparison.marked(row.method),
            str(row.runs),
            _interval(row.final),
            "–" if row.share is None else _interval(row.share, scale=100.0, unit=" %", decimals=1),
            f"{row.seconds:.1f}",
        ]
        for row in comparison.rows
    ]
    for task in comparison.tasks:
        known = comparison.best_known(task)
        if known is not None:
            at = max(i for i, line in enumerate(lines) if line[0] == task) + 1
            lines.insert(at, [task, "best known front", "", f"{known:.2f}", "100 %", ""])
    head = ["task", "method", "runs", "hypervolume at the end", "share", "s a run"]
    return f"## At the end\n\n{words}\n\n{_table(head, lines, right=(2, 5))}"


def _overall_part(comparison: Comparison) -> str:
    """All tasks together, where there are enough."""
    if not comparison.overall:
        return ""
    words = (
        f"E_hv of each method as a ratio to that of {comparison.baseline}, each task counting once: mean with its 95 % "
        "bootstrap interval over the tasks; two-sided Wilcoxon signed-rank test of the logarithms over the tasks, "
        "corrected for the number of methods (Holm)."
    )
    lines = [
        [
            comparison.marked(over.method),
            _interval(over.ratio, decimals=3),
            f"{over.test.better} of {over.test.n}",
            f"{over.test.effect:+.2f}",
            _p(over.test.p),
            _p(over.p_holm),
        ]
        for over in comparison.overall
    ]
    return f"## Over all tasks\n\n{words}\n\n{_table(['method', 'ratio', 'better', 'effect', 'p', 'p (Holm)'], lines)}"


def _contrast_part(comparison: Comparison) -> str:
    """Tests against the baseline."""
    if not comparison.contrasts:
        return ""
    n = len(comparison.contrasts)
    words = (
        f"Each method beside {comparison.baseline} in E_hv, seed by seed: mean difference with its 95 % bootstrap "
        "interval; two-sided Wilcoxon signed-rank test, its p corrected for the "
        f"{n} comparison{'s' if n > 1 else ''} (Holm); effect: matched-pairs rank-biserial correlation."
    )
    lines = [
        [
            contrast.task,
            comparison.marked(contrast.method),
            _interval(contrast.test.difference, sign=True),
            f"{contrast.test.better} of {contrast.test.n}",
            f"{contrast.test.effect:+.2f}",
            _p(contrast.test.p),
            _p(contrast.p_holm),
        ]
        for contrast in comparison.contrasts
    ]
    head = ["task", "method", "difference", "better", "effect", "p", "p (Holm)"]
    warning = ""
    if comparison.is_undecidable:
        fewest = min(contrast.test.n for contrast in comparison.contrasts)
        pairs = f"{fewest} pairs" if fewest > 1 else "a single pair"
        warning = (
            "\n\n**With fewer than six seeds no test at 5 % can reject**: the smallest p that "
            f"{pairs} of runs can give is {least_p(fewest):.4g}. `--seeds 20` is enough for most differences."
        )
    return f"## Differences\n\n{words}{warning}\n\n{_table(head, lines)}"


def _time_part(comparison: Comparison) -> str:
    """Trials to a share of the best known hypervolume."""
    times = comparison.times
    if not times:
        return ""
    levels = sorted({time.level for time in times})
    words = (
        "Counted trials until a share of the best known hypervolume (of the best of these runs, where none is known) "
        "was there: median over the runs; in brackets how many got there."
    )
    by_place = {(time.task, time.method, time.level): time for time in times}
    places = list(dict.fromkeys((time.task, time.method) for time in times))

    def cell(task: str, method: str, level: float) -> str:
        time = by_place[task, method, level]
        median = "–" if time.median is None else f"{time.median:.0f}"
        return f"{median} ({time.reached} of {time.runs})"

    lines = [
        [task, comparison.marked(method), *(cell(task, method, level) for level in levels)] for task, method in places
    ]
    head = ["task", "method", *(f"{level:.0%}" for level in levels)]
    return f"## Trials to a hypervolume\n\n{words}\n\n{_table(head, lines)}"


def _proposer_part(comparison: Comparison) -> str:
    """What the proposals brought, and what they have in common."""
    records = _proposer_records(comparison)
    if not records:
        return ""
    words = (
        "Means over the runs. Gained: the share of the final hypervolume by which the proposer's designs enlarged it "
        "when they came. Round: designs all of whose lengths are multiples of 5 cm; in plane: bases on a plane of "
        "symmetry of the targets; repeats: designs with the joints of an earlier one and no number more than 1 mm from "
        "its (in brackets: the black box's)."
    )
    head = ["task", "method", "proposals", "on the front", "gained", "round", "in plane", "repeats", "calls", "USD"]
    lines = [
        [
            record["task"],
            comparison.marked(record["method"]),
            _number(record["proposals"], 0),
            _share(record["front_share"]),
            _share(record["gained_share"]),
            *(
                f"{_share(record[name])} ({_share(record[f'black_box_{name}'])})"
                for name in ("lengths_5_cm", "base_on_symmetry_plane", "near_repeats")
            ),
            _number(record["calls"], 0),
            _number(record["cost_usd"], 4),
        ]
        for record in records
    ]
    return f"## Proposals\n\n{words}\n\n{_table(head, lines)}"


def latex(comparison: Comparison, published: Published | None = None, published_in: str = "") -> str:
    """The first table for a paper that loads booktabs: E_hv and σ_hv of each task."""
    published = published or {}
    ours = {(row.method, row.task): row for row in comparison.rows if row.e_hv is not None}
    best = _best(comparison)
    tasks = comparison.tasks

    def numbers(method: str, task: str) -> str:
        row = ours.get((method, task))
        if row is None or row.e_hv is None:
            return "-- & --"
        mean = f"{row.e_hv.mean:.{DECIMALS}f}"
        mean = rf"\textbf{{{mean}}}" if best.get(task) == method else mean
        return f"{mean} & {row.deviation:.{DECIMALS}f}"

    lines = [
        "% needs \\usepackage{booktabs}",
        rf"\begin{{tabular}}{{l{'rr' * len(tasks)}}}",
        r"\toprule",
        "Method & " + " & ".join(rf"\multicolumn{{2}}{{c}}{{{_tex(task)}}}" for task in tasks) + r" \\",
        " & " + " & ".join(r"$E_{hv}$ & $\sigma_{hv}$" for _ in tasks) + r" \\",
        r"\midrule",
    ]
    for method in comparison.methods:
        if not any((method, task) in ours for task in tasks):
            continue
        lines.append(f"{_tex(comparison.marked(method))} & {' & '.join(numbers(method, t) for t in tasks)} " + r"\\")
        theirs = [published.get((method, task)) for task in tasks]
        if any(theirs):
            cells = " & ".join("-- & --" if t is None else f"{t[0]:.2f} & {t[1]:.2f}" for t in theirs)
            lines.append(rf"\quad published & {cells} \\")
    lines += [r"\bottomrule", r"\end{tabular}"]
    remarks = [f"published: {published_in}"] if published and published_in else []
    lines += [f"% {_tex(remark)}" for remark in (*remarks, *_marks(comparison))]
    return "\n".join(lines) + "\n"


def _best(comparison: Comparison) -> dict[str, str]:
    """Of each task, the method of largest E_hv, where there are several."""
    best: dict[str, str] = {}
    for task in comparison.tasks:
        rows = [row for row in comparison.rows if row.task == task and row.e_hv is not None]
        if len(rows) > 1:
            best[task] = max(rows, key=lambda row: 0.0 if row.e_hv is None else row.e_hv.mean).method
    return best


def _marks(comparison: Comparison) -> list[str]:
    """What must be said of the runs in the tables."""
    notes = [f"{run.method} on {run.task}, seed {run.seed}: {_flag(run)}" for run in comparison.left_out]
    notes += [
        f"{task}: its runs had reference points of their own; the largest values of these, "
        f"({', '.join(f'{value:.4g}' for value in comparison.reference_point(task))}), count for all"
        for task in comparison.widened
    ]
    if any(run.is_scripted for run in comparison.runs):
        notes.append("[scripted]: no language model answered, but a stand-in; these rows say nothing about models")
    models: dict[str, set[str]] = {}
    for run in comparison.runs:
        if run.proposer.get("model") and not run.is_scripted:
            models.setdefault(run.method, set()).add(str(run.proposer["model"]))
    notes += [f"{method} asked {', '.join(sorted(names))}" for method, names in models.items()]
    return notes


def _flag(run: Run) -> str:
    return f"left out, as {run.proposer['fallback_share']:.0%} of its proposals failed"


def _row_records(comparison: Comparison, published: Published) -> Iterable[dict[str, Any]]:
    for row in comparison.rows:
        theirs = published.get((row.method, row.task))
        yield {
            "task": row.task,
            "method": row.method,
            "runs": row.runs,
            **_flat("e_hv", row.e_hv),
            "sigma_hv": row.deviation,
            **_flat("final", row.final),
            **_flat("share_of_best_known", row.share),
            "best_known": comparison.best_known(row.task),
            "published_e_hv": None if theirs is None else theirs[0],
            "published_sigma_hv": None if theirs is None else theirs[1],
            "seconds": row.seconds,
            "scripted": any(run.is_scripted for run in comparison.of(row.method, row.task)),
        }


def _contrast_records(comparison: Comparison) -> Iterable[dict[str, Any]]:
    for contrast in comparison.contrasts:
        test = contrast.test
        yield {
            "task": contrast.task,
            "method": contrast.method,
            "baseline": comparison.baseline,
            "pairs": test.n,
            **_flat("difference", test.difference),
            "better": test.better,
            "effect": test.effect,
            "p": test.p,
            "p_holm": contrast.p_holm,
            "least_p": least_p(test.n),
        }


def _overall_records(comparison: Comparison) -> Iterable[dict[str, Any]]:
    for over in comparison.overall:
        yield {
            "method": over.method,
            "baseline": comparison.baseline,
            "tasks": over.test.n,
            **_flat("ratio", over.ratio),
            "better": over.test.better,
            "effect": over.test.effect,
            "p": over.test.p,
            "p_holm": over.p_holm,
        }


def _time_records(comparison: Comparison) -> Iterable[dict[str, Any]]:
    for time in comparison.times:
        yield {
            "task": time.task,
            "method": time.method,
            "level": time.level,
            "hypervolume": time.hypervolume,
            "reached": time.reached,
            "runs": time.runs,
            "median_trials": time.median,
        }


def _proposer_records(comparison: Comparison) -> list[dict[str, Any]]:
    records: list[dict[str, Any]] = []
    for task in comparison.tasks:
        for method in comparison.methods:
            runs = [run for run in comparison.of(method, task) if run.proposer]
            if runs:
                records.append({"task": task, "method": method, **_proposer_means(runs)})
    return records


def _proposer_means(runs: Sequence[Run]) -> dict[str, Any]:
    habits = ("lengths_5_cm", "base_on_symmetry_plane", "near_repeats")
    each: list[dict[str, Any]] = []
    for run in runs:
        summary, name = run.summary, run.proposer["name"]
        credit = summary["credit"].get(name, {"trials": 0, "front": 0})
        found: dict[str, Any] = {
            "proposals": credit["trials"],
            "front_share": credit["front"] / max(1, summary["front_size"]),
            "gained_share": run.gained.get(name, 0.0),
            "calls": run.proposer["calls"],
            "failures": sum(run.proposer["failures"].values()),
            "tokens": run.proposer["tokens"],
            "cost_usd": run.proposer["cost_usd"],
        }
        for prefix, who in (("", "proposer"), ("black_box_", "black_box")):
            habit: dict[str, Any] = summary["diagnostics"][who] or {}
            found |= {f"{prefix}{key}": habit.get(key) for key in habits}
        each.append(found)
    return {"runs": len(runs)} | {key: _mean([found[key] for found in each]) for key in each[0]}


def _run_records(comparison: Comparison) -> Iterable[dict[str, Any]]:
    best = {task: comparison.best_known(task) for task in comparison.tasks}
    for run in [*comparison.runs, *comparison.left_out]:
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
            "folder": str(run.folder),
        }


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _flat(name: str, value: Interval | None) -> dict[str, float | None]:
    if value is None:
        return {name: None, f"{name}_low": None, f"{name}_high": None}
    return {name: value.mean, f"{name}_low": value.low, f"{name}_high": value.high}


def _pair(row: Row) -> str:
    assert row.e_hv is not None
    return f"{row.e_hv.mean:.{DECIMALS}f} ({row.deviation:.{DECIMALS}f})"


def _interval(value: Interval, scale: float = 1.0, unit: str = "", decimals: int = DECIMALS, sign: bool = False) -> str:
    form = f"{'+' if sign else ''}.{decimals}f"
    low, high = (f"{scale * end:{form}}" for end in (value.low, value.high))
    return f"{scale * value.mean:{form}}{unit} [{low}, {high}]"


def _p(value: float) -> str:
    return f"{value:.4f}" if value >= 1e-4 else f"{value:.1e}"


def _share(value: float | None) -> str:
    return "–" if value is None else f"{100.0 * value:.0f} %"


def _number(value: float | None, decimals: int) -> str:
    return "–" if value is None else f"{value:.{decimals}f}"


def _table(head: Sequence[str], lines: Iterable[Sequence[str]], right: Sequence[int] = ()) -> str:
    """A Markdown table whose columns stand under each other in plain text, too."""
    rows = [[text.replace("|", "\\|") for text in row] for row in (head, *lines)]
    widths = [max(3, *(len(row[i]) for row in rows)) for i in range(len(head))]
    aligned = [
        [
            text.rjust(width) if i in right else text.ljust(width)
            for i, (text, width) in enumerate(zip(row, widths, strict=True))
        ]
        for row in rows
    ]
    rule = ["-" * (width - 1) + ":" if i in right else "-" * width for i, width in enumerate(widths)]
    return "\n".join(f"| {' | '.join(row)} |" for row in (aligned[0], rule, *aligned[1:]))


_TEX = str.maketrans(
    {c: rf"\{c}" for c in "&%$#_{}"}
    | {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
)


def _tex(text: str) -> str:
    return text.translate(_TEX)
