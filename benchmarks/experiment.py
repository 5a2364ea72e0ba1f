"""How long the black-box and rules cells of the paper's experiment take, and what a second worker brings.

python benchmarks/experiment.py [--seeds 5] [--scaling-seeds 2]
"""

import argparse
import tempfile
import time
from pathlib import Path

from armwright.experiments.cells import collect, plan_cells
from armwright.experiments.plan import load_experiment
from armwright.experiments.runner import run_cells
from armwright.experiments.tables import markdown
from armwright.study.workers.cluster import Workers


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--scaling-seeds", type=int, default=2)
    options = parser.parse_args()
    run(1, 1)  # compiles the kernels, where they are not there yet
    one, other = run(options.scaling_seeds, 1)[0], run(options.scaling_seeds, 2)[0]
    seconds, table = run(options.seeds, 2)
    print(f"BBO and rules on the paper's tasks, {6 * options.seeds} cells in 2 processes: {seconds:.0f} s")
    print(
        f"  {6 * options.scaling_seeds} cells: {one:.0f} s in one process, {other:.0f} s in two: {one / other:.2f} x\n"
    )
    print(table.split("## At the end")[0].split("## Hypervolume over the trials")[1].strip())


def run(seeds: int, n_workers: int) -> tuple[float, str]:
    """The seconds that the cells take, and their tables."""
    plan, beside = load_experiment("paper")
    plan = plan.model_copy(update={"seeds": seeds})
    with tempfile.TemporaryDirectory() as out:
        cells, _ = plan_cells(plan, beside, Path(out), methods=["bbo", "rules"])
        started = time.perf_counter()
        faults = [outcome.fault for outcome in run_cells(cells, Workers(n_workers), print) if outcome.fault]
        seconds = time.perf_counter() - started
        assert not faults, faults
        return seconds, markdown(collect(plan, cells), "")


if __name__ == "__main__":
    main()
