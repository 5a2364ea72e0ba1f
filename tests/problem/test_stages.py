"""Arms whose evaluation ends early: what is not evaluated, and how designs are ordered."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import armwright as aw
from armwright.exceptions import SettingsError
from armwright.llm.feedback import Feedback
from armwright.pareto import NOT_EVALUATED, total_violation
from armwright.problem.evaluation import Evaluation
from armwright.problem.outcomes import Outcomes
from armwright.problem.problem import Problem
from armwright.proof.infeasibility import describe_infeasibility, feasibility_record
from armwright.runs.folder import read_run
from armwright.runs.history import RANDOM, History
from armwright.runs.trial import FinishedTrial

ALONG = ("jumps", "collision", "dynamic_utilisation", "speed_utilisation", "thermal_utilisation", "bearing_utilisation")


@cache
def problem() -> Problem:
    return Problem(aw.load_task("desk-sorting"), aw.load_space("desk-sorting"))


@cache
def evaluated() -> tuple[Evaluation, Outcomes]:
    matrix = problem().space.matrix(problem().space.sample(300, 0))
    evaluation = problem().physics(matrix)
    return evaluation, problem().outcomes(evaluation)


def history(off: int) -> History:
    """Return a history of designs that are far off, to the bit of their evaluation."""
    evaluation, outcomes = evaluated()
    designs = problem().space.sample(300, 0)
    rows = np.flatnonzero(evaluation.paths.is_off)[:off].tolist()
    trials = [
        FinishedTrial(number, RANDOM, designs[row], outcomes[row].values, violations=outcomes[row].violations)
        for number, row in enumerate(rows)
    ]
    return History(problem(), trials, len(trials))


def test_total_violation_orders_designs_by_stage_then_by_known_violation() -> None:
    evaluation, outcomes = evaluated()
    off, stopped = evaluation.paths.is_off, evaluation.is_stopped
    total = total_violation(outcomes.violations)
    assert off.any()
    assert (stopped & ~off).any()
    assert (~stopped).any()
    assert total[off].min() > total[stopped & ~off].max() > total[stopped & ~off].min() > total[~stopped].max()
    known = np.where(outcomes.violations < NOT_EVALUATED, outcomes.violations, 0.0)
    assert (np.argsort(total[off]) == np.argsort(total_violation(known)[off])).all()


def test_what_is_not_evaluated_is_never_a_number() -> None:
    evaluation, outcomes = evaluated()
    off, stopped = evaluation.paths.is_off, evaluation.is_stopped
    names = [constraint.quantity.name for constraint in problem().constraints]
    for name in ALONG:
        column = outcomes.violations[:, names.index(name)]
        unknown = off if name in ("jumps", "collision") else stopped
        assert (column[unknown] == NOT_EVALUATED).all()
        assert (column[~unknown] < NOT_EVALUATED).all()
    for name in ("unreached_targets", "path_error", "voltages"):
        assert (outcomes.violations[:, names.index(name)] < NOT_EVALUATED).all()
    price, time = outcomes.values.T
    assert np.isfinite(price).all()
    assert (np.isinf(time) == stopped).all()


def test_study_with_tpe_writes_null_and_reads_the_same_trials(tmp_path: Path) -> None:
    run = aw.optimize(problem(), proposer="none", sampler="tpe", n_total=10, n_step=5, verify=False, out=tmp_path / "r")
    lines = [json.loads(line) for line in (tmp_path / "r" / "trials.jsonl").read_text().splitlines()]
    unknown = [line for line in lines if None in line["values"]]
    assert unknown
    assert all(None in line["violations"] for line in unknown)
    assert "Infinity" not in json.dumps(lines)
    assert not any(NOT_EVALUATED in line["violations"] for line in lines)
    _, again = read_run(tmp_path / "r")
    assert [trial.outcome for trial in again] == [trial.outcome for trial in run.history]
    assert again.nearest(1) == [int(total_violation(run.history.violations).argmin())]


def test_texts_lead_with_the_missed_target_and_say_not_evaluated() -> None:
    found = history(5)
    record = feasibility_record(found)["feasibility"]
    text = describe_infeasibility(found)
    assert text.split("violates ")[1].startswith(("path_error", "unreached_targets", "path_angle"))
    assert "dynamic_utilisation <= 1 (not evaluated)" in text
    assert "1e+09" not in text + json.dumps(record, allow_nan=False)
    assert str(NOT_EVALUATED) not in json.dumps(record)
    assert record["nearest"]["measured"]["collision <= 0"] is None
    assert not record["conflict"]["admitting"]
    shown = Feedback(found, seed=0).records([0], [0])[0]
    assert "not evaluated" in shown["e_all"]
    assert shown["violated"].startswith("E_unreached =")
    assert "E_thermal not evaluated" in shown["violated"]


def test_arm_that_misses_by_far_has_no_trajectory() -> None:
    design = history(1).trials[0].design
    with pytest.raises(SettingsError, match="not evaluated"):
        aw.cycle_model(problem().arm(design), problem().task)
