"""Properties of the rules proposer."""

import itertools
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armwright.pareto import hypervolume
from armwright.problem.problem import Problem
from armwright.proposers.proposer import Proposal
from armwright.proposers.rule_geometry import affordable_length, needed_length, shoulder, stretched_torque
from armwright.proposers.rule_structures import OPENING, adapted_joints, divided, fitted
from armwright.proposers.rules import EXPECTED, RULES, RulesProposer, members_inside
from armwright.runs.history import RANDOM, History
from armwright.runs.trial import FinishedTrial
from armwright.spaces.design_space import DesignSpace, paper_space
from armwright.spaces.link_mass import MassPerLink, MassPerMetre
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task, random_task
from armwright.tasks.task import Task


def task(*points: tuple[float, float, float], reference_point: tuple[float, float] | None = (5.0, 5.0)) -> Task:
    return Task(name="test", targets=points, reference_point=reference_point)


def history_of(problem: Problem, n: int, seed: int = 0) -> History:
    designs = problem.space.sample(n, seed)
    values = problem.evaluate(designs).values.tolist() if designs else []
    trials = [FinishedTrial(i, RANDOM, d, tuple(v)) for i, (d, v) in enumerate(zip(designs, values, strict=True))]
    return History(problem, trials, max(n, 1))


def with_proposal(history: History, proposal: Proposal) -> History:
    values = tuple(history.problem.evaluate([proposal.design]).values[0].tolist())
    trial = FinishedTrial(len(history), "rules", proposal.design, values, proposal.id)
    return History(history.problem, [*history.trials, trial], history.n_init)


def proposals(history: History, n: int) -> list[Proposal]:
    """`n` proposals, one upon the other; each is checked for what every proposal must be."""
    made: list[Proposal] = []
    for k in range(n):
        proposal = RulesProposer().propose(history, seed=k, number=len(history))
        assert RulesProposer().propose(history, seed=k, number=len(history)) == proposal
        history.problem.space.design(proposal.design.params)
        assert proposal.reason
        assert "\n" not in proposal.reason
        made.append(proposal)
        history = with_proposal(history, proposal)
    return made


ranges = st.tuples(st.floats(-2.0, 2.0), st.floats(0.0, 2.0)).map(lambda r: (r[0], r[0] + r[1]))
spaces: st.SearchStrategy[DesignSpace] = st.builds(
    DesignSpace,
    joints=st.integers(1, 8),
    joint_types=st.lists(st.sampled_from("RPY"), min_size=1, max_size=3, unique=True).map(tuple),
    joint_range=st.tuples(st.floats(-3.0, -0.1), st.floats(0.1, 3.0)),
    origin_x=ranges,
    origin_y=ranges,
    origin_z=ranges,
    link=st.tuples(st.floats(0.001, 1.0), st.floats(0.0, 1.0)).map(lambda r: (r[0], r[0] + r[1])),
    mass=st.sampled_from([MassPerMetre(), MassPerMetre(kg=0.0), MassPerLink(kind="per_link", kg=1.0)]),
)
points = st.tuples(*[st.floats(-3.0, 3.0)] * 3)
tasks = st.builds(
    lambda targets, reference_point: task(*targets, reference_point=reference_point),
    st.lists(points, min_size=1, max_size=6),
    st.sampled_from([None, (5.0, 5.0), (0.01, 0.01), (1e4, 1e4)]),
)


@given(space=spaces, task=tasks, n=st.integers(0, 6))
@settings(max_examples=8)
def test_proposals_lie_in_any_space_and_are_reproducible(space: DesignSpace, task: Task, n: int) -> None:
    proposals(history_of(Problem(task, space), n), len(OPENING) + 4)


@pytest.mark.parametrize(
    "targets",
    [
        [(0.0, 0.0, 0.0)],
        [(0.2, 0.3, 0.4)] * 3,
        [(900.0, -900.0, 900.0), (-900.0, 0.0, 0.0)],
        [(0.1 * k, 0.0, 0.3) for k in range(5)],
        [(x, y, 0.5) for x, y in itertools.product((0.0, 0.4), repeat=2)],
    ],
    ids=["one", "coincident", "far", "line", "plane"],
)
def test_unusual_tasks_get_distinct_proposals(targets: list[tuple[float, float, float]]) -> None:
    made = proposals(history_of(Problem(task(*targets)), 3), len(OPENING) + 6)
    assert len({p.design for p in made}) == len(made)


@pytest.mark.parametrize("rule", RULES)
def test_every_rule_proposes_within_the_space(rule: str) -> None:
    history = history_of(Problem(random_task(1000)), 200)
    for seed in range(5):
        design, reason = RULES[rule](history, members_inside(history), np.random.default_rng(seed))
        history.problem.space.design(design.params)
        assert reason
        assert "\n" not in reason
        assert design not in {trial.design for trial in history}
    assert set(RULES) == set(EXPECTED)


