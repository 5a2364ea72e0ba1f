"""Show the progress of studies and front searches."""

import math
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
from rich.table import Column
from rich.text import Text

from armwright.study.progress import Progress as StudyProgress
from armwright.study.search_budget import SearchProgress

LINE_INTERVAL = 10  # counted trials between two plain lines


@contextmanager
def study_progress(console: Console) -> Generator[Callable[[StudyProgress], None]]:
    """Yield a callback that shows a study: a live line in a terminal, plain lines elsewhere."""
    if console.is_terminal:
        with _live(console) as watch:
            yield watch
    else:
        yield _plain(console)


def _state(progress: StudyProgress) -> str:
    volume = "-" if progress.hypervolume is None else f"{progress.hypervolume:.3f}"
    faults = sum(progress.faults.values())
    failed = f"  failed {faults}" if faults else ""
    return f"hypervolume {volume}  front {progress.front_size}{failed}"


def _note(progress: StudyProgress) -> str:
    """Return a message for the user; empty without one, or if it was shown before."""
    if progress.fault and progress.note:
        return f"trial {progress.number}: no usable proposal ({progress.note}); a black-box trial took its place"
    return progress.note


@contextmanager
def search_progress(console: Console) -> Generator[Callable[[SearchProgress], None]]:
    """Yield a callback that shows a front search: a live line in a terminal, plain lines elsewhere."""
    if not console.is_terminal:
        yield _plain_search(console)
        return
    columns = (TextColumn("{task.fields[state]}"), BarColumn(24))
    with Progress(*columns, console=console) as bar:
        line = bar.add_task("", total=1.0, state="starting")

        def watch(progress: SearchProgress) -> None:
            bar.update(line, completed=_spent(progress), state=_search_state(progress))

        yield watch


def _plain_search(console: Console) -> Callable[[SearchProgress], None]:
    due = 0.0  # share of the budget at the next line

    def watch(progress: SearchProgress) -> None:
        nonlocal due
        if _spent(progress) >= due:
            console.print(_search_state(progress))
            console.file.flush()
            due = _spent(progress) + 0.1

    return watch


def _spent(progress: SearchProgress) -> float:
    """Return the spent share of the budget, at most 1."""
    budget = progress.budget
    shares = [progress.evaluations / (budget.evaluations or math.inf), progress.seconds / (budget.seconds or math.inf)]
    return min(1.0, max(shares))


def _search_state(progress: SearchProgress) -> str:
    return (
        f"{progress.evaluations:9,} evaluations  {progress.seconds:6.1f} s  hypervolume {progress.hypervolume:.3f}  "
        f"front {progress.front_size}"
    )


def _plain(console: Console) -> Callable[[StudyProgress], None]:
    started = time.perf_counter()

    def watch(progress: StudyProgress) -> None:
        if note := _note(progress):
            console.print(note)
        done = progress.iteration
        if progress.doing == "finished" and done > 0 and (done % LINE_INTERVAL == 0 or done == progress.n_total):
            spent = time.perf_counter() - started
            console.print(f"iteration {done}/{progress.n_total}  {_state(progress)}  {progress.source}  {spent:.1f} s")
            console.file.flush()

    return watch


class _TimeLeft(ProgressColumn):
    """The remaining time at the pace of this session's trials."""

    def render(self, task: Task) -> Text:
        left = task.time_remaining
        return Text("" if left is None else f"{left // 60:.0f}:{left % 60:02.0f} left")


@contextmanager
def _live(console: Console) -> Generator[Callable[[StudyProgress], None]]:
    bar_columns = [BarColumn(24)] if console.width >= 100 else []
    columns = (
        TextColumn("{task.fields[count]}", table_column=Column(no_wrap=True)),
        *bar_columns,
        TextColumn("{task.fields[state]}", table_column=Column(no_wrap=True)),
        _TimeLeft(table_column=Column(no_wrap=True)),
    )
    with Progress(*columns, console=console, transient=False) as bar:
        line = bar.add_task("", total=None, count="starting", state="")

        def watch(progress: StudyProgress) -> None:
            if note := _note(progress):
                console.print(note)
            activities = {"proposing": f"asking {progress.source} …", "paused": "paused"}
            activity = activities.get(progress.doing, progress.source)
            if progress.n_in_flight:
                activity += f"  {progress.n_in_flight} asked"
            bar.update(
                line,
                total=progress.n_total,
                completed=progress.iteration,
                count=f"iteration {progress.iteration}/{progress.n_total}",
                state=f"{_state(progress)}  {activity}",
            )

        yield watch
