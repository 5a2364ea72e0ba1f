"""Constraints, and infeasible designs in every result, against Optuna, pymoo and moocore."""

import json
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import moocore
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pymoo.util.dominator import Dominator

from armwright.exceptions import FailureError, RunConflictError, RunFolderError, SettingsError, TaskError
from armwright.pareto import (
    default_reference_point,
    penalised_objectives,
    total_violation,
)
from armwright.problem.constraints import Constraint, read_constraints
from armwright.problem.objectives import QUANTITIES
from armwright.problem.problem import Problem
from armwright.proof.attribution import attribution_by_source
from armwright.proof.front_gap import known_front
from armwright.proof.selection import numbers_of, pick
from armwright.runs.folder import read_run
from armwright.runs.history import History, found_reference_point
from armwright.runs.trial import FinishedTrial
from armwright.search.samplers import BlackBox
from armwright.spaces.design_space import paper_space
from armwright.spaces.tolerance import perturbed
from armwright.study.front.front_run import find_front
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task
from armwright.tasks.task import Task
from tests.support.fixed_problem import FixedProblem, fixed_history

SPACE = paper_space()
BOUNDS = ("worst_error <= 0.4", "length >= 0.5", "peak_torque <= 0.06")  # of target-2, 1 in 8 random designs keeps them
IMPOSSIBLE = ("worst_error <= 1e-08", "length <= 0.5")  # targets of target-2 lie 1.3 m apart
VALUES = arrays(float, st.tuples(st.integers(1, 20), st.just(2)), elements=st.integers(1, 12).map(float))


def task(*constraints: str, **update: Any) -> Task:
    return load_task("target-2").model_copy(update={"constraints": constraints, **update})


def told(values: np.ndarray, broken: np.ndarray) -> History:
    """A history of these objectives (N, 2) and constraints (N, C)."""
    problem = FixedProblem(
        task(*("length >= 0.1", "mass <= 3", "unreached_targets <= 4")[: broken.shape[1]], reference_point=(10.0, 10.0))
    )
    designs = SPACE.sample(len(values), 0)
    rows = zip(designs, values.tolist(), broken.tolist(), strict=True)
    trials = [FinishedTrial(i, "bbo", d, tuple(v), violations=tuple(b)) for i, (d, v, b) in enumerate(rows)]
    return History(problem, trials, 0, (10.0, 10.0))


def lines(folder: Path) -> list[dict[str, Any]]:
    trials = (folder / "trials.jsonl").read_text(encoding="utf-8").splitlines()
    return [{key: value for key, value in json.loads(line).items() if key != "seconds"} for line in trials]


@given(st.sampled_from(sorted(QUANTITIES)), st.sampled_from(["<=", ">="]), st.floats(-1e6, 1e6))
def test_constraint_text_is_parsed(name: str, relation: str, bound: float) -> None:
    (constraint,) = read_constraints([f" {name}{relation} {bound!r} "])
    assert (constraint.quantity.name, constraint.relation, constraint.bound) == (name, relation, bound)
    assert read_constraints([constraint.description])[0].bound == pytest.approx(bound, rel=1e-11)


@pytest.mark.parametrize(
    ("sentences", "words"),
    [
        (["worst_eror <= 0.01"], r'unknown quantity "worst_eror"\. Did you mean "worst_error"\? Quantities: position_'),
        (["mass <= three"], r'expected a finite number \[kg\], at most ±1e\+60, got "three"; try mass <= 3'),
        (["mass <= nan"], r'expected a finite number \[kg\], at most ±1e\+60, got "nan"'),
        (["mass <= 1e999"], r'expected a finite number \[kg\], at most ±1e\+60, got "1e999"'),
        (["mass <= 1_0"], r'expected a finite number \[kg\], at most ±1e\+60, got "1_0"'),
        (["mass < 3"], "<= or >=, and a number without unit; try mass <= 3"),
        (["mass <= 3 kg"], "a number without unit"),
        (["__import__('os').getcwd() <= 3"], "a quantity, <= or >=, and a number"),
        (["mass <= 3", "mass <= 2"], '"mass <= 3" and "mass <= 2" bound the same quantity'),
        (["mass <= 3", "mass >= 4"], 'no design satisfies both "mass >= 4" and "mass <= 3"'),
    ],
)
def test_invalid_constraints_are_refused_in_one_line(sentences: list[str], words: str) -> None:
    with pytest.raises(TaskError, match=words.replace("(", r"\(") if "import" in words else words) as refusal:
        Problem(task(*sentences))
    assert "\n" not in str(refusal.value)


