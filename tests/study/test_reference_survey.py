"""Reference points that direct searches find."""

from pathlib import Path

import numpy as np
import pytest

from armwright.pareto import hypervolume
from armwright.problem.problem import Problem
from armwright.runs.folder import read_config
from armwright.runs.results import read_summary
from armwright.spaces.design_space import paper_space
from armwright.study.front_run import find_front
from armwright.tasks.task import Task

TARGETS = ((0.3, 0.0, 0.3), (0.2, 0.1, 0.4))


def problem(*constraints: str) -> Problem:
    content = {"name": "open", "targets": TARGETS, "objectives": ["worst_error", "torque"], "constraints": constraints}
    return Problem(Task.model_validate(content), paper_space())


def test_bounded_objectives_take_their_bounds() -> None:
    run = find_front(problem("worst_error <= 0.003", "torque <= 2"), evaluations=500, seed=0)
    assert run.history.reference_point == pytest.approx((0.0033, 2.2))
    assert run.summary["search"]["reference_point_from"] == ["worst_error <= 0.003", "torque <= 2"]


def test_other_objectives_take_a_point_from_feasible_designs() -> None:
    run = find_front(problem("worst_error <= 0.01"), evaluations=20_000, seed=0)
    assert run.history.reference_point is not None
    error, torque = run.history.reference_point
    assert error == pytest.approx(0.011)
    assert run.summary["search"]["reference_point_from"] == ["worst_error <= 0.01", "feasible designs"]
    highest = run.history.values[:, 1].max()
    assert highest < torque < 5.0 * highest
    final = run.summary["search"]["hypervolume_history"][-1][1]
    assert final == pytest.approx(hypervolume(run.history.values, (error, torque)), rel=1e-2)


def test_a_search_without_feasible_designs_states_that_its_point_is_provisional() -> None:
    run = find_front(problem("worst_error <= 0.01", "length <= 0.13"), evaluations=1000, seed=0)
    assert not run.history.feasible.any()
    assert run.summary["search"]["reference_point_from"] == ["worst_error <= 0.01", "random designs"]


@pytest.mark.parametrize("evaluations", [700, 5000])
def test_a_resumed_search_finds_the_same_point(evaluations: int, tmp_path: Path) -> None:
    """The first session ends before, or after, the point is set."""
    bounded = problem("worst_error <= 0.05")
    whole = find_front(bounded, evaluations=8000, seed=0)
    first = find_front(bounded, evaluations=evaluations, seed=0, out=tmp_path / "run")
    assert (first.history.reference_point == whole.history.reference_point) == (evaluations == 5000)
    resumed = find_front(bounded, evaluations=8000, seed=0, out=tmp_path / "run")
    assert resumed.resumed > 0
    assert resumed.history.reference_point == whole.history.reference_point
    assert read_config(tmp_path / "run").reference_point == whole.history.reference_point
    assert np.array_equal(resumed.history.values, whole.history.values)
    assert resumed.summary["search"]["hypervolume_history"] == whole.summary["search"]["hypervolume_history"]
    assert read_summary(tmp_path / "run") == resumed.summary


def test_the_point_stays_once_it_is_set() -> None:
    runs = [find_front(problem("worst_error <= 0.05"), evaluations=n, seed=0) for n in (5000, 7000)]
    assert runs[0].history.reference_point == runs[1].history.reference_point
