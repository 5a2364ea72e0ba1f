import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armwright import Problem, load_space, load_task, paper_space
from armwright.pareto import front_mask, hypervolume
from armwright.search.encoding import DesignEncoding
from armwright.search.front.front_search import (
    CAPACITIES,
    FIRST_BATCH,
    LATE_SHARE,
    LOST_FROM,
    LOST_LIFE,
    LOST_SHARE,
    PER_NUMBER,
    SMALLEST_BATCH,
    FrontSearch,
)
from armwright.search.front.selection import best_of_each, leaders, ranks, survivors
from armwright.search.front.variation import RARE_SHARE, _parents, offspring
from armwright.spaces.parameters import CategoricalParameter, FloatParameter

SPACE = paper_space()
MIXED = (
    FloatParameter("a", -2.0, 3.0, "m"),
    CategoricalParameter("joint_1", ("u", "v", "w")),
    *(FloatParameter(f"x_{i}", 0.0, 1.0, "m") for i in range(4)),
    FloatParameter("fixed", 0.3, 0.3, "m"),
)


def dtlz2(n_objectives):
    """DTLZ2 over the columns of MIXED (Deb et al. 2005): the front is the unit sphere, reached by joint v alone.

    Its optimum is at 0.3 instead of 0.5, because the search tries the middle of every range.
    """

    def evaluate(rows):
        units = np.column_stack([(rows[:, 0] + 2.0) / 5.0, rows[:, 2:]])
        angles, rest = units[:, : n_objectives - 1] * np.pi / 2, units[:, n_objectives - 1 :]
        radius = 1.0 + np.sum((rest - 0.3) ** 2, axis=1) + 0.3 * (rows[:, 1] != 1)
        values = np.repeat(radius[:, None], n_objectives, axis=1)
        for m in range(n_objectives):
            values[:, m] *= np.prod(np.cos(angles[:, : n_objectives - 1 - m]), axis=1)
            values[:, m] *= np.sin(angles[:, n_objectives - 1 - m]) if m else 1.0
        return values

    return evaluate


def made(n_objectives=2, seed=0, **known):
    return FrontSearch(MIXED, dtlz2(n_objectives), [1.1] * n_objectives, seed, **known)


def stepped(search, n):
    for _ in range(n):
        search.step()
    return search


def assert_same(one, other):
    np.testing.assert_array_equal(one.matrix, other.matrix)
    np.testing.assert_array_equal(one.values, other.values)
    np.testing.assert_array_equal(one.history, other.history)
    assert one.evaluations == other.evaluations


def test_equal_seeds_give_equal_fronts():
    one = stepped(made(), 10)
    assert_same(one, stepped(made(), 10))
    assert not np.array_equal(one.matrix, stepped(made(seed=1), 10).matrix)


@pytest.mark.parametrize("n_objectives", [1, 2, 3, 4])
def test_restored_search_equals_uninterrupted_one(n_objectives):
    whole = stepped(made(n_objectives), 12)
    state = stepped(made(n_objectives), 5).state()
    restored = made(n_objectives)
    restored.restore(state)
    assert_same(stepped(restored, 7), whole)


def test_ask_repeats_its_designs_until_tell():
    search = stepped(made(), 2)
    rows = search.ask()
    np.testing.assert_array_equal(search.ask(), rows)
    search.tell(rows, dtlz2(2)(rows))
    assert not np.array_equal(search.ask(), rows)


def test_random_designs_that_the_first_generation_lacks_come_later():
    """A generation's last designs are the random ones, which `vary` does not make."""
    asked = []

    def vary(pool, ranks, encoding, n, rng):
        asked.append(n)
        return offspring(pool, ranks, encoding, n, rng)

    search = made(vary=vary)
    first = search.ask()[:200]
    search.tell(first, dtlz2(2)(first))
    drawn, numbers = [first], []
    while search.evaluations < 2_000:
        batch = search.ask()
        assert len(batch) == SMALLEST_BATCH
        drawn.append(batch[asked[-1] :])
        numbers.append(len(drawn[-1]))
        search.tell(batch, dtlz2(2)(batch))
    assert numbers[:7] == [*[round(LATE_SHARE * SMALLEST_BATCH)] * 6, 0]
    assert sum(len(designs) for designs in drawn) == FIRST_BATCH
    units = np.vstack(drawn)[:, 2:6]
    assert np.quantile(units, [0.1, 0.5, 0.9]) == pytest.approx([0.1, 0.5, 0.9], abs=0.03)  # over the whole range


