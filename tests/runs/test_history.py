"""Grown histories equal new ones and compute only new trials."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armwright import FinishedTrial, History, Problem, load_task
from armwright.pareto import FrontTracker

PROBLEM = Problem(load_task("target-2").model_copy(update={"constraints": ("length <= 1",), "reference_point": None}))
DESIGNS = PROBLEM.space.sample(12, seed=0)

trials = st.lists(
    st.tuples(
        st.sampled_from(DESIGNS),  # some come twice
        st.tuples(st.integers(0, 4), st.integers(0, 4)),  # many are equal
        st.sampled_from([-0.5, 0.0, 0.5]),
        st.sampled_from(["random", "bbo", "rules", "llm"]),
    ),
    max_size=20,
)


def finished(number: int, design: object, values: tuple[float, ...], broken: float, source: str) -> FinishedTrial:
    assert design in DESIGNS
    return FinishedTrial(number, source, design, values, violations=(broken,))  # type: ignore[arg-type]


def assert_same(one: History, other: History) -> None:
    for name in ("values", "violations", "masked_objectives", "feasible", "hypervolumes", "hypervolume"):
        mine, theirs = getattr(one, name), getattr(other, name)
        assert mine.shape == theirs.shape, name
        assert np.array_equal(mine, theirs), name
    assert one.front == other.front
    assert one.proposed == other.proposed
    assert [one.has_tried(design) for design in DESIGNS] == [other.has_tried(design) for design in DESIGNS]


@given(trials, st.lists(st.integers(0, 20), max_size=6), st.integers(0, 20), st.data())
def test_grown_history_equals_a_new_history(
    rows: list[tuple[object, tuple[int, int], float, str]], steps: list[int], found_at: int, data: st.DataObject
) -> None:
    """This holds whatever is computed in between, and whenever the reference point is found."""
    everything = [finished(i, d, tuple(map(float, v)), b, s) for i, (d, v, b, s) in enumerate(rows)]
    point = (3.5, 3.5)
    history = History(PROBLEM, (), 2)
    met: list[History] = []
    for n in [*sorted(min(step, len(rows)) for step in steps), len(rows)]:
        history = history.grown(everything[:n], point if n >= found_at else None)
        met.append(history)
        for name in data.draw(
            st.sets(st.sampled_from(["values", "front", "hypervolumes", "proposed", "masked_objectives"]))
        ):
            getattr(history, name)
        if n and data.draw(st.booleans()):
            history.has_tried(DESIGNS[0])
    for one in reversed(met):  # those before know nothing of what came after
        assert_same(one, History(PROBLEM, tuple(one.trials), 2, one.frozen_reference_point))


def test_grown_history_evaluates_only_new_trials(monkeypatch: pytest.MonkeyPatch) -> None:
    added: list[object] = []
    built: list[int] = []
    add, member = FrontTracker.add, History.member
    monkeypatch.setattr(FrontTracker, "add", lambda self, row: (added.append(row), add(self, row)))
    monkeypatch.setattr(History, "member", lambda self, number: (built.append(number), member(self, number))[1])
    everything = [finished(i, DESIGNS[i % 12], (1.0 + i, 99.0 - i), -1.0, "bbo") for i in range(60)]
    history = History(PROBLEM, (), 2, (100.0, 100.0))
    for n in range(10, 61, 10):
        history = history.grown(everything[:n], (100.0, 100.0))
        assert len(history.front) == len(history.hypervolumes) == n
        assert history.grown(everything[:n], (100.0, 100.0)) is history
    assert len(added) == 60
    assert sorted(built) == list(range(60))
