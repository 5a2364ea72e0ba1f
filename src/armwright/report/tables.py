"""Tables of a comparison: Markdown to read, CSV for programs and LaTeX for papers."""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from itertools import groupby
from pathlib import Path

from armwright.experiments.compare_runs import LEVELS, Comparison
from armwright.experiments.outcome import NOTHING_PUBLISHED, Published
from armwright.experiments.statistics import Interval, PairedTest, least_p
from armwright.files import naming_write_errors, replace_file, to_csv
from armwright.report.table_records import (
    BIASES,
    contrast_records,
    overall_records,
    proposer_records,
    row_records,
    run_records,
)

WIDE = 4  # up to this many tasks, each has a column, as in the paper
TEST_COLUMNS = ("better", "effect", "p", "p (Holm)")


def write_tables(
    place: Path,
    comparison: Comparison,
    title: str,
    published: Published = NOTHING_PUBLISHED,
    notes: Sequence[str] = (),
) -> list[Path]:
    """Write table.md, table.csv, table.tex and the detailed CSV tables; return the paths, table.md first.

    notes: further remarks, such as missing cells.
    """
    files = {
        "table.md": markdown(comparison, title, published, notes),
        "table.csv": to_csv(row_records(comparison, published)),
        "table.tex": latex(comparison, published),
        "contrasts.csv": to_csv(contrast_records(comparison)),
        "overall.csv": to_csv(overall_records(comparison)),
        "time-to.csv": to_csv(map(asdict, comparison.times)),
        "proposers.csv": to_csv(proposer_records(comparison)),
        "runs.csv": to_csv(run_records(comparison)),
    }
    for name, text in files.items():
        with naming_write_errors(place / name, "; the runs are safe"):
            place.mkdir(parents=True, exist_ok=True)
            replace_file(place / name, text.encode())
    return [place / name for name in files]


def markdown(
    comparison: Comparison, title: str, published: Published = NOTHING_PUBLISHED, notes: Sequence[str] = ()
) -> str:
    """Return the whole comparison as Markdown."""
    remarks = [*_remarks(comparison), *notes]
    parts = [
        f"# {title}",
        _summary_section(comparison, published),
        _final_section(comparison),
        _overall_section(comparison),
        _contrast_section(comparison),
        _time_section(comparison),
        _proposer_section(comparison),
        "## Notes\n\n" + "\n".join(f"- {note}" for note in remarks) if remarks else "",
    ]
    return "\n\n".join(filter(None, parts)) + "\n"


def _section(
    title: str, caption: str, head: Sequence[str], rows: Sequence[Sequence[str]], right: Sequence[int] = ()
) -> str:
    return f"## {title}\n\n{caption}\n\n{_table(head, rows, right)}" if rows else ""


def _summary_section(comparison: Comparison, published: Published) -> str:
    """Return the paper's table, with published values if there are any."""
    caption = (
        "Mean hypervolume E_hv over the counted trials and the runs. In brackets σ_hv: the mean over the trials of the "
        "standard deviation over the runs (ddof = 0)."
    )
    if published.source and published.values:
        caption += f" Published: {published.source}."

    def cell(mean: float, deviation: float, is_best: bool) -> str:
        text = f"{mean:.2f} ({deviation:.2f})"
        return f"**{text}**" if is_best else text

    is_wide = len(comparison.tasks) > WIDE
    rows = _summary(comparison, published, cell, "–")
    table = [["task" if is_wide else "method", *comparison.tasks], *rows]
    if is_wide:
        table = list(map(list, zip(*table, strict=True)))
    return _section("Hypervolume over the trials", caption, table[0], table[1:]) if rows else ""


