"""Expensive evaluators: the hypervolume that searches reach within 10 to 200 evaluations.

    python benchmarks/expensive.py --out expensive              # the whole plan; the same command resumes
    python benchmarks/expensive.py --out expensive --share 1/2  # half of it; --share 2/2 on another core
    python benchmarks/expensive.py --out expensive --methods tpe,surrogate --evaluators pd --tasks target-1 --seeds 3
    python benchmarks/expensive.py --out expensive --only-tables
    python benchmarks/expensive.py --own-time desk-sorting      # what samplers take on a task with a cycle

Set OMP_NUM_THREADS=1 for `gp` and `botorch`: their threads only get in each other's way.

Each finished run is one line of OUT/runs.jsonl. All methods of a seed begin with the same 10 random designs, which
count as evaluations. Hypervolumes are bounded by the point of `reference_point`.

`gp` and `botorch` (qNEHVI) need packages that armwright does not bring, best in an environment of their own. `botorch`
takes seconds a trial, so it runs only if it is named by --methods.

    pip install -e '.[gp]' mujoco optuna-integration==5.0.0 botorch==0.18.1

| evaluator | objectives | time |
|---|---|---|
| pd | distance from the targets and work of motors with a PD law, in MuJoCo | 10 to 30 ms |
| settling | time until the tip rests at the targets, and its distance then | 10 to 30 ms |
| control | two random smooth functions of the parameters | < 1 ms |
| simulation | `examples/mujoco_simulation.py:follow` | 40 ms |
"""

import argparse
import json
import os
import time
import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import expensive_evaluators
import numpy as np

import armwright as aw
from armwright.arrays import Array
from armwright.exceptions import SettingsError, UsageError
from armwright.experiments.statistics import LEVEL, PairedTest, holm, interval, paired_test
from armwright.pareto import hypervolume_history
from armwright.spaces.design_space import default_space

N_INIT = 10
COUNTS = (10, 20, 30, 60, 100, 200)
FULL = Path(__file__).parents[1] / "examples" / "mujoco_simulation.py"
BOX = {"pd": (5.0, 20.0), "simulation": (5.0, 20.0)}  # [m], [J]
N_PROBED, QUANTILE = 64, 0.75  # random designs that bound the other evaluators


def botorch(seed: int) -> Any:
    """Return BoTorch's noisy expected hypervolume improvement as a sampler of Optuna."""
    try:
        from optuna_integration import botorch as integration  # pyright: ignore
    except ImportError as reason:
        raise SettingsError(f"{reason}; pip install optuna-integration botorch greenlet") from reason

    def candidates(x: Any, y: Any, constraints: Any, bounds: Any, pending: Any) -> Any:
        varies = constraints is not None and bool((constraints > 0.0).any())  # some evaluation failed
        return integration.botorch.qnehvi_candidates_func(  # pyright: ignore
            x, y, constraints if varies else None, bounds, pending
        )

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that it is experimental
        return integration.BoTorchSampler(  # pyright: ignore
            candidates_func=candidates, n_startup_trials=N_INIT, seed=seed
        )


METHODS: Mapping[str, dict[str, Any]] = {
    "random": {"sampler": "random", "proposer": "none"},
    "tpe": {"sampler": "tpe", "proposer": "none"},
    "tpe-rules": {"sampler": "tpe", "proposer": "rules"},
    "nsga2": {"sampler": "nsga2", "proposer": "none"},
    "gp": {"sampler": "gp", "proposer": "none"},
    "botorch": {"sampler": botorch, "proposer": "none"},
    "surrogate": {"sampler": "surrogate", "proposer": "none"},
}
SLOW = ("botorch",)
OURS, MAIN = "surrogate", ("tpe", "tpe-rules", "surrogate")
SEEDS_OF_MAIN, SEEDS_OF_OTHERS = 20, 5


@dataclass(frozen=True)
class Cell:
    """An evaluator on a task."""

    evaluator: str
    task: str

    @property
    def name(self) -> str:
        return f"{self.evaluator}, {self.task}"


