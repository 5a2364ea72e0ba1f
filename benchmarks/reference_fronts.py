"""The best known fronts of the built-in tasks (src/armwright/proof/best_known_fronts/), and how they are made.

Of each task the union of: our search with several seeds; in the paper's space, our search within each joint sequence by
itself, which no other sequence can crowd out; pymoo's NSGA-II; and what was known before. So a run of this script never
makes a front worse. Tasks with a cycle are searched in the spaces of their names, with fewer evaluations. A file states
the hypervolume of the union, and contains the designs that keep 99.9 % of it.

    python benchmarks/reference_fronts.py [TASK ...]      # some 45 minutes on two idle cores for all
"""

import csv
import io
import sys
import time
from pathlib import Path

import moocore
import numpy as np
from peers import Nsga2
from searches import by_sequence, reference_point_of, searched

import armwright
from armwright.arrays import Array
from armwright.pareto import hypervolume
from armwright.problem.problem import Problem
from armwright.proof.front_gap import VOLUME_LINE, known_front
from armwright.search.front.selection import front
from armwright.spaces.design_space import default_space
from armwright.tasks.catalogue import builtin_tasks

SEEDS, CYCLE_SEEDS = range(3), range(2)  # cycles take a hundred times as long to evaluate
EVALUATIONS, CYCLE_EVALUATIONS = 250_000, 10_000  # for each seed
PER_SEQUENCE = 2_000
PYMOO_EVALUATIONS, PYMOO_CYCLE_EVALUATIONS = 30_000, 3_000
KEPT = 0.999  # of a front's hypervolume, by its designs in the file
DECIMALS = 9  # of its parameters: a nanometre, as a micrometre already costs 0.1 % of target-2's hypervolume
PLACE = Path(armwright.__file__).parent / "proof" / "best_known_fronts"


def main() -> None:
    for name, task in builtin_tasks().items():
        if len(sys.argv) == 1 or name in sys.argv[1:]:
            make(Problem(task, default_space(name)))


def make(problem: Problem) -> None:
    started = time.perf_counter()
    reference, cycles = reference_point_of(problem), problem.task.cycle is not None
    seeds = CYCLE_SEEDS if cycles else SEEDS
    evaluations = CYCLE_EVALUATIONS if cycles else EVALUATIONS
    theirs = PYMOO_CYCLE_EVALUATIONS if cycles else PYMOO_EVALUATIONS
    rows, values = [np.empty((0, len(problem.space.parameters)))], [np.empty((0, len(problem.objectives)))]
    words: list[str] = []

    def take(what: str, found: tuple[Array, Array]) -> None:
        rows.append(found[0])
        values.append(found[1])
        words.append(f"{what}: {hypervolume(found[1], reference):.4f}")
        print(f"  {problem.task.name}: {words[-1]}", flush=True)

    known = known_front(problem)
    if known is not None:
        # Values of another machine are not taken on trust.
        take(
            "known before, by such searches",
            (problem.space.matrix(known.designs), problem.evaluate(known.designs).penalised),
        )
    for seed in seeds:
        search = searched(problem, reference, seed, evaluations)
        take(f"search, seed {seed}, {evaluations:,} evaluations", (search.matrix, search.values))
    if not cycles:
        take(f"search within each sequence, {PER_SEQUENCE:,} evaluations each", within_sequences(problem, reference))
    for seed in seeds:
        run = Nsga2(problem, seed, population=100, evaluations=theirs)
        take(f"pymoo's NSGA-II, seed {seed}, {theirs:,} evaluations", (run.rows, run.values))

    # Rounded first, so that values and hypervolume are those of the numbers in the file.
    everything = np.round(np.vstack(rows), DECIMALS)
    worth = np.vectorize(lambda value: float(written(value)))(problem.evaluate(everything).penalised)
    on_front = front(worth, np.asarray(reference))
    volume = hypervolume(worth[on_front], reference)
    print(f"  {problem.task.name}: together {volume:.4f} in {time.perf_counter() - started:.0f} s", flush=True)
    if known is None or volume > known.volume:
        kept = on_front[reduced(worth[on_front], reference)]
        kept = kept[np.argsort(worth[kept, 0])]
        write(problem, everything[kept], worth[kept], reference, words, volume)


def written(value: float) -> str:
    """Return a value as the file states it."""
    return f"{value:.9g}"


def reduced(values: Array, reference: tuple[float, ...]) -> Array:
    """Return the indices of points of a front (K, M) that keep KEPT of its hypervolume, among them its ends.

    The point that contributes least is left out, again and again.
    """
    kept, least = np.arange(len(values)), KEPT * hypervolume(values, reference)
    while True:
        contributions = moocore.hv_contributions(values[kept], ref=list(reference))
        contributions[np.argmin(values[kept], axis=0)] = np.inf
        rest = np.delete(kept, np.argmin(contributions))
        if np.isinf(contributions).all() or hypervolume(values[rest], reference) < least:
            return kept
        kept = rest


def within_sequences(problem: Problem, reference: tuple[float, ...]) -> tuple[Array, Array]:
    """The designs that our search finds within each joint sequence, all together."""
    rows: list[Array] = []
    values: list[Array] = []
    for _, space in by_sequence(problem.space):
        search = searched(Problem(problem.task, space), reference, 0, PER_SEQUENCE)
        rows.append(problem.space.matrix(space.designs(search.matrix)))
        values.append(search.values)
    return np.vstack(rows), np.vstack(values)


def write(
    problem: Problem, rows: Array, values: Array, reference: tuple[float, ...], words: list[str], volume: float
) -> None:
    text = io.StringIO()
    text.write(f"# The best known front of {problem.task.name} in the design space {problem.space.name}.\n")
    text.write("# The union of these searches, to which benchmarks/reference_fronts.py adds; hypervolumes within ")
    text.write(f"({', '.join(f'{value:.4g}' for value in reference)}):\n")
    text.writelines(f"#   {line}\n" for line in words)
    text.write(f"{VOLUME_LINE}{volume!r} of the whole front; the designs below keep {KEPT:.1%} of it\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([p.name for p in problem.space.parameters] + [o.name for o in problem.objectives])
    for design, row in zip(problem.space.designs(rows), values.tolist(), strict=True):
        params = [design.params.get(parameter.name, "") for parameter in problem.space.parameters]
        writer.writerow([*params, *map(written, row)])
    PLACE.mkdir(exist_ok=True)
    (PLACE / f"{problem.task.name}.csv").write_text(text.getvalue(), encoding="utf-8")


if __name__ == "__main__":
    main()