@pytest.mark.parametrize(("n_objectives", "least"), [(1, 0.999), (2, 0.98), (3, 0.9), (4, 0.7)])
def test_search_finds_front_of_dtlz2(n_objectives, least):
    search = stepped(made(n_objectives), 60)
    share_of_sphere = {1: 1.0, 2: np.pi / 4, 3: np.pi / 6, 4: np.pi**2 / 32}[n_objectives]
    best = 1.1**n_objectives - share_of_sphere
    assert least * best < search.hypervolume <= best
    assert np.mean(search.matrix[:, 1] == 1) > 0.9


def test_front_is_non_dominated_sorted_and_bounded():
    search = stepped(made(), 60)
    assert CAPACITIES[0] <= len(search.matrix) == len(search.values) <= CAPACITIES[1]
    assert front_mask(search.values).all()
    assert np.all(search.values < 1.1)
    assert np.all(np.diff(search.values[:, 0]) > 0.0)
    np.testing.assert_array_equal(dtlz2(2)(search.matrix), search.values)


def test_asked_designs_lie_in_the_space():
    search = made()
    for _ in range(20):
        rows = search.ask()
        for column, parameter in zip(rows.T, MIXED, strict=True):
            if isinstance(parameter, FloatParameter):
                assert np.all((parameter.low <= column) & (column <= parameter.high))
            else:
                assert set(column) <= set(range(len(parameter.choices)))
        search.tell(rows, dtlz2(2)(rows))


def test_children_reach_ends_and_middles_of_ranges_exactly():
    encoding, rng = DesignEncoding(SPACE.parameters), np.random.default_rng(0)
    pool = encoding.random(50, rng)
    units = encoding.units(offspring(pool, np.zeros(50), encoding, 2000, rng))
    for marked in (0.0, 0.5, 1.0):
        shares = np.mean(np.abs(units - marked) < 1e-9, axis=0)
        assert np.all((shares > 1e-3) & (shares < 0.05))


def test_space_without_categories_is_searched():
    parameters = [p for p in MIXED if isinstance(p, FloatParameter)]
    search = FrontSearch(parameters, lambda rows: rows[:, :2] ** 2, [10.0, 10.0], seed=0)
    assert stepped(search, 30).hypervolume > 99.9


def test_known_designs_join_the_front():
    perfect = np.array([[0.5, 1, 0.3, 0.3, 0.3, 0.3, 0.3]])
    search = made(known=perfect)
    assert len(search.ask()) == FIRST_BATCH + 1
    assert np.any(np.all(stepped(search, 5).matrix == perfect, axis=1))


def test_search_stalls_when_hypervolume_stops_growing():
    search = stepped(made(), 1)
    assert not search.stalled
    while not search.stalled:
        search.step()
        assert search.evaluations < 500_000
    late, early = search.hypervolume, np.interp(search.evaluations / 2, *search.history.T)
    assert late / early - 1.0 < 1e-3


def test_side_pools_start_join_and_are_restored(monkeypatch):
    for name, value in (("SIDE_FROM", 2000), ("SIDE_LIFE", 1500)):
        monkeypatch.setattr(f"armwright.search.front.front_search.{name}", value)
    search, ages = made(), []
    while search.evaluations < 12_000:
        search.step()
        ages.append(int(search.state()["side_age"]))
        if len(ages) == 60:
            other = made()
            other.restore(search.state())
    assert max(ages) < 1500
    assert sum(before > after for before, after in itertools.pairwise(ages)) >= 1  # one joined
    spent = search.state()["side_evaluations"]
    assert spent == pytest.approx(0.25 * (search.evaluations - 2000), abs=FIRST_BATCH)
    while other.evaluations < 12_000:
        other.step()
    assert np.array_equal(other.matrix, search.matrix)


