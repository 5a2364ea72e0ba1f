"""Problems whose tasks have a cycle: implied constraints, quantities of motions, variations."""

from typing import Any

import numpy as np
import pytest

from armwright.exceptions import SettingsError
from armwright.problem.objectives import OBJECTIVES, QUANTITIES
from armwright.problem.outcomes import Outcomes, worst_case
from armwright.problem.problem import Problem
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.tolerance import TOLERANCE, perturbed
from armwright.tasks.task import Task
from tests.support.arms import LIGHT

DOWN = [0, 0, -1]
TARGETS = [
    {"name": "bin", "position": [0.3, 0.0, 0.1], "axis": DOWN},
    {"name": "tray", "position": [0.2, 0.25, 0.15], "axis": DOWN},
    {"name": "home", "position": [0.15, -0.2, 0.25], "axis": DOWN},
]
PICKS = [{"to": "bin", "do": "pick"}, {"to": "tray", "do": "place"}, {"to": "home", "by": "line"}]
IMPLIED = ["unreached_targets <= 0", "path_error <= 0.002", "path_angle <= 0.02", "jumps <= 0", "collision <= 0"]
DRIVES = ["dynamic_utilisation <= 1", "speed_utilisation <= 1", "thermal_utilisation <= 1", "voltages <= 1",
          "bearing_utilisation <= 1"]  # fmt: skip
ARM: dict[str, Any] = {
    "name": "arm",
    "joints": 5,
    "restrict": {f"joint_{j}": letter for j, letter in enumerate("YPPPP", start=1)},
    "link": [0.1, 0.3],
    "origin_x": [-0.1, 0.1],
    "origin_y": [-0.1, 0.1],
    "origin_z": [0.0, 0.1],
}
BARE, DRIVEN = (DesignSpace.model_validate({**ARM, **more}) for more in ({}, {**LIGHT, "actuators": ["XM540-W270"]}))
N = 12


def task(cycle: Any = None, **more: Any) -> Task:
    steps = {"steps": PICKS, "time": 2.0, **(cycle or {})}
    content = {"name": "cell", "targets": TARGETS, "payload": 0.2, "cycle": steps, "objectives": ["worst_error"]}
    return Task.model_validate({**content, **more})


def bounds(problem: Problem) -> list[str]:
    return [constraint.description for constraint in problem.constraints]


STILL = {"cycle": None}
LINES = {"cycle": {"steps": [{"to": n, "by": "line"} for n in (1, 2, 3)]}, "targets": [t["position"] for t in TARGETS]}
WIDE = {"cycle": {"tolerance": {"path": 0.005, "angle": 0.1}}}


@pytest.mark.parametrize(
    ("more", "space", "expected"),
    [
        ({}, BARE, IMPLIED),
        ({}, DRIVEN, [*IMPLIED, *DRIVES]),
        (WIDE, BARE, [IMPLIED[0], "path_error <= 0.005", "path_angle <= 0.1", *IMPLIED[3:]]),
        (LINES, BARE, [c for c in IMPLIED if "angle" not in c]),
        (STILL, BARE, []),
        (STILL, DRIVEN, ["collision <= 0"]),
    ],
)
def test_cycle_and_motors_imply_constraints(more: dict[str, Any], space: DesignSpace, expected: list[str]) -> None:
    asked = task(**more) if more is not STILL else task().model_copy(update=STILL)
    assert bounds(Problem(asked, space)) == expected


@pytest.mark.parametrize(
    ("own", "replaced"),
    [
        *((f"{implied.split()[0]} <= 3", implied) for implied in [*IMPLIED, *DRIVES]),
        *((f"{quantity} >= 0.01", "collision <= 0") for quantity in ("clearance", "self_clearance")),
        ("obstacle_clearance >= 0.01", "collision <= 0"),
        ("mass <= 3", None),
    ],
)
def test_a_bound_of_the_task_replaces_the_implied_one(own: str, replaced: str | None) -> None:
    implied = [c for c in [*IMPLIED, *DRIVES] if c != replaced]
    assert bounds(Problem(task(constraints=[own]), DRIVEN)) == [own, *implied]


@pytest.mark.parametrize("name", [name for name, q in QUANTITIES.items() if "cycle" in q.needs])
def test_quantities_of_motions_need_a_cycle(name: str) -> None:
    still = task().model_copy(update={"cycle": None})
    designs = DRIVEN.sample(2, 0)
    for update in ({"objectives": (name,)}, {"constraints": (f"{name} <= 1",)}):
        if name not in OBJECTIVES and "objectives" in update:
            continue
        problem = Problem(still.model_copy(update=update), DRIVEN)
        with pytest.raises(SettingsError, match=r"need a cycle in the task; try cycle: in_order"):
            problem.evaluate(designs)
    assert np.isfinite(Problem(task(constraints=[f"{name} <= 1"]), DRIVEN).evaluate(designs).violations).all()


def test_quantities_of_time_need_durations_or_drives() -> None:
    fastest = task(cycle={"time": "fastest"}, objectives=["cycle_time"])
    designs = DRIVEN.sample(2, 0)
    with pytest.raises(
        SettingsError, match=r"need the duration of each step, or actuators with known torques and spee"
    ):
        Problem(fastest, BARE).evaluate(designs)
    assert (Problem(fastest, DRIVEN).evaluate(designs).values > 0.0).all()
    assert Problem(task(objectives=["cycle_time"]), BARE).evaluate(designs).values == pytest.approx(6.0)


