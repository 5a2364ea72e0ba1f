"""The rules for any study beside Optuna's and OptunaHub's samplers, on OptunaHub's multi-objective test problems.

    git clone --depth 1 https://github.com/optuna/optunahub-registry
    pip install optunahub coco-experiment optproblems diversipy cmaes      # for GP and auto_sampler: torch
    python benchmarks/hub.py --registry optunahub-registry [--n-trials 200] [--seeds 5] [--jobs 2] [--keep FOLDER]
        [--problems NAME ...] [--methods NAME ...]

No model is asked: `+ rules` is the sampler with StudyRulesProposer, one trial in ten. The figure is the hypervolume of
a study's trials as a share of that of all studies on the problem together. Its box reaches from the best values of all
to 10 % beyond the worst ones on a study's front, median over the studies. `arms` is armwright's own task target-1,
where `+ arm rules` are the rules for arms. With --keep, finished studies are kept as files, and the same command goes
on.
"""

import argparse
import itertools
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np
import optuna
import optunahub
from optuna.distributions import BaseDistribution
from optuna.samplers import BaseSampler
from scipy.stats import rankdata

import armwright as aw
from armwright.pareto import front_mask
from armwright.spaces.optuna_distributions import distributions

Evaluate = Callable[[dict[str, float]], Sequence[float]]
Matrix = np.ndarray

# name: package of the registry, and its problem's arguments
PROBLEMS: dict[str, tuple[str, dict[str, int]]] = {
    "ZDT1": ("zdt", {"function_id": 1}),
    "ZDT4": ("zdt", {"function_id": 4}),
    "DTLZ2": ("dtlz", {"function_id": 2, "n_objectives": 3, "dimension": 12}),
    "DTLZ7": ("dtlz", {"function_id": 7, "n_objectives": 2, "dimension": 10}),
    "WFG1": ("wfg", {"function_id": 1, "n_objectives": 2, "dimension": 10}),
    "WFG4": ("wfg", {"function_id": 4, "n_objectives": 2, "dimension": 10}),
    "WFG9": ("wfg", {"function_id": 9, "n_objectives": 3, "dimension": 10}),
    "biobj-3": ("bbob_biobj", {"function_id": 3, "dimension": 10}),
    "biobj-21": ("bbob_biobj", {"function_id": 21, "dimension": 5}),
    "biobj-46": ("bbob_biobj", {"function_id": 46, "dimension": 10}),
    "mixint-10": ("bbob_biobj_mixint", {"function_id": 10, "dimension": 10}),
    "arms": ("", {}),
    # On these the rules were developed; they are not in the table.
    "dev-ZDT2": ("zdt", {"function_id": 2}),
    "dev-DTLZ1": ("dtlz", {"function_id": 1, "n_objectives": 2, "dimension": 8}),
    "dev-DTLZ5": ("dtlz", {"function_id": 5, "n_objectives": 3, "dimension": 10}),
    "dev-WFG2": ("wfg", {"function_id": 2, "n_objectives": 2, "dimension": 10}),
    "dev-WFG6": ("wfg", {"function_id": 6, "n_objectives": 2, "dimension": 10}),
    "dev-biobj-1": ("bbob_biobj", {"function_id": 1, "dimension": 10}),
    "dev-biobj-13": ("bbob_biobj", {"function_id": 13, "dimension": 5}),
    "dev-biobj-31": ("bbob_biobj", {"function_id": 31, "dimension": 10}),
    "dev-mixint-5": ("bbob_biobj_mixint", {"function_id": 5, "dimension": 10}),
}
# name: the class in Optuna, or package and class in the registry
SAMPLERS: dict[str, tuple[str, str]] = {
    "random": ("", "RandomSampler"),
    "TPE": ("", "TPESampler"),
    "NSGA-II": ("", "NSGAIISampler"),
    "NSGA-III": ("", "NSGAIIISampler"),
    "GP": ("", "GPSampler"),
    "auto_sampler": ("auto_sampler", "AutoSampler"),
    "hype": ("hype", "HypESampler"),
    "mocma": ("mocma", "MoCmaSampler"),
    "moead": ("moead", "MOEADSampler"),
    "nsgaii_with_initial_trials": ("nsgaii_with_initial_trials", "NSGAIIwITSampler"),
    "speaii": ("speaii", "SPEAIISampler"),
}
RULES, ARM_RULES = " + rules", " + arm rules"
METHODS = [
    *SAMPLERS,
    f"TPE{RULES}",
    f"NSGA-II{RULES}",
    f"GP{RULES}",
    f"random{RULES}",
    f"TPE{ARM_RULES}",
]
POPULATION = 20  # of the genetic ones: 200 trials are ten generations


@dataclass(frozen=True)
class Cell:
    """One study."""

    problem: str
    method: str
    seed: int
    n_trials: int
    registry: Path
    folder: Path
    every: int

    @property
    def file(self) -> Path:
        return self.folder / f"{self.problem}-{self.method}-{self.seed}-{self.n_trials}.npz".replace(" ", "")


@cache
def problem_of(name: str, registry: Path) -> tuple[dict[str, BaseDistribution], list[str], Evaluate]:
    """Search space, directions and function."""
    package, arguments = PROBLEMS[name]
    if not package:
        arms = aw.Problem(aw.load_task("target-1"))
        return (
            distributions(arms.space),
            ["minimize"] * 2,
            lambda params: arms.evaluate([arms.space.design(params)]).values[0].tolist(),
        )
    made = local(f"benchmarks/{package}", registry).Problem(**arguments)
    return made.search_space, [direction.name.lower() for direction in made.directions], made.evaluate


def local(package: str, registry: Path):
    return optunahub.load_local_module(package, registry_root=str(registry / "package"))


