"""Many trials, and many evaluations, in one process: does anything grow that should not?

A study with the random sampler, one with TPE and one with the rules, each in a run folder; beside the first two the
same trials on Optuna alone, in memory: ask, suggest, tell, with values that are known beforehand. Then a search for the
whole front. Each part is a process of its own on one core; times are its processor's, so that others do not count.

    python benchmarks/soak.py --figure docs/soak.png         # some 15 minutes on a quiet machine
    python benchmarks/soak.py --only tpe                     # one part of it

Memory is the resident set. A study keeps all its trials, so its memory grows by the trial, as Optuna's does; what is
asked is that it grows by a straight line. Files and threads are those that are open after the first tenth and at last.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import optuna
import psutil
from matplotlib.figure import Figure

from armwright.problem.problem import Problem
from armwright.runs.folder import read_run
from armwright.search.samplers import sampler_factory
from armwright.seeding import derived_seed
from armwright.spaces.parameters import FloatParameter
from armwright.study.front.front_run import find_front
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task

TASK = "target-1"
STUDIES = {"random": ("none", "random", 100_000), "tpe": ("none", "tpe", 2_000), "rules": ("rules", "random", 20_000)}
EVALUATIONS = 10_000_000
PARTS = 10  # that a soak is shown in
LOOKS = 200  # at memory, over a soak


@dataclass(frozen=True)
class Look:
    """at: trials or evaluations. seconds: of the processor. evaluating: of these, for evaluations. memory [MiB]."""

    at: int
    seconds: float
    memory: float
    files: int
    threads: int
    evaluating: float = 0.0


class Watcher:
    """Looks at this process, every so often."""

    def __init__(self, n: int) -> None:
        self.looks: list[Look] = []
        self._every = n / LOOKS
        self._started = time.process_time()
        self._process = psutil.Process()

    def see(self, at: int, evaluating: float = 0.0) -> None:
        if self.looks and at < self.looks[-1].at + self._every:
            return
        with self._process.oneshot():
            memory = self._process.memory_info().rss / 2**20
            files, threads = self._process.num_fds(), self._process.num_threads()
        seconds = time.process_time() - self._started
        self.looks.append(Look(at, seconds, memory, files, threads, evaluating))


def study(kind: str, n: int, folder: Path) -> list[Look]:
    """A run of armwright."""
    proposer, sampler, _ = STUDIES[kind]
    problem = Problem(load_task(TASK))
    problem.evaluate(problem.space.sample(1, 0))  # loads the kernels
    watcher = Watcher(n)
    optimize(
        problem,
        proposer=proposer,
        sampler=sampler,
        n_total=n,
        out=folder,
        verify=False,
        watch=lambda progress: watcher.see(progress.number) if progress.doing == "finished" else None,
    )
    return watcher.looks


def bare(kind: str, n: int, folder: Path) -> list[Look]:
    """The same trials on Optuna alone, and what their evaluations take."""
    _, sampler, _ = STUDIES[kind]
    _, history = read_run(folder)
    problem = history.problem
    problem.evaluate(problem.space.sample(1, 0))
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    alone = optuna.create_study(directions=["minimize", "minimize"])
    watcher = Watcher(n)
    evaluating = 0.0
    for trial in history:
        drawing = "random" if trial.number < history.n_init else sampler
        alone.sampler = sampler_factory(drawing)(derived_seed(0, 1, trial.number))
        asked = alone.ask()
        assert suggested(asked, problem) == trial.design.params, "the same trials"
        alone.tell(asked, trial.values)
        if trial.duplicate_of is None:
            started = time.process_time()
            problem.evaluate([trial.design])
            evaluating += time.process_time() - started
        watcher.see(trial.number, evaluating)
    return watcher.looks


def suggested(trial: optuna.Trial, problem: Problem) -> dict[str, float | str]:
    """As an objective of anybody's would: the paper's space has neither steps nor conditions."""
    return {
        p.name: trial.suggest_float(p.name, p.low, p.high)
        if isinstance(p, FloatParameter)
        else trial.suggest_categorical(p.name, p.choices)
        for p in problem.space.parameters
    }


def front(n: int, folder: Path) -> list[Look]:
    problem = Problem(load_task(TASK))
    watcher = Watcher(n)
    find_front(
        problem,
        evaluations=n,
        stop_at_stall=False,
        out=folder,
        watch=lambda progress: watcher.see(progress.evaluations),
    )
    return watcher.looks


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", nargs="+", choices=[*STUDIES, "front"], default=[*STUDIES, "front"])
    parser.add_argument("--share", type=float, default=1.0, help="of the trials and evaluations")
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--part", nargs=3, metavar=("PART", "N", "FOLDER"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.part:
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {cores[os.getpid() % len(cores)]})
        (name, kind), n, folder = given.part[0].split("-"), int(given.part[1]), Path(given.part[2])
        parts: dict[str, Callable[[], list[Look]]] = {
            "study": lambda: study(kind, n, folder),
            "bare": lambda: bare(kind, n, folder),
            "front": lambda: front(n, folder),
        }
        print(json.dumps([asdict(look) for look in parts[name]()]))
        return
    drawn: dict[str, list[Look]] = {}
    for kind in given.only:
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary) / "run"
            if kind == "front":
                n = int(given.share * EVALUATIONS)
                drawn[f"front, {n:,} evaluations"] = looks = in_process("front-all", n, folder)
                show_front(looks)
                continue
            n = int(given.share * STUDIES[kind][2])
            looks = in_process(f"study-{kind}", n, folder)
            drawn[f"{kind}, {n:,} trials"] = looks
            alone = in_process(f"bare-{kind}", n, folder) if STUDIES[kind][0] == "none" else None
            if alone:
                drawn[f"Optuna alone, {kind}"] = alone
            show_study(kind, looks, alone)
    if given.figure:
        draw(drawn, given.figure)


def in_process(part: str, n: int, folder: Path) -> list[Look]:
    command = [sys.executable, __file__, "--part", part, str(n), str(folder)]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, encoding="utf-8")
    return [Look(**look) for look in json.loads(done.stdout.splitlines()[-1])]


def show_study(kind: str, ours: list[Look], alone: list[Look] | None) -> None:
    proposer, sampler, _ = STUDIES[kind]
    print(f"\n{ours[-1].at + 1:,} trials, sampler {sampler}, proposer {proposer}; ms a trial by tenths")
    rows = {"armwright": per_step([look.seconds for look in ours], ours)}
    if alone:
        evaluating = [look.evaluating for look in alone]
        rows["evaluations alone"] = per_step(evaluating, alone)
        rows["Optuna alone"] = per_step([a.seconds - e for a, e in zip(alone, evaluating, strict=True)], alone)
        rows["what armwright adds"] = [a - e - o for a, e, o in zip(*rows.values(), strict=True)]
    for name, steps in rows.items():
        print(f"  {name:22}{''.join(f'{1e3 * step:7.2f}' for step in steps)}")
    for name, looks in (("armwright", ours), ("Optuna alone", alone or [])):
        if looks:
            show_memory(name, looks, 1, "KiB a trial", 2**10)
    show_open(ours)


def show_front(looks: list[Look]) -> None:
    print(f"\nfront, {looks[-1].at:,} evaluations; µs an evaluation by tenths")
    steps = per_step([look.seconds for look in looks], looks)
    print(f"  {'armwright':22}{''.join(f'{1e6 * step:7.1f}' for step in steps)}")
    show_memory("armwright", looks, 1_000_000, "KiB a million evaluations", 2**10)
    show_open(looks)


def per_step(spent: list[float], looks: list[Look]) -> list[float]:
    """[s] a trial or evaluation, by tenths."""
    at = np.array([look.at for look in looks])
    edges = np.linspace(at[0], at[-1], PARTS + 1)
    return (np.diff(np.interp(edges, at, spent)) / np.diff(edges)).tolist()


def show_memory(name: str, looks: list[Look], per: int, words: str, unit: int) -> None:
    """The straight line through the second half."""
    half = looks[len(looks) // 2 :]
    slope, at_zero = np.polyfit([look.at for look in half], [look.memory for look in half], 1)
    off = max(abs(look.memory - at_zero - slope * look.at) for look in half)
    print(
        f"  {name}: memory {looks[0].memory:.0f} MiB at first, {looks[len(looks) // 2].memory:.0f} in the middle, "
        f"{looks[-1].memory:.0f} at last; in the second half {slope * per * unit:+.2f} {words}, "
        f"at most {off:.1f} MiB off that line"
    )


def show_open(looks: list[Look]) -> None:
    early, last = looks[len(looks) // PARTS], looks[-1]
    print(f"  open files {early.files} and {last.files}, threads {early.threads} and {last.threads}")


def draw(drawn: dict[str, list[Look]], file: Path) -> None:
    figure = Figure(figsize=(7.0, 3.5), layout="constrained")
    axes = figure.subplots()
    for name, looks in drawn.items():
        axes.plot([look.at / looks[-1].at for look in looks], [look.memory for look in looks], label=name)
    axes.set(xlabel="share of the trials or evaluations", ylabel="resident memory [MiB]")
    axes.set_ylim(0.0, 1.1 * max(look.memory for looks in drawn.values() for look in looks))
    axes.legend(fontsize=8)
    figure.savefig(file, dpi=150)


if __name__ == "__main__":
    main()
