"""The stored baselines of the built-in tasks (src/armwright/experiments/baselines.csv), and their page (docs/suite.md).

armwright experiment suite --no-figures      # 31 tasks x 2 methods x 5 seeds: some 20 minutes on two idle cores
python benchmarks/baselines.py experiments/suite
"""

import csv
import platform
import sys
from importlib.metadata import version
from pathlib import Path

import armwright
from armwright.experiments.baselines import BASELINES, baselines, baselines_of
from armwright.experiments.plan import suite_tasks
from armwright.files import to_csv
from armwright.proof.front_gap import best_known_hypervolume
from armwright.tasks.catalogue import load_task

PACKAGE = Path(armwright.__file__).parent
PAGE = PACKAGE.parents[1] / "docs" / "suite.md"
LIBRARIES = ("armwright", "optuna", "warp-lang", "numpy")
NUMBERS = {"e_hv": "e_hv", "sigma_hv": "sigma_hv", "final": "final", "share": "share_of_best_known"}


def main(folder: Path) -> None:
    rows = list(csv.DictReader((folder / "table.csv").read_text(encoding="utf-8").splitlines()))
    missing = set(suite_tasks()) - {row["task"] for row in rows}
    if missing:
        sys.exit(f"{folder} holds no finished runs of {', '.join(sorted(missing))}")
    records = [
        {"task": row["task"], "method": row["method"], "runs": row["runs"]}
        | {ours: f"{float(row[theirs]):.6f}" for ours, theirs in NUMBERS.items()}
        for row in rows
    ]
    made = ", ".join(f"{library} {version(library)}" for library in LIBRARIES)
    head = f"# armwright experiment suite, with {made} on Python {platform.python_version()}; benchmarks/baselines.py\n"
    (PACKAGE / "experiments" / BASELINES).write_text(head + to_csv(records), encoding="utf-8")
    baselines.cache_clear()
    PAGE.write_text(page(), encoding="utf-8")


def page() -> str:
    """docs/suite.md."""
    runs = baselines()[0].runs
    methods = list(dict.fromkeys(baseline.method for baseline in baselines()))
    head = ["task", "targets", "what for", "best known", *(f"{m}: E_hv (σ_hv)" for m in methods)]
    head += [f"{m}: final" for m in methods]
    lines = [f"| {' | '.join(head)} |", "|---|--:|---|" + "--:|" * (1 + 2 * len(methods))]
    for name, task in ((name, load_task(name)) for name in suite_tasks()):
        by_method = {baseline.method: baseline for baseline in baselines_of(name)}
        cells = [f"`{name}`", str(len(task.targets)), task.description]
        cells += [f"{best_known_hypervolume(task):.2f}"]
        cells += [f"{by_method[m].e_hv:.2f} ({by_method[m].sigma_hv:.2f})" for m in methods]
        cells += [f"{by_method[m].share:.1%}" for m in methods]
        lines.append(f"| {' | '.join(cells)} |")
    return f"""\
# The benchmark suite

After reading this page you can place a search method of your own next to the usual ones on
{len(suite_tasks())} tasks.

Each task has its points, a reference point, the best known front and baselines. `armwright tasks NAME` shows everything
about one task, including its points and their source. `random-N` is one of a seeded family.

The table gives the hypervolume within the task's reference point over {runs} runs (seeds 0 to {runs - 1}) of 10 random
and 200 counted trials in the paper's design space. "Final" is the mean share of the best known hypervolume at the end.
`armwright design` reaches 97 to 100 % of it ([benchmarks](benchmarks.md)). This page and the stored numbers are made by

    armwright experiment suite
    python benchmarks/baselines.py experiments/suite

To add your method, copy the experiment (`armwright experiment suite --print > mine.yaml`), add the method, and run it
([experiments](experiments.md)).

{chr(10).join(lines)}
"""


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]))
