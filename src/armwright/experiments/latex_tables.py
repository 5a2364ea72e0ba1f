"""Tables of a comparison in LaTeX (booktabs)."""

from collections.abc import Iterable, Sequence

from armwright.experiments.compare_runs import Comparison
from armwright.experiments.outcome import NOTHING_PUBLISHED, Published
from armwright.experiments.table_cells import SummaryCell, format_interval, remarks_on, summary_rows


def latex(comparison: Comparison, published: Published = NOTHING_PUBLISHED) -> str:
    """Return two tables: E_hv and σ_hv of each task, and the paired differences."""
    remarks = [f"published: {published.source}"] if published.values and published.source else []
    lines = [
        "% needs \\usepackage{booktabs}",
        *_summary_table(comparison, published),
        *_contrast_table(comparison),
        *(f"% {_tex(remark)}" for remark in (*remarks, *remarks_on(comparison))),
    ]
    return "\n".join(lines) + "\n"


def _summary_table(comparison: Comparison, published: Published) -> list[str]:
    tasks = comparison.tasks
    head = [
        "Method & Seeds & " + " & ".join(rf"\multicolumn{{2}}{{c}}{{{_tex(task)}}}" for task in tasks),
        " & & " + " & ".join(r"$E_{hv}$ & $\sigma_{hv}$" for _ in tasks),
    ]
    rows = (
        " & ".join([_tex(row.label), row.seeds.replace("–", "--"), *map(_summary_cell, row.cells)])
        for row in summary_rows(comparison, published)
    )
    return _tabular("ll" + "rr" * len(tasks), head, rows)


def _summary_cell(cell: SummaryCell | None) -> str:
    if cell is None:
        return "-- & --"
    mean = rf"\textbf{{{cell.e_hv:.2f}}}" if cell.is_best else f"{cell.e_hv:.2f}"
    return f"{mean} & --" if cell.sigma_hv is None else f"{mean} & {cell.sigma_hv:.2f}"


def _contrast_table(comparison: Comparison) -> list[str]:
    rows = (
        " & ".join(
            [
                _tex(contrast.task),
                _tex(comparison.label(contrast.method)),
                _tex(comparison.label(contrast.baseline)),
                format_interval(contrast.test.difference, sign="+").replace("-", "$-$"),
                f"{contrast.test.better} of {contrast.test.n}",
                "--" if contrast.p_holm is None else f"{contrast.p_holm:.2g}",
            ]
        )
        for contrast in comparison.contrasts
    )
    head = [r"Task & Method & Against & Difference of $E_{hv}$ & Better & $p$ (Holm)"]
    return ["", *_tabular("lllrrr", head, rows)] if comparison.contrasts else []


def _tabular(columns: str, head: Sequence[str], rows: Iterable[str]) -> list[str]:
    return [
        rf"\begin{{tabular}}{{{columns}}}",
        r"\toprule",
        *(rf"{line} \\" for line in head),
        r"\midrule",
        *(rf"{row} \\" for row in rows),
        r"\bottomrule",
        r"\end{tabular}",
    ]


_TEX = str.maketrans(
    {c: rf"\{c}" for c in "&%$#_{}"}
    | {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
)


def _tex(text: str) -> str:
    return text.translate(_TEX)
