"""The page of the usual methods on the built-in tasks (docs/suite.md).

armwright experiment suite --no-figures      # 31 tasks x 2 methods x 5 seeds: some 20 minutes on two idle cores
python benchmarks/baselines.py experiments/suite
"""

import csv
import sys
from pathlib import Path

from armwright.experiments.plan import suite_tasks
from armwright.proof.front_gap import best_known_hypervolume
from armwright.tasks.catalogue import load_task

PAGE = Path(__file__).parents[1] / "docs" / "suite.md"


def main(folder: Path) -> None:
    rows = list(csv.DictReader((folder / "table.csv").read_text(encoding="utf-8").splitlines()))
    missing = set(suite_tasks()) - {row["task"] for row in rows}
    if missing:
        sys.exit(f"{folder} holds no finished runs of {', '.join(sorted(missing))}")
    PAGE.write_text(page(rows), encoding="utf-8")


def page(rows: list[dict[str, str]]) -> str:
    """docs/suite.md."""
    runs = int(rows[0]["runs"])
    methods = list(dict.fromkeys(row["method"] for row in rows))
    head = ["task", "targets", "what for", "best known", *(f"{m}: E_hv (σ_hv)" for m in methods)]
    head += [f"{m}: final" for m in methods]
    lines = [f"| {' | '.join(head)} |", "|---|--:|---|" + "--:|" * (1 + 2 * len(methods))]
    for name, task in ((name, load_task(name)) for name in suite_tasks()):
        by_method = {row["method"]: row for row in rows if row["task"] == name}
        cells = [f"`{name}`", str(len(task.targets)), task.description]
        cells += [f"{best_known_hypervolume(task):.2f}"]
        cells += [f"{float(by_method[m]['e_hv']):.2f} ({float(by_method[m]['sigma_hv']):.2f})" for m in methods]
        cells += [f"{float(by_method[m]['share_of_best_known']):.1%}" for m in methods]
        lines.append(f"| {' | '.join(cells)} |")
    return f"""\
# The benchmark suite

Place a search method of your own next to the usual ones on
{len(suite_tasks())} tasks.

Each task has its points, a reference point and the best known front. `armwright tasks NAME` shows one
task, its points and their source. `random-N` is one of a seeded family.

The table gives the hypervolume within the task's reference point over {runs} runs (seeds 0 to {runs - 1}) of 10 random
and 200 counted trials in the paper's design space. "Final" is the mean share of the best known hypervolume at the end.
`armwright design` reaches 97 to 100 % of it ([benchmarks](benchmarks.md)). This page is made by

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
