"""Show the progress of studies and front searches: a live line in a terminal, plain lines elsewhere."""

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
SHARE_INTERVAL = 0.1  # share of the budget between two plain lines of a search
# After the hypervolume, in place of the rest of the state, which a narrow terminal would cut
VERIFYING = "verifying"


@contextmanager
def study_progress(console: Console) -> Generator[Callable[[StudyProgress], None]]:
    """Yield a callback that shows a study."""
    with _live_line(console) as update:
        started = time.perf_counter()
        failed_kinds: set[str] = set()

        def watch(progress: StudyProgress) -> None:
            if progress.note:
                note = f"no usable proposal ({progress.note}); a black-box trial took its place"
                console.print(f"trial {progress.number}: {note}" if progress.fault else progress.note)
            source, done = source_label(progress.source), progress.iteration
            if progress.reason and progress.source != "rules":  # the rules are explained in the report
                console.print(f"trial {progress.number}, {source}: {progress.reason}")
            for kind in progress.latest_failures.keys() - failed_kinds:
                failed_kinds.add(kind)
                text = progress.latest_failures[kind]
                _print_at_once(console, f"{progress.failures[kind]} failed ({kind.replace('_', ' ')}): {text}")
            volume = f"hypervolume {decimals(progress.hypervolume, 3)}"
            failed = f"  failed {sum(progress.faults.values())}" if progress.faults else ""
            failed += f"  failed evaluations {sum(progress.failures.values())}" if progress.failures else ""
            state = f"{volume}  front {progress.front_size}{failed}"
            count, is_last = f"iteration {done}/{progress.n_total}", done == progress.n_total
            if update is not None:
                activity = f"asking {source} …" if progress.doing == "proposing" else source
                waiting = f"  {progress.n_in_flight} in flight" if progress.n_in_flight else ""
                is_ended = progress.doing == "finished" and is_last
                state = f"{volume}  {VERIFYING}" if is_ended else f"{state}  {activity}{waiting}"
                update(total=progress.n_total, completed=done, count=count, state=state)
            elif progress.doing == "finished" and done and (done % LINE_INTERVAL == 0 or is_last):
                _print_at_once(console, f"{count}  {state}  {source}  {time.perf_counter() - started:.1f} s")

        yield watch


@contextmanager
def search_progress(console: Console) -> Generator[Callable[[SearchProgress], None]]:
    """Yield a callback that shows a front search."""
    with _live_line(console) as update:
        due = 0.0  # spent share of the budget at the next plain line

        def watch(progress: SearchProgress) -> None:
            nonlocal due
            count = f"{progress.evaluations:9,} evaluations"
            volume = f"hypervolume {decimals(progress.hypervolume, 3)}"
            state = f"{progress.seconds:6.1f} s  {volume}  front {progress.front_size}"
            if update is not None:
                is_ended = progress.is_ended
                state, spent = (f"{volume}  {VERIFYING}", 1.0) if is_ended else (state, progress.share)
                update(total=1.0, completed=spent, count=count, state=state)
            elif progress.share >= due and not progress.is_ended:
                _print_at_once(console, f"{count}  {state}")
                due = progress.share + SHARE_INTERVAL

        yield watch


def announce_compilation(console: Console) -> None:
    """Print a line before the first kernel compiles."""
    compilation.announce = lambda: _print_at_once(
        console, "compiling kernels for this machine, once; this time does not count"
    )


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