def test_violations_are_relative_distances_from_the_bound() -> None:
    """For a bound of 0, the violation is in the quantity's own unit."""
    problem = Problem(task("worst_error <= 0.4", "length >= 0.5", "unreached_targets <= 0", "peak_torque <= 0.06"))
    designs = SPACE.sample(50, 3)
    outcomes = problem.evaluate(designs)
    values, broken = outcomes.values, outcomes.violations
    evaluation = problem.physics(designs)
    lengths = np.array([sum(design.links) for design in designs])
    missed = np.sum(np.linalg.norm(evaluation.reached - evaluation.targets, axis=-1) >= 1e-3, axis=1)
    peak = np.abs(evaluation.joint_torques).max(axis=(1, 2))
    expected = [
        (evaluation.position_error.max(axis=1) - 0.4) / 0.4,
        (0.5 - lengths) / 0.5,
        missed,
        (peak - 0.06) / 0.06,
    ]
    assert broken == pytest.approx(np.column_stack(expected), rel=1e-5, abs=1e-6)
    assert np.array_equal(values, Problem(task()).evaluate(designs).values)
    measured = [problem.constraints[1].measured(b) for b in broken[:, 1].tolist()]
    assert measured == pytest.approx(lengths, rel=1e-6)


def test_violations_of_matrix_and_designs_agree_and_take_the_worst_copy() -> None:
    problem = Problem(task(*BOUNDS), tolerance=1e-3)
    exact = Problem(task(*BOUNDS))
    designs = SPACE.sample(20, 5)
    rows = SPACE.matrix(designs)
    copies = [exact.evaluate(r).violations for r in (rows, *perturbed(SPACE, rows))]
    assert np.array_equal(problem.evaluate(rows).violations, np.max(copies, axis=0))
    assert np.array_equal(problem.evaluate(designs).violations, np.max(copies, axis=0))
    assert np.array_equal(exact.evaluate(designs).violations, exact.evaluate(rows).violations)


def test_nonfinite_constraint_value_is_refused() -> None:
    problem = Problem(task("mass <= 3"))
    lost = replace(problem.constraints[0].quantity, each=lambda evaluation: np.full(len(evaluation), np.nan))  # type: ignore[type-var]
    object.__setattr__(problem, "constraints", (Constraint(lost, "<=", 3.0),))
    with pytest.raises(SettingsError, match=r"mass <= 3.*expected a finite number for every design, got nan"):
        problem.evaluate(SPACE.sample(1, 0))


@given(VALUES, st.data())
def test_constrained_dominance_agrees_with_pymoo(values: np.ndarray, data: st.DataObject) -> None:
    broken = data.draw(arrays(float, (len(values), 2), elements=st.integers(-2, 2).map(lambda i: i / 3)))
    ranks, total = penalised_objectives(values, broken), total_violation(broken)
    for a, b in product(range(len(values)), repeat=2):
        if total[a] == total[b] > 0.0:
            continue  # where pymoo looks at the objectives; Deb's rules call neither better
        theirs = Dominator.get_relation(values[a], values[b], total[a], total[b])
        assert Dominator.get_relation(ranks[a], ranks[b]) == theirs


@given(VALUES, st.data())
def test_constrained_front_agrees_with_optuna_and_hypervolume_with_moocore(
    values: np.ndarray, data: st.DataObject
) -> None:
    broken = data.draw(arrays(float, (len(values), 3), elements=st.integers(-3, 1).map(float)))
    history = told(values, broken)
    names = [constraint.description for constraint in history.problem.constraints]
    box = BlackBox(SPACE, "random", seed=0, constraints=names)
    box.restore(history.trials)
    best = [trial.number for trial in box.study.best_trials]
    equals = [n for n in best if not any(values[n].tolist() == values[k].tolist() for k in best if k < n)]
    assert sorted(member.number for member in history.front) == sorted(equals)
    feasible = values[np.all(broken <= 0.0, axis=1)]
    whole = float(moocore.hypervolume(feasible, ref=[10.0, 10.0])) if len(feasible) else 0.0
    assert history.hypervolume[-1] == pytest.approx(whole)
    assert sum(one.hypervolume_gained or 0.0 for one in attribution_by_source(history).values()) == pytest.approx(whole)


