"""Tables in terminals of any width."""

import io

from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from armwright.cli.tables import Column, print_table, shorten
from armwright.text import rounded

LETTERS = st.text("abc é中", max_size=30).map(str.strip)
NUMBERS = st.floats(-1e6, 1e6)
HEADS = st.sampled_from(["#", "price", "cycle time", "peak torque [N m]", "a head"])
COLUMNS = st.lists(
    st.builds(
        lambda head, is_number, rank, least: (head, is_number, rank, None if is_number else least),
        HEADS, st.booleans(), st.integers(0, 3), st.none() | st.integers(3, 10),
    ),
    min_size=1, max_size=8, unique_by=lambda one: one[0],
)  # fmt: skip


def printed(columns: list[Column], rows: list[dict[str, object]], width: int, gap: int = 2) -> list[str]:
    console = Console(file=io.StringIO(), width=width, soft_wrap=True, markup=False, highlight=False)
    print_table(console, columns, rows, "--csv prints all", gap=gap)
    return console.file.getvalue().splitlines()  # type: ignore[attr-defined]


@given(COLUMNS, st.data(), st.integers(1, 90), st.integers(1, 2))
def test_tables_fit_and_cut_no_number(shapes: list, data: st.DataObject, width: int, gap: int) -> None:
    """What does not fit is of rank 0; heads are shown or named, and the highest ranks are left out first."""
    columns = [
        Column(head, head, "{:.4g}".format if is_number else None, rank, least)
        for head, is_number, rank, least in shapes
    ]
    row = {head: data.draw(NUMBERS if is_number else LETTERS) for head, is_number, _, _ in shapes}
    lines = printed(columns, [row], width, gap)
    note = lines.pop() if "left out" in lines[-1] else ""
    dropped = note.removeprefix("left out at this width: ").removesuffix("; --csv prints all").split(", ")
    kept = [column for column in columns if column.head not in dropped]
    if max(Console().measure(line).maximum for line in [*lines, ""]) > width:
        assert {column.rank for column in kept} == {0} or len(kept) == 1
    for column in kept:
        assert column.head.split()[0] in " ".join(lines)
        assert not column.write or f"{row[column.head]:.4g}" in lines[-1]
    gone = [column.rank for column in columns if column not in kept]
    assert min(gone, default=9) >= max((column.rank for column in kept if column.rank), default=0)


def test_what_is_left_out_is_named() -> None:
    columns = [
        Column("#", "n", rounded),
        Column("source", "by", rank=1),
        Column("cycle time", "t", rounded),
        Column("links [m]", "l", rank=2),
    ]
    rows: list[dict[str, object]] = [{"n": 1, "by": "front search", "t": 3.125, "l": "0.10 0.20"}]
    whole = ["# source       cycle time links [m]", "1 front search       3.12 0.10 0.20"]
    assert printed(columns, rows, 80, gap=1) == whole
    narrow = ["               cycle", "# source        time", "1 front search  3.12"]
    assert printed(columns, rows, 24, gap=1) == [*narrow, "left out at this width: links [m]; --csv prints all"]


def test_texts_are_shortened_to_whole_characters() -> None:
    assert shorten("an arm", 6) == "an arm"
    assert shorten("an arm", 5) == "an a…"
    assert shorten("an arm", 4) == "an…"
    assert shorten("中中中", 5) == "中中…"
