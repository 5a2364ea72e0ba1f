"""Designs a second along whole cycles, beside another checkout: medians of several rounds, the two in turn.

near the front   lengths of the best known front's designs off by 2 % of their range; all bodies, motors and loads;
                 in the processes of a direct search, if the checkout has such, as all that follows but one design
random           designs of the same space
one design       milliseconds of one design near the front alone, as `optimize` evaluates them; median of twelve
robust           with `--robust`: each design and its copies
estimates        as the direct search screens children, from paths of the designs that they are near to; and the rank
                 correlation of their objectives with those of evaluations, the mean over the objectives
one core         near the front on one core; the ratio is that of both cores to it

Times are of the wall clock. Ratios are of the medians; the last line has their geometric means. The seventh job is
jobs/six-bins.yaml, with 36 motions, and designs of a short search (jobs/six-bins.csv).

    python benchmarks/cycle_speed.py [--against CHECKOUT] [--rounds 7] [--jobs NAME ...]
"""

import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent
BUILT_IN = ("desk-sorting", "box-palletising", "lathe-tending", "screwing", "casting-inspection", "dispensing")
OWN = ("six-bins",)
N, N_RANDOM, N_ROBUST, N_ESTIMATES, N_SINGLE = 96, 96, 6, 384, 12
NEAR = 0.02  # of the range of a length
HIGHER = ("near the front", "random", "robust", "estimates", "one core")  # designs a second
WIDTH = 16
START_SECONDS = 6.0  # for other processes


def problem_of(job: str) -> tuple[Any, Any]:
    """Return the problem, and a matrix of designs of its front."""
    import armwright as aw
    from armwright.problem.problem import Problem
    from armwright.proof.front_gap import known_front
    from armwright.tasks.catalogue import load_task

    if job in BUILT_IN:
        problem = Problem(load_task(job), aw.load_space(job))
        front = known_front(problem)
        assert front is not None
        return problem, problem.space.matrix(front.designs)
    folder = HERE / "jobs"
    problem = Problem(load_task(folder / f"{job}.yaml"), aw.load_space(folder / f"{job}-space.yaml"))
    return problem, np.loadtxt(folder / f"{job}.csv", delimiter=",", ndmin=2)


def near_front(problem: Any, front: Any, n: int) -> Any:
    """Return (n, P) designs near those of a front, as benchmarks/branches.py does."""
    from armwright.spaces.tolerance import length_columns

    space = problem.space
    rng, columns = np.random.default_rng(2), length_columns(space)
    matrix = front[np.arange(n) % len(front)]
    low, high = np.array([(p.low, p.high) for p in (space.parameters[i] for i in columns)]).T
    changed = matrix[:, columns] + NEAR * (high - low) * rng.normal(size=(n, len(columns)))
    matrix[:, columns] = np.clip(changed, low, high)
    return space.normalised(matrix)


def seconds(do: Callable[[], object]) -> float:
    started = time.perf_counter()
    do()
    return time.perf_counter() - started


