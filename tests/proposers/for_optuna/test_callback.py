"""Proposals in a plain `study.optimize`."""

import logging
from collections import Counter
from collections.abc import Iterator
from typing import Any

import optuna
import pytest
from optuna.samplers import NSGAIIISampler, NSGAIISampler, TPESampler
from optuna.trial import TrialState

from armwright import ProposalCallback, RulesProposer
from armwright.exceptions import ProposalError, SettingsError
from armwright.proposers.for_optuna.proposer import StudyProposal, StudyProposer


class Told(StudyProposer):
    """Proposes (x, y) that nobody else draws: x is the number that was asked for."""

    name = "told"

    def __init__(self, **others: Any) -> None:
        self.others = others

    def propose(self, study: optuna.Study, seed: int, number: int) -> StudyProposal:
        return StudyProposal({"x": float(number), "y": 3, **self.others}, f"told-{number:04d}", "as told")


class Failing(Told):
    """Fails with one fault after the other; then it proposes."""

    def __init__(self, *faults: ProposalError) -> None:
        super().__init__()
        self.left = list(faults)
        self.asked = 0

    def propose(self, study: optuna.Study, seed: int, number: int) -> StudyProposal:
        self.asked += 1
        if self.left:
            raise self.left.pop(0)
        return super().propose(study, seed, number)


def objective(trial: optuna.Trial) -> float:
    return trial.suggest_float("x", 0.0, 1000.0) + trial.suggest_int("y", 1, 9, step=2)