def sampler_of(name: str, seed: int, registry: Path) -> BaseSampler:
    package, class_name = SAMPLERS[name]
    module = local(f"samplers/{package}", registry) if package else optuna.samplers
    kind = getattr(module, class_name)
    genetic = {"NSGA-II", "NSGA-III", "hype", "moead", "nsgaii_with_initial_trials", "speaii"}
    settings = {"population_size": POPULATION} if name in genetic else {}
    settings |= {"popsize": POPULATION} if name == "mocma" else {}
    return kind(seed=seed, **settings)


def study(cell: Cell) -> Path:
    """The values of its trials, minimised, and how long it took, in a file."""
    if cell.file.exists():
        return cell.file
    warnings.simplefilter("ignore")  # others' experimental features and old spellings
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    space, directions, evaluate = problem_of(cell.problem, cell.registry)
    base, _, proposer = cell.method.partition(" + ")
    if proposer == "arm rules":
        return arm_study(cell, base)
    callbacks = [aw.ProposalCallback(aw.StudyRulesProposer(), cell.every, seed=cell.seed)] if proposer else []
    made = optuna.create_study(directions=directions, sampler=sampler_of(base, cell.seed, cell.registry))

    def objective(trial: optuna.Trial) -> tuple[float, ...]:
        params = {name: trial._suggest(name, distribution) for name, distribution in space.items()}
        return tuple(evaluate(params))

    began = perf_counter()
    made.optimize(objective, n_trials=cell.n_trials, callbacks=callbacks)
    seconds = perf_counter() - began
    values = np.array([trial.values for trial in made.trials])
    values *= [-1.0 if direction == "maximize" else 1.0 for direction in directions]
    np.savez(cell.file, values=values, seconds=seconds)
    return cell.file


def arm_study(cell: Cell, base: str) -> Path:
    """The same of a study of arms with the rules for arms."""
    n_init = cell.every - 1
    schedule = {"n_init": n_init, "n_step": cell.every, "n_total": cell.n_trials - n_init}
    began = perf_counter()
    run = aw.optimize(
        aw.Problem(aw.load_task("target-1")),
        proposer="rules",
        sampler=lambda seed: sampler_of(base, seed, cell.registry),
        seed=cell.seed,
        verify=False,
        **schedule,
    )
    np.savez(cell.file, values=np.array([trial.values for trial in run.trials]), seconds=perf_counter() - began)
    return cell.file


def shares(matrices: dict[tuple[str, int], Matrix]) -> dict[tuple[str, int], float]:
    """Of each study's values (N, M) the hypervolume, as a share of that of all together."""
    together = np.concatenate(list(matrices.values()))
    front = together[front_mask(together)]
    low = front.min(axis=0)
    # The typical study's front ends here: with the common front's own ends most would have no hypervolume at all.
    worst = np.median([values[front_mask(values)].max(axis=0) for values in matrices.values()], axis=0)
    span = np.maximum(worst - low, 1e-12)
    reference = (1.1,) * front.shape[1]
    whole = aw.hypervolume((front - low) / span, reference)
    return {key: aw.hypervolume((values - low) / span, reference) / whole for key, values in matrices.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--registry", type=Path, required=True)
    parser.add_argument("--n-trials", type=int, default=200)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--every", type=int, default=10)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--problems", nargs="+", default=[name for name in PROBLEMS if not name.startswith("dev-")])
    parser.add_argument("--methods", nargs="+", default=METHODS)
    options = parser.parse_args()

    with TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        cells = [
            Cell(problem, method, seed, options.n_trials, options.registry, folder, options.every)
            for seed, problem, method in itertools.product(range(options.seeds), options.problems, options.methods)
            if problem == "arms" or not method.endswith(ARM_RULES)
        ]
        with ProcessPoolExecutor(options.jobs) as pool:
            loaded = dict(zip(cells, map(np.load, pool.map(study, cells)), strict=True))
        show(loaded, options.problems, options.methods)


def show(loaded: dict[Cell, dict[str, Matrix]], problems: Sequence[str], methods: Sequence[str]) -> None:
    """Shares by method and problem, mean ranks over the test problems, seconds of a study."""
    table = np.full((len(methods), len(problems)), np.nan)
    for j, problem in enumerate(problems):
        found = shares({(c.method, c.seed): f["values"] for c, f in loaded.items() if c.problem == problem})
        for i, method in enumerate(methods):
            own = [share for (name, _), share in found.items() if name == method]
            table[i, j] = np.mean(own) if own else np.nan
    tests = [j for j, problem in enumerate(problems) if problem != "arms"]
    among = ~np.isnan(table[:, tests]).any(axis=1) & bool(tests)
    ranks = rankdata(-table[among][:, tests], axis=0).mean(axis=1)
    print(f"{'method':<28}" + "".join(f"{name:>10}" for name in problems) + "   mean rank   s/study")
    order = iter(ranks)
    for i, method in enumerate(methods):
        seconds = np.mean([float(f["seconds"]) for c, f in loaded.items() if c.method == method])
        rank = f"{next(order):12.2f}" if among[i] else " " * 12
        print(f"{method:<28}" + "".join(f"{share:10.3f}" for share in table[i]) + f"{rank}{seconds:10.1f}")
    for method in methods:
        base = method.partition(" + ")[0]
        both, alone = (table[methods.index(name)] if name in methods else table[0] * np.nan for name in (method, base))
        if base != method and not np.isnan(both - alone).all():
            n, better, worse = np.sum(~np.isnan(both - alone)), np.sum(both > alone), np.sum(both < alone)
            print(f"{method} against {base}: better on {better} of {n} problems, worse on {worse}")


if __name__ == "__main__":
    main()
