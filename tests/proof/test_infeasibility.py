"""Runs without a feasible design: conflicts, the nearest design, and bounds that would admit one."""

from pathlib import Path

import numpy as np
import pytest

from armwright.problem.constraints import read_constraints
from armwright.problem.problem import Problem
from armwright.proof.infeasibility import ViolationTally, conflict_record, describe_conflict
from armwright.study.front.front_run import find_front
from armwright.study.study import optimize
from armwright.tasks.task import Task

CONSTRAINTS = read_constraints(["mass <= 2", "price <= 500", "clearance >= 0.01", "jumps <= 0"])
# Relative violations: 0.5 of "mass <= 2" is 3 kg
LIGHT, CHEAP, BOTH = [-0.5, 0.6, -1.0, 0.0], [0.5, -0.1, -1.0, 0.0], [0.123456, 0.2, -1.0, 0.0]
IMPOSSIBLE = ("worst_error <= 1e-8", "length <= 0.2")


def record_of(*violations: list[float]) -> dict[str, object]:
    return conflict_record(CONSTRAINTS, ViolationTally.of(np.array(violations)))


def task(*constraints: str) -> Task:
    return Task(name="mine", targets=((0.3, 0.0, 0.3), (0.2, 0.1, 0.4)), constraints=constraints)


def test_constraints_that_no_design_satisfies_together_are_named() -> None:
    record = record_of(LIGHT, LIGHT, CHEAP, BOTH)
    assert record == {
        "designs": 4,
        "satisfied_by": {"mass <= 2": 2, "price <= 500": 1, "clearance >= 0.01": 4, "jumps <= 0": 4},
        "conflicts": [["mass <= 2", "price <= 500"]],
        "admitting": ["mass <= 2.25", "price <= 600"],
        "admitting_alone": "mass <= 3",
    }
    assert describe_conflict(record) == (
        "none of 4 designs satisfies mass <= 2 and price <= 500 together (2, 1 alone); bounds that would admit one: "
        "mass <= 2.25, price <= 600; a single one: mass <= 3"
    )


def test_smallest_conflicts_and_bounds_are_named() -> None:
    """Constraints that no design satisfies one by one; bounds of 0 stay if others can change."""
    record = record_of([0.5, -1.0, 1.5, 3.0], [0.1, 0.1, 2.0, 1.0])
    assert record["conflicts"] == [["mass <= 2"], ["clearance >= 0.01"], ["jumps <= 0"]]
    assert record["admitting"] == ["mass <= 2.2", "price <= 550", "clearance >= -0.01", "jumps <= 1"]
    assert record["admitting_alone"] is None
    assert record_of([-1.0, -1.0, -1.0, 1.0], [2.0, 3.0, -1.0, 0.0])["admitting"] == ["mass <= 6", "price <= 2000"]
    pairs = [[-1.0, -1.0, 1.0, -1.0], [-1.0, 1.0, -1.0, -1.0], [1.0, -1.0, -1.0, -1.0]]
    assert record_of(*pairs)["conflicts"] == [["mass <= 2", "price <= 500", "clearance >= 0.01"]]


def test_bounds_admit_the_designs_that_they_were_made_for() -> None:
    rng = np.random.default_rng(0)
    violations = rng.uniform(-1.0, 1.0, (300, 4)) * rng.choice([1e-6, 1.0, 1e3], (300, 4))
    violations[:, 0] = np.abs(violations[:, 0]) + 1e-9
    for row in violations:
        record = conflict_record(CONSTRAINTS, ViolationTally.of(row[None]))
        loosened = {c.quantity.name: c for c in read_constraints(record["admitting"])}
        for constraint, violation in zip(CONSTRAINTS, row.tolist(), strict=True):
            value, bound = constraint.measured(violation), loosened.get(constraint.quantity.name)
            assert (bound is None) == (violation <= 0.0)
            if bound is not None:
                slack = 1e-8 * abs(value)
                assert value <= bound.bound + slack if bound.relation == "<=" else value >= bound.bound - slack
                assert abs(bound.bound - value) <= 0.011 * abs(value)


def test_tally_in_parts_and_restored_is_that_of_all_designs() -> None:
    violations = np.random.default_rng(1).normal(size=(500, 4))
    whole, parts = ViolationTally.of(violations), ViolationTally(4)
    for rows in np.array_split(violations, 7):
        parts.add(rows)
        restored = ViolationTally(4)
        restored.restore(parts.state())
        parts = restored
    assert whole.n_designs == 500
    assert conflict_record(CONSTRAINTS, parts) == conflict_record(CONSTRAINTS, whole)
    assert parts.counts == whole.counts
    for key, row in whole.nearest.items():
        assert np.array_equal(parts.nearest[key], row)
        assert np.maximum(row, 0.0).sum() == min(
            np.maximum(other, 0.0).sum() for other in violations if np.array_equal(other <= 0.0, row <= 0.0)
        )


def test_study_reports_its_conflict() -> None:
    run = optimize(Problem(task(*IMPOSSIBLE)), proposer="none", n_init=4, n_total=4, seed=0)
    conflict = run.summary["feasibility"]["conflict"]
    assert conflict["designs"] == len(run.trials)
    assert ["worst_error <= 1e-08"] in conflict["conflicts"]
    admitting = read_constraints(conflict["admitting"])
    measured = run.summary["feasibility"]["nearest"]["measured"]
    assert {c.quantity.name for c in admitting} <= {name.split()[0] for name in measured}
    feasible = optimize(Problem(task("length <= 2")), proposer="none", n_init=4, n_total=4, seed=0)
    assert feasible.summary["feasibility"]["conflict"] is None


def test_direct_search_reports_the_conflict_of_all_its_designs_and_of_all_sessions(tmp_path: Path) -> None:
    far_apart = task("worst_error <= 1e-3", "length <= 0.2").model_copy(
        update={"targets": ((0.3, 0, 0.3), (-0.3, 0, 0.3))}
    )
    problem = Problem(far_apart)  # no arm of 0.2 m reaches both
    whole = find_front(problem, evaluations=3000, seed=0, stop_at_stall=False)
    conflict = whole.summary["feasibility"]["conflict"]
    assert conflict["designs"] == whole.summary["search"]["evaluations"]
    assert conflict["conflicts"] == [["worst_error <= 0.001", "length <= 0.2"]]
    assert min(conflict["satisfied_by"].values()) > 0
    find_front(problem, evaluations=1500, seed=0, stop_at_stall=False, out=tmp_path / "run")
    resumed = find_front(problem, evaluations=3000, seed=0, stop_at_stall=False, out=tmp_path / "run")
    assert resumed.summary["feasibility"]["conflict"] == conflict


@pytest.mark.parametrize("n", [0, 5])
def test_tally_without_constraints_is_kept(n: int) -> None:
    tally = ViolationTally.of(np.empty((n, 0)))
    tally.restore(tally.state())
    assert tally.n_designs == n
