"""Designs a second on one core: several kinds of work, measured in turn, as the speed of a shared machine drifts."""

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping

Work = Mapping[str, Callable[[], object]]
Rates = dict[str, list[float]]


def on_one_core(script: str, main: Callable[[], None]) -> None:
    """Runs `main` of a script in a process of its own, which never had more threads than that."""
    if "--one-core" in sys.argv:
        main()
        return
    subprocess.run(
        [sys.executable, script, "--one-core"],
        check=True,
        preexec_fn=lambda: os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:1]),
    )


def rates_in_turn(work: Work, n: int, rounds: int) -> Rates:
    """(rounds,) designs a second of each, where all that one does is for n designs."""
    for do in work.values():
        do()  # compiles and loads
    found = [{name: n / seconds(do) for name, do in work.items()} for _ in range(rounds)]
    return {name: [one[name] for one in found] for name in work}


def print_rates(rates: Rates) -> None:
    for name, found in rates.items():
        print(f"  {name:38s} {statistics.median(found):10.0f}   ({min(found):.0f}, {max(found):.0f})")


def seconds(do: Callable[[], object]) -> float:
    started = time.perf_counter()
    do()
    return time.perf_counter() - started
