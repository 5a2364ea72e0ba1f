"""What armwright adds to Optuna: a 200-trial run beside the same trials on Optuna's bare in-memory ask/tell.

Both sides make the same 210 trials with TPE; for that the bare side, too, seeds a sampler for each trial. It knows the
values beforehand, so it pays for Optuna alone; ours pays for the evaluation, the schedule, the hypervolume and the run
folder, too. Imports, kernel compilation, results and figures are timed apart.

    python benchmarks/overhead.py
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import optuna

from armwright.pictures.figures import write_figures
from armwright.problem.problem import Problem
from armwright.search.samplers import sampler_factory
from armwright.seeding import derived_seed
from armwright.spaces.optuna_distributions import distributions
from armwright.study.progress import StudyResult
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task

PROBLEM = Problem(load_task("target-1"))
ROUNDS = 5


def main() -> None:
    PROBLEM.evaluate(PROBLEM.space.sample(1, 0))  # compiles and loads
    pairs = [(seconds_of_run(seed), seconds_of_bare(seed)) for seed in range(ROUNDS)]
    ratios = sorted(ours / bare for ours, bare in pairs)
    print(f"Overhead: 210 trials with --proposer none beside bare Optuna, {ROUNDS} seeds in turn")
    print(f"  armwright    {statistics.median(ours for ours, _ in pairs):6.2f} s (median)")
    print(f"  bare Optuna  {statistics.median(bare for _, bare in pairs):6.2f} s (median)")
    print(f"  ratio        {statistics.median(ratios):6.3f} (median; {ratios[0]:.3f} to {ratios[-1]:.3f})")
    whole_process()


def seconds_of_run(seed: int) -> float:
    """From the call to the moment after the last trial was written and reported."""
    ends: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        started = time.perf_counter()
        optimize(
            PROBLEM,
            proposer="none",
            seed=seed,
            out=Path(folder) / "run",
            watch=lambda progress: ends.append(time.perf_counter()),
        )
    return ends[-1] - started


def seconds_of_bare(seed: int) -> float:
    run = optimize(PROBLEM, proposer="none", seed=seed)
    started = time.perf_counter()
    bare(run, seed)
    return time.perf_counter() - started


def bare(run: StudyResult, seed: int) -> None:
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(directions=["minimize", "minimize"])
    space = distributions(PROBLEM.space)
    for trial in run.trials:
        kind = "random" if trial.source == "random" else "tpe"
        study.sampler = sampler_factory(kind)(derived_seed(seed, 1, trial.number))
        asked = study.ask(space)
        assert asked.params == dict(trial.design.params), "the same trials"
        study.tell(asked, trial.values)


def whole_process() -> None:
    """The command line as a user meets it, and what is not the search."""
    command = [sys.executable, "-m", "armwright"]
    helps = [seconds_and_memory([*command, "--help"])[0] for _ in range(5)]
    print(f"  armwright --help                       {statistics.median(helps):6.2f} s")
    imports = "import armwright.study.study, armwright.search.samplers, warp, optuna"
    print(f"  imports of a run                       {seconds_and_memory([sys.executable, '-c', imports])[0]:6.2f} s")
    with tempfile.TemporaryDirectory() as folder:
        load = (
            "from armwright.kinematics.devices import load_kernels; "
            "load_kernels('ik.ik_kernels', 'cpu', 'float32', 8, 'revolute', 'position')"
        )
        cold = seconds_and_memory([sys.executable, "-c", load], WARP_CACHE_PATH=folder)[0]
        warm = seconds_and_memory([sys.executable, "-c", load], WARP_CACHE_PATH=folder)[0]
        print(f"  kernels: compiled {cold:.2f} s, loaded from the cache {warm:.2f} s (with the import of Warp)")
        cache = f"{folder}/new"
        for name in ("first run", "later run"):
            out = f"{folder}/run-{name}"
            run = [*command, "optimize", "target-1", "--out", out]
            seconds, memory = seconds_and_memory(run, WARP_CACHE_PATH=cache)
            print(f"  armwright optimize target-1, {name} {seconds:6.2f} s, peak memory {memory:.0f} MB")
        started = time.perf_counter()
        write_figures(f"{folder}/run-later run")
        print(f"  of which figures                       {time.perf_counter() - started:6.2f} s")


def seconds_and_memory(command: list[str], **environment: str) -> tuple[float, float]:
    """Wall time [s] and peak memory [MB] of a process."""
    started = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, env={**os.environ, **environment})
    _, status, usage = os.wait4(process.pid, 0)
    assert status == 0, command
    return time.perf_counter() - started, usage.ru_maxrss / 1024


if __name__ == "__main__":
    main()
