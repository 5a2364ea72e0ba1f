"""Compare kernels and search on a GPU with those on the CPU beside it: rates, differences of results, and fronts.

rates         designs per second of `Problem.evaluate`, the best of three, after a first call
differences   the share of designs of which an objective differs by more than 1 % between the devices. The iteration
              of the inverse kinematics amplifies rounding; beside it is the share on the CPU alone when the designs'
              numbers move by one bit of single precision
postures      the kernels of the inverse kinematics alone: rates, and the median and largest distance of tips between
              the devices after 10 and after 100 updates
fronts        hypervolume of a search after a number of evaluations, relative to the best known front or, where none
              is known, to the CPU's, and seconds

python benchmarks/gpu.py [--evaluations 100000] [--cycle-evaluations 1000] [--seeds 2]
"""

import argparse
import sys
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import warp as wp
from searches import new_search, reference_point_of

from armwright.arrays import Array
from armwright.exceptions import SettingsError
from armwright.kinematics.arms.arm_arrays import Precision
from armwright.kinematics.devices import Device, compilation, cores, resolve_device
from armwright.kinematics.ik.ik import solve_postures
from armwright.problem.problem import Problem
from armwright.proof.front_gap import known_front
from armwright.search.front.screening import Screen, pays
from armwright.spaces.design_space import DesignSpace, default_space
from armwright.spaces.parameters import FloatParameter
from armwright.tasks.catalogue import load_task

DEVICES: tuple[Device, ...] = ("cpu", "cuda")
BATCHES = {"target-1": (1_000, 100_000), "machine-tending": (100_000,), "welding-seam": (100_000,)}
CYCLE_BATCHES = {"screwing": (100, 1_000), "box-palletising": (100, 1_000)}
FRONTS = ("target-1", "target-2", "target-3", "welding-seam")
CYCLE_FRONTS = ("screwing", "box-palletising")
DIFFERENT = 0.01  # relative
N_ARMS = 100_000


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--evaluations", type=int, default=100_000)
    parser.add_argument("--cycle-evaluations", type=int, default=1_000)
    parser.add_argument("--seeds", type=int, default=2)
    options = parser.parse_args()
    try:
        resolve_device("cuda", many=True)
    except SettingsError as error:
        sys.exit(str(error))
    print(f"{wp.get_device('cuda').name}; CPU: {cores()} cores")
    print(f"  {'':34s}{'CPU':>12s}{'GPU':>12s}{'ratio':>8s}   differ by over 1 %, by one bit on the CPU")
    for name, batches in (BATCHES | CYCLE_BATCHES).items():
        for batch in batches:
            rates(name, batch)
    postures("float32")
    postures("float64")
    print(f"\n  {'':34s}{'CPU':>20s}{'GPU':>20s}")
    for name in FRONTS:
        fronts(name, options.evaluations, options.seeds)
    for name in CYCLE_FRONTS:
        fronts(name, options.cycle_evaluations, options.seeds)
    print(f"\ncompiling the kernels, both devices together: {compilation.seconds:.0f} s")


def rates(name: str, batch: int) -> None:
    """Print the line of one batch."""
    problems = [problem_on(name, device) for device in DEVICES]
    space = problems[0].space
    few = space.matrix(space.sample(min(batch, 10_000), seed=0))
    matrix = np.tile(few, (-(-batch // len(few)), 1))[:batch]
    values: list[Array] = []
    speeds: list[float] = []
    for problem in problems:
        values.append(problem.evaluate(matrix).values[: len(few)])
        speeds.append(batch / best_of_three(lambda problem=problem: problem.evaluate(matrix)))
    off = differing(*values)
    control = differing(values[0], problems[0].evaluate(moved_by_a_bit(few, space)).values)
    print(
        f"  {f'{name}, {batch:,d}':34s}{speeds[0]:12,.0f}{speeds[1]:12,.0f}{speeds[1] / speeds[0]:8.2f}   "
        f"{off:6.2%} {control:6.2%}",
        flush=True,
    )


def postures(precision: Precision) -> None:
    """Print the line of the inverse kinematics alone: random arms at the points of target-1."""
    problem = problem_on("target-1", "cpu")
    arms = problem.arms(problem.space.matrix(problem.space.sample(N_ARMS, seed=0)), precision)
    points = problem.task.target_positions
    speeds: list[float] = []
    for device in DEVICES:
        work = partial(solve_postures, arms, points, precision=precision, device=device)
        work()
        speeds.append(N_ARMS / best_of_three(work))
    cells = ""
    for updates in (10, 100):
        first, second = (
            solve_postures(arms, points, updates, precision=precision, device=device).reached.astype(np.float64)
            for device in DEVICES
        )
        off = np.linalg.norm(first - second, axis=2)
        cells += f"   {updates}: {np.median(off):.1e} m, {np.max(off):.1e} m"
    ratio = speeds[1] / speeds[0]
    print(f"  {f'postures alone, {precision}':34s}{speeds[0]:12,.0f}{speeds[1]:12,.0f}{ratio:8.2f}{cells}", flush=True)


def moved_by_a_bit(matrix: Array, space: DesignSpace) -> Array:
    """Return the designs with their continuous parameters moved by a bit of single precision, towards 0."""
    is_float = np.array([isinstance(parameter, FloatParameter) for parameter in space.parameters])
    return np.where(is_float, matrix * (1.0 - 2.0**-23), matrix)


def best_of_three(work: Callable[[], object]) -> float:
    """Return the least of three durations [s]."""
    times: list[float] = []
    for _ in range(3):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


def differing(first: Array, second: Array) -> float:
    """Return the share of designs of which an objective differs by more than `DIFFERENT`."""
    scale = np.maximum(np.abs(first), np.abs(second))
    same = (first == second) | (scale == 0.0)
    with np.errstate(invalid="ignore"):
        near = np.abs(first - second) <= DIFFERENT * scale
    agree = np.all(same | near, axis=1)
    return 1.0 - np.count_nonzero(agree) / len(agree)


def fronts(name: str, evaluations: int, seeds: int) -> None:
    """Print the lines of the searches of one task, with 500 random designs at the start."""
    reference = reference_point_of(problem_on(name, "cpu"))
    for seed in range(seeds):
        found: list[tuple[float, float]] = []
        for device in DEVICES:
            problem = problem_on(name, device)
            screen = Screen(problem, lambda: reference) if pays(problem) else None
            search = new_search(problem, reference, seed, screen)
            compiled, began = compilation.seconds, time.perf_counter()
            while search.evaluations < evaluations:
                search.step()
            found.append((search.hypervolume, time.perf_counter() - began - (compilation.seconds - compiled)))
        known = known_front(problem_on(name, "cpu"))
        best = found[0][0] if known is None else known.hypervolume(reference)
        cells = "".join(f"{volume / best:12.2%}{seconds:6.1f} s" for volume, seconds in found)
        print(f"  {f'{name}, {evaluations:,d}, seed {seed}':34s}{cells}", flush=True)


def problem_on(name: str, device: Device) -> Problem:
    """Return the problem of a built-in task in its own space."""
    return Problem(load_task(name), default_space(name), device=device)


if __name__ == "__main__":
    main()