CELLS = (
    Cell("pd", "target-1"),
    Cell("pd", "target-2"),
    Cell("pd", "target-3"),
    Cell("pd", "machine-tending"),
    Cell("settling", "target-1"),
    Cell("settling", "target-2"),
    Cell("settling", "machine-tending"),
    Cell("simulation", "target-1"),
    Cell("control", "target-1"),
)
GOAL_CELLS = tuple(cell for cell in CELLS if cell.evaluator != "control")  # eight


@dataclass(frozen=True)
class Run:
    """A finished run.

    Attributes:
        evaluator, task, method, seed: what was run.
        evaluations, failed: how many, and how many of them failed.
        hypervolumes: after each of COUNTS evaluations.
        seconds: wall time of the whole run, and of the evaluations alone [s].
    """

    evaluator: str
    task: str
    method: str
    seed: int
    evaluations: int
    failed: int
    hypervolumes: Mapping[str, float]
    seconds: float
    evaluation_seconds: float

    @property
    def key(self) -> tuple[str, str, str, int]:
        return self.evaluator, self.task, self.method, self.seed


@lru_cache
def problem_of(cell: Cell) -> aw.Problem:
    """Return the problem of a cell, whose task states no reference point of its own."""
    if cell.evaluator == "simulation":
        evaluator = aw.load_evaluator(f"{FULL}:follow")
    else:
        evaluator = getattr(expensive_evaluators, cell.evaluator)
    task = aw.load_task(cell.task).model_copy(update={"objectives": None, "reference_point": None, "resolution": ()})
    return aw.Problem(task, default_space(cell.task), evaluator=evaluator)


@lru_cache
def reference_point(cell: Cell) -> tuple[float, ...]:
    """Return the worst values that count: a stated box, or a quantile of random designs."""
    if cell.evaluator in BOX:
        return BOX[cell.evaluator]
    problem = problem_of(cell)
    values = problem.evaluate(problem.space.sample(N_PROBED, seed=12345)).values
    finite = values[np.isfinite(values).all(axis=1)]
    return tuple(np.quantile(finite, QUANTILE, axis=0).tolist())


def plan(options: argparse.Namespace) -> Iterator[tuple[Cell, str, int]]:
    """Yield the runs seed by seed, so that a plan which is cut short is balanced."""
    for seed in range(options.seeds or SEEDS_OF_MAIN):
        for cell in CELLS:
            for method in options.methods:
                seeds = options.seeds or (SEEDS_OF_MAIN if method in MAIN else SEEDS_OF_OTHERS)
                if cell.evaluator in options.evaluators and cell.task in options.tasks and seed < seeds:
                    yield cell, method, seed


def execute(cell: Cell, method: str, seed: int, evaluations: int) -> Run:
    """Run a search."""
    problem, settings = problem_of(cell), METHODS[method]
    started = time.perf_counter()
    found = aw.optimize(
        problem, **settings, n_init=N_INIT, n_total=evaluations - N_INIT, seed=seed, allow_failures=True
    )
    seconds = time.perf_counter() - started
    point = reference_point(cell)
    values = np.array([[np.inf] * len(point) if trial.failure else trial.values for trial in found.trials])
    curve = hypervolume_history(values, point)
    return Run(
        cell.evaluator,
        cell.task,
        method,
        seed,
        len(values),
        sum(trial.failure is not None for trial in found.trials),
        {str(count): float(curve[count - 1]) for count in COUNTS if count <= len(curve)},
        round(seconds, 2),
        round(found.summary["seconds"]["evaluation"], 2),
    )


def read(file: Path) -> list[Run]:
    """Return the finished runs, the longest of each kind; lines that a kill truncated do not count."""
    lines = file.read_bytes().split(b"\n") if file.exists() else []
    lines = [line for line in lines if line.endswith(b"}")]
    runs = sorted((Run(**json.loads(line)) for line in lines), key=lambda run: run.evaluations)
    return list({run.key: run for run in runs}.values())


