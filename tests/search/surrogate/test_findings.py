"""What the surrogate learned: quality of predictions, effects of inputs, and corrections in words."""

import numpy as np
import pytest

import armwright as aw
from armwright.arrays import Array
from armwright.problem.evaluators import Evaluator
from armwright.problem.objective import Objective
from armwright.problem.objectives import LENGTH, PEAK_TORQUE, POSITION_ERROR, TORQUE
from armwright.problem.problem import Problem
from armwright.runs.history import RANDOM, History
from armwright.runs.surrogate_summary import SurrogateSummary
from armwright.runs.trial import FinishedTrial
from armwright.search.surrogate.correction import describe_correction
from armwright.search.surrogate.findings import largest_effects, quality, summarize_surrogate
from armwright.search.surrogate.response import choose_model
from armwright.search.surrogate.surrogate import Surrogate
from armwright.spaces.design_space import paper_space
from armwright.tasks.catalogue import load_task

TASK = load_task("target-1").model_copy(update={"reference_point": None})


@aw.evaluator("effort [N m]")
def effort(arm: aw.Arm, task: aw.Task) -> float:
    """1.4 times our largest torque"""
    return 1.4 * float(np.abs(aw.evaluate(arm, task).motor_torques).max())


@aw.evaluator("noise [N m]")
def noise(arm: aw.Arm, task: aw.Task) -> float:
    """a number that has nothing to do with our physics"""
    return 2.0 + float(np.sin(1e4 * sum(link.length for link in arm.links)))


def history_of(evaluator: Evaluator, n: int = 40) -> History:
    problem = Problem(TASK, paper_space(), evaluator=evaluator)
    designs = problem.space.sample(n, 3)
    trials = [FinishedTrial(i, RANDOM, d, evaluator(problem.arm(d), problem.task)) for i, d in enumerate(designs)]
    return History(problem, trials, n)


def learned(history: History) -> SurrogateSummary | None:
    return summarize_surrogate(Surrogate(history.problem), history)


def objective(unit: str) -> Objective:
    return Objective("energy", unit, "measured", lambda e: e.arms.length, over="arm")


def lognormal(seed: int, n: int = 60) -> Array:
    return np.random.default_rng(seed).lognormal(size=n)


@pytest.mark.slow
def test_multiple_of_a_torque_is_stated() -> None:
    summary = learned(history_of(effort))
    assert summary is not None
    (found,) = summary.objectives
    assert summary.designs == 40
    assert found.correction.startswith("effort is 1.4 times our peak torque")
    assert found.explained is not None
    assert found.explained > 0.95
    assert found.effects[0].name == "peak_torque"
    assert summary.trials == list(range(40))


@pytest.mark.slow
def test_predictions_explain_the_stated_share() -> None:
    history = history_of(effort)
    summary = learned(history)
    assert summary is not None
    (found,) = summary.objectives
    values, predicted = history.values[:, 0], np.array(found.predicted)
    if found.log_shift is not None:
        values, predicted = np.log(values + found.log_shift), np.log(predicted + found.log_shift)
    assert found.explained == pytest.approx(1.0 - np.mean((predicted - values) ** 2) / values.var(), abs=1e-4)


@pytest.mark.slow
def test_unrelated_objective_is_not_described() -> None:
    summary = learned(history_of(noise))
    assert summary is not None
    (found,) = summary.objectives
    assert found.correction == ""
    assert not found.effects
    assert found.explained is not None
    assert found.explained < 0.3


def test_few_designs_give_no_summary() -> None:
    assert learned(history_of(effort, n=9)) is None


def test_repeated_designs_and_failures_do_not_count() -> None:
    whole = history_of(effort, n=12)
    copies = [FinishedTrial(12 + i, RANDOM, whole.trials[0].design, (1.0,), duplicate_of=0) for i in range(3)]
    more = History(whole.problem, [*whole.trials, *copies], 12)
    assert learned(more) == learned(whole)