def shared(problem: Any, matrix: Any) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return how a direct search evaluates and estimates designs, once its processes have started."""
    from functools import partial

    from armwright.problem.estimates import estimates

    try:
        from armwright.study.front.evaluation_pool import EvaluationPool
    except ModuleNotFoundError:
        return problem.evaluate, partial(estimates, problem)
    pool, started = EvaluationPool(problem), time.monotonic()
    pool.start()
    while len(os.sched_getaffinity(0)) > 1 and time.monotonic() - started < START_SECONDS:
        pool.evaluate(matrix)
    return pool.evaluate, pool.estimates


class Measured:
    """The work on one job in one process."""

    def __init__(self, job: str) -> None:
        from armwright.spaces.tolerance import TOLERANCE

        self.problem, front = problem_of(job)
        self.near = near_front(self.problem, front, N)
        space = self.problem.space
        self.random = space.matrix(space.sample(N_RANDOM, seed=1))
        robust = replace(self.problem, tolerance=TOLERANCE)
        self.evaluate, estimates = shared(self.problem, self.near[:N_SINGLE])
        self.evaluate_robust, _ = shared(robust, self.near[:2])
        parents = near_front(self.problem, front, N_ESTIMATES)
        entry = self.problem.evaluate(parents).entry
        children = near_front(self.problem, parents, N_ESTIMATES)
        self.estimate = lambda: estimates(children, entry)
        found, exact = self.estimate().values, self.problem.evaluate(children)
        rows = (exact.violations <= 0.0).all(axis=1)
        self.correlation = float(
            np.mean([spearman(a[rows], b[rows]) for a, b in zip(found.T, exact.values.T, strict=True)])
        )
        self.evaluate(self.random)  # kernels

    def round(self) -> dict[str, float]:
        """Return what one round measures."""
        found = {
            "near the front": N / seconds(lambda: self.evaluate(self.near)),
            "random": N_RANDOM / seconds(lambda: self.evaluate(self.random)),
            "robust": N_ROBUST / seconds(lambda: self.evaluate_robust(self.near[:N_ROBUST])),
            "estimates": N_ESTIMATES / seconds(self.estimate),
            "rank correlation": self.correlation,
        }
        singles = [seconds(lambda row=row: self.problem.evaluate(self.near[row : row + 1])) for row in range(N_SINGLE)]  # type: ignore[misc]
        return found | {"one design": 1e3 * statistics.median(singles)}


def spearman(a: Any, b: Any) -> float:
    """Return the rank correlation; 1 if one is constant."""
    from scipy.stats import rankdata  # pyright: ignore[reportUnknownVariableType]

    ranks = np.array([rankdata(a), rankdata(b)])
    return float(np.corrcoef(ranks)[0, 1]) if np.ptp(a) > 0.0 and np.ptp(b) > 0.0 else 1.0


def serve(job: str, few: bool) -> None:
    """Answer each line of stdin with a round; few: only the work near the front."""
    measured = Measured(job)
    print(json.dumps("ready"), flush=True)
    for _ in sys.stdin:
        near = {"one core": N / seconds(lambda: measured.evaluate(measured.near))} if few else measured.round()
        print(json.dumps(near), flush=True)


class Process:
    """A process that imports a checkout and measures a job on some cores."""

    def __init__(self, checkout: Path, job: str, one_core: bool) -> None:
        def restrict() -> None:
            os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[: 1 if one_core else None])

        environment = {**os.environ, "PYTHONPATH": str(checkout / "src")}
        command = [sys.executable, __file__, "--serve", job, *(["--few"] if one_core else [])]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment, preexec_fn=restrict
        )
        self.answer()

    def answer(self) -> Any:
        assert self.process.stdout is not None
        return json.loads(self.process.stdout.readline())

    def round(self) -> dict[str, float]:
        assert self.process.stdin is not None
        self.process.stdin.write("\n")
        self.process.stdin.flush()
        return dict(self.answer())


def measure(job: str, checkouts: list[Path], rounds: int) -> list[dict[str, float]]:
    """Return the medians of each checkout."""
    processes = [[Process(checkout, job, one_core) for one_core in (False, True)] for checkout in checkouts]
    found: list[list[dict[str, float]]] = [[] for _ in checkouts]
    for _ in range(rounds):
        for both, own in zip(found, processes, strict=True):
            both.append(own[0].round() | own[1].round())
    for one in (process for own in processes for process in own):
        one.process.communicate()
    return [{name: statistics.median(each[name] for each in own) for name in own[0]} for own in found]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", type=Path, help="another checkout, such as a worktree of an earlier commit")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--jobs", nargs="+", default=[*BUILT_IN, *OWN], choices=[*BUILT_IN, *OWN], metavar="NAME")
    parser.add_argument("--serve", help=argparse.SUPPRESS)
    parser.add_argument("--few", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.serve:
        serve(given.serve, given.few)
        return
    checkouts = [HERE.parent, *([given.against.resolve()] if given.against else [])]
    ratios: dict[str, list[float]] = {}
    for job in given.jobs:
        medians = measure(job, checkouts, given.rounds)
        print(f"{job}", flush=True)
        for name, value in medians[0].items():
            line = f"  {name:{WIDTH}} {value:8.2f}"
            if len(medians) > 1:
                other = medians[1][name]
                ratio = value / other if name in HIGHER else other / value
                ratios.setdefault(name, []).append(ratio)
                line += f"  before {other:8.2f}" + (
                    "" if name == "rank correlation" else f"  {ratio:5.2f} times as fast"
                )
            print(line)
        cores = [each["near the front"] / each["one core"] for each in medians]
        print(f"  {'cores':{WIDTH}} " + "  before ".join(f"{each:8.2f}" for each in cores), flush=True)
    for name, values in ratios.items():
        if name != "rank correlation":
            mean = math.exp(statistics.fmean(map(math.log, values)))
            print(f"{name:{WIDTH}} geometric mean {mean:5.2f}, least {min(values):5.2f} times as fast")


if __name__ == "__main__":
    main()
