"""The screen of proposals: what is evaluated, recorded, resumed and replayed."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armwright as aw
from armwright.proof.results import read_summary
from armwright.proposers.rule_helpers import rule_of
from armwright.proposers.rules import STRUCTURE, RulesProposer
from armwright.runs.history import BBO, History
from armwright.runs.trial import FinishedTrial, ScreenedOut, parse_trial, trial_line
from armwright.search.surrogate.surrogate import LEAST_GAIN, LEAST_TRIALS, Observations, Surrogate

TASK = aw.load_task("target-1").model_copy(update={"reference_point": None})
SETTINGS: dict[str, Any] = {"sampler": "surrogate", "n_init": 16, "n_step": 2}


@aw.evaluator("shift [m]", "span [m]")
def measure(arm: aw.Arm, task: aw.Task) -> tuple[float, float]:
    """how far the base is in front, and how long the arm"""
    return 1.0 + arm.base[0], 0.1 + sum(link.length for link in arm.links)


class Repeating(aw.Proposer):
    """Proposes the worst of the first designs, which gains nothing."""

    name = "repeating"

    def propose(self, history: History, seed: int, number: int) -> aw.Proposal:
        """Return the design with the largest span."""
        worst = max(history.trials[:16], key=lambda trial: trial.values[1])
        return aw.Proposal(worst.design, id=f"{self.name}-{number:04d}")


class Replaying(Repeating):
    """Repeats the proposals of a run at the trials that it recorded."""

    def __init__(self, trials: Sequence[FinishedTrial]) -> None:
        self._trials = trials

    def recorded_trials(self) -> Sequence[FinishedTrial]:
        """Return the trials of the run."""
        return self._trials


def problem() -> aw.Problem:
    return aw.Problem(TASK, aw.paper_space(), evaluator=measure)


def observed(p: aw.Problem, designs: Sequence[aw.Design]) -> Observations:
    matrix = p.space.matrix(designs)
    values = np.array([measure(p.arm(design), p.task) for design in designs])
    return Observations(matrix, values, np.zeros(len(designs), dtype=bool), matrix[:0])


def told(trials: Sequence[FinishedTrial]) -> list[tuple[Any, ...]]:
    return [(t.number, t.source, t.design, t.values, t.proposal, t.request, t.screened) for t in trials]


def test_design_that_gains_nothing_is_rejected_with_its_prediction() -> None:
    p = problem()
    known = observed(p, p.space.sample(24, 5))
    worst = known.matrix[int(np.argmax(known.values.sum(axis=1)))]
    found = Surrogate(p).rejection(known, worst, 0)
    assert found is not None
    gain, predicted = found
    assert 0.0 <= gain < LEAST_GAIN
    assert predicted == pytest.approx(measure(p.arm(p.space.designs(worst[None])[0]), TASK), rel=0.5)


def test_best_candidate_is_not_rejected() -> None:
    p = problem()
    known, surrogate = observed(p, p.space.sample(24, 5)), Surrogate(p)
    assert surrogate.rejection(known, surrogate.choose(known, 0), 0) is None


def test_nothing_is_rejected_by_few_trials_or_a_poor_model() -> None:
    p = problem()
    known = observed(p, p.space.sample(24, 5))
    noisy = replace(known, values=np.random.default_rng(0).random((24, 2)))
    for poor in (known.before(LEAST_TRIALS - 1), noisy):
        assert all(Surrogate(p).rejection(poor, row, 0) is None for row in known.matrix[:5])


def test_trial_round_trips_the_rejected_proposal() -> None:
    run = aw.optimize(problem(), proposer="none", sampler="random", n_init=1, n_total=1)
    screened = ScreenedOut("rules", "rules-0001-size", 0.01, (0.1, 0.2))
    trial = FinishedTrial(0, BBO, run.trials[0].design, (1.0, 2.0), screened=screened)
    again = parse_trial(trial_line(trial), 0, run.config)
    assert again == trial
    assert again.request == (0, 0)


@pytest.mark.slow
def test_rejected_proposals_are_replaced_counted_and_resumed(tmp_path: Path) -> None:
    whole = aw.optimize(problem(), proposer=Repeating(), n_total=6, out=tmp_path / "whole", **SETTINGS)
    rejected = [trial for trial in whole.trials if trial.screened is not None]
    assert [trial.number for trial in rejected] == [16, 18, 20]
    assert {trial.source for trial in rejected} == {BBO}
    assert all(trial.proposal is None and trial.duplicate_of is None for trial in rejected)
    assert whole.summary["screened_out"] == {"repeating": 3}
    summary = read_summary(tmp_path / "whole")
    assert summary is not None
    assert summary["screened_out"] == {"repeating": 3}
    aw.optimize(problem(), proposer=Repeating(), n_total=3, out=tmp_path / "parts", **SETTINGS)
    aw.optimize(problem(), proposer=Repeating(), n_total=6, out=tmp_path / "parts", **SETTINGS)
    assert told(aw.read_run(tmp_path / "parts")[1].trials) == told(whole.trials)


@pytest.mark.slow
def test_replay_rejects_the_same_proposals() -> None:
    run = aw.optimize(problem(), proposer=Repeating(), n_total=4, **SETTINGS)
    assert sum(trial.screened is not None for trial in run.trials) == 2
    again = aw.optimize(problem(), proposer=Replaying(run.trials), n_total=4, **SETTINGS)
    assert told(again.trials) == told(run.trials)


def test_rules_count_rejected_structures_as_opened() -> None:
    """Otherwise they would propose the same structure again, which would be rejected again."""
    p = problem()
    run = aw.optimize(p, proposer="none", sampler="random", n_init=16, n_total=1)
    first = RulesProposer().propose(run.history, 1, 16)
    assert rule_of(first.id) == STRUCTURE
    screened = ScreenedOut("rules", first.id, 0.01, (0.1, 0.2))
    trials = (*run.trials[:16], replace(run.trials[16], screened=screened))
    history = History(p, trials, 16, run.history.reference_point, run.config.study)
    second = RulesProposer().propose(history, 1, 18)
    assert second.design.joints != first.design.joints


def test_other_samplers_screen_nothing() -> None:
    run = aw.optimize(problem(), proposer=Repeating(), n_total=2, n_init=16, n_step=2, sampler="tpe")
    assert not run.config.study.screen
    assert run.trials[16].source == "repeating"
