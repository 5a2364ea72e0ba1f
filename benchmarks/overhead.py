"""What armwright adds to Optuna: a 200-trial run beside the same trials on Optuna's bare in-memory ask/tell.

Both sides make the same 210 trials with TPE. The bare side knows the values beforehand, so it pays for Optuna
alone; ours pays for the evaluation, the schedule, the hypervolume and the run folder, too. Imports, kernel
compilation and the results at the end are timed apart.

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

from armwright.problem import Problem
from armwright.sampling import distributions, sampler_factory
from armwright.seeding import derived_seed
from armwright.study import Run, optimize
from armwright.task import load_task

PROBLEM = Problem(load_task("target-1"))
ROUNDS = 7


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
    with tempfile.TemporaryDirectory() as folder:
        run = optimize(PROBLEM, proposer="none", seed=seed, out=Path(folder) / "run")
    return run.summary["seconds"]["total"]


def seconds_of_bare(seed: int) -> float:
    run = optimize(PROBLEM, proposer="none", seed=seed)
    started = time.perf_counter()
    bare(run, seed)
    return time.perf_counter() - started


def bare(run: Run, seed: int) -> None:
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
    """The command line as a user meets it."""
    command = [sys.executable, "-m", "armwright"]
    helps: list[float] = []
    for _ in range(5):
        started = time.perf_counter()
        subprocess.run([*command, "--help"], capture_output=True, check=True)
        helps.append(time.perf_counter() - started)
    with tempfile.TemporaryDirectory() as folder:
        started = time.perf_counter()
        process = subprocess.Popen(
            [*command, "optimize", "target-1", "--out", f"{folder}/run"], stdout=subprocess.DEVNULL
        )
        _, _, usage = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - started
    print(f"  armwright --help           {statistics.median(helps):6.2f} s")
    print(f"  armwright optimize target-1{seconds:6.2f} s with imports, results and figures, kernels in the cache")
    print(f"  its peak memory            {usage.ru_maxrss / 1024:6.0f} MB")


if __name__ == "__main__":
    main()