def _summary(
    comparison: Comparison, published: Published, form: Callable[[float, float, bool], str], missing: str
) -> list[list[str]]:
    """Return the rows of the paper's table: a label, and a cell per task.

    Args:
        comparison: The runs.
        published: Published values, in rows below ours.
        form: Renders E_hv, σ_hv and whether this E_hv is the largest of several methods on the task.
        missing: The cell of a task without a value.
    """
    ours = {
        (row.method, row.task): (row.e_hv.mean, row.sigma_hv)
        for row in comparison.rows
        if row.e_hv is not None and row.sigma_hv is not None
    }
    best: dict[str, float] = {}
    for task in comparison.tasks:
        means = [mean for (_, of), (mean, _) in ours.items() if of == task]
        if len(means) > 1:
            best[task] = max(means)
    rows: list[list[str]] = []
    for method in comparison.methods:
        for label, values in ((comparison.label(method), ours), (f"{method}, published", published.values)):
            cells = [(values.get((method, task)), best.get(task)) for task in comparison.tasks]
            if any(pair for pair, _ in cells):
                shown = (missing if pair is None else form(*pair, values is ours and pair[0] == b) for pair, b in cells)
                rows.append([label, *shown])
    return rows


def _final_section(comparison: Comparison) -> str:
    """Return the table of final hypervolumes."""
    caption = (
        "Mean over the runs, with 95 % bootstrap intervals. Share: relative to the best known hypervolume of the task."
    )
    rows: list[list[str]] = []
    for task in comparison.tasks:
        for row in (row for row in comparison.rows if row.task == task):
            share = "–" if row.share is None else _interval(row.share, scale=100.0, unit=" %", decimals=1)
            label = comparison.label(row.method)
            rows.append([task, label, str(row.runs), _interval(row.final), share, f"{row.seconds:.1f}"])
        known = comparison.best_known(task)
        if known is not None:
            rows.append([task, "best known front", "", f"{known:.2f}", "100 %", ""])
    head = ["task", "method", "runs", "hypervolume at the end", "share", "s a run"]
    return _section("At the end", caption, head, rows, right=(2, 5))


def _overall_section(comparison: Comparison) -> str:
    """Return the table over all tasks; empty if there are too few."""
    caption = (
        f"Ratio of each method's E_hv to that of {comparison.baseline}; every task counts once. Mean with its 95 % "
        "bootstrap interval over the tasks. Two-sided Wilcoxon signed-rank test of the logarithms over the tasks, "
        "corrected for the number of methods (Holm)."
    )
    rows = [
        [comparison.label(over.method), _interval(over.ratio, decimals=3), *_test_cells(over.test, over.p_holm)]
        for over in comparison.overall
    ]
    return _section("Over all tasks", caption, ["method", "ratio", *TEST_COLUMNS], rows)


def _contrast_section(comparison: Comparison) -> str:
    """Return the table of paired tests against the baseline."""
    caption = (
        f"E_hv of each method minus that of {comparison.baseline}, paired by seed: mean difference with its 95 % "
        "bootstrap interval. Two-sided Wilcoxon signed-rank test, corrected for the number of comparisons (Holm). "
        "Effect: matched-pairs rank-biserial correlation."
    )
    if comparison.is_undecidable:
        fewest = min(contrast.test.n for contrast in comparison.contrasts)
        caption += (
            "\n\n**With fewer than six seeds, no test can reject at 5 %**, so no p is shown (seeds in common: "
            f"{fewest}, smallest possible p: {least_p(fewest):.4g}). `--seeds 20` is enough for most differences."
        )
    rows = [
        [
            contrast.task,
            comparison.label(contrast.method),
            _interval(contrast.test.difference, sign="+"),
            *_test_cells(contrast.test, contrast.p_holm),
        ]
        for contrast in comparison.contrasts
    ]
    return _section("Differences", caption, ["task", "method", "difference", *TEST_COLUMNS], rows)


def _time_section(comparison: Comparison) -> str:
    """Return the table of trials needed to reach shares of the best known hypervolume."""
    caption = (
        "Counted trials needed to reach a share of the best known hypervolume (if none is known, of the best of these "
        "runs): median over the runs. In brackets: the number of runs that reached it."
    )
    rows = [
        [
            task,
            comparison.label(method),
            *(f"{_number(time.median_trials)} ({time.reached} of {time.runs})" for time in times),
        ]
        for (task, method), times in groupby(comparison.times, lambda time: (time.task, time.method))
    ]
    return _section("Trials to a hypervolume", caption, ["task", "method", *(f"{level:.0%}" for level in LEVELS)], rows)