def test_side_pools_come_early_while_nothing_counts():
    """Designs count in a side pool only, and only late."""

    def evaluate(rows):
        return dtlz2(2)(rows) + (0.0 if search._is_side_generation and search.evaluations > 9_000 else 10.0)

    ages = []
    search = FrontSearch(MIXED, evaluate, [1.1, 1.1], seed=0)
    while search.evaluations < 9_000:
        search.step()
        ages.append(int(search.state()["side_age"]))
    assert search.hypervolume == 0.0
    assert search.state()["side_evaluations"] == pytest.approx(LOST_SHARE * (9_000 - LOST_FROM), abs=FIRST_BATCH)
    assert LOST_LIFE / 2 < max(ages) < LOST_LIFE
    while search.hypervolume == 0.0:
        search.step()
        assert search.evaluations < 10_000
    assert search.state()["side_age"] == 0  # it joined at once
    assert np.any(np.all(search.state()["values"] < 1.1, axis=1))


def test_survivors_keep_most_hypervolume():
    rng = np.random.default_rng(0)
    values = rng.random((500, 2))
    kept = survivors(values, np.array([1.0, 1.0]), 5)
    front = np.flatnonzero(front_mask(values))
    assert len(kept) == 5
    assert set(kept) <= set(front)
    at_random = [hypervolume(values[rng.choice(front, 5, replace=False)], [1.0, 1.0]) for _ in range(50)]
    assert hypervolume(values[kept], [1.0, 1.0]) >= max(at_random)


def test_survivors_fill_a_small_front_by_rank():
    values = np.array([[9.0, 9.0], [1.0, 1.0], [1.0, 1.0], [2.0, 2.0], [0.0, 7.0], [6.0, 0.0]])
    kept = survivors(values, np.array([5.0, 5.0]), 5)
    assert kept.tolist() == [1, 2, 3, 4, 5]


@given(
    st.lists(st.tuples(st.floats(0.0, 2.0), st.floats(0.0, 2.0), st.integers(0, 5)), min_size=1, max_size=60),
    st.integers(1, 4),
)
def test_leaders_are_best_points_of_best_structures(points, most):
    values, structures = np.array(points)[:, :2], np.array([kind for _, _, kind in points])
    reference = np.array([1.5, 1.5])
    kept = leaders(values, structures, reference, most)
    boxes = np.prod(np.maximum(reference - values, 0.0), axis=1)
    largest = {kind: boxes[structures == kind].max() for kind in set(structures[boxes > 0.0].tolist())}
    led = set(structures[kept].tolist())
    assert len(set(kept.tolist())) == len(kept)
    assert len(led) == min(most, len(largest))
    assert all(largest[kind] <= min(largest[one] for one in led) for kind in set(largest) - led)
    for kind in led:
        chosen = [row for row in kept if structures[row] == kind]
        assert 1 <= len(chosen) <= 3
        assert largest[kind] in boxes[chosen]


@given(
    st.lists(st.tuples(st.floats(0.0, 2.0), st.floats(0.0, 2.0), st.integers(4, 6)), min_size=1, max_size=40),
    st.integers(1, 4),
)
def test_best_of_each_group_stay(points, n):
    values, groups = np.array(points)[:, :2], np.array([group for _, _, group in points])
    reference = np.array([1.5, 1.5])
    kept, rank = best_of_each(values, groups, reference, n), ranks(values, reference)
    assert len(set(kept.tolist())) == len(kept)
    for group in set(groups.tolist()):
        chosen, others = kept[groups[kept] == group], np.setdiff1d(np.flatnonzero(groups == group), kept)
        assert len(chosen) == min(n, len(chosen) + len(others))
        assert not len(others) or rank[chosen].max() <= rank[others].min()