def test_postures_at_targets_are_those_of_the_cycle_whatever_the_restarts() -> None:
    plain, restarted = (Problem(task(restarts=n), BARE) for n in (0, 4))
    designs = BARE.sample(N, 1)
    first, second = plain.physics(designs), restarted.physics(designs)
    assert np.array_equal(first.q, first.paths.postures(3).astype(np.float32))
    assert np.array_equal(first.q, second.q)
    assert np.array_equal(plain.evaluate(designs).values, restarted.evaluate(designs).values)


def test_payload_counts_only_where_the_cycle_carries_it() -> None:
    loaded, empty = (Problem(task(payload=kg), BARE).physics(BARE.sample(N, 1)) for kg in (0.5, 0.0))
    assert loaded.payload.tolist() == [0.5, 0.5, 0.0]
    assert np.array_equal(loaded.joint_torques[:, 2], empty.joint_torques[:, 2])
    assert not np.allclose(loaded.joint_torques[:, :2], empty.joint_torques[:, :2])
    carried = Problem(task(cycle={"steps": [{"to": n} for n in (1, 2)]}, payload=0.5), BARE)
    assert carried.scenes[0].payload.tolist() == [0.5, 0.5, 0.5]  # throughout, and at a target that it leaves out


def test_target_noise_shifts_the_whole_cycle() -> None:
    designs, noise = BARE.sample(4, 3), 0.01

    def shifted(shift: Any) -> Any:
        moved = [{**t, "position": (np.array(t["position"]) + shift).tolist()} for t in TARGETS]
        return Problem(task(targets=moved), BARE).evaluate(designs)

    found = Problem(task(target_noise=noise), BARE).evaluate(designs)
    cases = [shifted(0.0), *(shifted(sign * noise * axis) for axis in np.eye(3) for sign in (-1.0, 1.0))]
    assert found.values == pytest.approx(np.max([case.values for case in cases], axis=0), abs=1e-9)
    assert found.violations == pytest.approx(np.max([case.violations for case in cases], axis=0), abs=1e-6)


def test_a_batch_equals_single_designs_to_the_bit() -> None:
    problem = Problem(task(objectives=["worst_error", "dynamic_torque", "path_error"]), DRIVEN)
    designs = DRIVEN.sample(N, 4)
    whole = problem.evaluate(designs)
    for row, design in enumerate(designs):
        assert problem.evaluate([design])[0] == whole[row]


@pytest.mark.parametrize("tolerance", [0.0, TOLERANCE])
def test_outcomes_do_not_depend_on_the_number_of_threads(tolerance: float, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = Problem(task(), DRIVEN, tolerance=tolerance)
    matrix = problem.space.matrix(problem.space.sample(N if tolerance else 4 * N, seed=1))
    found: list[Outcomes] = []
    for threads in (1, 2, 3):
        monkeypatch.setattr("armwright.kinematics.chunks.cores", lambda n=threads: n)
        found.append(problem.evaluate(matrix))
    for other in found[1:]:
        for name in ("values", "violations", "entry", "q"):
            assert np.array_equal(getattr(other, name), getattr(found[0], name), equal_nan=True), name


def test_feasible_designs_exist_and_stay_within_what_is_implied() -> None:
    problem = Problem(task(cycle={"approach": 0.05}), BARE)
    designs = BARE.sample(60, 5)
    outcomes, physics = problem.evaluate(designs), problem.physics(designs)
    feasible = (outcomes.violations <= 0.0).all(axis=1)
    assert feasible.any()
    assert not feasible.all()
    assert physics.paths.path_error[feasible].max() <= 0.002
    assert not physics.paths.jumps[feasible].any()
    assert not physics.unreached[feasible].any()
    assert physics.clearance[feasible].min() >= 0.0


def test_robust_values_are_the_worst_of_copies_that_keep_the_postures_of_the_arm() -> None:
    problem, robust = Problem(task(), DRIVEN), Problem(task(), DRIVEN, tolerance=TOLERANCE)
    rows = DRIVEN.matrix(DRIVEN.sample(N, 0))
    exact = problem.physics(rows)
    copies = [problem.physics(moved, entry=exact.entry) for moved in perturbed(DRIVEN, rows)]
    reached = ~exact.unreached.any(axis=1)
    assert reached.any()
    for copy in copies:
        assert 0.0 < np.abs(copy.q - exact.q)[reached].max() < 0.3  # [rad]; another branch is further
    outcomes = [problem.outcomes(one) for one in (exact, *copies)]
    found = robust.evaluate(rows)
    assert np.array_equal(found.values, np.max([one.values for one in outcomes], axis=0))
    assert np.array_equal(found.violations, np.max([one.violations for one in outcomes], axis=0))


def test_stored_postures_give_the_same_results_to_the_bit() -> None:
    """In each case of the task, also of arms that violate a constraint on the first chain; digits are those of runs."""
    problem = Problem(task(payload_factors=[1.5]), DRIVEN)
    rows = DRIVEN.matrix(DRIVEN.sample(4 * N, 0))
    found = problem.evaluate(rows)
    entry = np.array([outcome.entry for outcome in found], dtype=np.float32)
    assert entry.shape == (4 * N, 2, 2, 5)
    again = worst_case(map(problem.outcomes, problem.cases(rows, entry.astype(np.float64))))
    assert np.array_equal(again.values, found.values)
    assert np.array_equal(again.violations, found.violations)
    assert np.array_equal(again.q, found.q)  # type: ignore[arg-type]