def append(file: Path, run: Run) -> None:
    """Write a run as one line, in a single write."""
    with file.open("ab", buffering=0) as out:
        out.write(b"\n" + json.dumps(asdict(run)).encode() + b"\n")  # apart from a truncated line
        os.fsync(out.fileno())


def work(options: argparse.Namespace, file: Path) -> None:
    """Execute the runs of the plan that are missing."""
    done = {run.key for run in read(file) if run.evaluations >= options.evaluations}
    part, parts = options.share
    deadline = time.monotonic() + 3600.0 * options.hours
    unusable: set[str] = set()
    for number, (cell, method, seed) in enumerate(plan(options)):
        if number % parts != part - 1 or (cell.evaluator, cell.task, method, seed) in done or method in unusable:
            continue
        if time.monotonic() > deadline:
            print(f"stopped after {options.hours:g} h; the same command goes on")
            return
        try:
            run = execute(cell, method, seed, options.evaluations)
        except UsageError as reason:  # a sampler that is not installed
            unusable.add(method)
            print(f"{method} is left out: {reason}", flush=True)
            continue
        append(file, run)
        print(f"{cell.name}, {method}, seed {seed}: {run.seconds:.1f} s", flush=True)


def own_times(task: str, evaluations: int) -> None:
    """Print what samplers take beside an evaluator that takes nothing."""
    for method in ("tpe", OURS):
        run = execute(Cell("control", task), method, 0, evaluations)
        seconds = (run.seconds - run.evaluation_seconds) / run.evaluations
        print(f"{method} on {task}: {seconds:.3f} s a trial, of {run.evaluations}", flush=True)


def table(runs: Iterable[Run], options: argparse.Namespace) -> Mapping[tuple[Cell, str, int], dict[int, float]]:
    """Print the mean hypervolumes with their 95 % intervals; return all, by cell, method, count and seed."""
    found: dict[tuple[Cell, str, int], dict[int, float]] = {}
    times: dict[tuple[Cell, str], list[float]] = {}
    for run in runs:
        cell = Cell(run.evaluator, run.task)
        times.setdefault((cell, run.method), []).append(1e3 * (run.seconds - run.evaluation_seconds) / run.evaluations)
        for count, volume in run.hypervolumes.items():
            found.setdefault((cell, run.method, int(count)), {})[run.seed] = volume
    for cell in CELLS:
        rows = [(method, count) for name, method, count in found if name == cell]
        methods = [method for method in METHODS if method in {method for method, _ in rows}]
        if not methods or cell.evaluator not in options.evaluators or cell.task not in options.tasks:
            continue
        point = ", ".join(f"{value:.4g}" for value in reference_point(cell))
        print(f"\n{cell.name}; reference point ({point})\n")
        print(f"| evaluations | {' | '.join(map(str, COUNTS))} | seeds | own time [ms/trial] |")
        print(f"|---|{'---|' * (len(COUNTS) + 2)}")
        for method in methods:
            seeds = max(len(found.get((cell, method, count), ())) for count in COUNTS)
            cells = [describe(found.get((cell, method, count), {})) for count in COUNTS]
            print(f"| {method} | {' | '.join(cells)} | {seeds} | {np.mean(times[cell, method]):.0f} |")
    return found


def describe(volumes: Mapping[int, float]) -> str:
    """Return a mean and its interval."""
    if not volumes:
        return "-"
    mean = interval(list(volumes.values()))
    return f"{mean.mean:.2f} ({mean.low:.2f} to {mean.high:.2f})"


def paired(
    found: Mapping[tuple[Cell, str, int], dict[int, float]], cell: Cell, few: int, other: str, many: int
) -> tuple[Array, Array] | None:
    """Return the hypervolumes of ours after `few` and of another method after `many` evaluations, by common seeds."""
    ours, theirs = found.get((cell, OURS, few), {}), found.get((cell, other, many), {})
    seeds = sorted(ours.keys() & theirs.keys())
    if len(seeds) < 2:
        return None
    return np.array([ours[seed] for seed in seeds]), np.array([theirs[seed] for seed in seeds])


