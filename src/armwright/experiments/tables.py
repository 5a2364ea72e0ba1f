"""Tables of a comparison: Markdown to read, CSV for programs and LaTeX for papers."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from armwright.experiments.compare_runs import LEVELS, Comparison
from armwright.experiments.latex_tables import latex
from armwright.experiments.outcome import NOTHING_PUBLISHED, Published
from armwright.experiments.run_record import shares_by_source
from armwright.experiments.statistics import can_reject, least_p
from armwright.experiments.table_cells import (
    TEST_COLUMNS,
    SummaryCell,
    contrast_cells,
    format_interval,
    format_number,
    format_share,
    remarks_on,
    summary_rows,
)
from armwright.experiments.table_records import (
    BIASES,
    contrast_records,
    overall_records,
    proposer_records,
    row_records,
    run_records,
    source_records,
)
from armwright.files import naming_write_errors, replace_file, to_csv
from armwright.runs.history import source_label

WIDE = 4  # up to this many tasks, each has a column, as in the paper


@dataclass(frozen=True)
class Section:
    """A table of a comparison.

    Attributes:
        title: Its title.
        caption: What its numbers mean.
        head: The heads of its columns.
        rows: Its rows.
        right: The columns that are aligned to the right.
    """

    title: str
    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    right: Sequence[int] = ()


def write_tables(
    place: Path,
    comparison: Comparison,
    title: str,
    published: Published = NOTHING_PUBLISHED,
    notes: Sequence[str] = (),
) -> list[Path]:
    """Write table.md, table.csv, table.tex and the detailed CSV tables; return the paths, table.md first.

    Only runs.csv holds measured times and folders: equal runs give equal bytes in all other files.

    notes: further remarks, such as missing cells.
    """
    files = {
        "table.md": markdown(comparison, title, published, notes),
        "table.csv": to_csv(row_records(comparison, published)),
        "table.tex": latex(comparison, published),
        "contrasts.csv": to_csv(contrast_records(comparison)),
        "overall.csv": to_csv(overall_records(comparison)),
        "time-to.csv": to_csv(map(asdict, comparison.times)),
        "sources.csv": to_csv(source_records(comparison)),
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
    remarks = [*remarks_on(comparison), *notes]
    parts = [
        f"# {title}",
        *(
            f"## {one.title}\n\n{one.caption}\n\n{_table(one.head, one.rows, one.right)}"
            for one in sections(comparison, published)
        ),
        *(["## Notes\n\n" + "\n".join(f"- {note}" for note in remarks)] if remarks else []),
    ]
    return "\n\n".join(parts) + "\n"


def sections(comparison: Comparison, published: Published = NOTHING_PUBLISHED) -> list[Section]:
    """Return the tables of a comparison that have rows."""
    tables = (
        _summary_section(comparison, published),
        _final_section(comparison),
        _overall_section(comparison),
        _contrast_section(comparison),
        _time_section(comparison),
        _source_section(comparison),
        _proposer_section(comparison),
    )
    return [table for table in tables if table.rows]


def comparison_record(comparison: Comparison, published: Published = NOTHING_PUBLISHED) -> dict[str, Any]:
    """Return the records of a comparison in JSON types."""
    return {
        "methods": list(row_records(comparison, published)),
        "differences": list(contrast_records(comparison)),
        "overall": list(overall_records(comparison)),
        "time_to": [asdict(time) for time in comparison.times],
        "sources": list(source_records(comparison)),
        "proposers": proposer_records(comparison),
        "runs": list(run_records(comparison)),
    }


def _summary_section(comparison: Comparison, published: Published) -> Section:
    """Return the paper's table, with published values if there are any."""
    caption = (
        "Mean hypervolume E_hv over the counted trials and the runs. In brackets σ_hv: the mean over the trials of the "
        "standard deviation over the runs (ddof = 0). Bold: the largest E_hv of the methods with most runs on a task."
    )
    if published.source and published.values:
        caption += f" Published: {published.source}."

    is_wide = len(comparison.tasks) > WIDE
    rows = [[row.label, row.seeds, *map(_summary_cell, row.cells)] for row in summary_rows(comparison, published)]
    table = [["task" if is_wide else "method", "seeds", *comparison.tasks], *rows]
    if is_wide:
        table = list(map(list, zip(*table, strict=True)))
    return Section("Hypervolume over the trials", caption, table[0], table[1:] if rows else [])


def _summary_cell(cell: SummaryCell | None) -> str:
    if cell is None:
        return "–"
    text = f"{cell.e_hv:.2f}" if cell.sigma_hv is None else f"{cell.e_hv:.2f} ({cell.sigma_hv:.2f})"
    return f"**{text}**" if cell.is_best else text


