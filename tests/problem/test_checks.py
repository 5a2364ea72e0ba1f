"""Checks before a search: nothing true is refused, and nothing is called proven that a design disproves."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armwright.exceptions import SettingsError, TaskError
from armwright.kinematics.arms.arm_arrays import FIXED
from armwright.problem.checks.bounds import intervals_by_modules
from armwright.problem.checks.finding import PROVEN, SUSPECTED
from armwright.problem.checks.instant import check_instantly, stop_if_proven
from armwright.problem.checks.sampling import check_by_sampling
from armwright.problem.evaluators import load_evaluator
from armwright.problem.objectives import QUANTITIES
from armwright.problem.problem import Problem
from armwright.spaces.design_space import DesignSpace, default_space, load_space, paper_space
from armwright.tasks.catalogue import builtin_names, load_task
from armwright.tasks.task import Task
from tests.support.arms import LIGHT
from tests.support.examples import With, example_tasks

DOWN = [0, 0, -1]
HERE = [0.4, 0.2, 0.3]
TABLE = {"kind": "ground", "name": "table"}
MOTORS = ["XL430-W250", "XM430-W350", "XM540-W270"]
SPACES = {
    "paper": {},
    "motors": {"joints": [2, 5], "joint_types": ["R", "P", "S", "F"], "stroke": [0.1, 0.4],
               **LIGHT, "actuators": MOTORS, "bracket_mass": 0.05},
    "restricted": {"joints": 3, "restrict": {"link_1": [0.1, 0.2], "joint_2": ["O"], "motor_3": ["XL430-W250"]},
                   "joint_types": ["R", "O", "X"], "actuators": MOTORS, "motor_bodies": False,
                   "link_section": {"tubes": [[0.03, 0.002]], "material": "aluminium"}},
    "slides": {"joints": [1, 4], "joint_types": ["X", "T", "S"], "stroke": 0.5, "grid": {"link": 0.02},
               "bracket_mass": 0.2, "mass": {"kind": "per_link", "kg": 0.3}},
    "tubes": {"joints": [1, 4], "joint_types": ["R", "O", "S"], "stroke": [0.1, 0.4], "actuators": MOTORS,
              "motor_bodies": False,
              "restrict": {"tube_1": "30x2"},
              "link_section": {"tubes": [[0.03, 0.002], [0.02, 0.001]],
                               "material": {"density": 2700, "youngs": 7e10, "shear": 2.7e10, "price_per_kg": 30.0}}},
}  # fmt: skip


def space(**keys: Any) -> DesignSpace:
    light = LIGHT if "actuators" in keys and "link_section" not in keys else {}
    return DesignSpace.model_validate({"name": "mine", **light, **keys})


def problem(targets: Any = (HERE,), of: DesignSpace | None = None, **keys: Any) -> Problem:
    return Problem(Task.model_validate({"name": "mine", "targets": list(targets), **keys}), of or paper_space())


def found(checked: Problem) -> list[tuple[str, str]]:
    return [(finding.evidence, finding.message) for finding in check_instantly(checked)]


def only(checked: Problem) -> tuple[str, str]:
    """Return evidence and message of the only finding."""
    (finding,) = found(checked)
    return finding


# Nothing to find


@pytest.mark.parametrize("name", builtin_names())
def test_builtin_tasks_have_no_findings(name: str) -> None:
    assert found(Problem(load_task(name), default_space(name))) == []


@pytest.mark.parametrize(("task", "given"), example_tasks().items(), ids=lambda file: getattr(file, "stem", ""))
def test_examples_have_no_findings(task: Path, given: With) -> None:
    evaluator = load_evaluator(given.evaluator) if given.evaluator else None
    space = load_space(given.space) if given.space else paper_space()
    assert found(Problem(load_task(task), space, evaluator=evaluator)) == []


def test_random_tasks_have_no_findings() -> None:
    assert [seed for seed in range(60) if found(Problem(load_task(f"random-{seed}")))] == []


# Reach


@pytest.mark.parametrize("keys", SPACES.values(), ids=SPACES)
def test_no_design_reaches_further_than_the_longest_arm(keys: dict[str, Any]) -> None:
    checked = problem(of=space(**keys), tool={"tip": [0.0, 0.03, 0.1]})
    reaches = [checked.arm(design).reach for design in checked.space.sample(300, 0)]
    assert max(reaches) <= checked.max_reach + 1e-12


def test_targets_beyond_the_longest_arm_are_proven() -> None:
    # bases within 1 m of the origin along each axis, arms up to 1.2 m
    assert found(problem([[2.19, 0.0, 0.0]])) == []
    evidence, message = only(problem([[2.19, 0.0, 0.0], [2.21, 0.0, 0.0], [0.0, 0.0, -2.3]]))
    assert evidence == PROVEN
    assert message.startswith("2 of 3 targets (2, 3) are out of reach: the farthest, (0, 0, -2.3) m, is 1.3 m from")


def test_targets_within_what_the_task_allows_are_not_refused() -> None:
    near = [2.25, 0.0, 0.0]
    assert len(found(problem([near]))) == 1
    assert found(problem([{"position": near, "tolerance": 0.06}])) == []
    assert found(problem([near], constraints=["worst_error <= 0.06"])) == []
    assert found(problem([near], constraints=["position_error <= 0.06"])) == []
    assert len(found(problem([near], constraints=["worst_error <= 0.04"]))) == 1


# Obstacles


def test_target_in_an_obstacle_is_suspected_unless_the_constraints_exclude_it() -> None:
    box = {"kind": "box", "name": "shelf", "center": HERE, "size": [0.2, 0.2, 0.06]}
    bounds = ["collision <= 0", "worst_error <= 0.003"]
    evidence, message = only(problem(obstacles=[box]))
    assert evidence == SUSPECTED
    assert "target 1 (0.4, 0.2, 0.3) m is 30 mm inside an obstacle: shelf: box" in message
    for one in bounds:
        assert only(problem(obstacles=[box], constraints=[one]))[0] == SUSPECTED
    assert only(problem(obstacles=[box], constraints=bounds))[0] == PROVEN
    # a tool longer than the depth reaches in from outside
    assert only(problem(obstacles=[box], constraints=bounds, tool={"tip": [0, 0, 0.1]}))[0] == SUSPECTED


@pytest.mark.parametrize("pose", [{"axis": DOWN}, {"orientation": [np.pi, 0.0, 0.3]}])
@pytest.mark.parametrize(
    ("bodies", "name", "deep"),
    [
        ({"payload": {"mass": 1.0, "center": [0, 0, 0.01], "size": [0.03, 0.03, 0.08]}}, "payload", 50),
        ({"tool": {"tip": [0, 0, 0.1], "radius": 0.02}, "payload": 1.0}, "tool", 0),
        ({"tool": {"tip": [0, 0, 0.1], "center": [0, 0, 0.1], "size": [0.02, 0.02, 0.04]}}, "tool", 20),
    ],
)
def test_body_in_an_obstacle_is_refused_with_the_right_height(
    pose: dict[str, Any], bodies: dict[str, Any], name: str, deep: int
) -> None:
    def checked(height: float, **more: Any) -> list[tuple[str, str]]:
        target = {"name": "part", "position": [0.4, 0.2, height], "tolerance": 0.004, **pose, **more}
        bounds = ["collision <= 0", "unreached_targets <= 0"]
        keys = {"obstacles": [TABLE], "constraints": bounds, "objectives": ["peak_torque", "mass"], **bodies}
        return found(problem([target], **keys))

    assert checked(deep / 1000) == []
    assert checked(deep / 1000 - 0.0039) == []
    if deep:
        ((evidence, message),) = checked(deep / 1000 - 0.02)
        assert evidence == PROVEN
        assert message.startswith(f"target part: the {name} is 20 mm inside an obstacle: table: ground")
        assert f"at most 4 mm are allowed; move the target to (0.4, 0.2, {deep / 1000:g}) m" in message
        assert [one[0] for one in checked(deep / 1000 - 0.006)] == [SUSPECTED]
        assert checked(deep / 1000 - 0.02, into="table") == []


@pytest.mark.parametrize(
    "target", [[0.4, 0.2, 0.0], [0.4, 0.2, -0.0009], {"position": [*HERE[:2], -0.01], "tolerance": 0.02}]
)
def test_target_on_a_surface_or_within_its_tolerance_is_fine(target: Any) -> None:
    assert found(problem([target], obstacles=[TABLE])) == []
    bounds, tool = ["collision <= 0", "unreached_targets <= 0"], {"tip": [0, 0, 0.1]}
    assert found(problem([target], obstacles=[TABLE], constraints=bounds, tool=tool, objectives=["torque"])) == []


@pytest.mark.parametrize(
    ("height", "bounds", "is_proven"),
    [
        (0.013, ["collision <= 0", "unreached_targets <= 0"], True),  # a link of 15 mm radius, 1 mm of tolerance
        (0.0145, ["collision <= 0", "unreached_targets <= 0"], False),
        (0.0145, ["collision <= 0", "worst_error <= 1e-5"], True),
        (0.0145, ["collision <= 0.002", "worst_error <= 1e-5"], False),
        (0.03, ["clearance >= 0.02", "worst_error <= 0.001"], True),
        (0.03, ["obstacle_clearance >= 0.01", "worst_error <= 0.001"], False),
        (0.03, ["clearance_shortfall <= 0.05", "position_error <= 0.001"], True),
        (0.03, ["self_clearance >= 0.5", "worst_error <= 0.001"], False),
    ],
)
def test_proven_obstacles_leave_no_feasible_design(height: float, bounds: list[str], is_proven: bool) -> None:
    arm = space(joints=5, origin_z=[0.1, 0.6])
    checked = problem([[0.3, 0.1, height]], arm, obstacles=[TABLE], constraints=bounds, objectives=["torque"])
    assert [evidence for evidence, _ in found(checked)] == [PROVEN] * is_proven
    if is_proven:
        sampled = checked.violations(checked.physics(checked.space.sample_matrix(3000, np.random.default_rng(0))))
        assert (sampled.max(axis=1) > 0.0).all()
        assert (sampled <= 0.0).any(axis=0).all()  # each alone can be satisfied


@pytest.mark.parametrize(("height", "is_proven"), [(0.0, True), (0.0169, True), (0.0171, False), (0.1, False)])
def test_bases_too_low_for_the_first_motor_are_proven(height: float, is_proven: bool) -> None:
    """An XL430-W250 or XM430-W350 reaches 17 mm below the base of a turntable, an XM540-W270 22 mm."""
    keys = {"joints": 2, "restrict": {"joint_1": "Y"}, **LIGHT, "actuators": MOTORS, "origin_z": [-0.1, height]}
    checked = problem(obstacles=[TABLE], of=space(**keys))
    if not is_proven:
        assert found(checked) == []
        return
    evidence, message = only(checked)
    assert evidence == PROVEN
    assert message.startswith(f"origin_z: the base is at most at {height:g} m, but the motor of the first joint")
    assert "allow bases from 0.017 m up" in message
    outcomes = checked.evaluate(checked.space.matrix(checked.space.sample(200, 0)))
    assert (outcomes.violations > 0.0).any(axis=1).all()


def test_arm_of_one_link_stands_on_its_foot() -> None:
    low = {"obstacles": [TABLE], "constraints": ["collision <= 0", "worst_error <= 0.001"]}
    assert found(problem([[0.2, 0.0, 0.005]], space(joints=1), **low)) == []
    assert only(problem([[0.2, 0.0, 0.005]], space(joints=2), **low))[0] == PROVEN


# Constraints


@pytest.mark.parametrize("keys", SPACES.values(), ids=SPACES)
def test_designs_lie_within_the_intervals_of_their_size(keys: dict[str, Any]) -> None:
    checked = problem(of=space(**keys), tool={"mass": 0.2})
    designs = checked.space.sample(400, 1)
    arms = checked.arms(checked.space.matrix(designs))
    measured = {
        "mass": arms.mass.sum(axis=1, dtype=np.float64) + arms.base_mass,
        "length": arms.length,
        "joints": (arms.motion < FIXED).sum(axis=1),
        **({} if arms.actuation is None else {"price": arms.actuation.price + arms.structure_price}),
    }
    known = intervals_by_modules(checked)
    for row, design in enumerate(designs):
        intervals = known[len(design.joints)]
        assert set(intervals) == set(measured)
        for name, values in measured.items():
            assert intervals[name].low * (1 - 1e-6) <= values[row] <= intervals[name].high * (1 + 1e-6)


@pytest.mark.parametrize(
    ("bounds", "texts"),
    [
        (["price <= 80"], ['"price <= 80": price is at least 82.5 USD in this space']),
        (["mass >= 100"], ["mass is at most"]),
        (
            ["price <= 100", "joints >= 4"],
            ['"price <= 100" and "joints >= 4" together: with 3 modules, joints is at most 3; with 4 modules, price'],
        ),
        (["worst_error <= -0.001"], ["worst_error is at least 0 m"]),
        (["clearance >= 1.5"], ["clearance is at most 1 m"]),
    ],
)
def test_constraints_beyond_their_interval_are_proven(bounds: list[str], texts: list[str]) -> None:
    arm = space(joints=[3, 5], actuators=MOTORS)
    evidence, message = only(problem(of=arm, constraints=bounds))
    assert evidence == PROVEN
    for text in texts:
        assert text in message


@pytest.mark.parametrize(
    "bounds",
    [["worst_error <= 0.003"], ["worst_error <= 0"], ["price <= 82.5"], ["price <= 110", "joints >= 4"],
     ["joints >= 5"], ["clearance >= 0.1", "mass <= 1"]],
)  # fmt: skip
def test_constraints_that_designs_can_satisfy_are_not_refused(bounds: list[str]) -> None:
    assert found(problem(of=space(joints=[3, 5], actuators=MOTORS), constraints=bounds)) == []


def test_stated_durations_bound_the_time_of_a_cycle() -> None:
    cycle = {"steps": [{"to": 1, "do": "pick"}, {"to": 2, "do": "place"}], "time": 1.5, "dwell": 0.5}
    keys: dict[str, Any] = {"targets": [HERE, [0.4, -0.2, 0.3]], "cycle": cycle, "objectives": ["torque"]}
    assert found(problem(**keys, constraints=["cycle_time <= 4"])) == []
    evidence, message = only(problem(**keys, constraints=["cycle_time <= 3.9"]))
    assert (evidence, "cycle_time is at least 4 s" in message) == (PROVEN, True)


def test_proven_findings_stop_and_others_do_not() -> None:
    stop_if_proven(check_instantly(problem(payload=500)))
    with pytest.raises(TaskError, match="clearance is at most 1 m") as error:
        stop_if_proven(check_instantly(problem(constraints=["clearance >= 2", "anisotropy >= 2"])))
    (note,) = error.value.__notes__
    assert note.startswith('armwright: constraints: no design satisfies "anisotropy >= 2"')


# Magnitudes and strength


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({"targets": [HERE, [0.3, 0.1, 8.0]], "tool": {"tip": [0, 0, 7]}}, "from the flange = 7 m is 5.83 times"),
        ({"targets": [{"position": HERE, "tolerance": 2.0}]}, "target 1: tolerance = 2 m is 1.67 times"),
        ({"targets": [{"position": HERE, "axis": DOWN, "angle_tolerance": 3}]}, "write 0.0524 for 3°"),
        ({"obstacles": [{"kind": "sphere", "center": [500, 0, 0], "radius": 100}]}, "obstacle 1: size = 200 m"),
        ({"payload": {"mass": 0.5, "size": [60, 40, 40]}}, "payload: the longest side = 60 m"),
        ({"of": space(link=[30, 300])}, "space: the longest arm reaches 1.2e+03 m"),
        ({"payload": 500}, "500 kg are 34,435 times the mass of the heaviest arm of the space, 0.0145 kg"),
        (
            {"targets": [HERE, [0.4, -0.6, 0.3]], "payload": 50, "of": space(actuators=MOTORS)},
            "payload: 50 kg take 98.1 N m about a horizontal axis at 0.2 m",
        ),
    ],
)  # fmt: skip
def test_numbers_of_a_strange_size_are_suspected(keys: dict[str, Any], text: str) -> None:
    evidences, messages = zip(*found(problem(**keys)), strict=True)
    assert SUSPECTED in evidences
    assert text in " ".join(messages)


def test_approach_beyond_reach_is_suspected() -> None:
    targets = [{"position": HERE, "axis": DOWN}, {"position": [0.4, -0.2, 0.3], "axis": DOWN}]
    cycle = {"steps": [{"to": 1, "do": "pick"}, {"to": 2, "do": "place"}], "time": 1.5, "approach": 60}
    evidence, message = only(problem(targets, cycle=cycle, objectives=["torque"]))
    assert (evidence, "cycle: approach = 60 m is 50 times" in message) == (SUSPECTED, True)


# Requirements


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({"objectives": ["price"]}, "objective price needs actuators"),
        ({"objectives": ["backlash_error"]}, "objective backlash_error needs actuators"),
        ({"constraints": ["payload_capacity >= 0.1"]}, "objective payload_capacity needs actuators"),
        (
            {"constraints": ["deflection <= 0.1"], "of": space(actuators=MOTORS)},
            "deflection needs the section and the material of the links; try link_section: ",
        ),
        ({"constraints": ["thermal_utilisation <= 1"]}, "objective thermal_utilisation needs actuators"),
        ({"objectives": ["path_error"]}, "need a cycle"),
        ({"objectives": ["uncovered_fraction"]}, "needs a workspace"),
        ({"objectives": ["undexterous_fraction"]}, "need a workspace with directions"),
        (
            {"objectives": ["cycle_time"], "targets": [HERE, [0.4, 0, 0]], "cycle": "in_order"},
            "need the duration of each step",
        ),
    ],
)
def test_missing_parts_are_named_as_an_evaluation_names_them(keys: dict[str, Any], text: str) -> None:
    checked = problem(**keys)
    with pytest.raises(SettingsError, match=text) as instantly:
        check_instantly(checked)
    with pytest.raises(SettingsError) as evaluated:
        checked.evaluate(checked.space.sample(1, seed=0))
    assert str(instantly.value) == str(evaluated.value)


# Samples


def test_samples_name_the_constraints_that_none_satisfies() -> None:
    checked = problem(constraints=["worst_error >= 50", "mass <= 1"])
    findings, n = check_by_sampling(checked, 0.0, at_least=500)
    (finding,) = findings
    assert 500 <= n < 1000
    assert finding.evidence == f"none of {n} samples"
    assert not finding.is_proven
    assert finding.message.startswith('no random design satisfies "worst_error >= 50"; the best has ')


def test_few_samples_are_no_evidence() -> None:
    checked = problem(constraints=["worst_error >= 50"])
    ticks = iter(np.arange(0.0, 100.0, 0.9))
    findings, n = check_by_sampling(checked, 1.0, clock=lambda: float(next(ticks)))
    assert not findings
    assert n < 100


def test_tasks_without_constraints_are_not_sampled() -> None:
    assert check_by_sampling(problem(), 1.0) == ([], 0)


# Soundness


def scattered(seed: int) -> tuple[Problem, np.random.Generator]:
    """Return a problem whose targets lie in and around obstacles and the reach of its arms."""
    rng = np.random.default_rng(seed)
    keys = list(SPACES.values())[seed % len(SPACES)]
    size = float(rng.uniform(0.2, 2.0))
    points = rng.uniform(-1.0, 1.0, (3, 3)) * size
    shapes = [
        {"kind": "box", "center": points[0].tolist(), "size": rng.uniform(0.02, 0.4, 3).tolist(), "yaw": 0.3},
        {"kind": "sphere", "center": points[1].tolist(), "radius": 0.1},
        {"kind": "cylinder", "center": points[2].tolist(), "radius": 0.05, "height": 0.3, "axis": "x"},
        {"kind": "ground", "z": float(points[:, 2].min()) + 0.01},
    ]
    chosen = [shape for shape in shapes if rng.uniform() < 0.5]
    tool = {"tip": [0.0, 0.0, float(rng.choice([0.0, 0.05]))], "mass": float(rng.choice([0.0, 0.3]))}
    targets = [{"position": point, "weight": float(rng.choice([0.5, 1.0, 2.0]))} for point in points.tolist()]
    return problem(targets, space(**keys), obstacles=chosen, tool=tool), rng


@pytest.mark.parametrize("seed", range(25))
def test_constraints_that_a_design_satisfies_are_never_proven_impossible(seed: int) -> None:
    """Bounds are what one design has, so that this design is feasible."""
    bare, rng = scattered(seed)
    design = bare.space.sample(1, seed)[0]
    if seed % 2:  # the tip is at its targets, so that bounds are sharp
        reached = bare.physics([design]).reached[0].tolist()
        bare = problem(reached, bare.space, obstacles=bare.task.obstacles, tool=bare.task.tool)
    evaluation = bare.physics([design])
    names = ["worst_error", "position_error", "collision", "clearance_shortfall", "clearance", "obstacle_clearance"]
    names += ["mass", "length", "joints", "torque", "anisotropy", "manipulability", "unreached_targets"]
    names += ["price", "voltages"] if bare.space.actuators else []
    bounds = [f"worst_error <= {float(QUANTITIES['worst_error'](evaluation)[0])!r}"]
    for name in names[1:]:
        value = float(QUANTITIES[name](evaluation)[0])
        bounds += [f"{name} {relation} {value!r}" for relation in ("<=", ">=") if rng.uniform() < 0.7]
    checked = Problem(bare.task.model_copy(update={"constraints": tuple(bounds)}), bare.space)
    assert (checked.evaluate([design]).violations <= 0.0).all()
    assert [message for evidence, message in found(checked) if evidence == PROVEN] == []
