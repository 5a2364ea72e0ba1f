"""The surrogate as a sampler: resuming, conditional spaces, constraints, failures, several trials at a time."""

import io
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import pytest
from optuna.trial import TrialState, create_trial
from rich.console import Console

import armwright as aw
from armwright.cli.show_results import show_result
from armwright.exceptions import SettingsError
from armwright.proof.results import read_summary
from armwright.runs.history import BBO, RANDOM, History
from armwright.search.samplers import SamplerFactory, sampler_for, sampler_name
from armwright.search.surrogate.surrogate import Observations, Screen, Surrogate
from armwright.spaces.optuna_distributions import distributions

TASK = aw.load_task("target-1")


@aw.evaluator("height [m]", "span [m]")
def measure(arm: aw.Arm, task: aw.Task) -> tuple[float, float]:
    """how high the base is, and how long the arm"""
    return abs(arm.base[2]), 0.1 + sum(link.length for link in arm.links)


def problem(space: aw.DesignSpace | None = None, evaluator: aw.Evaluator = measure, **changes: object) -> aw.Problem:
    task = TASK.model_copy(update={"reference_point": None, **changes})
    return aw.Problem(task, space or aw.paper_space(), evaluator=evaluator)


def observed(problem: aw.Problem, n: int, pending: int = 0) -> Observations:
    designs = problem.space.sample(n + pending, 5)
    values = np.array([measure(problem.arm(design), problem.task) for design in designs[:n]])
    matrix = problem.space.matrix(designs)
    return Observations(matrix[:n], values, np.zeros(n, dtype=bool), matrix[n:])


def test_gain_is_bounded_by_what_is_stated_else_by_the_worst_values() -> None:
    seen = observed(problem(), 8)
    seen.failed[2] = True
    worst = np.delete(seen.values, 2, axis=0).max(axis=0)
    assert Surrogate(problem()).reference_point(seen) == pytest.approx(worst)
    stated = Surrogate(aw.Problem(TASK.model_copy(update={"reference_point": (0.4, 1.3)})))
    assert stated.reference_point(seen) == pytest.approx([0.4, 1.3])


@pytest.mark.slow
def test_resumed_run_equals_uninterrupted_one(tmp_path: Path) -> None:
    def run(n_total: int, out: Path | None = None) -> aw.StudyResult:
        return aw.optimize(problem(), proposer="rules", n_init=6, n_step=4, n_total=n_total, out=out)

    whole = run(7)
    run(3, tmp_path)
    resumed = run(7, tmp_path)
    assert [t.design for t in resumed.trials] == [t.design for t in whole.trials]
    assert {t.source for t in whole.trials} == {RANDOM, BBO, "rules"}


@pytest.mark.slow
def test_summary_and_terminal_state_the_errors_of_predictions(tmp_path: Path) -> None:
    run = aw.optimize(problem(), proposer="none", n_init=10, n_total=2, out=tmp_path)
    summary = read_summary(tmp_path)
    assert summary is not None
    assert summary["surrogate"] == Surrogate(problem()).left_out_errors(run.history)
    output = io.StringIO()
    show_result(Console(file=output, width=200), run, [])
    assert f", span {summary['surrogate']['errors']['span']:.2g}\n" in output.getvalue()


def history_of(problem: aw.Problem, values: np.ndarray) -> History:
    """Return random trials of designs with these values (N, M)."""
    designs = problem.space.sample(len(values), 3)
    pairs = enumerate(zip(designs, values.tolist(), strict=True))
    return History(
        problem, [aw.FinishedTrial(i, RANDOM, design, tuple(row)) for i, (design, row) in pairs], len(values)
    )


@pytest.mark.slow
def test_errors_tell_what_is_predictable_from_what_is_not() -> None:
    designs = problem().space.sample(40, 3)
    length = np.array([sum(design.links) for design in designs])
    noise = 2.0 + np.sin(1e4 * length)
    found = Surrogate(problem()).left_out_errors(history_of(problem(), np.column_stack([noise, length])))
    assert found is not None
    assert found["errors"]["span"] < 0.1
    assert found["errors"]["height"] > 0.8


