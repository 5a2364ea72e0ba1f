"""Tables in terminals of any width."""

import fcntl
import io
import os
import pty
import re
import struct
import sys
import termios

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from armwright.cli.streams import wrap_sentences
from armwright.cli.tables import Column, Table, fit_table, numbers, print_table, shorten

COLUMNS = st.lists(
    st.builds(
        Column,
        head=st.sampled_from(["#", "price", "cycle time", "peak torque [N m]", "a head"]),
        is_number=st.booleans(),
        rank=st.integers(0, 3),
        least=st.none() | st.integers(3, 10),
    ),
    min_size=1,
    max_size=8,
)


@st.composite
def tables(draw: st.DrawFn) -> Table:
    """Draw tables whose numbers are never shortened."""
    columns = [
        column if not column.is_number else numbers(column.head, rank=column.rank)[0] for column in draw(COLUMNS)
    ]
    text = st.text("abc é中", max_size=30).map(str.strip)
    row = st.tuples(*(st.floats(-1e6, 1e6).map(lambda value: f"{value:.4g}") if c.is_number else text for c in columns))
    return Table(columns, draw(st.lists(row, max_size=4)), "--json prints all", gap=draw(st.integers(1, 2)))


def printed(table: Table, width: int) -> str:
    console = Console(file=io.StringIO(), width=width, soft_wrap=True, markup=False, highlight=False)
    print_table(console, table)
    return console.file.getvalue()  # type: ignore[attr-defined]


@given(tables(), st.integers(1, 90))
def test_fitted_tables_are_narrow_enough_or_hold_only_what_is_never_dropped(table: Table, width: int) -> None:
    fitted, dropped = fit_table(table, width)
    lines = printed(fitted, 10_000).splitlines()
    console = Console(width=10_000)
    if max((console.measure(line).maximum for line in lines), default=0) > width:
        assert {column.rank for column in fitted.columns} == {0} or len(fitted.columns) == 1
    kept = [column.rank for column in fitted.columns]
    assert len(kept) + len(dropped) == len(table.columns)
    gone = sorted(column.rank for column in table.columns)[len(kept) :]
    assert sorted([*kept, *gone]) == sorted(column.rank for column in table.columns)  # the highest ranks go first


@given(tables(), st.integers(1, 90))
def test_numbers_and_heads_are_never_cut(table: Table, width: int) -> None:
    fitted, dropped = fit_table(table, width)
    heads = [column.head.replace("\n", " ") for column in fitted.columns]
    assert sorted([*heads, *dropped]) == sorted(column.head for column in table.columns)
    cells = [[cell for c, cell in zip(table.columns, row, strict=True) if c.is_number] for row in table.rows]
    for shown, whole in zip(fitted.rows, cells, strict=True):
        left = [cell for c, cell in zip(fitted.columns, shown, strict=True) if c.is_number]
        assert set(left) <= set(whole)


def test_what_is_left_out_is_named() -> None:
    columns = (*numbers("#"), Column("source", rank=1), *numbers("cycle time"), Column("links [m]", rank=2))
    table = Table(columns, [["1", "front search", "3.125", "0.10 0.20"]], "--csv prints all", title="Front", gap=1)
    whole = ["Front", "# source       cycle time links [m]", "1 front search      3.125 0.10 0.20"]
    assert printed(table, 80).splitlines() == whole
    narrow = ["Front", "               cycle", "# source        time", "1 front search 3.125"]
    assert printed(table, 24).splitlines() == [*narrow, "left out at this width: links [m]; --csv prints all"]


def test_texts_are_shortened_to_whole_characters() -> None:
    assert shorten("an arm", 6) == "an arm"
    assert shorten("an arm", 5) == "an a…"
    assert shorten("an arm", 4) == "an…"
    assert shorten("中中中", 5) == "中中…"


@given(st.text("abc 12.5%`-", max_size=120), st.integers(5, 60))
def test_wrapped_sentences_keep_their_words(text: str, width: int) -> None:
    wrapped = wrap_sentences(text, width)
    assert wrapped.split() == text.split()
    for line in wrapped.splitlines():
        assert len(line) <= width or " " not in re.sub(r"`[^`]*`|\d (?=%)", "", line.strip())


ESCAPE = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]")


def in_terminal(width: int, *arguments: str) -> tuple[int, list[str]]:
    """Return the exit code of a command and what a terminal of this width has on its lines in the end."""
    child, terminal = pty.fork()
    if child == 0:
        environment = {name: value for name, value in os.environ.items() if name != "COLUMNS"} | {"TERM": "xterm"}
        fcntl.ioctl(1, termios.TIOCSWINSZ, struct.pack("HHHH", 50, width, 0, 0))
        os.execve(sys.executable, [sys.executable, "-m", "armwright", *arguments], environment)
    written = b""
    while True:
        try:
            part = os.read(terminal, 65536)
        except OSError:  # the command has ended
            break
        written += part
    os.close(terminal)
    _, status = os.waitpid(child, 0)
    text = ESCAPE.sub("", written.decode("utf-8", "replace")).replace("\r\n", "\n")
    return os.waitstatus_to_exitcode(status), [line.split("\r")[-1] for line in text.split("\n")]


@pytest.mark.slow
@pytest.mark.parametrize("command", [("actuators", "XM430-W350", "MG996R"), ("check", "desk-sorting", "--no-picture")])
def test_terminals_wrap_only_what_has_no_spaces(command: tuple[str, ...]) -> None:
    code, lines = in_terminal(60, *command)
    assert code == 0
    for line in lines:
        assert len(line) <= 60 or len(line.split()) == 1 or "https://" in line, line
