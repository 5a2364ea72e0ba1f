"""Rules for any Optuna study."""

import math
from typing import Any

import numpy as np
import optuna
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from optuna.distributions import BaseDistribution, CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.samplers import RandomSampler
from optuna.trial import TrialState, create_trial

import armwright as aw
from armwright.exceptions import ProposalError
from armwright.proposers.for_optuna.parameter_values import checked_value, from_unit, is_number, to_unit
from armwright.proposers.for_optuna.rules import RULES, draw_rule, rule_successes
from armwright.proposers.for_optuna.study_view import StudyView
from tests.proposers.for_optuna.test_parameters import categories, floats, ints

SPACE: dict[str, BaseDistribution] = {
    "kind": CategoricalDistribution(["flat", "curved"]),
    "lr": FloatDistribution(1e-4, 1.0, log=True),
    "depth": IntDistribution(1, 9, step=2),
    "bend": FloatDistribution(-1.0, 1.0),  # of curved alone
    "one": CategoricalDistribution(["only"]),
}


def params(kind: str, lr: float, depth: int, bend: float = 0.0) -> dict[str, Any]:
    return {"kind": kind, "lr": lr, "depth": depth, "one": "only"} | ({"bend": bend} if kind == "curved" else {})


def row(own: dict[str, Any], values: tuple[float, ...], **more: Any) -> optuna.trial.FrozenTrial:
    return create_trial(params=own, distributions={name: SPACE[name] for name in own}, values=list(values), **more)


def study_of(trials: list[tuple[dict[str, Any], tuple[float, ...]]], directions: tuple[str, ...]) -> optuna.Study:
    study = optuna.create_study(directions=directions)
    study.add_trials([row(own, values) for own, values in trials])
    return study


FRONT = [
    (params("flat", 0.001, 3), (0.0, 4.0)),
    (params("flat", 0.1, 7), (1.0, 1.0)),
    (params("curved", 0.5, 9, 0.5), (1.5, 0.0)),
    (params("flat", 1.0, 1), (9.0, 9.0)),
]
TWO = ("minimize", "minimize")


def made(rule: str, study: optuna.Study, seed: int) -> tuple[dict[str, Any], str]:
    view = StudyView.of(study, aw.StudyRulesProposer().space(study), "rules")
    return RULES[rule](view, np.random.default_rng(seed))


@pytest.mark.filterwarnings("ignore:The distribution is specified by:UserWarning")
@given(st.one_of(ints(), floats()), st.floats(-0.5, 1.5))
def test_unit_scale_round_trips(drawn: tuple[BaseDistribution, Any], share: float) -> None:
    distribution, value = drawn
    assume(is_number(distribution))
    assert 0.0 <= to_unit(value, distribution) <= 1.0 + 1e-9
    assert from_unit(to_unit(value, distribution), distribution) == pytest.approx(value, rel=1e-9, abs=1e-9)
    there = from_unit(share, distribution)
    assert checked_value("x", there, distribution) == there
    ends = [from_unit(-0.1, distribution), from_unit(1.1, distribution)]
    assert ends == pytest.approx([distribution.low, distribution.high], rel=1e-12)


@st.composite
def trials(draw: st.DrawFn) -> tuple[dict[str, BaseDistribution], list[dict[str, Any]], list[list[float]]]:
    names = draw(st.lists(st.text(max_size=9), min_size=1, max_size=4, unique=True))
    kinds = {name: draw(st.one_of(ints(), floats(), categories())) for name in names}
    objectives, n = draw(st.integers(1, 3)), draw(st.integers(1, 9))
    values = st.lists(st.floats(allow_nan=False), min_size=objectives, max_size=objectives)
    rows: list[dict[str, Any]] = []
    for _ in range(n):
        among = draw(st.lists(st.sampled_from(names), min_size=1, unique=True))
        rows.append({name: kinds[name][1] for name in among})
    return {name: kind[0] for name, kind in kinds.items()}, rows, [draw(values) for _ in range(n)]


@pytest.mark.filterwarnings("ignore:The distribution is specified by:UserWarning")
@given(trials(), st.integers(0, 2**31))
def test_rules_stay_in_the_space_of_any_study(
    drawn: tuple[dict[str, BaseDistribution], list[dict[str, Any]], list[list[float]]], seed: int
) -> None:
    """For any parameter kinds, conditions and values, Optuna accepts the proposals."""
    space, rows, values = drawn
    study = optuna.create_study(directions=["minimize"] * len(values[0]))
    for row, value in zip(rows, values, strict=True):
        study.add_trial(create_trial(params=row, distributions={n: space[n] for n in row}, values=value))
    proposer = aw.StudyRulesProposer()
    proposal = proposer.propose(study, seed, 7)
    assert proposal.params
    for name, value in proposal.params.items():
        assert space[name]._contains(space[name].to_internal_repr(value))
    assert proposal == proposer.propose(study, seed, 7)


def test_gap_rule_proposes_between_neighbours() -> None:
    study = study_of(FRONT, TWO)
    for seed in range(20):
        own, reason = made("fill", study, seed)
        a, b = (int(word) for word in reason.split("trials ")[1].split(" and "))
        assert {a, b} in ({0, 1}, {1, 2})
        low, high = sorted(FRONT[i][0]["lr"] for i in (a, b))
        assert low < own["lr"] < high
    reasons = [made("fill", study, seed)[1] for seed in range(60)]
    assert sum("0" in reason for reason in reasons) > 30  # the wider gap more often


def test_extrapolation_rule_extends_the_front_ends() -> None:
    """The trials of least first value have ever smaller lr: so the next has."""
    study = study_of([(params("flat", 10.0 ** -(3 - i), 5), (i, -i)) for i in range(3)], TWO)
    for seed in range(20):
        own, reason = made("extend", study, seed)
        assert own["lr"] < 1e-3 if reason.startswith("beyond trial 0") else own["lr"] > 0.1


