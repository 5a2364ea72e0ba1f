"""Tables in LaTeX."""

from collections.abc import Sequence

_TEX = str.maketrans(
    {c: rf"\{c}" for c in "&%$#_{}"}
    | {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "–": "--"}
)


def latex_table(head: Sequence[str], rows: Sequence[Sequence[str]], remarks: Sequence[str]) -> str:
    """Return a table in LaTeX (booktabs), its remarks as comments; cells in ** are bold."""
    lines = [
        "% needs \\usepackage{booktabs}",
        rf"\begin{{tabular}}{{{'l' * len(head)}}}",
        r"\toprule",
        _tex_row(head),
        r"\midrule",
        *map(_tex_row, rows),
        r"\bottomrule",
        r"\end{tabular}",
        *(f"% {_tex(remark)}" for remark in remarks),
    ]
    return "\n".join(lines) + "\n"


def _tex_row(cells: Sequence[str]) -> str:
    bold = (rf"\textbf{{{_tex(cell[2:-2])}}}" if cell.startswith("**") else _tex(cell) for cell in cells)
    return f"{' & '.join(bold)} \\\\"


def _tex(text: str) -> str:
    return text.translate(_TEX)
