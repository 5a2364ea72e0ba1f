"""Properties of the rules proposer."""

import itertools
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armwright import DesignSpace, FinishedTrial, Problem, Proposal, Task, paper_space, random_task
from armwright.pareto import front_mask, hypervolume
from armwright.proposers.rule_feedback import RULES, members_inside
from armwright.proposers.rule_forecast import candidates, forecast, gains, gravity_share
from armwright.proposers.rule_helpers import rule_of
from armwright.proposers.rule_structures import (
    STRUCTURES,
    Structure,
    adapted,
    fitted,
    fitted_structures,
    median,
    needed_length,
    shoulders,
)
from armwright.proposers.rules import EXPECTED, STRUCTURE, RulesProposer
from armwright.runs.history import RANDOM, History
from armwright.spaces.link_mass import MassModel, MassPerLink, MassPerMetre


def task(*points: tuple[float, float, float], reference_point: tuple[float, float] | None = (5.0, 5.0)) -> Task:
    return Task(name="test", targets=points, reference_point=reference_point)


def history_of(problem: Problem, n: int, seed: int = 0) -> History:
    designs = problem.space.sample(n, seed)
    found = problem.evaluate(designs) if designs else ()
    trials = [
        FinishedTrial(i, RANDOM, design, outcome.values, violations=outcome.violations)
        for i, (design, outcome) in enumerate(zip(designs, found, strict=True))
    ]
    return History(problem, trials, max(n, 1))


def with_proposal(history: History, proposal: Proposal) -> History:
    found = history.problem.evaluate([proposal.design])[0]
    trial = FinishedTrial(
        len(history), "rules", proposal.design, found.values, proposal.id, violations=found.violations
    )
    return History(history.problem, [*history.trials, trial], history.n_init)


def proposals(history: History, n: int) -> list[Proposal]:
    """`n` proposals, one upon the other; each is checked for what every proposal must be."""
    made: list[Proposal] = []
    one, other = RulesProposer(), RulesProposer()
    for k in range(n):
        proposal = one.propose(history, seed=k, number=len(history))
        assert other.propose(history, seed=k, number=len(history)) == proposal
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
    proposals(history_of(Problem(task, space), n), len(STRUCTURES) + 4)


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
    made = proposals(history_of(Problem(task(*targets)), 3), len(STRUCTURES) + 6)
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


def test_structures_are_proposed_before_the_reference_point_is_known() -> None:
    problem = Problem(task((0.3, 0.0, 0.3), reference_point=None))
    history = History(problem, history_of(problem, 4).trials, n_init=100)
    assert all(rule_of(p.id) == STRUCTURE for p in proposals(history, 2 * len(STRUCTURES)))


@pytest.mark.parametrize("structure", STRUCTURES, ids=lambda s: s.name)
def test_translated_task_translates_the_arm(structure: Structure) -> None:
    wide = paper_space().model_copy(update=dict.fromkeys(("origin_x", "origin_y", "origin_z"), (-5.0, 5.0)))
    at, moved = random_task(1001), np.array([0.5, -0.7, 0.2])
    there = task(*(tuple(p) for p in (at.target_positions + moved).tolist()))
    (a,), (b,) = (fitted(structure, Problem(t, wide), np.array([0.5])) for t in (at, there))
    assert b.joints == a.joints
    np.testing.assert_allclose(b.links, a.links, atol=1e-6)
    np.testing.assert_allclose(np.subtract(b.origin, a.origin), moved, atol=1e-6)


def test_swapped_x_and_y_swap_the_structures() -> None:
    at = random_task(1002)
    swapped = task(*((y, x, z) for x, y, z in at.targets))
    here, there = ([(s.name, d) for s, d in fitted_structures(Problem(t))] for t in (at, swapped))
    found = {(name, d.joints, tuple(np.round([*d.origin, *d.links], 9).tolist())) for name, d in there}
    for name, design in here:
        x, y, z = design.origin
        numbers = tuple(np.round([y, x, z, *design.links], 9).tolist())
        assert (name, design.joints.translate(str.maketrans("RP", "PR")), numbers) in found