def goals(found: Mapping[tuple[Cell, str, int], dict[int, float]]) -> None:
    """Print the paired tests of the goals; p-values are corrected over all of them (Holm)."""
    tests: list[tuple[str, Cell, PairedTest, float]] = []
    for few, other, many in ((20, "tpe", 60), (60, "tpe", 200), (60, "tpe-rules", 200)):
        for cell in GOAL_CELLS:
            if (pair := paired(found, cell, few, other, many)) is not None:
                title = f"{OURS} at {few} - {other} at {many}"
                tests.append((title, cell, paired_test(*pair), float(pair[1].mean())))
    for count in (60, 200):
        for cell in CELLS:
            if cell not in GOAL_CELLS and (pair := paired(found, cell, count, "tpe", count)) is not None:
                title = f"{OURS} - tpe at {count}"
                tests.append((title, cell, paired_test(*pair), float(pair[1].mean())))
    if not tests:
        return
    corrected = holm([test.p for _, _, test, _ in tests])
    print("\n| comparison | evaluator, task | difference | relative | better | p (Holm) | |")
    print("|---|---|---|---|---|---|---|")
    for (title, cell, test, mean), p in zip(tests, corrected.tolist(), strict=True):
        change = test.difference
        verdict = "not distinguishable" if p > LEVEL else "better" if change.mean > 0.0 else "worse"
        span = f"{change.mean:+.2f} ({change.low:+.2f} to {change.high:+.2f})"
        relative = f"{change.mean / mean:+.1%} ({change.low / mean:+.1%} to {change.high / mean:+.1%})"
        print(f"| {title} | {cell.name} | {span} | {relative} | {test.better} of {test.n} | {p:.2g} | {verdict} |")


def read_options() -> argparse.Namespace:
    def names(known: Iterable[str]) -> Any:
        def parse(text: str) -> list[str]:
            given = text.split(",")
            if unknown := set(given) - set(known):
                raise argparse.ArgumentTypeError(f"unknown: {', '.join(unknown)}; available: {', '.join(known)}")
            return given

        return parse

    def share(text: str) -> tuple[int, int]:
        part, _, parts = text.partition("/")
        return int(part), int(parts)

    evaluators, tasks = (list(dict.fromkeys(getattr(c, name) for c in CELLS)) for name in ("evaluator", "task"))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    result = parser.add_mutually_exclusive_group(required=True)
    result.add_argument("--out", type=Path, help="folder of runs.jsonl")
    result.add_argument("--own-time", metavar="TASK", help="print only what samplers take on this task")
    parser.add_argument("--tasks", type=names(tasks), default=tasks)
    parser.add_argument("--methods", type=names(METHODS), default=[name for name in METHODS if name not in SLOW])
    parser.add_argument("--evaluators", type=names(evaluators), default=evaluators)
    parser.add_argument(
        "--seeds", type=int, help=f"default: {SEEDS_OF_MAIN} for {', '.join(MAIN)}, else {SEEDS_OF_OTHERS}"
    )
    parser.add_argument("--evaluations", type=int, default=COUNTS[-1])
    parser.add_argument("--hours", type=float, default=8.0, help="no run begins later")
    parser.add_argument("--share", type=share, default=(1, 1), help="such as 1/2, for several processes")
    parser.add_argument("--only-tables", action="store_true")
    return parser.parse_args()


def main() -> None:
    options = read_options()
    if options.own_time is not None:
        own_times(options.own_time, options.evaluations)
        return
    options.out.mkdir(parents=True, exist_ok=True)
    file = options.out / "runs.jsonl"
    if not options.only_tables:
        work(options, file)
    goals(table(read(file), options))


if __name__ == "__main__":
    main()
