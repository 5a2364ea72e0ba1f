"""Advice on the sampler for fast and slow evaluations."""

import armwright as aw
from armwright.runs.config import Method
from armwright.study.sampler_advice import sampler_advice

PROBLEM = aw.Problem(aw.load_task("target-1"))


@aw.evaluator("height [m]")
def height(arm: aw.Arm, task: aw.Task) -> float:
    """how high the base is"""
    return abs(arm.base[2])


def advice(problem: aw.Problem, sampler: str, seconds: float, n_trials: int = 4) -> str:
    method = Method(proposer=None, sampler=sampler, n_init=4, n_step=10, n_total=20)
    design = PROBLEM.space.sample(1, 0)[0]
    trials = [aw.FinishedTrial(n, "random", design, (1.0,), seconds={"evaluation": seconds}) for n in range(n_trials)]
    return sampler_advice(problem, method, trials)


def test_fast_evaluations_of_the_surrogate_are_reported_once() -> None:
    measured = aw.Problem(aw.load_task("target-1").model_copy(update={"reference_point": None}), evaluator=height)
    told = advice(measured, "surrogate", 0.005)
    assert "5.0 ms" in told
    assert "--sampler tpe" in told
    assert advice(measured, "surrogate", 0.005, n_trials=5) == ""
    assert "armwright design" in advice(PROBLEM, "surrogate", 0.005)
    assert advice(PROBLEM, "surrogate", 0.5) == advice(PROBLEM, "tpe", 0.005) == ""