def _proposer_section(comparison: Comparison) -> str:
    """Return the table of gains and biases of the proposals."""
    caption = (
        "Means over the runs. Gained: the share of the final hypervolume that the proposer's designs added when they "
        "were evaluated. Round: designs whose link lengths are all multiples of 5 cm. In plane: bases on a symmetry "
        "plane of the targets. Repeats: designs with the joint types of an earlier one and no number more than 1 mm "
        "from it. In brackets: the black box."
    )
    head = ["task", "method", "proposals", "on the front", "gained", "round", "in plane", "repeats", "calls", "USD"]
    rows = [
        [
            record["task"],
            comparison.label(record["method"]),
            _number(record["proposals"]),
            _share(record["front_share"]),
            _share(record["gained_share"]),
            *(f"{_share(record[bias])} ({_share(record[f'black_box_{bias}'])})" for bias in BIASES),
            _number(record["calls"]),
            _number(record["cost_usd"], 4),
        ]
        for record in proposer_records(comparison)
    ]
    return _section("Proposals", caption, head, rows)


def latex(comparison: Comparison, published: Published = NOTHING_PUBLISHED) -> str:
    """Return the first table in LaTeX (booktabs): E_hv and σ_hv of each task."""

    def cell(mean: float, deviation: float, is_best: bool) -> str:
        return rf"\textbf{{{mean:.2f}}} & {deviation:.2f}" if is_best else f"{mean:.2f} & {deviation:.2f}"

    tasks = comparison.tasks
    remarks = [f"published: {published.source}"] if published.values and published.source else []
    lines = [
        "% needs \\usepackage{booktabs}",
        rf"\begin{{tabular}}{{l{'rr' * len(tasks)}}}",
        r"\toprule",
        "Method & " + " & ".join(rf"\multicolumn{{2}}{{c}}{{{_tex(task)}}}" for task in tasks) + r" \\",
        " & " + " & ".join(r"$E_{hv}$ & $\sigma_{hv}$" for _ in tasks) + r" \\",
        r"\midrule",
        *(
            rf"{_tex(label)} & {' & '.join(cells)} \\"
            for label, *cells in _summary(comparison, published, cell, "-- & --")
        ),
        r"\bottomrule",
        r"\end{tabular}",
        *(f"% {_tex(remark)}" for remark in (*remarks, *_remarks(comparison))),
    ]
    return "\n".join(lines) + "\n"


def _remarks(comparison: Comparison) -> list[str]:
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


def _interval(value: Interval, scale: float = 1.0, unit: str = "", decimals: int = 2, sign: str = "-") -> str:
    mean, low, high = (f"{scale * end:{sign}.{decimals}f}" for end in (value.mean, value.low, value.high))
    return f"{mean}{unit} [{low}, {high}]"


def _test_cells(test: PairedTest, p_holm: float | None) -> list[str]:
    """Return the cells of TEST_COLUMNS."""
    ps = ("–", "–") if p_holm is None else (f"{p:.4f}" if p >= 1e-4 else f"{p:.1e}" for p in (test.p, p_holm))
    return [f"{test.better} of {test.n}", f"{test.effect:+.2f}", *ps]


def _share(value: float | None) -> str:
    return "–" if value is None else f"{100.0 * value:.0f} %"


def _number(value: float | None, decimals: int = 0) -> str:
    return "–" if value is None else f"{value:.{decimals}f}"


def _table(head: Sequence[str], lines: Sequence[Sequence[str]], right: Sequence[int] = ()) -> str:
    """Return a Markdown table whose columns also line up in plain text."""
    rows = [[text.replace("|", "\\|") for text in row] for row in (head, *lines)]
    columns: list[list[str]] = []
    for i, (name, *cells) in enumerate(zip(*rows, strict=True)):
        width = max(3, len(name), *map(len, cells))
        rule = "-" * (width - 1) + ":" if i in right else "-" * width
        columns.append([f"{text:{'>' if i in right else '<'}{width}}" for text in (name, rule, *cells)])
    return "\n".join(f"| {' | '.join(row)} |" for row in zip(*columns, strict=True))


_TEX = str.maketrans(
    {c: rf"\{c}" for c in "&%$#_{}"}
    | {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
)


def _tex(text: str) -> str:
    return text.translate(_TEX)
