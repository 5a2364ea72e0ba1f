"""The page of the benchmark suite matches the tasks and their best known fronts."""

import re

from armwright.experiments.plan import suite_tasks
from armwright.proof.front_gap import best_known_hypervolume
from armwright.tasks.catalogue import load_task
from tests import ROOT

ROW = re.compile(r"\| `(\S+)` \| (\d+) \| (.+?) \| ([\d.]+) \|")


def test_suite_page_matches_the_tasks() -> None:
    rows = ROW.findall((ROOT / "docs" / "suite.md").read_text(encoding="utf-8"))
    tasks = map(load_task, suite_tasks())
    assert rows == [
        (task.name, str(len(task.targets)), task.description, f"{best_known_hypervolume(task):.2f}") for task in tasks
    ], "python benchmarks/baselines.py makes the page anew"