def test_run_counts_only_feasible_designs(tmp_path: Path) -> None:
    problem = Problem(task(*BOUNDS))
    run = optimize(problem, proposer="rules", sampler="nsga2", n_total=40, seed=1, out=tmp_path / "run")
    broken = problem.evaluate([trial.design for trial in run.trials]).violations
    assert np.array_equal(run.history.violations, broken)
    feasible = np.all(broken <= 0.0, axis=1)
    assert 0 < feasible.sum() < len(feasible)
    values = np.array([trial.values for trial in run.trials])
    assert run.hypervolume[-1] == pytest.approx(float(moocore.hypervolume(values[feasible], ref=[5.0, 5.0])))
    assert all(feasible[member.number] for member in run.front)
    record = run.summary["feasibility"]
    assert record["infeasible"] == int((~feasible).sum())
    assert record["nearest"] is None
    assert list(record["violated_by"].values()) == (broken > 0.0).sum(axis=0).tolist()
    assert known_front(problem) is None
    assert run.summary["front_gap"] is None
    # on disk
    _, there = read_run(tmp_path / "run")
    assert list(there) == list(run.trials)
    assert run.front
    for member in run.front:
        design = json.loads(
            (tmp_path / "run" / "designs" / f"{member.number:04d}" / "design.json").read_text(encoding="utf-8")
        )
        assert list(design["violations"].values()) == broken[member.number].tolist()
    numbers = numbers_of(there, there.front[0])
    assert numbers["worst_error"] == pytest.approx(there.evaluation([there.front[0].number]).position_error.max())
    # what is verified keeps its bounds, but for a little, when it is built a little off
    designs = [there.trials[number].design for number in run.summary["verification"]["robust_numbers"]]
    rows = SPACE.matrix(designs)
    off = np.max([problem.evaluate(copies).violations for copies in perturbed(SPACE, rows)], axis=0)
    assert np.all(off <= 0.06)  # 5 % in float64


def test_changed_constraints_and_missing_violations_are_refused(tmp_path: Path) -> None:
    optimize(Problem(task(*BOUNDS)), proposer="none", sampler="random", n_total=2, out=tmp_path / "run")
    with pytest.raises(RunConflictError, match=r"constraints: .*worst_error <= 0.4"):
        optimize(Problem(task("worst_error <= 0.3")), proposer="none", n_total=2, out=tmp_path / "run")
    file = tmp_path / "run" / "trials.jsonl"
    first = json.loads(file.read_text(encoding="utf-8").splitlines()[0])
    del first["violations"]
    file.write_text(json.dumps(first) + "\n", encoding="utf-8")
    with pytest.raises(RunFolderError, match=r"line 1 is damaged .expected 3 violations, found 0"):
        read_run(tmp_path / "run")


def test_run_without_a_feasible_design_reports_the_nearest(tmp_path: Path) -> None:
    problem = Problem(task(*IMPOSSIBLE))
    run = optimize(problem, proposer="rules", sampler="random", n_total=6, seed=1, out=tmp_path / "run")
    assert run.front == []
    assert run.hypervolume.tolist() == [0.0] * 6
    broken = problem.evaluate([trial.design for trial in run.trials]).violations
    nearest = int(np.argmin(np.maximum(broken, 0.0).sum(axis=1)))
    assert run.summary["feasibility"]["nearest"]["number"] == nearest
    assert run.summary["front_size"] == 0
    assert run.summary["verification"] is None
    words = f"the nearest, #{nearest}, violates worst_error <= 1e-08 .* most"
    with pytest.raises(FailureError, match=words):
        pick(run.history)


def test_reference_point_comes_from_feasible_designs() -> None:
    values = np.array([[1.0, 9.0], [9.0, 1.0], [4.0, 6.0], [6.0, 4.0]])
    broken = np.array([[1.0], [1.0], [0.0], [-1.0]])
    assert found_reference_point(values, broken) == pytest.approx((6.6, 6.6))
    assert found_reference_point(values, np.array([[1.0], [1.0], [0.0], [1.0]])) == default_reference_point(values)
    assert found_reference_point(values, np.ones((4, 1))) == default_reference_point(values)
    assert found_reference_point(values, np.empty((4, 0))) == default_reference_point(values)
    open_ = task("length >= 0.2", reference_point=None)
    run = optimize(Problem(open_), proposer="none", sampler="random", n_total=2, seed=0)
    assert run.history.reference_point == run.history.found_reference_point()


def test_front_search_reports_feasible_designs_only() -> None:
    problem = Problem(task(*BOUNDS))
    run = find_front(problem, evaluations=4_000)
    assert run.front
    assert np.all(run.history.feasible)
    assert np.array_equal(run.history.violations, problem.evaluate([m.design for m in run.history.trials]).violations)
    assert 0 < run.summary["search"]["infeasible"] < run.summary["search"]["evaluations"]


def test_front_search_without_a_feasible_design_keeps_the_nearest() -> None:
    run = find_front(Problem(task(*IMPOSSIBLE)), evaluations=3_000)
    assert run.front == []
    assert run.summary["hypervolume"]["final"] == 0.0
    assert run.summary["feasibility"]["nearest"]["number"] == 0
    assert len(run.history) == 1
    assert max(run.history.trials[0].values) < 1e6  # the design's own values, not ranks


def test_feedback_of_infeasible_designs_starts_with_the_nearest() -> None:
    history = fixed_history(FixedProblem(task("mass <= 0.0001")))
    assert history.front == []
    assert history.nearest(3) == np.argsort(history.violations[:, 0], kind="stable")[:3].tolist()
