"""Optuna samplers: asking, telling and injecting designs."""

from functools import partial

import optuna
import pytest
from optuna.samplers import BaseSampler, NSGAIISampler, RandomSampler, TPESampler

from armwright import Design, FinishedTrial, Problem, RulesProposer, extras, load_task, optimize, paper_space
from armwright.exceptions import DesignError, MissingExtraError, SettingsError
from armwright.runs.history import BBO, RANDOM, History
from armwright.search.samplers import BlackBox, SamplerFactory, sampler_factory, sampler_name
from armwright.seeding import SAMPLING, derived_seed
from armwright.spaces.optuna_distributions import distributions
from tests.support.extras import NEEDS_GP

SPACE = paper_space()
PROBLEM = Problem(load_task("target-1"))
LEARNING = ["tpe", "tpe-multivariate", "nsga2", pytest.param("gp", marks=NEEDS_GP)]


def finished(number: int, design: Design, source: str = RANDOM) -> FinishedTrial:
    values = PROBLEM.evaluate([design]).values[0].tolist()
    return FinishedTrial(number, source, design, tuple(values))


def fill(box: BlackBox, n: int, first: int = 0) -> list[FinishedTrial]:
    trials: list[FinishedTrial] = []
    for number in range(first, first + n):
        trial, design = box.draw(number, RANDOM if number < 10 else BBO)
        trials.append(finished(number, design))
        box.tell(trial, trials[-1].values)
    return trials


@pytest.mark.parametrize(("name", "value"), [("link_3", 1.4), ("joint_2", "Z"), ("origin_x", float("nan"))])
def test_injected_design_outside_space_is_refused(name: str, value: float | str) -> None:
    """Optuna takes an out-of-range value with a warning; an unknown category leaves its trial RUNNING."""
    box = BlackBox(SPACE, "tpe", seed=0)
    wrong = Design({**SPACE.sample(1, 0)[0].params, name: value})
    with pytest.raises(DesignError, match=name):
        box.inject(wrong, 0)
    assert box.study.get_trials(deepcopy=False) == []


@pytest.mark.parametrize("sampler", LEARNING)
def test_named_samplers_learn_from_rules_proposals(sampler: str) -> None:
    """What it draws depends on how well a proposal among the first ten did."""

    def drawn(*values: float) -> list[Design]:
        box = BlackBox(SPACE, sampler, seed=0)
        trials = fill(box, 8)
        proposal = RulesProposer().propose(History(PROBLEM, trials, 8), seed=0, number=8)
        box.tell(box.inject(proposal.design, 8)[0], values)
        assert box.study.trials[8].params == dict(proposal.design.params)
        return [trial.design for trial in fill(box, 4, first=9)][1:]

    assert drawn(9.0, 9.0) == drawn(9.0, 9.0)
    assert drawn(9.0, 9.0) != drawn(0.1, 0.1)


def test_factory_names_are_unique_and_stable() -> None:
    def made(cls: type[BaseSampler], **settings: int) -> SamplerFactory:
        return lambda seed: cls(seed=seed, **settings)

    class Factory:
        def __init__(self, size: int) -> None:
            self.size = size

        def __repr__(self) -> str:
            return f"Factory({self.size})"

        def __call__(self, seed: int) -> BaseSampler:
            return NSGAIISampler(population_size=self.size, seed=seed)

    def factories() -> list[SamplerFactory]:
        several = [lambda s: RandomSampler(s), lambda s: TPESampler(seed=s), lambda s: TPESampler(seed=s + 1)]
        several += [made(RandomSampler), made(TPESampler), made(NSGAIISampler, population_size=4)]
        several += [made(NSGAIISampler, population_size=6), partial(made, RandomSampler), partial(made, TPESampler)]
        return [*several, Factory(4), Factory(6), Factory(6).__call__, RandomSampler, fill]

    names = [sampler_name(factory) for factory in factories()]
    assert len(set(names)) == len(names)
    assert names == [sampler_name(factory) for factory in factories()]
    assert sampler_name("tpe") == "tpe"
    assert sampler_name(fill) == "tests.search.test_samplers.fill"
    assert not any(" at 0x" in name for name in names)


def test_missing_gp_packages_name_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extras, "is_installed", lambda package: package != "torch")
    with pytest.raises(MissingExtraError, match=r'gp needs torch: pip install "armwright\[gp\]"'):
        optimize(PROBLEM, proposer="none", sampler="gp")


def test_random_trials_are_independent_of_the_sampler() -> None:
    """Methods compared by seed therefore start equally."""
    a = fill(BlackBox(SPACE, "tpe", seed=3), 10)
    b = fill(BlackBox(SPACE, "random", seed=3), 10)
    assert [trial.design for trial in a] == [trial.design for trial in b]


def test_genetic_samplers_use_injected_designs_as_parents() -> None:
    """NSGA-II passes over enqueued trials unless they were given a generation."""

    def nsga2(seed: int) -> BaseSampler:
        return NSGAIISampler(population_size=4, mutation_prob=0.0, crossover_prob=0.0, seed=seed)

    box = BlackBox(SPACE, nsga2, seed=0)
    injected = SPACE.sample(4, 11)
    for number, design in enumerate(injected):
        box.tell(box.inject(design, number)[0], (1.0 + number, 5.0 - number))
    generations = [
        value for trial in box.study.trials for name, value in trial.system_attrs.items() if name.endswith("generation")
    ]
    assert generations == [0, 0, 0, 0]
    child = box.draw(4, BBO)[1]
    assert child in injected  # without crossover and mutation a child is a parent


def test_tpe_has_settings_of_the_paper() -> None:
    """The same draws as a plain Optuna study with the sampler that docs/method.md §5 pins."""
    box, plain = BlackBox(SPACE, "tpe", seed=4), optuna.create_study(directions=["minimize"] * 2)
    for trial in fill(box, 30):
        seed = derived_seed(4, SAMPLING, trial.number)
        pinned = TPESampler(n_startup_trials=10, multivariate=False, constant_liar=False, seed=seed)
        plain.sampler = RandomSampler(seed=seed) if trial.number < 10 else pinned
        asked = plain.ask(distributions(SPACE))
        assert asked.params == dict(trial.design.params)
        plain.tell(asked, trial.values)


def test_unknown_sampler_is_refused_with_suggestion() -> None:
    with pytest.raises(SettingsError, match=r'unknown sampler "tp".*Did you mean "tpe".*tpe-multivariate, nsga2, gp'):
        sampler_factory("tp")


def test_optuna_verbosity_of_the_user_is_restored(capfd: pytest.CaptureFixture[str]) -> None:
    before = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.INFO)
    try:
        BlackBox(SPACE, "tpe", seed=0)
        assert optuna.logging.get_verbosity() == optuna.logging.INFO
        assert capfd.readouterr().err == ""
    finally:
        optuna.logging.set_verbosity(before)