def test_constant_objective_and_few_designs_have_no_error() -> None:
    assert Surrogate(problem()).left_out_errors(history_of(problem(), np.ones((9, 2)))) is None
    values = np.column_stack([np.full(12, 3.0), np.random.default_rng(8).uniform(1.0, 2.0, 12)])
    found = Surrogate(problem()).left_out_errors(history_of(problem(), values))
    assert found is not None
    assert found["errors"]["height"] is None


@pytest.mark.slow
def test_memory_changes_no_choice() -> None:
    p = problem()
    used = Surrogate(p)
    for n in (6, 12, 9):
        known = observed(p, n)
        assert np.array_equal(used.choose(known, 3), Surrogate(p).choose(known, 3))


def test_auto_is_the_surrogate_for_evaluators_only() -> None:
    assert sampler_name(sampler_for(problem(), "auto")) == "surrogate"
    assert sampler_for(aw.Problem(TASK), "auto") == "tpe"
    assert sampler_for(problem(), "nsga2") == "nsga2"


def longest_link(design: aw.Design) -> list[float]:
    return [max(design.links)]


def test_custom_features_are_inputs() -> None:
    designs = problem().space.sample(6, 0)
    matrix = problem().space.matrix(designs)
    found = Surrogate(problem(), longest_link).features.describe(matrix).inputs["physics"]
    assert found.shape[1] == Surrogate(problem()).features.describe(matrix).inputs["physics"].shape[1] + 1
    assert np.corrcoef(found[:, -1], [max(design.links) for design in designs])[0, 1] == pytest.approx(1.0)


def test_features_of_optimize_are_those_of_the_surrogate() -> None:
    run = aw.optimize(problem(), proposer="none", features=longest_link, n_init=6, n_total=1)
    same = aw.surrogate_sampler(problem(), features=longest_link)
    other = aw.optimize(problem(), proposer="none", sampler=same, n_init=6, n_total=1)
    assert run.config.study.sampler == sampler_name(same)
    assert [trial.design for trial in run.trials] == [trial.design for trial in other.trials]


@pytest.mark.parametrize("sampler", ["tpe", "random", aw.surrogate_sampler(problem())])
def test_features_with_another_sampler_are_refused(sampler: str | SamplerFactory) -> None:
    with pytest.raises(SettingsError, match=r'features: expected the sampler "surrogate".*try sampler="surrogate"'):
        aw.optimize(problem(), proposer="none", sampler=sampler, features=longest_link)


@pytest.mark.parametrize("value", [[np.nan], [np.inf, 1.0], [[1.0]], "long", {"length": 1.0}, [1.0, [2.0]], [None]])
def test_features_that_are_not_finite_numbers_are_refused(value: Any) -> None:
    with pytest.raises(SettingsError, match=r"features: expected (\d finite )?numbers.*, got"):
        Surrogate(problem(), lambda design: value).features.describe(observed(problem(), 2).matrix)


def test_features_of_varying_length_are_refused() -> None:
    p = problem(aw.load_space("desk-sorting"))
    matrix = p.space.matrix(p.space.sample(20, 0))
    with pytest.raises(SettingsError, match=r"expected \d finite numbers for every design"):
        Surrogate(p, lambda design: design.links).features.describe(matrix)


@pytest.mark.parametrize("pending", [0, 3])
def test_choice_is_a_new_design_of_the_space(pending: int) -> None:
    p = problem()
    known = observed(p, 12, pending)
    row = Surrogate(p).choose(known, 0)
    p.space.design(p.space.designs(row[None])[0].params)
    assert not any(np.array_equal(row, other) for other in np.vstack([known.matrix, known.pending]))


def test_pending_design_gains_less() -> None:
    p = problem()
    known, surrogate = observed(p, 12), Surrogate(problem())
    best = surrogate.choose(known, 0)[None]
    waiting = Observations(known.matrix, known.values, known.failed, best)
    before, after = (Screen(surrogate, k).gain(surrogate.features.describe(best))[0] for k in (known, waiting))
    assert 0.0 < after < before