def test_run_has_distinct_designs_and_is_reproducible() -> None:
    settings: dict[str, Any] = {"proposer": RulesProposer(), "n_init": 3, "n_step": 1, "n_total": 40, "seed": 4}
    run = optimize(Problem(load_task("target-2")), **settings)
    again = optimize(Problem(load_task("target-2")), **settings)
    assert [t.design for t in run.trials] == [t.design for t in again.trials]
    assert len({t.design for t in run.trials}) == len(run.trials)
    assert {t.source for t in run.trials[3:]} == {"rules"}


def test_rules_propose_with_no_design_inside_the_reference_box() -> None:
    problem = Problem(task((0.3, 0.0, 0.3), (0.0, 0.3, 0.3), reference_point=(1e-6, 1e-6)))
    made = proposals(history_of(problem, 2), 2 * len(OPENING))
    assert len({p.design for p in made}) == len(made)


def test_structures_are_proposed_before_the_reference_point_is_known() -> None:
    problem = Problem(task((0.3, 0.0, 0.3), reference_point=None))
    history = History(problem, history_of(problem, 4).trials, n_init=100)
    assert all(p.id.endswith("-open") for p in proposals(history, 2 * len(OPENING)))


@pytest.mark.parametrize("structure", OPENING, ids=lambda s: s.name)
def test_translated_task_translates_the_arm(structure: Any) -> None:
    wide = paper_space().model_copy(update=dict.fromkeys(("origin_x", "origin_y", "origin_z"), (-5.0, 5.0)))
    at, moved = random_task(1001), np.array([0.5, -0.7, 0.2])
    there = task(*(tuple(p) for p in (at.target_positions + moved).tolist()))
    a, b = (fitted(structure, Problem(t, wide), 5.0) for t in (at, there))
    assert b.joints == a.joints
    np.testing.assert_allclose(b.links, a.links, atol=1e-6)
    np.testing.assert_allclose(np.subtract(b.origin, a.origin), moved, atol=1e-6)


@pytest.mark.parametrize("structure", OPENING, ids=lambda s: s.name)
def test_swapped_x_and_y_swap_the_axes(structure: Any) -> None:
    at = random_task(1002)
    a = fitted(structure, Problem(at), 5.0)
    b = fitted(structure, Problem(task(*((y, x, z) for x, y, z in at.targets))), 5.0)
    assert b.joints == a.joints.translate(str.maketrans("RP", "PR"))
    np.testing.assert_allclose(b.origin, np.array(a.origin)[[1, 0, 2]], atol=1e-9)
    np.testing.assert_allclose(b.links, a.links)


def test_shoulder_position_is_locally_optimal() -> None:
    targets = random_task(1003).target_positions

    def missed(place: np.ndarray) -> float:
        return float(np.maximum(np.linalg.norm(targets - place, axis=1) - 0.2, 0.0).sum())

    best = shoulder(targets, 0.2)
    for step in 0.1 * np.vstack([np.eye(3), -np.eye(3)]):
        assert missed(best) < missed(best + step)
    assert np.linalg.norm(targets - shoulder(targets, np.inf), axis=1).max() == pytest.approx(needed_length(targets))


@pytest.mark.parametrize("mass", [MassPerMetre(), MassPerLink(kind="per_link", kg=0.002)])
def test_affordable_length_spends_the_torque_budget(mass: Any) -> None:
    space = DesignSpace(mass=mass)
    length = affordable_length(space, 8, 5.0, 100.0)
    assert 8 * stretched_torque(space, length) == pytest.approx(5.0)
    assert affordable_length(space, 8, np.inf, 100.0) == 100.0


@pytest.mark.parametrize("n", range(1, 9))
def test_structures_fit_any_number_of_joints(n: int) -> None:
    assert len(divided(OPENING[0].links, n)) == n
    assert sum(divided(OPENING[0].links, n)) == pytest.approx(sum(OPENING[0].links))
    assert set(adapted_joints(OPENING[0].joints, DesignSpace(joints=n, joint_types=("Y",)))) == {"Y"}
    assert len(adapted_joints(OPENING[0].joints, paper_space(n))) == n


def test_first_proposal_beats_the_median_random_design() -> None:
    problem = Problem(load_task("target-1"))
    first = RulesProposer().propose(history_of(problem, 10), 0, 10).design
    random = [hypervolume(row[None], (5.0, 5.0)) for row in problem.evaluate(problem.space.sample(500, 1)).values]
    alone = hypervolume(problem.evaluate([first]).values, (5.0, 5.0))
    assert alone > np.median(random)
    assert alone > 1.0