@pytest.mark.parametrize(
    ("targets", "special"),
    [
        ([(x, y, 0.4) for x, y in itertools.product((-0.4, 0.0, 0.4), repeat=2)], {"lying"}),
        ([(0.3, y, z) for y, z in itertools.product((-0.4, 0.0, 0.4), repeat=2)], {"turnover", "pole"}),
        ([(x, -0.3, z) for x, z in itertools.product((-0.4, 0.0, 0.4), repeat=2)], {"turnover", "pole"}),
        (list(itertools.product((-0.4, 0.4), repeat=3)), set()),
    ],
    ids=["level plane", "wall across x", "wall across y", "cube"],
)
def test_structures_for_planes_are_tried_on_planes(
    targets: list[tuple[float, float, float]], special: set[str]
) -> None:
    tried = {structure.name for structure, _ in fitted_structures(Problem(task(*targets)))}
    assert tried == special | {structure.name for structure in STRUCTURES[:5]}


def test_arm_in_a_plane_has_its_base_exactly_there() -> None:
    problem = Problem(task(*((x, y, 0.4) for x, y in itertools.product((-0.4, 0.0, 0.4), repeat=2))))
    lying = [design for structure, design in fitted_structures(problem) if structure.name == "lying"]
    assert lying
    for design in lying:
        assert design.origin[2] == pytest.approx(0.4, abs=1e-12)
        assert design.links[0] == problem.space.link[0]


def test_shoulder_position_is_locally_optimal() -> None:
    targets = random_task(1003).target_positions

    def missed(place: np.ndarray) -> float:
        return float(np.maximum(np.linalg.norm(targets - place, axis=1) - 0.2, 0.0).sum())

    best = shoulders(targets, np.array([0.2]))[0]
    for step in 0.1 * np.vstack([np.eye(3), -np.eye(3)]):
        assert missed(best) < missed(best + step)
    assert np.linalg.norm(targets - median(targets), axis=1).max() == pytest.approx(needed_length(targets))


TOOL = {"tip": [0.0, 0.0, 0.1], "mass": 0.005, "center": [0.0, 0.0, 0.05]}
BODY = {"mass": 0.01, "center": [0.0, 0.0, 0.03]}


@pytest.mark.parametrize("joints", ["PRYY", "RPYY", "YPYY", "YRYY"])
@pytest.mark.parametrize("carried", [{}, {"payload": 0.01}, {"tool": TOOL, "payload": BODY}], ids=["", "point", "body"])
@pytest.mark.parametrize("mass", [MassPerMetre(), MassPerLink(kind="per_link", kg=0.002)])
def test_forecast_of_a_straight_arm_is_its_evaluation(joints: str, carried: dict[str, Any], mass: MassModel) -> None:
    """Beyond its reach a pointer is stretched; only the shoulder's first link, of 1 mm, is beside the line."""
    targets = [(0.9, 0.2, 0.3), (0.5, -0.9, 0.5), (-0.6, -0.5, 0.7), (0.4, 0.8, -0.2)]
    space = DesignSpace(link=(0.001, 0.3), mass=mass)
    problem = Problem(Task.model_validate({"name": "test", "targets": targets, **carried}), space)
    design = space.clipped((0.0, 0.0, 0.0), joints, [0.001, 0.2, 0.1, 0.2])
    found, values = forecast(problem, [design]), problem.evaluate([design]).values[0]
    np.testing.assert_allclose([found.error[0], found.torque[0]], values, rtol=0.03)


def test_forecast_of_structures_is_near_their_evaluation() -> None:
    for seed in range(1500, 1510):
        problem = Problem(random_task(seed))
        found = candidates(problem)
        values = problem.evaluate(found.designs).values
        loaded = np.all(values < 5.0, axis=1) & (found.forecast.torque > 0.05)
        assert np.median(np.abs(found.forecast.error - values[:, 0])[loaded]) < 0.1
        assert np.median(np.abs(values[loaded, 1] / found.forecast.torque[loaded] - 1.0)) < 0.12


def test_vertical_axis_carries_nothing() -> None:
    """P lays the arm along x, where its lever is; R, which follows it, then stands vertical."""
    p, r, diagonal = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.6, 0.8, 0.0]])
    assert gravity_share(p, diagonal) == pytest.approx(0.6)
    assert gravity_share(r, diagonal) == pytest.approx(0.8)
    assert gravity_share(p, np.array([0.0, 0.0, 1.0])) == 0.0


