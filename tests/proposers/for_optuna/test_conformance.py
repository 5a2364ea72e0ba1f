"""Optuna's conformance suite for samplers, applied to studies with proposals."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import pytest
from optuna.distributions import IntDistribution
from optuna.samplers import (
    BaseSampler,
    GridSampler,
    NSGAIISampler,
    PartialFixedSampler,
    RandomSampler,
    TPESampler,
)
from optuna.storages import BaseStorage, InMemoryStorage, JournalStorage, RDBStorage
from optuna.storages.journal import JournalFileBackend
from optuna.testing.pytest_samplers import BasicSamplerTestCase
from optuna.trial import FrozenTrial, TrialState

import armwright as aw
from armwright.exceptions import SettingsError

pytestmark = pytest.mark.filterwarnings("ignore::optuna.exceptions.ExperimentalWarning")


class TestOptunasOwnSuite(BasicSamplerTestCase):
    """Its tests that optimise, with proposals; `first` so that none is left over where they count trials."""

    # These look at the sampler alone.
    test_float = test_int = test_categorical = test_conditional_sample_independent = None  # type: ignore[assignment]
    test_sample_single_distribution = None  # type: ignore[assignment]
    test_partial_fixed_sampling = None  # type: ignore[assignment]  # proposals go before samplers; see below

    @pytest.fixture(params=[RandomSampler, TPESampler, NSGAIISampler])
    def sampler(
        self, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
    ) -> Iterator[Callable[[], BaseSampler]]:
        optimize, made = optuna.Study.optimize, []

        def proposing(self: optuna.Study, *arguments: Any, **others: Any) -> None:
            made.append(rules(5, first=2))
            optimize(self, *arguments, **others, callbacks=[made[-1]])

        monkeypatch.setattr(optuna.Study, "optimize", proposing)
        yield lambda: request.param(seed=0)
        assert sum(callback.proposed for callback in made) > 0
        assert not any(callback.faults for callback in made)


def mixed(trial: optuna.Trial) -> float:
    """Each kind of parameter, some of them conditional, some of a single value."""
    value = trial.suggest_float("plain", -1.0, 1.0) ** 2
    value += abs(np.log10(trial.suggest_float("log", 1e-7, 1.0, log=True)) + 3)
    value += trial.suggest_float("stepped", -10.2, 10.2, step=0.1) ** 2
    value += trial.suggest_int("whole", -10, 10, step=2) + trial.suggest_int("log whole", 1, 100, log=True)
    value += trial.suggest_int("single", 3, 3) + trial.suggest_categorical("only", (1,))
    match trial.suggest_categorical("kind", ("a", 1, None, True, 0.5)):
        case "a":
            value += trial.suggest_float("of a", 0.0, 1.0)
        case None:
            value += trial.suggest_int("of none", 0, 5)
        case _:
            value += 1.0
    return value


def two(trial: optuna.Trial) -> tuple[float, float]:
    value = mixed(trial)
    return value, -trial.params["plain"]


def of_rules(study: optuna.Study) -> list[FrozenTrial]:
    return [trial for trial in study.get_trials() if trial.user_attrs.get("source") == "rules"]


def rules(every: int = 3, **settings: Any) -> aw.ProposalCallback:
    return aw.ProposalCallback(aw.StudyRulesProposer(), every, **settings)


def finite(trial: optuna.Trial) -> float:
    """Forty points."""
    value = trial.suggest_float("x", 0.0, 1.0, step=0.25) + trial.suggest_int("y", 1, 4)
    return value + len(trial.suggest_categorical("kind", ["a", "bb"]))


GRID = {"x": [0.0, 0.25, 0.5, 0.75, 1.0], "y": [1, 2, 3, 4], "kind": ["a", "bb"]}
ABSTRACT = ("BaseSampler", "BaseGASampler", "nsgaii")  # the last is a module
EVERY_SAMPLER = {name: getattr(optuna.samplers, name) for name in optuna.samplers.__all__ if name not in ABSTRACT}
NEEDS = {"CmaEsSampler": "cmaes", "GPSampler": "torch"}  # packages that Optuna leaves to its users
ARGUMENTS: dict[str, Callable[[], tuple[Any, ...]]] = {
    "GridSampler": lambda: (GRID, 0),
    "PartialFixedSampler": lambda: ({"y": 2}, TPESampler(seed=0)),
}


class Partial(aw.StudyProposer):
    """Propose random values of some parameters."""

    name = "rules"

    def __init__(self, names: Sequence[str]) -> None:
        self.names = names

    def propose(self, study: optuna.Study, seed: int, number: int) -> aw.StudyProposal:
        draw = np.random.default_rng(seed)
        values = {name: GRID[name][draw.integers(len(GRID[name]))] for name in self.names}
        return aw.StudyProposal(values, f"rules-{number:04d}")


@pytest.mark.parametrize("names", [("x", "y", "kind"), ("x",), ()], ids=len)
@pytest.mark.parametrize("sampler", EVERY_SAMPLER)
@pytest.mark.fast_cases(3)
def test_every_sampler_of_optuna_accepts_proposals_or_is_refused(sampler: str, names: Sequence[str]) -> None:
    if sampler in NEEDS:
        pytest.importorskip(NEEDS[sampler])
    made = EVERY_SAMPLER[sampler](*ARGUMENTS[sampler]()) if sampler in ARGUMENTS else EVERY_SAMPLER[sampler](seed=0)
    study = optuna.create_study(sampler=made)
    callback = aw.ProposalCallback(Partial(names), every=3)
    if sampler == "GridSampler":
        with pytest.raises(SettingsError, match="sampler GridSampler: expected one that accepts proposals"):
            study.optimize(finite, n_trials=40, callbacks=[callback])
        assert len(study.trials) == 1  # at its first call, not when the first proposal is due
        return
    study.optimize(finite, n_trials=40, callbacks=[callback])
    assert {trial.state for trial in study.trials} <= {TrialState.COMPLETE, TrialState.WAITING}
    assert (callback.proposed, callback.faults) == (13, {})
    assert [trial.number for trial in of_rules(study)] == list(range(2, 40, 3))


@pytest.mark.parametrize("wrapped", [False, True])
def test_custom_and_wrapped_grid_samplers_are_refused(wrapped: bool) -> None:
    class Lattice(GridSampler):
        """A custom sampler that inherits the counting of cells."""

    sampler = Lattice(GRID, seed=0)
    study = optuna.create_study(sampler=PartialFixedSampler({"y": 2}, sampler) if wrapped else sampler)
    with pytest.raises(SettingsError, match="sampler Lattice: expected one that accepts proposals"):
        study.optimize(finite, n_trials=40, callbacks=[rules()])


@pytest.fixture(params=["memory", pytest.param("sqlite", marks=pytest.mark.slow), "journal"])
def storage(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[BaseStorage]:
    if request.param == "memory":
        yield InMemoryStorage()
    elif request.param == "journal":
        yield JournalStorage(JournalFileBackend(str(tmp_path / "journal")))
    else:
        database = RDBStorage(f"sqlite:///{tmp_path / 'study.db'}")
        yield database
        database.remove_session()
        database.engine.dispose()


def test_proposals_survive_in_every_storage(storage: BaseStorage) -> None:
    study = optuna.create_study(storage=storage, directions=["minimize"] * 2, sampler=TPESampler(seed=0))
    study.optimize(two, n_trials=12, callbacks=[rules()])
    again = optuna.load_study(study_name=study.study_name, storage=storage, sampler=TPESampler(seed=1))
    again.optimize(two, n_trials=6, callbacks=[rules()])
    assert [trial.number for trial in of_rules(again)] == list(range(2, 18, 3))
    assert [set(trial.user_attrs) for trial in of_rules(again)] == [{"source", "proposal", "reason"}] * 6


def test_failed_pruned_and_nan_trials_are_ignored() -> None:
    def broken(trial: optuna.Trial) -> float:
        value = mixed(trial)
        if "proposal" not in trial.user_attrs and trial.number % 4:
            return value
        if trial.number % 4 == 0:
            raise RuntimeError("broken")
        if trial.number % 4 == 1:
            raise optuna.TrialPruned
        return float("nan")

    study = optuna.create_study(sampler=TPESampler(seed=0))
    callback = rules()
    study.optimize(broken, n_trials=40, catch=(RuntimeError,), callbacks=[callback])
    assert (callback.proposed, callback.faults) == (13, {})
    assert {trial.state for trial in of_rules(study)} == {TrialState.FAIL, TrialState.PRUNED}
    assert {trial.state for trial in study.trials} == {TrialState.COMPLETE, TrialState.FAIL, TrialState.PRUNED}


def test_maximising_the_negated_objective_gives_the_same_study() -> None:
    def proposals(direction: str, sign: float, seed: int = 0) -> list[dict[str, Any]]:
        study = optuna.create_study(directions=[direction, "minimize"], sampler=RandomSampler(seed=0))
        study.optimize(lambda t: (sign * mixed(t), t.params["plain"]), n_trials=30, callbacks=[rules(seed=seed)])
        return [trial.params for trial in of_rules(study)]

    assert proposals("minimize", 1.0) == proposals("maximize", -1.0) != proposals("maximize", -1.0, seed=1)


def test_infeasible_trials_are_not_parents() -> None:
    def objective(trial: optuna.Trial) -> float:
        x, y = trial.suggest_float("x", 0.0, 1.0), trial.suggest_categorical("y", ["allowed", "forbidden"])
        trial.set_constraint("forbidden", 1.0 if y == "forbidden" else -1.0)
        return x - 9.0 * (y == "forbidden")

    study = optuna.create_study(sampler=TPESampler(seed=0))
    study.optimize(objective, n_trials=60, callbacks=[rules()])
    late = [trial for trial in of_rules(study) if trial.number > 12]  # by then two are feasible
    by_rule = [(trial.user_attrs["proposal"].rpartition("-")[2], trial.params["y"]) for trial in late]
    assert len(by_rule) == 16
    assert {y for rule, y in by_rule if rule != "swap"} == {"allowed"}


def test_stated_space_keeps_a_fixed_parameter() -> None:
    """Enqueued trials bypass samplers, so PartialFixedSampler alone does not bind proposals."""
    study = optuna.create_study(sampler=TPESampler(seed=0))
    study.optimize(mixed, n_trials=5)
    study.sampler = PartialFixedSampler({"whole": 4}, study.sampler)
    callback = aw.ProposalCallback(aw.StudyRulesProposer(space={"whole": IntDistribution(4, 4)}), every=2)
    study.optimize(mixed, n_trials=15, callbacks=[callback])
    assert len(of_rules(study)) >= 7
    assert {trial.params["whole"] for trial in study.trials[5:]} == {4}