def test_few_joints_stay_in_the_pool_until_they_are_feasible():
    space = load_space("desk-sorting")
    columns = DesignEncoding(space.parameters)

    def evaluate(rows):  # arms of four joints miss a constraint, though by less from step to step
        values = 0.1 + columns.units(rows)[:, :2]
        return np.where(columns.n_joints(rows)[:, None] == 4, 1e6 * (1.0 + values), values)

    search = stepped(FrontSearch(space.parameters, evaluate, [2.0, 2.0], seed=0), 20)
    assert set(columns.n_joints(search.matrix).tolist()) == {5}
    assert np.sum(columns.n_joints(search.state()["matrix"]) == 4) >= PER_NUMBER


def test_rare_structures_get_more_children():
    columns = DesignEncoding(MIXED)
    rows = columns.random(100, np.random.default_rng(0))
    rows[:, 1] = 0.0
    rows[-1, 1] = 2.0  # the only one of its kind
    structures = np.sort(columns.structures(rows))
    parents = _parents(structures, 20_000, np.random.default_rng(1))
    share = np.mean(structures[parents] == structures[-1])
    assert share == pytest.approx(RARE_SHARE / 2 + (1 - RARE_SHARE) / 100, abs=0.01)
    assert set(parents.tolist()) == set(range(100))


def test_encoding_round_trips_designs_of_a_space():
    columns = DesignEncoding(SPACE.parameters)
    rows = columns.random(200, np.random.default_rng(0))
    assert rows.shape == (200, len(SPACE.parameters))
    for design in SPACE.designs(rows):
        SPACE.design(design.params)
    assert len(np.unique(columns.structures(rows))) > 60
    np.testing.assert_allclose(columns.from_units(columns.units(rows)), rows[:, columns.real], atol=1e-15)


def test_structures_are_joint_sequences():
    space = load_space("desk-sorting")
    columns = DesignEncoding(space.parameters)
    rows = columns.random(300, np.random.default_rng(0))
    sequences = np.array([design.joints for design in space.designs(rows)])
    structures = columns.structures(rows)
    np.testing.assert_array_equal(structures[:, None] == structures, sequences[:, None] == sequences)
    assert 50 < len(np.unique(structures)) < 300


def test_units_outside_a_range_are_reflected():
    columns = DesignEncoding(MIXED[:1])
    units = np.array([[-0.1], [0.0], [1.2], [2.5], [-7.0]])
    np.testing.assert_allclose(columns.from_units(units)[:, 0], [-1.5, -2.0, 2.0, -2.0, -2.0], atol=1e-12)


@pytest.mark.slow
def test_search_matches_nsga2_of_pymoo_over_five_seeds():
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.core.problem import Problem as PymooProblem
    from pymoo.optimize import minimize

    problem = Problem(load_task("target-2"))
    bounds = [(p.low, p.high) if isinstance(p, FloatParameter) else (0.0, 3.0 - 1e-9) for p in SPACE.parameters]
    categorical = [isinstance(p, CategoricalParameter) for p in SPACE.parameters]

    class Arms(PymooProblem):
        def _evaluate(self, x, out, *args, **kwargs):
            out["F"] = problem.evaluate(np.where(categorical, np.floor(x), x)).values
            found.append(out["F"])

    theirs, ours = [], []
    for seed in range(5):
        found = []
        low, high = np.array(bounds).T
        arms = Arms(n_var=len(bounds), n_obj=2, xl=low, xu=high)
        minimize(arms, NSGA2(pop_size=100), ("n_eval", 20_000), seed=seed)
        theirs.append(hypervolume(np.vstack(found), (5.0, 5.0)))
        search = FrontSearch(SPACE.parameters, lambda rows: problem.evaluate(rows).values, (5.0, 5.0), seed)
        while search.evaluations < 20_000:
            search.step()
        ours.append(search.hypervolume)
    assert np.mean(ours) >= np.mean(theirs)
