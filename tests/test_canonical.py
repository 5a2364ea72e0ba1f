"""Designs that are the same arm have one key, and values that agree; others do not."""

import numpy as np
import pytest

from armwright.batch_builder import stack_designs
from armwright.canonical import SameArms
from armwright.objectives import named_objectives
from armwright.parameters import Design
from armwright.problem import Problem
from armwright.space import DesignSpace, paper_space
from armwright.study import optimize
from armwright.task import Task, load_task

ANY_WAY = DesignSpace.model_validate(
    {"joints": [2, 5], "joint_types": ["R", "P", "Y", "F"], "link_directions": ["+x", "-y", "+z"], "link": [0.01, 1.0]}
)


def values(problem: Problem, designs: list[Design], updates: int = 3) -> np.ndarray:
    """In float64 and after few updates, where rounding has not grown into another posture."""
    from armwright.evaluation import Evaluation
    from armwright.kinematics.solve import solve_postures

    arms = stack_designs(problem.space, problem.space.matrix(designs), "float64")
    points = problem.task.points
    solved = solve_postures(arms, points, updates, precision="float64")
    error = np.linalg.norm(solved.reached - points, axis=-1)
    angle, goals = np.zeros_like(error), problem.task.goals
    evaluation = Evaluation(
        arms, points, problem.task.payloads, solved.q, solved.reached, error, angle, solved.torque, goals
    )
    return problem.outcomes(evaluation).values


def same_pair(space: DesignSpace, rng: np.random.Generator, kind: str) -> tuple[Design, Design]:
    """A random design, and the same arm otherwise said."""
    base = {f"origin_{axis}": float(value) for axis, value in zip("xyz", rng.uniform(-0.5, 0.5, 3), strict=True)}
    a, b, c, d = rng.uniform(0.05, 0.2, 4).tolist()

    def design(word: str, links: list[float], ways: list[str], origin: dict[str, float] = base) -> Design:
        params: dict[str, float | str] = {**origin, "n_joints": str(len(word))}
        params |= {f"joint_{j}": letter for j, letter in enumerate(word, 1)}
        params |= {f"link_{j}": length for j, length in enumerate(links, 1)}
        params |= {f"direction_{j}": way for j, way in enumerate(ways, 1)}
        return space.design(params)

    up = ["+z"] * 4
    match kind:
        case "last yaw":
            return design("RPY", [a, b, c], up[:3]), design("RP", [a, b + c], up[:2])
        case "fixed":
            return design("RFP", [a, b, c], ["+x", "+x", "+z"]), design("RP", [a + b, c], ["+x", "+z"])
        case "yaws":
            return design("YYPR", [a, b, c, d], up), design("YYPR", [b / 2, a + b / 2, c, d], up)
        case "mirrored":
            other = {**base, "origin_x": -base["origin_x"]}
            return design("RYP", [a, b, c], up[:3]), design("RYP", [a, b, c], up[:3], other)
        case _:
            other = {**base, "origin_x": base["origin_y"], "origin_y": base["origin_x"]}
            return design("RYPP", [a, b, c, d], up), design("PYRR", [a, b, c, d], up, other)


@pytest.mark.parametrize("kind", ["last yaw", "fixed", "yaws", "mirrored", "swapped"])
def test_the_same_arm_has_one_key_and_the_same_values(kind: str) -> None:
    problem = Problem(load_task("target-1"), ANY_WAY)  # a cube about the origin
    same = SameArms(problem)
    rng = np.random.default_rng(1)
    pairs = [same_pair(ANY_WAY, rng, kind) for _ in range(40)]
    assert all(same.key(one) == same.key(other) for one, other in pairs)
    found = values(problem, [one for one, _ in pairs]), values(problem, [other for _, other in pairs])
    assert np.allclose(*found, rtol=1e-6, atol=1e-9)


def test_other_arms_have_other_keys() -> None:
    problem = Problem(load_task("target-1"), ANY_WAY)
    same = SameArms(problem)
    designs = ANY_WAY.sample(3000, 0)
    keys: dict[object, list[int]] = {}
    for number, design in enumerate(designs):
        keys.setdefault(same.key(design), []).append(number)
    assert max(map(len, keys.values())) == 1  # none at random
    (design,) = ANY_WAY.sample(1, 5)
    for name in ("origin_x", "origin_y", "origin_z", "link_1"):
        moved = Design({**design.params, name: float(design.params[name]) * 0.9})
        assert same.key(moved) != same.key(design)


def test_what_tells_arms_apart_is_heeded() -> None:
    rng = np.random.default_rng(2)
    last_yaw, mirrored = same_pair(ANY_WAY, rng, "last yaw"), same_pair(ANY_WAY, rng, "mirrored")
    cube = load_task("target-1")
    aside = Task(name="aside", targets=((0.3, 0.1, 0.2), (0.5, -0.2, 0.4), (0.1, 0.6, 0.1)))
    unequal = cube.model_copy(update={"payload": (0.1, *(0.0,) * 7)})
    blocked = Task.model_validate({**cube.model_dump(), "obstacles": [{"kind": "ground", "z": -1.0}]})
    for task, mirrors in ((cube, True), (aside, False), (unequal, False), (blocked, False)):
        same = SameArms(Problem(task, ANY_WAY))
        assert (same.key(mirrored[0]) == same.key(mirrored[1])) == mirrors
    counted = SameArms(Problem(cube, ANY_WAY, objectives=named_objectives(["position_error", "joints"])))
    built = SameArms(Problem(cube, ANY_WAY, tolerance=1e-3))
    assert all(same.key(last_yaw[0]) != same.key(last_yaw[1]) for same in (counted, built))


def test_a_study_pays_once_and_says_so() -> None:
    space = DesignSpace.model_validate(
        {"joints": 3, "joint_types": ["P", "Y"], "link": [0.2, 0.3], "grid": {"link": 0.05}}
        | {f"origin_{axis}": [0.0, 0.0] for axis in "xyz"}
    )
    run = optimize(Problem(load_task("target-1"), space), proposer=None, sampler="random", n_total=90)
    same = SameArms(run.history.problem)
    first: dict[object, tuple[float, ...]] = {}
    twice = 0
    for trial in run.trials:
        key = same.key(trial.design)
        twice += key in first
        assert first.setdefault(key, trial.values) == trial.values
        assert (trial.evaluations == 0) == (trial.values is not None and key in first and trial.same_as is not None)
    assert twice > 10
    assert run.summary["same_arms"] == twice
    assert sum(trial.same_as is not None for trial in run.trials) == twice


def test_the_paper_s_problem_hardly_ever_meets_an_arm_again() -> None:
    run = optimize(Problem(load_task("target-1"), paper_space()), proposer="rules", n_total=100)
    assert run.summary["same_arms"] == 0