def test_corrections_are_for_custom_objectives_only() -> None:
    problem = Problem(TASK)
    designs = problem.space.sample(24, 3)
    values = problem.evaluate(designs).values.tolist()
    pairs = zip(designs, values, strict=True)
    trials = [FinishedTrial(i, RANDOM, d, tuple(row)) for i, (d, row) in enumerate(pairs)]
    summary = learned(History(problem, trials, 24))
    assert summary is not None
    assert [one.correction for one in summary.objectives] == ["", ""]
    assert [one.effects[0].name for one in summary.objectives] == ["position_error", "torque"]


def test_ratio_of_scaled_unit_is_in_the_objective_s_unit() -> None:
    torque = lognormal(0)
    text = describe_correction(objective("N m"), 1.2 * torque / 40.0, {TORQUE: torque})
    assert text == "energy is 1.2 times our torque (80 % of designs: 1.2)"
    text = describe_correction(objective("N m"), torque / 40.0, {TORQUE: torque})
    assert text == "energy equals our torque (80 % of designs: 1)"


@pytest.mark.parametrize("quantile", [0.3, 0.5, 0.8])
def test_long_and_short_arms_have_different_ratios(quantile: float) -> None:
    rng = np.random.default_rng(1)
    lengths, torque = rng.uniform(0.2, 1.0, 60), lognormal(2)
    threshold = float(f"{np.quantile(lengths, quantile):.2g}")
    values = torque * np.where(lengths > threshold, 1.4, 1.0) * rng.uniform(0.97, 1.03, 60)
    text = describe_correction(objective("N m"), values, {PEAK_TORQUE: torque, LENGTH: lengths})
    assert f"times our peak torque on arms longer than {threshold:g} m and" in text


def test_small_addition_is_a_difference() -> None:
    error = np.concatenate([np.full(20, 1e-4), np.linspace(0.1, 4.0, 20)])
    text = describe_correction(objective("m"), error + 0.07, {POSITION_ERROR: error, LENGTH: lognormal(9, 40)})
    assert text == "energy is within 0.074 m of our position error on 100 % of designs"


def test_other_units_give_a_trend_only() -> None:
    torque = lognormal(3)
    assert "energy grows with our peak torque" in describe_correction(objective("J"), torque**2, {PEAK_TORQUE: torque})
    assert "falls with growing" in describe_correction(objective("J"), 1.0 / torque, {PEAK_TORQUE: torque})


@pytest.mark.parametrize("seed", range(20))
def test_independent_quantities_are_not_mentioned(seed: int) -> None:
    quantities = {PEAK_TORQUE: lognormal(3 * seed, 20), TORQUE: lognormal(3 * seed + 1, 20)}
    assert describe_correction(objective("N m"), lognormal(3 * seed + 2, 20), quantities) == ""


def test_equal_numbers_that_hardly_vary_are_no_ratio() -> None:
    rng = np.random.default_rng(4)
    length, value = rng.uniform(1.0, 1.1, 40), rng.uniform(2.0, 2.2, 40)
    assert describe_correction(objective("m"), value, {LENGTH: length}) == ""


def test_constants_zeros_and_few_designs_are_no_evidence() -> None:
    error = np.concatenate([np.zeros(30), lognormal(5, 10)])
    assert describe_correction(objective("m"), np.ones(40), {POSITION_ERROR: error}) == ""
    assert describe_correction(objective("m"), lognormal(6, 40), {POSITION_ERROR: np.zeros(40)}) == ""
    assert describe_correction(objective("m"), error[-10:], {POSITION_ERROR: error[-10:]}) == ""


def test_quality_and_effects_of_a_known_function() -> None:
    inputs = np.random.default_rng(7).normal(size=(60, 4))
    values = np.exp(inputs[:, 1] + 0.5 * inputs[:, 2])
    model = choose_model({"physics": inputs}, values)
    explained, error = quality(model, inputs, values)
    assert explained is not None
    assert error is not None
    assert explained > 0.95
    assert error < 0.1
    effects = largest_effects(model, ["a", "b", "c", "d"], inputs, values)
    assert [effect.name for effect in effects] == ["b", "c"]
    assert effects[0].share == pytest.approx(0.8, abs=0.1)  # variances 1 and 0.25


def test_constant_objective_has_no_quality() -> None:
    inputs = np.random.default_rng(8).normal(size=(20, 2))
    values = np.full(20, 3.0)
    assert quality(choose_model({"physics": inputs}, values), inputs, values) == (None, None)