def test_choice_does_not_depend_on_the_unit_of_an_objective() -> None:
    p = problem()
    known = observed(p, 12)
    scaled = Observations(known.matrix, known.values * np.array([1024.0, 1.0]), known.failed, known.pending)
    assert np.array_equal(Surrogate(p).choose(known, 0), Surrogate(p).choose(scaled, 0))


@pytest.mark.slow
@pytest.mark.parametrize("n_objectives", [1, 5])
def test_one_to_five_objectives(n_objectives: int) -> None:
    @aw.evaluator(*(f"f{i}" for i in range(n_objectives)))
    def several(arm: aw.Arm, task: aw.Task) -> tuple[float, ...]:
        return tuple((0.01 * i + arm.base[i % 3]) ** 2 + arm.links[0].length for i in range(n_objectives))

    run = aw.optimize(problem(evaluator=several), proposer="none", n_init=6, n_total=2)
    assert run.config.study.sampler == "surrogate"
    assert [trial.source for trial in run.trials[-2:]] == [BBO, BBO]


@pytest.mark.slow
def test_conditional_parameters_and_motors() -> None:
    space = aw.load_space("desk-sorting")
    run = aw.optimize(problem(space), proposer="none", sampler="surrogate", n_init=8, n_total=5)
    assert all(space.design(trial.design.params) == trial.design for trial in run.trials)
    assert len({trial.design for trial in run.trials}) == 13


def test_constraints_are_known_without_an_evaluation() -> None:
    p = problem(constraints=("length <= 0.5",))
    run = aw.optimize(p, proposer="none", sampler="surrogate", n_init=6, n_total=4)
    assert not any(trial.is_feasible for trial in run.trials[:6])
    assert all(trial.is_feasible for trial in run.trials[6:])


def test_failures_are_avoided() -> None:
    """Evaluations fail where the base is at x < 0.3 m, where all the values are best."""
    p = problem()
    known = observed(p, 24)
    failed = known.matrix[:, 0] < 0.3
    values = np.where(failed[:, None], np.inf, known.values)
    surrogate = Surrogate(p)
    row = surrogate.choose(Observations(known.matrix, values, failed, known.pending), 0)
    assert failed.any()
    assert row[0] > 0.2


def test_late_successes_are_modelled() -> None:
    """All five successes are among the last tenth, which models are otherwise not chosen with."""
    p = problem()
    known = observed(p, 109)
    failed = np.arange(109) < 104
    values = np.where(failed[:, None], np.inf, known.values)
    row = Surrogate(p).choose(Observations(known.matrix, values, failed, known.pending), 0)
    assert p.space.designs(row[None])


@pytest.mark.slow
def test_rare_success_is_sought_among_its_likes() -> None:
    """One design in fifteen succeeds; the sampler learns from failures before it can model an objective."""

    @aw.evaluator("span [m]", "height [m]")
    def short(arm: aw.Arm, task: aw.Task) -> tuple[float, float]:
        if arm.length > 0.5:
            raise ValueError("too long")
        return arm.length, abs(arm.base[2])

    def failures(sampler: str) -> int:
        asked: Any = {"sampler": sampler, "proposer": "none", "n_init": 10, "n_total": 20, "allow_failures": True}
        runs = [aw.optimize(problem(evaluator=short), **asked, seed=seed) for seed in range(3)]
        return sum(trial.failure is not None for run in runs for trial in run.trials[20:])

    assert failures("random") > 22  # of 30
    assert failures("surrogate") < 15


def test_failed_trials_of_a_script_are_not_learned_from() -> None:
    p = problem()
    study = optuna.create_study(directions=["minimize", "maximize"])
    space = distributions(p.space)
    for number, design in enumerate(p.space.sample(8, 1)):
        state = TrialState.FAIL if number == 3 else TrialState.COMPLETE
        values = None if number == 3 else [design.links[0], -design.links[1]]
        study.add_trial(create_trial(params=dict(design.params), distributions=space, values=values, state=state))
    study.sampler = aw.surrogate_sampler(p)(0)
    trial = study.ask(space)
    assert p.space.design(trial.params)