def _final_section(comparison: Comparison) -> Section:
    """Return the table of final hypervolumes."""
    caption = (
        "Mean over the runs, with 95 % bootstrap intervals. Share: relative to the best known hypervolume of the task."
    )
    rows: list[list[str]] = []
    for task in comparison.tasks:
        for row in (row for row in comparison.rows if row.task == task):
            share = "–" if row.share is None else format_interval(row.share, scale=100.0, unit=" %", decimals=1)
            label = comparison.label(row.method)
            rows.append([task, label, str(len(row.seeds)), format_interval(row.final), share])
        known = comparison.best_known(task)
        if known is not None:
            rows.append([task, "best known front", "", f"{known:.2f}", "100 %"])
    head = ["task", "method", "runs", "hypervolume at the end", "share"]
    return Section("At the end", caption, head, rows, right=(2,))


def _overall_section(comparison: Comparison) -> Section:
    """Return the table over all tasks; empty if there are too few."""
    caption = (
        "Ratio of a method's E_hv to that of another one; every task counts once. Mean with its 95 % bootstrap "
        "interval over the tasks. Two-sided Wilcoxon signed-rank test of the logarithms over the tasks, corrected for "
        "the number of comparisons (Holm)."
    )
    rows = [
        [
            comparison.label(over.method),
            comparison.label(over.baseline),
            format_interval(over.ratio, decimals=3),
            *contrast_cells(over.test, over.p_holm),
        ]
        for over in comparison.overall
    ]
    return Section("Over all tasks", caption, ["method", "against", "ratio", *TEST_COLUMNS], rows)


def _contrast_section(comparison: Comparison) -> Section:
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
    rows = [
        [
            contrast.task,
            comparison.label(contrast.method),
            comparison.label(contrast.baseline),
            format_interval(contrast.test.difference, sign="+"),
            *contrast_cells(contrast.test, contrast.p_holm),
        ]
        for contrast in comparison.contrasts
    ]
    return Section("Differences", caption, ["task", "method", "against", "difference", *TEST_COLUMNS], rows)


def _time_section(comparison: Comparison) -> Section:
    """Return the table of trials needed to reach shares of the best known hypervolume."""
    caption = (
        "Counted trials needed to reach a share of the best known hypervolume (if none is known, of the best of these "
        "runs): median over the runs. In brackets: the number of runs that reached it."
    )
    rows = [
        [
            task,
            comparison.label(method),
            *(f"{format_number(time.median_trials)} ({time.reached} of {time.runs})" for time in times),
        ]
        for (task, method), times in groupby(comparison.times, lambda time: (time.task, time.method))
    ]
    return Section("Trials to a hypervolume", caption, ["task", "method", *(f"{level:.0%}" for level in LEVELS)], rows)


def _source_section(comparison: Comparison) -> Section:
    """Return the table of who found the front and the hypervolume."""
    caption = (
        "Share of the final front that was found by each source. In brackets: the share of the final hypervolume that "
        "its designs added when they were evaluated. Means over the runs."
    )
    found = [
        (task, comparison.label(method), {share.source: share for share in shares})
        for task in comparison.tasks
        for method in comparison.methods
        if (shares := shares_by_source(comparison.runs_of(method, task)))
    ]
    sources = list(dict.fromkeys(source for *_, shares in found for source in shares))
    rows = [
        [
            task,
            label,
            *(
                f"{format_share(s.front)} ({format_share(s.gained)})" if (s := shares.get(source)) else "–"
                for source in sources
            ),
        ]
        for task, label, shares in found
    ]
    return Section("Front by source", caption, ["task", "method", *(source_label(source) for source in sources)], rows)


def _proposer_section(comparison: Comparison) -> Section:
    """Return the table of the proposals and their biases."""
    caption = (
        "Means over the runs. 5 cm, 1 cm: designs whose link lengths are all multiples of it. In plane: bases on a "
        "symmetry plane of the targets. Equal neighbours: pairs of consecutive joints with one type. In brackets: the "
        "black box."
    )
    biases = ["5 cm", "1 cm", "in plane", "equal neighbours"]
    head = ["task", "method", "proposals", *biases, "calls", "USD"]
    rows = [
        [
            record["task"],
            comparison.label(record["method"]),
            format_number(record["proposals"]),
            *(f"{format_share(record[bias])} ({format_share(record[f'black_box_{bias}'])})" for bias in BIASES),
            format_number(record["calls"]),
            format_number(record["cost_usd"], 4),
        ]
        for record in proposer_records(comparison)
    ]
    return Section("Proposals", caption, head, rows)


def _table(head: Sequence[str], lines: Sequence[Sequence[str]], right: Sequence[int] = ()) -> str:
    """Return a Markdown table whose columns also line up in plain text."""
    rows = [[text.replace("|", "\\|") for text in row] for row in (head, *lines)]
    columns: list[list[str]] = []
    for i, (name, *cells) in enumerate(zip(*rows, strict=True)):
        width = max(3, len(name), *map(len, cells))
        rule = "-" * (width - 1) + ":" if i in right else "-" * width
        columns.append([f"{text:{'>' if i in right else '<'}{width}}" for text in (name, rule, *cells)])
    return "\n".join(f"| {' | '.join(row)} |" for row in zip(*columns, strict=True))
