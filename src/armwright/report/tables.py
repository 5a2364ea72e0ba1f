"""Tables of a comparison: Markdown to read, CSV for programs and LaTeX for papers."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from armwright.exceptions import RunFolderError
from armwright.experiments.compare_runs import Comparison, MethodResult
from armwright.experiments.run_summary import RunSummary
from armwright.experiments.statistics import Interval, least_p
from armwright.files import replace_file, to_csv
from armwright.report.table_records import (
    Published,
    contrast_records,
    overall_records,
    proposer_records,
    row_records,
    run_records,
    time_records,
)

WIDE = 4  # up to this many tasks, each has a column, as in the paper
DECIMALS = 2


def write_tables(
    place: Path,
    comparison: Comparison,
    title: str,
    published: Published | None = None,
    published_in: str = "",
    notes: Sequence[str] = (),
) -> list[Path]:
    """Write table.md, table.csv, table.tex and the detailed CSV tables; return the paths, table.md first.

    notes: further remarks, such as missing cells.
    """
    published = published or {}
    files = {
        "table.md": markdown(comparison, title, published, published_in, notes),
        "table.csv": to_csv(row_records(comparison, published)),
        "table.tex": latex(comparison, published, published_in),
        "contrasts.csv": to_csv(contrast_records(comparison)),
        "overall.csv": to_csv(overall_records(comparison)),
        "time-to.csv": to_csv(time_records(comparison)),
        "proposers.csv": to_csv(proposer_records(comparison)),
        "runs.csv": to_csv(run_records(comparison)),
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
    """Return the whole comparison as Markdown."""
    parts = [f"# {title}", *_summary_part(comparison, published or {}, published_in), _final_part(comparison)]
    parts += [_overall_part(comparison), _contrast_part(comparison)]
    parts += [_time_part(comparison), _proposer_part(comparison)]
    remarks = [*_remarks(comparison), *notes]
    if remarks:
        parts.append("## Notes\n\n" + "\n".join(f"- {note}" for note in remarks))
    return "\n\n".join(part for part in parts if part) + "\n"


def _summary_part(comparison: Comparison, published: Published, published_in: str) -> list[str]:
    """Return the paper's table, with published values where they exist."""
    ours = {(row.method, row.task): row for row in comparison.rows if row.e_hv is not None}
    if not ours:
        return []
    caption = (
        "Mean hypervolume E_hv over the counted trials and the runs. In brackets σ_hv: the mean over the trials of the "
        "standard deviation over the runs (ddof = 0)."
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
            lines.append([comparison.label(method), *(cell(method, task) for task in comparison.tasks)])
            published_values = [published.get((method, task)) for task in comparison.tasks]
            if any(published_values):
                lines.append(
                    [
                        f"{method}, published",
                        *("–" if t is None else f"{t[0]:.2f} ({t[1]:.2f})" for t in published_values),
                    ]
                )
    else:
        head = ["task", *(comparison.label(method) for method in methods)]
        lines = [[task, *(cell(method, task) for method in methods)] for task in comparison.tasks]
    source = f" Published: {published_in}." if published_in and published else ""
    return [f"## Hypervolume over the trials\n\n{caption}{source}", _table(head, lines)]


def _final_part(comparison: Comparison) -> str:
    """Return the table of final hypervolumes."""
    caption = (
        "Mean over the runs, with 95 % bootstrap intervals. Share: relative to the best known hypervolume of the task."
    )
    lines = [
        [
            row.task,
            comparison.label(row.method),
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
    return f"## At the end\n\n{caption}\n\n{_table(head, lines, right=(2, 5))}"


def _overall_part(comparison: Comparison) -> str:
    """Return the table over all tasks; empty if there are too few."""
    if not comparison.overall:
        return ""
    caption = (
        f"Ratio of each method's E_hv to that of {comparison.baseline}; every task counts once. Mean with its 95 % "
        "bootstrap interval over the tasks. Two-sided Wilcoxon signed-rank test of the logarithms over the tasks, "
        "corrected for the number of methods (Holm)."
    )
    lines = [
        [
            comparison.label(over.method),
            _interval(over.ratio, decimals=3),
            f"{over.test.better} of {over.test.n}",
            f"{over.test.effect:+.2f}",
            _p(over.test.p),
            _p(over.p_holm),
        ]
        for over in comparison.overall
    ]
    return (
        f"## Over all tasks\n\n{caption}\n\n{_table(['method', 'ratio', 'better', 'effect', 'p', 'p (Holm)'], lines)}"
    )


def _contrast_part(comparison: Comparison) -> str:
    """Return the table of paired tests against the baseline."""
    if not comparison.contrasts:
        return ""
    n = len(comparison.contrasts)
    caption = (
        f"E_hv of each method minus that of {comparison.baseline}, paired by seed: mean difference with its 95 % "
        f"bootstrap interval. Two-sided Wilcoxon signed-rank test, corrected for {n} comparison{'s' if n > 1 else ''} "
        "(Holm). Effect: matched-pairs rank-biserial correlation."
    )
    lines = [
        [
            contrast.task,
            comparison.label(contrast.method),
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
            "\n\n**With fewer than six seeds, no test can reject at 5 %**: the smallest possible p for "
            f"{pairs} of runs is {least_p(fewest):.4g}. `--seeds 20` is enough for most differences."
        )
    return f"## Differences\n\n{caption}{warning}\n\n{_table(head, lines)}"


def _time_part(comparison: Comparison) -> str:
    """Return the table of trials needed to reach shares of the best known hypervolume."""
    times = comparison.times
    if not times:
        return ""
    levels = sorted({time.level for time in times})
    caption = (
        "Counted trials needed to reach a share of the best known hypervolume (if none is known, of the best of these "
        "runs): median over the runs. In brackets: the number of runs that reached it."
    )
    by_place = {(time.task, time.method, time.level): time for time in times}
    places = list(dict.fromkeys((time.task, time.method) for time in times))

    def cell(task: str, method: str, level: float) -> str:
        time = by_place[task, method, level]
        median = "–" if time.median is None else f"{time.median:.0f}"
        return f"{median} ({time.reached} of {time.runs})"

    lines = [
        [task, comparison.label(method), *(cell(task, method, level) for level in levels)] for task, method in places
    ]
    head = ["task", "method", *(f"{level:.0%}" for level in levels)]
    return f"## Trials to a hypervolume\n\n{caption}\n\n{_table(head, lines)}"


def _proposer_part(comparison: Comparison) -> str:
    """Return the table of gains and biases of the proposals."""
    records = proposer_records(comparison)
    if not records:
        return ""
    caption = (
        "Means over the runs. Gained: the share of the final hypervolume that the proposer's designs added when they "
        "were evaluated. Round: designs whose link lengths are all multiples of 5 cm. In plane: bases on a symmetry "
        "plane of the targets. Repeats: designs with the joint types of an earlier one and no number more than 1 mm "
        "from it. In brackets: the black box."
    )
    head = ["task", "method", "proposals", "on the front", "gained", "round", "in plane", "repeats", "calls", "USD"]
    lines = [
        [
            record["task"],
            comparison.label(record["method"]),
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
    return f"## Proposals\n\n{caption}\n\n{_table(head, lines)}"


def latex(comparison: Comparison, published: Published | None = None, published_in: str = "") -> str:
    """Return the first table in LaTeX (booktabs): E_hv and σ_hv of each task."""
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
        return f"{mean} & {row.sigma_hv:.{DECIMALS}f}"

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
        lines.append(f"{_tex(comparison.label(method))} & {' & '.join(numbers(method, t) for t in tasks)} " + r"\\")
        published_values = [published.get((method, task)) for task in tasks]
        if any(published_values):
            cells = " & ".join("-- & --" if t is None else f"{t[0]:.2f} & {t[1]:.2f}" for t in published_values)
            lines.append(rf"\quad published & {cells} \\")
    lines += [r"\bottomrule", r"\end{tabular}"]
    remarks = [f"published: {published_in}"] if published and published_in else []
    lines += [f"% {_tex(remark)}" for remark in (*remarks, *_remarks(comparison))]
    return "\n".join(lines) + "\n"


def _best(comparison: Comparison) -> dict[str, str]:
    """Return the method with the largest E_hv for each task with at least two methods."""
    best: dict[str, str] = {}
    for task in comparison.tasks:
        rows = [row for row in comparison.rows if row.task == task and row.e_hv is not None]
        if len(rows) > 1:
            best[task] = max(rows, key=lambda row: 0.0 if row.e_hv is None else row.e_hv.mean).method
    return best


def _remarks(comparison: Comparison) -> list[str]:
    """Return the notes that the tables need: excluded runs, shared reference points, stand-ins and models."""
    notes = [f"{run.method} on {run.task}, seed {run.seed}: {_flag(run)}" for run in comparison.excluded]
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
    notes += [f"{method} asked {', '.join(sorted(names))}" for method, names in models.items()]
    return notes


def _flag(run: RunSummary) -> str:
    return f"excluded, because {run.proposer['fallback_share']:.0%} of its proposals failed"


def _pair(row: MethodResult) -> str:
    assert row.e_hv is not None
    return f"{row.e_hv.mean:.{DECIMALS}f} ({row.sigma_hv:.{DECIMALS}f})"


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
    """Return a Markdown table whose columns also line up in plain text."""
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
