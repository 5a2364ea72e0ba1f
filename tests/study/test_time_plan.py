"""`armwright design --budget`: a run ends on time, by a clock of the tests' own on a machine of any speed."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armwright import Problem, find_front, load_task
from armwright.exceptions import SettingsError
from armwright.kinematics.devices import Compilation
from armwright.proof.results import read_summary
from armwright.spaces.design_space import default_space
from armwright.study.front import direct_search, time_plan
from armwright.study.front.evaluation_pool import EvaluationPool
from armwright.study.front.search_budget import SearchBudget, read_seconds
from armwright.study.front.time_plan import ChunkSize, TimePlan
from tests.support.controlled_runs import interrupt_at

PROBLEM = Problem(load_task("target-1"))
PER_VERIFIED = 35  # evaluations that verifying a design takes, about as with real clocks


class Clock:
    """A clock that only `wait` moves, and evaluations: by the time of a design for each, or 35 times that to verify."""

    def __init__(self) -> None:
        self.now = 100.0
        self.of_a_design = 0.0

    def __call__(self) -> float:
        return self.now

    def wait(self, seconds: float) -> None:
        self.now += seconds


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(time_plan, "time", SimpleNamespace(monotonic=clock))
    monkeypatch.setattr(time_plan, "compilation", SimpleNamespace(seconds=0.0))

    def slow(owner: Any, name: str, n_designs: Callable[..., int]) -> None:
        function = getattr(owner, name)

        def wait(*given: Any) -> Any:
            clock.wait(clock.of_a_design * n_designs(*given))
            return function(*given)

        monkeypatch.setattr(owner, name, wait)

    slow(Problem, "evaluate", lambda _, matrix: len(matrix))
    slow(direct_search, "verify", lambda _, designs, *__: PER_VERIFIED * len(designs))
    slow(direct_search, "verify_front", lambda history: PER_VERIFIED * len(history.front))
    monkeypatch.setattr(direct_search, "MANY_ARMS", 1)
    return clock


def plan_of(drawing: bool = False, **budget: Any) -> TimePlan:
    return TimePlan(SearchBudget(**budget), drawing)


@pytest.mark.parametrize(
    ("budget", "seconds"),
    [("60s", 60.0), ("5min", 300.0), ("1h", 3600.0), ("5", 5.0), (5, 5.0), (0.5, 0.5), ("0.5s", 0.5), ("1_000", 1e3)],
)
def test_budgets_are_times(budget: str | float, seconds: float) -> None:
    assert read_seconds(budget) == seconds
    assert SearchBudget.of(budget, 7) == SearchBudget(evaluations=7, seconds=seconds)


def test_default_budget_is_a_time_unless_evaluations_are_given() -> None:
    assert SearchBudget.of() == SearchBudget(seconds=30.0)
    assert SearchBudget.of(evaluations=7) == SearchBudget(evaluations=7)
    with pytest.raises(SettingsError, match="above 0"):
        SearchBudget(evaluations=0)


@pytest.mark.parametrize("budget", ["0", "0s", "-5s", "5 parsecs", "", "s", "1e99", "nan", "inf s", "5m", 0, -1.0])
def test_invalid_budgets_are_refused(budget: str | float) -> None:
    with pytest.raises(SettingsError, match="budget"):
        SearchBudget.of(budget)


@pytest.mark.parametrize(
    ("seconds", "of_a_design"), [(5.0, 1e-3), (30.0, 0.01), (60.0, 0.02), (60.0, 0.2), (20.0, 0.05)]
)
def test_run_ends_on_time(clock: Clock, tmp_path: Path, seconds: float, of_a_design: float) -> None:
    clock.of_a_design = of_a_design
    started = clock.now
    run = find_front(PROBLEM, budget=plan_of(seconds=seconds), stop_at_stall=False, out=tmp_path / "run")
    spent = clock.now - started
    assert spent <= seconds + max(3.0, 0.1 * seconds)
    assert spent >= 0.5 * seconds  # it is used
    summary = read_summary(tmp_path / "run")
    assert summary is not None
    assert summary["search"]["ended_by"] == "budget"
    assert summary["verification"]["robust"] + summary["verification"]["sensitive"] == len(run.front) > 0
    # The same command computes nothing again; a larger budget goes on, within what it adds.
    before, file = clock.now, (tmp_path / "run" / "summary.json").stat().st_mtime_ns
    again = find_front(PROBLEM, budget=plan_of(seconds=seconds), stop_at_stall=False, out=tmp_path / "run")
    assert clock.now - before <= of_a_design * (1 + len(run.front))
    assert (tmp_path / "run" / "summary.json").stat().st_mtime_ns == file
    assert again.resumed == summary["search"]["evaluations"]
    before = clock.now
    more = find_front(PROBLEM, budget=plan_of(seconds=2 * seconds), stop_at_stall=False, out=tmp_path / "run")
    assert clock.now - before <= seconds + max(3.0, 0.2 * seconds)
    assert more.summary["search"]["evaluations"] > more.resumed == again.resumed


@pytest.mark.slow
@pytest.mark.parametrize(("of_a_design", "is_short"), [(0.1, True), (0.001, False)])
def test_cycle_search_is_short_if_time_is_short(
    clock: Clock, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, of_a_design: float, is_short: bool
) -> None:
    clock.of_a_design = of_a_design
    monkeypatch.setattr(EvaluationPool, "start", lambda _: None)  # other processes have another clock
    problem = Problem(load_task("screwing"), default_space("screwing"))
    watch = interrupt_at(300 if is_short else 500)
    with pytest.raises(KeyboardInterrupt):
        find_front(problem, budget=plan_of(seconds=60.0), out=tmp_path, watch=watch)
    with np.load(tmp_path / "search.npz") as state:
        assert int(state["random_left"]) == (250 if is_short else 0)


def test_evaluations_do_not_depend_on_the_clock(clock: Clock, tmp_path: Path) -> None:
    quick = find_front(PROBLEM, evaluations=700, seed=3)
    clock.of_a_design = 0.2  # chunks of 25 designs
    slow = find_front(PROBLEM, budget=plan_of(evaluations=700), seed=3, out=tmp_path / "run")
    assert np.array_equal(slow.history.values, quick.history.values)
    assert slow.summary["search"]["evaluations"] == quick.summary["search"]["evaluations"]


def test_whichever_limit_comes_first_ends_the_search(clock: Clock) -> None:
    clock.of_a_design = 0.01
    by_time = find_front(PROBLEM, budget=plan_of(seconds=10.0, evaluations=10**6))
    assert by_time.summary["search"]["evaluations"] < 1000
    by_evaluations = find_front(PROBLEM, budget=plan_of(seconds=1e6, evaluations=100))
    assert 100 <= by_evaluations.summary["search"]["evaluations"] <= 1100


def test_compilation_does_not_count(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    compiled = SimpleNamespace(seconds=4.0)
    monkeypatch.setattr(time_plan, "compilation", compiled)
    plan = TimePlan(SearchBudget(seconds=10.0))
    clock.wait(9.0)
    compiled.seconds += 8.0
    assert plan.elapsed == pytest.approx(1.0)
    assert plan.left == pytest.approx(9.0)


def test_compilation_is_announced_once() -> None:
    compilation, announced = Compilation(), list[str]()
    compilation.announce = lambda: announced.append("compiling")
    for _ in range(2):
        with compilation.timed():
            assert announced == ["compiling"]
    assert compilation.seconds >= 0.0


def test_results_get_a_share_of_the_time_and_of_expensive_ones_fewer_are_kept(clock: Clock) -> None:
    plan = plan_of(drawing=True, seconds=60.0)
    plan.begin_search()
    assert plan.search_left == pytest.approx(60.0 - 3.0 - 15.0)
    clock.wait(plan.search_left)
    assert [plan.n_designs(seconds) for seconds in (1e-4, 0.01, 0.1, 1.0, 60.0)] == [300, 300, 75, 7, 1]
    clock.wait(20.0)
    assert plan.n_designs(0.1) == 10  # late
    assert plan_of(seconds=3600.0).search_left == pytest.approx(3540.0)
    assert plan_of(drawing=True, seconds=4.0).search_left == pytest.approx(1.2)  # at least
    assert plan_of(evaluations=5).n_designs(1e9) == 300


@pytest.mark.parametrize("seconds", [1e-6, 1e-3, 0.02])
def test_chunks_take_a_small_share_of_the_budget(seconds: float) -> None:
    size = ChunkSize(SearchBudget(seconds=100.0))
    for _ in range(30):
        size.adapt(size.value, seconds * size.value)
        assert size.value * seconds <= 2.0
    assert size.value * seconds == pytest.approx(2.0, rel=0.01)
    size.adapt(size.value, 60.0 * size.value)
    assert size.value == 16  # of slow designs, chunks are not too small