@given(
    front=st.lists(st.tuples(st.floats(0.0, 6.0), st.floats(0.0, 6.0)), max_size=6),
    value=st.tuples(st.floats(0.0, 6.0), st.floats(0.0, 6.0)),
)
def test_gain_is_the_difference_of_hypervolumes(front: list[tuple[float, float]], value: tuple[float, float]) -> None:
    known = np.array(front).reshape(-1, 2)
    known = known[front_mask(known)]
    gain = gains(known, np.array([value]), (5.0, 5.0))[0]
    after = hypervolume(np.vstack([known, value]), (5.0, 5.0))
    assert gain == pytest.approx(after - hypervolume(known, (5.0, 5.0)), abs=1e-9)


def test_results_correct_the_forecast_of_their_structure() -> None:
    """A structure that turns out heavier than forecast promises less in all its sizes; others do not."""
    problem = Problem(random_task(1004))
    found, history = candidates(problem), history_of(problem, 5)
    before = found.expected_gains(history)
    row = int(np.argmax(before))
    heavy = (found.forecast.error[row] + 1.0, 2.0 * found.forecast.torque[row])
    assert np.all(np.array(heavy) < 5.0)
    trial = FinishedTrial(5, "rules", found.designs[row], heavy, "rules-0005-structure")
    after = found.expected_gains(History(problem, [*history.trials, trial], 5))
    own = np.array([s.name == found.structures[row].name for s in found.structures])
    assert after[row] == 0.0
    assert np.all(after[own] <= before[own])
    assert after[~own].max() > after[own].max()


def test_structures_that_violate_constraints_promise_less() -> None:
    at = random_task(1005)
    limited = Task(name="test", targets=at.targets, reference_point=(5.0, 5.0), constraints=("length <= 0.2",))
    problem = Problem(limited)
    found, history = candidates(problem), history_of(problem, 5)
    row = int(np.argmax(found.expected_gains(history)))
    history = with_proposal(history, Proposal(found.designs[row], "rules-0005-structure"))
    assert not history.feasible[5]
    best = int(np.argmax(found.expected_gains(history)))
    assert found.structures[best].name != found.structures[row].name


@pytest.mark.parametrize("structure", STRUCTURES, ids=lambda s: s.name)
@pytest.mark.parametrize("n", range(1, 9))
def test_structures_fit_any_number_of_joints(structure: Structure, n: int) -> None:
    joints, links = adapted(structure, paper_space(n))
    assert len(joints) == len(links) == n
    assert links.sum() == pytest.approx(sum(structure.links))
    assert set(adapted(structure, DesignSpace(joints=n, joint_types=("Y",)))[0]) == {"Y"}
    if n >= 3 and structure.name != "column":
        assert sum(kind != "Y" for kind in joints) == min(sum(kind != "Y" for kind in structure.joints), n)


def test_first_proposals_beat_random_designs() -> None:
    """One proposal gains more than the best of 500 random designs; eight more than all of them together."""
    problem = Problem(random_task(1006))
    random = problem.evaluate(problem.space.sample(500, 1)).values
    made = problem.evaluate([p.design for p in proposals(history_of(problem, 10), 8)]).values
    assert hypervolume(made[:1], (5.0, 5.0)) > max(hypervolume(row[None], (5.0, 5.0)) for row in random)
    assert hypervolume(made, (5.0, 5.0)) > hypervolume(random, (5.0, 5.0))


def test_other_objectives_get_every_structure_first() -> None:
    at = random_task(1007)
    problem = Problem(
        Task(name="test", targets=at.targets, objectives=("worst_error", "length"), reference_point=(2, 2))
    )
    made = proposals(history_of(problem, 20), len(candidates(problem).names) + 2)
    rules = [rule_of(proposal.id) for proposal in made]
    assert rules[:-2] == [STRUCTURE] * (len(made) - 2)
    assert len({proposal.reason.partition(":")[0] for proposal in made[:-2]}) == len(made) - 2
    assert set(rules[-2:]) <= set(RULES)