@pytest.fixture
def log() -> Iterator[list[str]]:
    """What goes through Optuna's logger."""
    lines: list[str] = []

    class Lines(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            lines.append(record.getMessage())

    handler = Lines(logging.WARNING)
    logging.getLogger("optuna").addHandler(handler)
    yield lines
    logging.getLogger("optuna").removeHandler(handler)


def proposals(study: optuna.Study) -> list[optuna.trial.FrozenTrial]:
    return [trial for trial in study.trials if trial.user_attrs.get("source") == "told"]


def tpe(seed: int = 0, **settings: Any) -> optuna.Study:
    return optuna.create_study(sampler=TPESampler(seed=seed), **settings)


def two(seed: int = 0) -> optuna.Study:
    """A study of two objectives."""
    return tpe(seed, directions=["minimize"] * 2)


def test_one_trial_per_block_is_a_proposal() -> None:
    study = tpe()
    callback = ProposalCallback(Told(), every=10)
    study.optimize(objective, n_trials=30, callbacks=[callback])
    assert [trial.number for trial in proposals(study)] == [9, 19, 29]
    assert [trial.params for trial in proposals(study)] == [{"x": float(n), "y": 3} for n in (9, 19, 29)]
    assert proposals(study)[0].user_attrs == {"source": "told", "proposal": "told-0009", "reason": "as told"}
    assert {trial.state for trial in study.trials} == {TrialState.COMPLETE}
    assert (callback.proposed, callback.faults) == (3, Counter())


@pytest.mark.parametrize(
    ("every", "first", "numbers"),
    [(10, 10, [10, 20]), (4, 1, [1, 5, 9, 13, 17, 21]), (1, 20, [20, 21, 22]), (30, 9, [9])],
)
def test_first_proposal_follows_the_initial_trials(every: int, first: int, numbers: list[int]) -> None:
    study = tpe()
    study.optimize(objective, n_trials=23, callbacks=[ProposalCallback(Told(), every, first=first)])
    assert len(study.trials) - 23 == (every == 1)  # one more waits where every trial asks
    assert [trial.number for trial in proposals(study)][: len(numbers)] == numbers


@pytest.mark.parametrize("sampler", [TPESampler(seed=0), NSGAIISampler(population_size=8, seed=0)])
def test_each_block_has_one_proposal_with_threads(sampler: optuna.samplers.BaseSampler) -> None:
    study = optuna.create_study(sampler=sampler)
    callback = ProposalCallback(Told(), every=5)
    study.optimize(objective, n_trials=60, n_jobs=4, callbacks=[callback])
    study.optimize(objective, n_trials=4)  # takes what the last block left waiting
    came = sorted((trial.user_attrs["proposal"], trial.params["x"]) for trial in proposals(study))
    assert came == [(f"told-{n:04d}", float(n)) for n in range(4, 60, 5)]
    assert {trial.state for trial in study.trials} == {TrialState.COMPLETE}
    assert callback.proposed == 12


@pytest.mark.filterwarnings("ignore::optuna.exceptions.ExperimentalWarning")
@pytest.mark.parametrize("genetic", [NSGAIISampler, NSGAIIISampler])
def test_genetic_samplers_use_proposals_as_parents(genetic: type[NSGAIISampler]) -> None:
    """Genetic samplers skip enqueued trials without a generation, so `enqueue_trial` alone gives no parents."""

    class Best(Told):
        def propose(self, study: optuna.Study, seed: int, number: int) -> StudyProposal:
            return StudyProposal({"x": 0.001 * number, "y": 1}, f"told-{number}")

    sampler = genetic(population_size=4, mutation_prob=0.0, crossover_prob=0.0, seed=0)
    study = optuna.create_study(directions=["minimize"] * 2, sampler=sampler)
    callback = ProposalCallback(Best(), every=2)
    study.optimize(lambda trial: (objective(trial),) * 2, n_trials=4, callbacks=[callback])
    study.optimize(lambda trial: (objective(trial),) * 2, n_trials=30)
    assert [trial.system_attrs[f"{genetic.__name__}:generation"] for trial in study.trials[:4]] == [0] * 4
    # Without crossover and mutation each child is a parent, and the best take over.
    assert {trial.params["x"] for trial in study.trials[20:]} <= {0.001, 0.003}


@pytest.mark.parametrize(
    ("others", "words"),
    [
        ({"y": 2}, "y = 2 is between the steps of 1 <= y <= 9 in steps of 2"),
        ({"kind": "c"}, "kind = 'c' is not one of a, b"),
        ({"z": 1.0}, 'unknown parameter "z"'),
    ],
)
def test_proposals_outside_the_space_are_refused(others: dict[str, Any], words: str, log: list[str]) -> None:
    """Optuna takes an out-of-range value with a warning; an unknown category leaves its trial RUNNING."""
    study = tpe()
    callback = ProposalCallback(Told(**others), every=5)

    def of_a_kind(trial: optuna.Trial) -> float:
        return objective(trial) + len(trial.suggest_categorical("kind", ["a", "b"]))

    study.optimize(of_a_kind, n_trials=10, callbacks=[callback])
    assert callback.faults == {"design": 2}
    assert proposals(study) == []
    assert len(study.trials) == 10
    assert [line for line in log if words in line] == log
    assert len(log) == 2
    assert log[0].endswith("the study continues without this proposal")


def test_proposer_fault_does_not_stop_the_study(log: list[str]) -> None:
    study = tpe()
    callback = ProposalCallback(Failing(ProposalError("timeout", "too slow"), ProposalError("answer", "what?")), 5)
    study.optimize(objective, n_trials=20, callbacks=[callback])
    assert callback.faults == {"timeout": 1, "answer": 1}
    assert [trial.number for trial in proposals(study)] == [14, 19]
    assert log == [f"{words}; the study continues without this proposal" for words in ("too slow", "what?")]


def test_permanent_fault_is_logged_once(log: list[str]) -> None:
    proposer = Failing(ProposalError("key", "wrong key", final=True))
    callback = ProposalCallback(proposer, 5)
    study = tpe()
    study.optimize(objective, n_trials=20, callbacks=[callback])
    assert (proposer.asked, callback.faults, proposals(study)) == (1, {"key": 4}, [])
    assert log == ["wrong key; no more proposals are requested"]


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"proposer": RulesProposer()}, "expected an instance of StudyProposer, got .*RulesProposer"),
        ({"proposer": Told}, "expected an instance of StudyProposer, got <class .*Told"),
        ({"proposer": Told(), "every": 0}, "every: expected a whole number from 1 to .*, got 0"),
        ({"proposer": Told(), "every": 2.5}, "every: expected a whole number from 1 to .*, got 2.5"),
        ({"proposer": Told(), "first": 0}, "first: expected a whole number from 1 to .*, got 0"),
    ],
)
def test_invalid_settings_are_refused(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(SettingsError, match=words):
        ProposalCallback(**settings)