def test_swapped_choice_brings_its_conditional_parameters() -> None:
    study = study_of(FRONT, TWO)
    for seed in range(20):
        own, reason = made("swap", study, seed)
        assert ("bend" in own) == (own["kind"] == "curved")
        if own["kind"] == "curved":
            assert own["bend"] == 0.5
        assert reason.endswith(f"with kind = {own['kind']}")


@pytest.mark.parametrize("direction", ["minimize", "maximize"])
def test_trend_rule_descends(direction: str) -> None:
    """If the value grows with x and falls with y, then x falls and y grows."""
    rng = np.random.default_rng(0)
    sign = 1.0 if direction == "minimize" else -1.0
    study = optuna.create_study(direction=direction)
    space = {name: FloatDistribution(0.0, 1.0) for name in "xyz"}
    for x, y, z in rng.uniform(0.3, 0.7, (30, 3)).tolist():
        own = {"x": x, "y": y, "z": z}
        study.add_trial(create_trial(params=own, distributions=space, value=sign * (3 * x - y)))
    best = study.best_params
    for seed in range(10):
        own, _ = made("trend", study, seed)
        assert own["x"] < best["x"]
        assert own["y"] > best["y"]
        assert best["x"] - own["x"] > abs(own["z"] - best["z"])


def test_exhausted_space_repeats_designs_without_a_fault() -> None:
    """Proposals find the remaining five of eight points, then repeat."""
    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))
    callback = aw.ProposalCallback(aw.StudyRulesProposer(), every=1, first=3)

    def objective(trial: optuna.Trial) -> float:
        return trial.suggest_int("x", 0, 3) + trial.suggest_categorical("y", [0, 1])

    study.optimize(objective, n_trials=6, callbacks=[callback])
    tried = [tuple(trial.params.values()) for trial in study.trials if trial.params]
    assert all(own not in tried[:number] for number, own in enumerate(tried) if number >= 3)
    study.optimize(objective, n_trials=20, callbacks=[callback])
    assert (callback.proposed, callback.faults) == (24, {})


def test_successful_rules_are_chosen_more_often() -> None:
    study = study_of(FRONT[:2], TWO)
    for i in range(12):
        rule, values = ("cross", (-1.0 - i, -1.0 - i)) if i % 2 else ("trend", (9.0, 9.0))
        source = {"source": "rules", "proposal": f"rules-{i:04d}-{rule}"}
        study.add_trial(row(params("flat", 0.2, 5), values, user_attrs=source))
    view = StudyView.of(study, SPACE, "rules")
    assert rule_successes(view) == {"fill": (0, 0), "extend": (0, 0), "cross": (6, 0), "swap": (0, 0), "trend": (0, 6)}
    rules = [draw_rule(view, np.random.default_rng(seed)) for seed in range(200)]
    assert rules.count("cross") > 3 * rules.count("trend")


def test_trials_outside_a_changed_range_are_ignored() -> None:
    study = optuna.create_study(sampler=RandomSampler(seed=0))
    for high in (10.0, 5.0):
        for _ in range(5):
            trial = study.ask()
            study.tell(trial, trial.suggest_float("x", 0.0, high))
    view = StudyView.of(study, aw.StudyRulesProposer().space(study), "rules")
    assert 5 <= len(view.params) < 10
    assert all(0.0 <= own["x"] <= 5.0 for own in view.params)
    for seed in range(30):
        assert 0.0 <= aw.StudyRulesProposer().propose(study, seed, seed).params.get("x", 0.0) <= 5.0


def test_study_without_parameters_gets_no_proposal() -> None:
    study = optuna.create_study()
    study.tell(study.ask(), state=TrialState.FAIL)
    with pytest.raises(ProposalError, match="no trial has shown a parameter yet"):
        aw.StudyRulesProposer().propose(study, 0, 0)


def test_second_proposal_is_far_from_a_single_trial() -> None:
    study = study_of([(params("flat", 1e-4, 1), (1.0,))], ("minimize",))
    proposal = aw.StudyRulesProposer().propose(study, 0, 1)
    assert (proposal.id, proposal.reason) == ("rules-0001-far", "far from all trials")
    assert proposal.params["depth"] > 5
    assert math.log10(proposal.params["lr"]) > -2


def test_enqueued_trials_may_lie_outside_the_space() -> None:
    """Enqueued trials may have unseen kinds of parameters or unknown names."""
    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))
    study.enqueue_trial({"kind": "a", "x": 0.5, "old": 3})
    study.enqueue_trial({"kind": "b", "y": 0.5})

    def objective(trial: optuna.Trial) -> float:
        return trial.suggest_float("x" if trial.suggest_categorical("kind", ["a", "b"]) == "a" else "y", 0.0, 1.0)

    callback = aw.ProposalCallback(aw.StudyRulesProposer(), every=2)
    study.optimize(objective, n_trials=8, callbacks=[callback])
    assert (callback.proposed, callback.faults) == (4, {})


@pytest.mark.parametrize("much", [math.inf, 1e300])
def test_infinite_violations_are_handled(much: float) -> None:
    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))

    def objective(trial: optuna.Trial) -> float:
        x = trial.suggest_float("x", 0.0, 1.0)
        trial.set_constraint("c", -1.0 if trial.number == 3 else much * (1.0 + x))
        return x

    callback = aw.ProposalCallback(aw.StudyRulesProposer(), every=2)
    study.optimize(objective, n_trials=40, callbacks=[callback])
    assert (callback.proposed, callback.faults) == (20, {})
