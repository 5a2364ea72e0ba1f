"""Show the progress of studies and front searches: a live line in a terminal, plain lines elsewhere."""

import math
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import partial

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Column

from armwright.kinematics.devices import compilation
from armwright.runs.history import source_label
from armwright.study.front.search_budget import SearchProgress
from armwright.study.progress import Progress as StudyProgress
from armwright.text import decimals

LINE_INTERVAL = 10  # counted trials between two plain lines of a study
VERIFYING = "verifying"  # after the hypervolume, in place of the rest of the state, which a narrow terminal would cut
RATE_AFTER = 1.0  # [s] of search
SHARE_INTERVAL = 0.1  # share of the budget between two plain lines of a search


@contextmanager
def study_progress(console: Console) -> Generator[Callable[[StudyProgress], None]]:
    """Yield a callback that shows a study."""
    with _live_line(console) as update:
        started = time.perf_counter()
        shown: dict[str, str] = {}  # the last failure of each kind that was printed
        due = 0  # counted trials from which failures of kinds that were printed are printed again

        def watch(progress: StudyProgress) -> None:
            nonlocal due
            if progress.note:
                console.print(_note(progress))
            if progress.reason and progress.source != "rules":  # the rules are explained in the report
                console.print(f"trial {progress.number}, {source_label(progress.source)}: {progress.reason}")
            source, done = source_label(progress.source), progress.iteration
            volume = decimals(progress.hypervolume, 3)
            new = {kind: text for kind, text in progress.latest_failures.items() if shown.get(kind) != text}
            if new.keys() - shown.keys() or (new and progress.iteration >= due):
                for kind, text in new.items():
                    _print_at_once(console, f"{progress.failures[kind]} failed ({kind.replace('_', ' ')}): {text}")
                shown.update(new)
                due = progress.iteration + LINE_INTERVAL
            failed = f"  failed {sum(progress.faults.values())}" if progress.faults else ""
            failed += f"  failed evaluations {sum(progress.failures.values())}" if progress.failures else ""
            count = f"iteration {done}/{progress.n_total}"
            state = f"hypervolume {volume}  front {progress.front_size}{failed}"
            if update is not None:
                activity = {"proposing": f"asking {source} …", "paused": "paused"}.get(progress.doing, source)
                waiting = f"  {progress.n_in_flight} in flight" if progress.n_in_flight else ""
                is_ended = progress.doing == "finished" and done == progress.n_total
                state = f"hypervolume {volume}  {VERIFYING}" if is_ended else f"{state}  {activity}{waiting}"
                update(total=progress.n_total, completed=done, count=count, state=state)
            elif progress.doing == "finished" and done and (done % LINE_INTERVAL == 0 or done == progress.n_total):
                _print_at_once(console, f"{count}  {state}  {source}  {time.perf_counter() - started:.1f} s")

        yield watch


@contextmanager
def search_progress(console: Console) -> Generator[Callable[[SearchProgress], None]]:
    """Yield a callback that shows a front search."""
    with _live_line(console) as update:
        due = 0.0  # spent share of the budget at the next plain line
        is_rate_known = False

        def watch(progress: SearchProgress) -> None:
            nonlocal due, is_rate_known
            if not is_rate_known and progress.new_seconds >= RATE_AFTER:
                is_rate_known = True
                _print_at_once(console, describe_rate(progress))
            spent = 1.0 if progress.is_ended else progress.share
            count = f"{progress.evaluations:9,} evaluations"
            volume = f"hypervolume {decimals(progress.hypervolume, 3)}"
            rest = f"{progress.seconds:6.1f} s  {volume}  front {progress.front_size}"
            state = f"{volume}  {VERIFYING}" if progress.is_ended else rest
            if update is not None:
                update(total=1.0, completed=spent, count=count, state=state)
            elif spent >= due and not progress.is_ended:
                _print_at_once(console, f"{count}  {state}")
                due = spent + SHARE_INTERVAL

        yield watch


def announce_compilation(console: Console) -> None:
    """Print a line before the first kernel compiles."""
    compilation.announce = lambda: _print_at_once(
        console, "compiling kernels for this machine, once; this time does not count"
    )


def describe_rate(progress: SearchProgress) -> str:
    """Return the measured rate of a search and how many designs it will evaluate."""
    rate = progress.new_evaluations / progress.new_seconds
    left = min(progress.seconds_left, ((progress.budget.evaluations or math.inf) - progress.evaluations) / rate)
    n, seconds = progress.evaluations + rate * left, progress.seconds + left
    return f"about {_rounded(rate)} designs/s: {_rounded(n)} designs in {_describe_seconds(seconds)}"


def _rounded(number: float) -> str:
    """Return a number of two digits."""
    return f"{float(f'{number:.2g}'):,.{0 if number >= 10.0 else 1}f}"


def _describe_seconds(seconds: float) -> str:
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.2g} s"


def _note(progress: StudyProgress) -> str:
    if progress.fault:
        return f"trial {progress.number}: no usable proposal ({progress.note}); a black-box trial took its place"
    return progress.note


def _print_at_once(console: Console, line: str) -> None:
    console.print(line)
    console.file.flush()


@contextmanager
def _live_line(console: Console) -> Generator[Callable[..., None] | None]:
    """Yield a function that updates a live line; None if the console is not a terminal."""
    if not console.is_terminal:
        yield None
        return
    count, state = (
        TextColumn(f"{{task.fields[{name}]}}", table_column=Column(no_wrap=True)) for name in ("count", "state")
    )
    bar = [BarColumn(24)] if console.width >= 100 else []
    with Progress(count, *bar, state, TimeRemainingColumn(compact=True), console=console) as line:
        yield partial(line.update, line.add_task("", total=None, count="starting", state=""))
