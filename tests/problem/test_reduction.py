"""Arms with one joint fewer, against Pinocchio."""

from typing import Any

import numpy as np
import pytest

from armwright.problem.problem import Problem
from armwright.problem.reduction import IDLE, idle_joints, reduced, without_joints
from armwright.robot.arm import Arm
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.joint_modules import MODULES, MOUNTS
from armwright.tasks.task import Task
from tests.support.arms import LIGHT
from tests.support.exported_arms import moving, peer_of, postures

EVERYTHING: dict[str, Any] = {
    "name": "everything",
    "joints": [2, 6],
    "joint_types": list(MODULES),
    "link": [0.03, 0.3],
    "link_directions": ["+x", "-y", "+z"],
    "mount": list(MOUNTS),
    "stroke": [0.1, 0.6],
    "limit": [0.5, 2.4],
    **LIGHT,
    "actuators": ["XL430-W250", "XM430-W350"],
    "motor_bodies": False,  # two joints at one place have no room for them
}
TUBES: dict[str, Any] = {"tubes": [[0.03, 0.002], [0.02, 0.001]], "material": "aluminium"}
SPACES = {
    "everything": EVERYTHING,
    "without-fixed": {**EVERYTHING, "joint_types": ["R", "P", "Y"]},
    "tubes": {**EVERYTHING, "mass": None, "link_section": TUBES},
    "one-tube": {**EVERYTHING, "mass": None, "link_section": {**TUBES, "per_link": False}},
    "constant-number": {**EVERYTHING, "joints": 4},
    "straight-on-a-grid": {**EVERYTHING, "joint_types": ["P", "Y"], "link_directions": "+z", "grid": {"link": 0.03}},
}
PLANE = [[0.3, 0.0, 0.2], [0.2, 0.0, 0.35], [0.35, 0.0, 0.1]]  # [m]; arms whose base is in it never leave it


def is_clipped(arm: Arm, other: Arm) -> bool:
    """Whether a merged link or the base had to be moved into its range; the length is that of parent and base shift."""
    moved = float(np.linalg.norm(np.subtract(other.base, arm.base)))
    return abs(other.length + moved - arm.length) > 1e-9


def planar(**update: Any) -> Problem:
    content: dict[str, Any] = {"name": "plane", "targets": PLANE, "tool": {"tip": [0.0, 0.0, 0.05]}, **update}
    space = {"name": "s", "joints": [2, 6], "origin_y": [0.0, 0.0], "joint_types": ["P", "Y"], "link": [0.05, 0.3]}
    return Problem(Task.model_validate(content), DesignSpace.model_validate(space))


@pytest.mark.parametrize("name", SPACES)
def test_removing_a_joint_at_zero_keeps_the_tip(name: str) -> None:
    space, n_reduced, n_exact = DesignSpace.model_validate(SPACES[name]), 0, 0
    for design in space.sample(25, 0):
        arm = space.arm(design)
        numbers = [number - 1 for number, joint in moving(arm) if joint.kind == "revolute"]
        for joint in numbers:
            for candidate in without_joints(space, design, np.arange(len(arm.joints)) == joint):
                n_reduced += 1
                assert space.design(candidate.params) == candidate
                other = space.arm(candidate)
                assert len(moving(other)) == len(moving(arm)) - 1
                if is_clipped(arm, other):
                    continue
                n_exact += 1
                place = [number - 1 for number, _ in moving(arm)].index(joint)
                for q in postures(arm, 3):
                    q[place] = 0.0
                    assert peer_of(other).tip(np.delete(q, place)) == pytest.approx(peer_of(arm).tip(q), abs=1e-9)
    assert n_reduced >= n_exact >= 8


def test_the_price_falls_by_the_removed_actuator() -> None:
    space = DesignSpace.model_validate(EVERYTHING)
    for design in space.sample(20, 1):
        arm = space.arm(design)
        for j, joint in enumerate(arm.joints):
            for candidate in without_joints(space, design, np.arange(len(arm.joints)) == j):
                names = [other.actuator.name for other in space.arm(candidate).joints if other.actuator]
                assert joint.actuator is not None
                assert sorted([*names, joint.actuator.name]) == sorted(
                    o.actuator.name for o in arm.joints if o.actuator
                )


def test_merged_link_has_the_tube_of_the_link_before() -> None:
    keys = {"joints": [1, 2], "joint_types": ["P"], "link": [0.03, 0.6], "link_section": TUBES}
    space = DesignSpace.model_validate(keys)
    params = {"origin_x": 0.0, "origin_y": 0.0, "origin_z": 0.0, "n_joints": "2", "joint_1": "P", "joint_2": "P"}
    design = space.design({**params, "link_1": 0.1, "link_2": 0.2, "tube_1": "20x1", "tube_2": "30x2"})
    (candidate,) = without_joints(space, design, np.array([False, True]))
    assert (candidate.params["tube_1"], candidate.params["link_1"]) == ("20x1", pytest.approx(0.3))


@pytest.mark.parametrize(("cycle", "least"), [({}, 20), ({"cycle": "in_order"}, 5)])
def test_reduced_arms_reach_what_their_parents_reach(cycle: dict[str, str], least: int) -> None:
    problem = planar(**cycle)
    designs = problem.space.sample(30, 0)
    evaluation = problem.physics(designs)
    candidates = reduced(problem, problem.space.matrix(designs))
    arms = {candidate: problem.arm(candidate) for candidate in problem.space.designs(candidates)}
    found: set[Any] = set()
    for i, design in enumerate(designs):
        idle = idle_joints(problem, problem.space.matrix([design]))[0, : len(design.joints)]
        for joint in np.flatnonzero(idle):
            for candidate in without_joints(problem.space, design, np.arange(len(idle)) == joint):
                found.add(candidate)
                if is_clipped(problem.arm(design), arms[candidate]):
                    continue
                for q, reached in zip(evaluation.q[i, :, : len(idle)], evaluation.reached[i], strict=True):
                    place = peer_of(arms[candidate]).tip(np.delete(q, joint))[:3, 3]
                    assert place == pytest.approx(reached, abs=IDLE * problem.max_reach)
    assert found == set(arms)
    assert len(found) >= least


def test_every_case_and_target_counts() -> None:
    problem = planar()
    matrix = problem.space.matrix(problem.space.sample(10, 0))
    assert len(reduced(problem, matrix))
    turning = planar(targets=[*PLANE, [0.2, 0.25, 0.2]])
    noisy = planar(target_noise=0.01)
    yaws = np.array(
        [[letter == "Y" for letter in design.joints.ljust(6, "-")] for design in problem.space.designs(matrix)]
    )
    for other in (turning, noisy):
        assert (idle_joints(other, matrix) & yaws).sum() < (idle_joints(problem, matrix) & yaws).sum()


def test_without_designs_nothing_is_reduced() -> None:
    problem = planar()
    assert reduced(problem, problem.space.matrix([])).shape == (0, len(problem.space.parameters))
