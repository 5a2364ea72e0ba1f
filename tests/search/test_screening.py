"""Screening of offspring on a task with a cycle, from designs of its best known front."""

from typing import Any

import numpy as np
import pytest

from armwright import Problem, load_task
from armwright.pareto import feasible_mask, total_violation
from armwright.problem.estimates import estimates, lower_bounds
from armwright.proof.front_gap import known_front
from armwright.search.encoding import DesignEncoding
from armwright.search.front.screening import CANDIDATES, NEAR_MISSES, REJECTED_SHARE, REMEMBERED, Screen
from armwright.search.front.variation import offspring
from armwright.spaces.design_space import default_space

TASK, SPACE = load_task("dispensing"), default_space("dispensing")
PROBLEM = Problem(TASK, SPACE)
ENCODING = DesignEncoding(SPACE.parameters)
POINT = (3000.0, 3.0, 1.0)
N = 40


@pytest.fixture(scope="module")
def pool() -> Any:
    """Designs in the middle of a search: neighbours of the best known ones."""
    known = known_front(PROBLEM)
    assert known is not None
    return offspring(SPACE.matrix(known.designs), np.zeros(len(known.designs)), ENCODING, 60, np.random.default_rng(0))


def learnt(pool: Any, problem: Problem = PROBLEM, point: tuple[float, ...] = POINT) -> Screen:
    screen = Screen(problem, lambda: point)
    screen.learn(pool, problem.evaluate(pool))
    return screen


def screened(screen: Screen, pool: Any, seed: int = 1) -> Any:
    return screen.offspring(pool, np.zeros(len(pool)), ENCODING, N, np.random.default_rng(seed))


def test_chosen_offspring_are_feasible_more_often(pool: Any) -> None:
    """Some are chosen although estimates call them infeasible; of the others, nearly all are feasible."""
    screen = learnt(pool)
    chosen = screened(screen, pool)
    others = offspring(pool, np.zeros(len(pool)), ENCODING, len(chosen), np.random.default_rng(1))
    feasible, by_chance = (feasible_mask(PROBLEM.evaluate(matrix).violations) for matrix in (chosen, others))
    seems_feasible = feasible_mask(estimates(PROBLEM, chosen, screen._postures_near(chosen)).violations)
    assert feasible[seems_feasible].mean() > 0.85
    assert feasible[~seems_feasible].mean() < 0.5
    assert feasible.mean() > 2.5 * by_chance.mean()
    assert by_chance.mean() < 0.6


def test_a_share_of_the_evaluations_goes_to_rejected_designs(pool: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    ranked, found = Screen._ranked, list[tuple[Any, Any]]()

    def noted(self: Screen, *arguments: Any) -> tuple[Any, Any]:
        found.append(ranked(self, *arguments))
        return found[-1]

    monkeypatch.setattr(Screen, "_ranked", noted)
    chosen = screened(learnt(pool), pool)
    assert len(chosen) == N
    ((best, others),) = found
    assert len(chosen) < len(best) + len(others) <= CANDIDATES * len(chosen)
    assert len(chosen) - len(best) >= REJECTED_SHARE * len(chosen)


def test_designs_that_bounds_discard_are_not_chosen(pool: Any) -> None:
    dearest = PROBLEM.evaluate(pool).values[:, 0]
    limit = float(np.median(np.unique(dearest)))
    problem = Problem(TASK.model_copy(update={"constraints": (f"price <= {limit}",)}), SPACE)
    screen = learnt(pool, problem)
    chosen = screened(screen, pool)
    assert np.all(lower_bounds(problem, chosen).violations <= 0.0)
    # Beyond the reference point, too.
    screen = learnt(pool, point=(limit, 3.0, 1.0))
    assert np.all(lower_bounds(PROBLEM, screened(screen, pool)).values[:, 0] < limit)


def test_near_misses_would_enlarge_the_front_and_miss_the_least(pool: Any) -> None:
    outcomes = PROBLEM.evaluate(pool)
    state = learnt(pool).state()
    near, front = state["screen_near_matrix"], state["screen_front"]
    assert 0 < len(near) <= NEAR_MISSES
    found = PROBLEM.evaluate(near)
    assert not feasible_mask(found.violations).any()
    assert not np.any(np.all(front <= found.values[:, None], axis=2))
    assert np.all(found.values < POINT)
    # The design with the least violation of all that qualify is among them.
    infeasible = ~feasible_mask(outcomes.violations) & np.all(outcomes.values < POINT, axis=1)
    infeasible &= ~np.any(np.all(front <= outcomes.values[:, None], axis=2), axis=1)
    least = total_violation(outcomes.violations)[infeasible].min()
    assert total_violation(found.violations).min() == pytest.approx(least)


def test_screen_goes_on_if_bounds_discard_all_designs(pool: Any) -> None:
    problem = Problem(TASK.model_copy(update={"constraints": ("price <= 1",)}), SPACE)
    screen = learnt(pool, problem)
    chosen = screened(screen, pool)
    assert len(chosen) == N


@pytest.mark.slow
def test_restored_screen_equals_uninterrupted_one(pool: Any) -> None:
    screen, restored = learnt(pool), Screen(PROBLEM, lambda: POINT)
    restored.restore(screen.state())
    for seed in range(3):
        chosen = screened(screen, pool, seed)
        assert np.array_equal(screened(restored, pool, seed), chosen)
        outcomes = PROBLEM.evaluate(chosen)
        screen.learn(chosen, outcomes)
        restored.learn(chosen, outcomes)


def test_screen_forgets_the_oldest_designs(pool: Any) -> None:
    screen, outcomes = Screen(PROBLEM, lambda: POINT), PROBLEM.evaluate(pool)
    for _ in range(2 + REMEMBERED // len(pool)):
        screen.learn(pool, outcomes)
    state = screen.state()
    assert [len(state[f"screen_{name}"]) for name in ("matrix", "postures", "feasible")] == [REMEMBERED] * 3
