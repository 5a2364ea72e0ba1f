"""Stored baselines match the tasks and their best known fronts."""

import runpy

import pytest

from armwright.experiments.baselines import baselines, baselines_of
from armwright.experiments.plan import suite_tasks
from armwright.proof.front_gap import best_known_hypervolume
from armwright.tasks.catalogue import load_task
from tests import ROOT


def test_every_task_in_the_paper_space_has_baselines() -> None:
    for name in suite_tasks():
        best = best_known_hypervolume(load_task(name))
        found = baselines_of(name)
        assert [baseline.method for baseline in found] == ["BBO", "BBO/rules"]
        for baseline in found:
            assert baseline.runs == 5
            assert baseline.e_hv < baseline.final < best
            assert baseline.share == pytest.approx(baseline.final / best, abs=2e-4), (
                f"the best known front of {name} or its baselines were made anew without the other"
            )
    assert {baseline.task for baseline in baselines()} == set(suite_tasks())


def test_suite_page_matches_the_stored_baselines() -> None:
    script = runpy.run_path(str(ROOT / "benchmarks" / "baselines.py"))
    stored = (ROOT / "docs" / "suite.md").read_text(encoding="utf-8")
    assert stored == script["page"](), "python benchmarks/baselines.py makes it anew"
