"""Refinement by CMA-ES: improvements, counts and determinism."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armwright.arrays import Array
from armwright.exceptions import RunConflictError, RunFolderError, SettingsError
from armwright.pareto import hypervolume
from armwright.problem.problem import Problem
from armwright.runs.folder import read_run
from armwright.runs.history import REFINE
from armwright.runs.results import read_summary
from armwright.search.cma_es import POPULATION, Refined, refine
from armwright.spaces.parameters import CategoricalParameter, FloatParameter
from armwright.study.progress import StudyResult
from armwright.study.refine_run import refine_run
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task

PROBLEM = Problem(load_task("target-1"))
BOX = tuple(FloatParameter(f"x_{i}", -1.0, 3.0, "m") for i in range(5))


def paraboloids(rows: Array) -> Array:
    """Two ill-conditioned bowls with least values at different points; their front is the curve between these."""
    weights = 10.0 ** np.linspace(0.0, 3.0, rows.shape[1])
    return np.column_stack([((rows - centre) ** 2 * weights).sum(axis=1) for centre in (0.5, 0.6)])


def test_refinement_finds_the_front_of_paraboloids() -> None:
    """Each start comes to within 1e-4 of a point where the two gradients oppose each other."""
    rows = np.random.default_rng(0).uniform(-1.0, 3.0, (7, 5))
    refined = refine(BOX, paraboloids, rows, paraboloids(rows), (1.0, 1.0), 6000, 0)
    assert refined.improved.all()
    # On the front both roots add up to the distance of the centres, in the metric of the bowls.
    apart = np.sqrt(paraboloids(np.full((1, 5), 0.5))[0, 1])
    assert np.sqrt(refined.values).sum(axis=1) == pytest.approx(apart, rel=1e-2)


@pytest.mark.parametrize("budget", [0, POPULATION, 400])
def test_refinement_is_never_worse_and_counted(budget: int) -> None:
    designs = PROBLEM.space.sample(20, seed=1)
    rows = PROBLEM.space.matrix(designs)
    values = PROBLEM.evaluate(designs).values
    counted: list[int] = []

    def evaluate(samples: Array) -> Array:
        counted.append(len(samples))
        return PROBLEM.evaluate_matrix(samples).values

    refined = refine(PROBLEM.space.parameters, evaluate, rows, values, (5.0, 5.0), budget, 3)
    assert refined.evaluations == sum(counted) == 20 * POPULATION * (budget // POPULATION)
    assert np.all(refined.values[refined.improved] < values[refined.improved])
    assert np.array_equal(refined.matrix[~refined.improved], rows[~refined.improved])
    # What it says is what comes out, and it is in the space, with the joints as they were.
    assert np.array_equal(PROBLEM.evaluate_matrix(refined.matrix).values, refined.values)
    for before, after in zip(designs, PROBLEM.space.designs(refined.matrix), strict=True):
        assert PROBLEM.space.design(after.params) == after
        assert after.joints == before.joints


def test_refinement_is_deterministic_and_keeps_categories() -> None:
    parameters = (*BOX[:2], CategoricalParameter("kind", ("a", "b")))
    rows = np.array([[0.0, 0.0, 1.0], [2.0, 2.0, 0.0]])
    runs = [refine(parameters, lambda r: paraboloids(r[:, :2]), rows, paraboloids(rows[:, :2]), (1, 1), 240, 5)] * 2
    runs.append(refine(parameters, lambda r: paraboloids(r[:, :2]), rows, paraboloids(rows[:, :2]), (1, 1), 240, 6))
    assert np.array_equal(runs[0].matrix, runs[1].matrix)
    assert not np.array_equal(runs[0].matrix, runs[2].matrix)
    assert np.array_equal(runs[0].matrix[:, 2], rows[:, 2])


def test_space_without_real_parameters_is_not_refined() -> None:
    rows = np.array([[0.0], [1.0]])
    parameters = (CategoricalParameter("kind", ("a", "b")),)
    refined = refine(parameters, lambda r: r, rows, rows, (1.0,), 100, 0)
    assert not refined.improved.any()
    assert refined.evaluations == 0


@pytest.fixture
def run(tmp_path: Path) -> StudyResult:
    return optimize(PROBLEM, proposer="rules", n_init=5, n_step=5, n_total=30, seed=0, out=tmp_path / "run")


def test_refine_run_adds_improved_designs(run: StudyResult) -> None:
    assert run.folder is not None
    refined = refine_run(run.folder, 240)
    new = refined.history.trials[len(run.trials) :]
    assert 0 < refined.added == len(new) <= refined.tried
    for trial in new:
        assert trial.source == REFINE
        assert trial.refines is not None
        parent = run.trials[trial.refines]
        assert np.all(np.array(trial.values) < parent.values)
        assert trial.design.joints == parent.design.joints
    assert sum(trial.evaluations for trial in new) == refined.evaluations
    assert refined.evaluations <= 240 * refined.tried
    summary = read_summary(run.folder)
    assert summary == refined.summary
    assert summary is not None
    assert summary["proposer"] == run.summary["proposer"]
    assert summary["hypervolume"]["final"] > run.summary["hypervolume"]["final"]
    assert summary["hypervolume"]["mean"] == pytest.approx(run.summary["hypervolume"]["mean"])  # of the counted trials
    assert summary["evaluations"] == len(run.trials) + refined.evaluations
    _, read = read_run(run.folder)
    assert read.trials == list(refined.history.trials)


def test_refined_run_is_finished_and_cannot_be_extended(run: StudyResult) -> None:
    assert run.folder is not None
    refine_run(run.folder, 120)
    _, before = read_run(run.folder)
    settings = {"proposer": "rules", "n_init": 5, "n_step": 5, "seed": 0, "out": run.folder}
    again = optimize(PROBLEM, n_total=30, **settings)
    assert list(again.trials) == before.trials
    with pytest.raises(RunConflictError, match="was refined"):
        optimize(PROBLEM, n_total=100, **settings)
    assert read_run(run.folder)[1].trials == before.trials


def test_refine_run_counts_evaluations_in_vain_and_draws_another_seed(
    run: StudyResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run.folder is not None
    seeds: list[int] = []

    def nothing_better(history: Any, members: Any, seed: int, evaluations: int) -> Refined:
        seeds.append(seed)
        values = np.array([member.values for member in members])
        rows = history.problem.space.matrix([member.design for member in members])
        return Refined(rows, values, np.zeros(len(rows), dtype=bool), evaluations * len(rows))

    monkeypatch.setattr("armwright.study.refine_run.refine_members", nothing_better)
    first = refine_run(run.folder, 120)
    assert first.added == 0
    assert first.summary["evaluations"] == 35 + first.evaluations
    second = refine_run(run.folder, 120)
    assert second.summary["evaluations"] == 35 + 2 * first.evaluations
    assert second.summary["refine"] == {"rounds": 2, "in_vain": 2 * first.evaluations}
    assert len(set(seeds)) == 2


def test_refine_run_refuses_bad_input(run: StudyResult, tmp_path: Path) -> None:
    assert run.folder is not None
    with pytest.raises(SettingsError, match="evaluations per design: expected 12"):
        refine_run(run.folder, 3)
    with pytest.raises(RunFolderError, match="not a run folder"):
        refine_run(tmp_path / "nothing")
    assert not (tmp_path / "nothing").exists()
    (run.folder / "summary.json").unlink()
    with pytest.raises(RunFolderError, match="not finished"):
        refine_run(run.folder)


@pytest.mark.slow
def test_refinement_within_a_study(tmp_path: Path) -> None:
    settings = {"proposer": "rules", "n_init": 5, "n_step": 10, "seed": 1, "refine_every": 5}
    run = optimize(PROBLEM, n_total=30, **settings)
    refined = [trial for trial in run.trials if trial.refines is not None]
    assert len(refined) == 5  # after 5, 10, …, 25 counted trials; at 10 and 20 the proposer's turn comes first
    assert [trial.number for trial in run.trials if trial.source == "rules"] == [5, 15, 25]
    for trial in refined:
        assert trial.refines is not None
        assert trial.evaluations == 1 + 1000 // POPULATION * POPULATION
        assert trial.refines < trial.number
        if trial.source == REFINE:
            assert np.all(np.array(trial.values) < run.trials[trial.refines].values)
    without = optimize(PROBLEM, n_total=30, **{**settings, "refine_every": None})
    assert hypervolume(run.history.values, (5, 5)) > hypervolume(without.history.values, (5, 5))
    # Stopped and resumed, it is the same run.
    for n_total in (11, 30):
        resumed = optimize(PROBLEM, n_total=n_total, out=tmp_path / "run", **settings)
    assert [(t.design, t.values, t.refines) for t in resumed.trials] == [
        (t.design, t.values, t.refines) for t in run.trials
    ]
