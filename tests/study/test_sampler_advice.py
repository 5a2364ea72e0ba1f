"""Advice on the sampler for fast and slow evaluations."""

import pytest

import armwright as aw
from armwright.problem.problem import Problem
from armwright.runs.config import Method
from armwright.runs.trial import FinishedTrial
from armwright.study.sampler_advice import sampler_advice
from armwright.tasks.catalogue import load_task

PROBLEM = Problem(load_task("target-1"))


@aw.evaluator("height [m]")
def height(arm: aw.Arm, task: aw.Task) -> float:
    """how high the base is"""
    return abs(arm.base[2])


def advice(problem: Problem, sampler: str, seconds: float, n_trials: int = 4) -> str:
    method = Method(proposer=None, sampler=sampler, n_init=4, n_step=10, n_total=20)
    design = PROBLEM.space.sample(1, 0)[0]
    trials = [FinishedTrial(n, "random", design, (1.0,), seconds={"evaluation": seconds}) for n in range(n_trials)]
    return sampler_advice(problem, method, trials)


def test_fast_evaluations_are_reported_once() -> None:
    measured = Problem(load_task("target-1").model_copy(update={"reference_point": None}), evaluator=height)
    assert "5.0 ms" in advice(measured, "surrogate", 0.005)
    assert "--sampler tpe" in advice(measured, "surrogate", 0.005)
    assert advice(measured, "surrogate", 0.005, n_trials=5) == ""
    assert "armwright design" in advice(PROBLEM, "surrogate", 0.005)


@pytest.mark.parametrize(("sampler", "seconds"), [("surrogate", 0.5), ("tpe", 0.005)])
def test_slow_evaluations_and_other_samplers_need_no_advice(sampler: str, seconds: float) -> None:
    assert advice(PROBLEM, sampler, seconds) == ""
