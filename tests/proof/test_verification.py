"""Verification of designs, against the plain float64 reference."""

from pathlib import Path

import numpy as np
import pytest

from armwright.exceptions import FailureError
from armwright.problem.problem import Problem
from armwright.proof.selection import pick_from
from armwright.proof.verification import Verification, verify, verify_front
from armwright.runs.history import History
from armwright.runs.trial import FinishedTrial
from armwright.spaces.parameters import Design
from armwright.spaces.tolerance import perturbed
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task
from armwright.tasks.task import Task
from tests.support import reference_kinematics as reference

PROBLEM = Problem(load_task("target-1"))
BOX = (5.0, 5.0)


def values_of(problem: Problem, designs: list[Design]) -> np.ndarray:
    """(N, 2) by the reference, in float64."""
    chains = reference.chains([problem.arm(design) for design in designs])
    solution = reference.solve(chains, problem.task.target_positions)
    return np.column_stack(
        [
            np.linalg.norm(solution.reached - problem.task.target_positions, axis=-1).sum(axis=1),
            40.0 * np.linalg.norm(solution.torque, axis=-1).sum(axis=1),
        ]
    )


def agree(found: np.ndarray, expected: np.ndarray) -> None:
    """Values (N, 2) of whole solves, 8 or more a design: the chaotic among them show, by little, to either side."""
    assert found.mean(axis=0) == pytest.approx(expected.mean(axis=0), rel=5e-3)
    assert np.mean(np.all(np.abs(found - expected) < 0.02 * expected + 1e-3, axis=1)) > 0.8


@pytest.fixture(scope="module")
def designs() -> list[Design]:
    return PROBLEM.space.sample(60, seed=4)


@pytest.fixture(scope="module")
def found(designs: list[Design]) -> Verification:
    return verify(PROBLEM, PROBLEM.space.matrix(designs), PROBLEM.evaluate(designs).values, BOX)


def test_exact_values_agree_with_the_reference(designs: list[Design], found: Verification) -> None:
    agree(found.exact, values_of(PROBLEM, designs))


@pytest.mark.slow
def test_perturbed_values_are_the_worst_over_copies(designs: list[Design], found: Verification) -> None:
    rows = PROBLEM.space.matrix(designs)
    copies = list(perturbed(PROBLEM.space, rows))
    assert len(copies) == 2 * 7
    for copy in copies:
        off = np.abs(copy - rows)
        assert np.all(np.count_nonzero(off > 1e-12, axis=1) == 1)
        assert off.max(axis=1) == pytest.approx(1e-3)
    worst = np.max([values_of(PROBLEM, PROBLEM.space.designs(copy)) for copy in copies], axis=0)
    agree(found.moved, worst)


def test_robustness_follows_from_the_worst_cases(designs: list[Design], found: Verification) -> None:
    values = PROBLEM.evaluate(designs).values
    allowed = values + np.maximum(0.05 * values, 0.005 * np.array(BOX))
    for i in range(len(designs)):
        robust = np.all(found.exact[i] <= allowed[i]) and np.all(found.moved[i] <= allowed[i])
        assert found.robust[i] == robust
    assert 0 < found.robust.sum() < len(designs)


def test_design_near_a_flip_of_the_solver_is_sensitive() -> None:
    """A target at the arm's full reach: with any shorter link it is a millimetre away; half a millimetre is allowed."""
    at_reach = Task(name="reach", targets=((0.0, 0.0, 0.4),), reference_point=(0.1, 20.0))
    lucky = Problem(at_reach).space.clipped((0.0, 0.0, 0.0), "RPRP", (0.1, 0.1, 0.1, 0.1))
    easy = Problem(at_reach).space.clipped((0.2, 0.0, 0.2), "YPPP", (0.15, 0.15, 0.15, 0.15))
    problem = Problem(at_reach)
    found = verify(problem, problem.space.matrix([lucky, easy]), problem.evaluate([lucky, easy]).values, (0.1, 20.0))
    assert found.moved[0, 0] == pytest.approx(1e-3, abs=1e-6)
    assert found.robust.tolist() == [False, True]


def test_robust_values_are_the_worst_case(designs: list[Design]) -> None:
    robust = Problem(PROBLEM.task, tolerance=1e-3)
    rows = PROBLEM.space.matrix(designs)
    worst = np.max([PROBLEM.evaluate(r).values for r in (rows, *perturbed(PROBLEM.space, rows))], axis=0)
    assert np.array_equal(robust.evaluate(rows).values, worst)
    assert np.array_equal(robust.evaluate(designs).values, worst)


def test_verification_marks_the_front(tmp_path: Path) -> None:
    settings = {"proposer": "rules", "n_init": 5, "n_step": 5, "n_total": 20, "seed": 0}
    run = optimize(PROBLEM, verify=False, **settings, out=tmp_path / "without")
    assert run.summary["verification"] is None
    assert "verdict" not in (tmp_path / "without" / "front.csv").read_text(encoding="utf-8")
    with pytest.raises(FailureError, match="without a verification"):
        pick_from(tmp_path / "without", holds=True)
    verified = optimize(PROBLEM, **settings, out=tmp_path / "run")
    record = verified.summary["verification"]
    assert record["robust"] + record["sensitive"] == len(verified.front)
    assert {**verified.summary, "verification": None, "seconds": None} == {**run.summary, "seconds": None}
    table = (tmp_path / "run" / "front.csv").read_text(encoding="utf-8")
    assert table.count(",robust,") == record["robust"]
    assert table.count(",sensitive,") == record["sensitive"]


def test_history_without_a_reference_point_is_not_verified() -> None:
    problem = Problem(Task(name="open", targets=((0.3, 0.0, 0.3),)))
    (design,) = problem.space.sample(1, seed=0)
    trial = FinishedTrial(0, "random", design, tuple(problem.evaluate([design]).values[0].tolist()))
    assert verify_front(History(problem, [trial], 10)) is None
