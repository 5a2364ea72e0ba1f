"""Attribution of hypervolume and front members to sources."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from armwright.pareto import hypervolume
from armwright.problem.problem import Problem
from armwright.proof.attribution import attribution_by_source, hypervolume_gains
from armwright.runs.history import History
from armwright.runs.trial import FinishedTrial
from armwright.tasks.task import Task

BOUNDED = Problem(Task(name="bounded", targets=((0.3, 0.0, 0.3),), reference_point=(5.0, 5.0)))
OPEN = Problem(Task(name="open", targets=((0.3, 0.0, 0.3),)))
DESIGN = BOUNDED.space.sample(1, 0)[0]
N_INIT = 3

TRIALS = st.lists(
    st.tuples(st.sampled_from(["rules", "bbo"]), st.tuples(st.integers(0, 24), st.integers(0, 24))), max_size=20
)


def history(trials: list[tuple[str, tuple[int, int]]], problem: Problem = BOUNDED) -> History:
    """On a coarse grid, so that equal values and ones outside the reference box are common."""
    sources = ["random"] * N_INIT + [source for source, _ in trials[N_INIT:]]
    values = [(a / 4, b / 4) for _, (a, b) in trials]
    return History(
        problem, [FinishedTrial(i, s, DESIGN, v) for i, (s, v) in enumerate(zip(sources, values, strict=False))], N_INIT
    )


@given(TRIALS)
def test_attribution_adds_up_to_the_run(trials: list[tuple[str, tuple[int, int]]]) -> None:
    past = history(trials)
    attribution = attribution_by_source(past)
    assert list(attribution) == list(dict.fromkeys(trial.source for trial in past))
    assert sum(c.trials for c in attribution.values()) == len(past)
    assert sum(c.front for c in attribution.values()) == len(past.front)
    gained = [c.hypervolume_gained for c in attribution.values()]
    assert sum(g or 0.0 for g in gained) == pytest.approx(hypervolume(past.values, (5.0, 5.0)))
    assert all(g is not None and g >= 0.0 for g in gained)


def test_trial_gains_the_hypervolume_it_adds_on_entry() -> None:
    """(1, 1) adds nothing after (1, 0), but would have before it."""
    past = history([("", (16, 16)), ("", (20, 0)), ("", (8, 8)), ("rules", (4, 4)), ("bbo", (4, 0)), ("rules", (4, 4))])
    gains = hypervolume_gains(past)
    assert gains is not None
    assert gains.tolist() == [1.0, 0.0, 8.0, 7.0, 4.0, 0.0]
    assert attribution_by_source(past)["rules"].hypervolume_gained == 7.0
    assert attribution_by_source(past)["rules"].front == 0


def test_attribution_without_a_reference_point_has_no_hypervolume() -> None:
    assert attribution_by_source(history([])) == {}
    past = history([("", (4, 4)), ("", (8, 0))], OPEN)
    assert hypervolume_gains(past) is None
    assert attribution_by_source(past)["random"].hypervolume_gained is None
    assert attribution_by_source(past)["random"].front == 2
