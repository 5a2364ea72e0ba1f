"""The black box: Optuna asks and is told. The only file that builds Optuna studies and samplers.

A fresh sampler, seeded from (seed, trial number), draws each trial: a resumed sampler with one seed for the
whole run would repeat its first draws, this one goes on as if it had never stopped.
"""

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from types import CodeType, FunctionType, MethodType
from typing import Any
from zlib import crc32

import optuna
from optuna.exceptions import ExperimentalWarning
from optuna.samplers import BaseSampler, GPSampler, NSGAIISampler, RandomSampler, TPESampler
from optuna.storages import InMemoryStorage
from optuna.study import StudyDirection
from optuna.trial import Trial, create_trial

from armwright.exceptions import SettingsError, did_you_mean
from armwright.extras import check_extra
from armwright.runs.history import RANDOM
from armwright.runs.trial import FinishedTrial
from armwright.seeding import SAMPLING, derived_seed
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.optuna_distributions import distributions, quietly
from armwright.spaces.parameters import Design, FloatParameter, ParameterValue

SamplerFactory = Callable[[int], BaseSampler]

# Of NSGA-II. 200 trials are then 20 generations, and the 10 random trials are the first. Mean hypervolume over the
# iterations, target-1 to -3, three seeds each, populations of 5, 10, 20, 30, 50: black box alone 10.3, 10.4, 8.8, 9.8,
# 8.7 (TPE 12.0); with the rules 14.7, 14.7, 14.7, 14.5, 14.5 (TPE 14.7). So few seeds tell 10 from 50, not from 5.
POPULATION = 10


def _tpe(seed: int) -> BaseSampler:
    return TPESampler(n_startup_trials=10, multivariate=False, constant_liar=True, seed=seed)


def _tpe_multivariate(seed: int) -> BaseSampler:
    return TPESampler(n_startup_trials=10, multivariate=True, constant_liar=True, seed=seed)


def _nsga2(seed: int) -> BaseSampler:
    return NSGAIISampler(population_size=POPULATION, seed=seed)


def _gp(seed: int) -> BaseSampler:
    with warnings.catch_warnings():
        # The argument is what Optuna calls experimental: it says that our objectives have no noise.
        warnings.simplefilter("ignore", ExperimentalWarning)
        return GPSampler(n_startup_trials=10, deterministic_objective=True, seed=seed)


def _random(seed: int) -> BaseSampler:
    return RandomSampler(seed=seed)


SAMPLERS: dict[str, SamplerFactory] = {
    "tpe": _tpe,
    "tpe-multivariate": _tpe_multivariate,
    "nsga2": _nsga2,
    "gp": _gp,
    "random": _random,
}


def sampler_factory(sampler: str | SamplerFactory) -> SamplerFactory:
    """The factory `seed -> Optuna sampler` of a name, or the given one.

    MissingExtraError where `gp` lacks its packages.
    """
    if isinstance(sampler, BaseSampler) or not (isinstance(sampler, str) or callable(sampler)):
        raise SettingsError(
            f"sampler = {sampler!r}: a name ({', '.join(SAMPLERS)}) or a factory seed -> sampler is needed, "
            "because every trial gets a sampler of its own"
        )
    if not isinstance(sampler, str):
        return sampler
    if sampler not in SAMPLERS:
        raise SettingsError(
            f'unknown sampler "{sampler}".{did_you_mean(sampler, SAMPLERS)} Samplers: {", ".join(SAMPLERS)}'
        )
    if sampler == "gp":
        check_extra("gp", "the sampler gp")
    return SAMPLERS[sampler]


def sampler_name(sampler: str | SamplerFactory) -> str:
    """What a run's settings call a sampler, so that a run that is resumed with another one is refused.

    A factory by its module and name; a lambda or a function within a function has no name of its own, and is told by
    its line and by a sum over what it holds.
    """
    factory = sampler_factory(sampler)
    return sampler if isinstance(sampler, str) else _named(factory)


def _named(thing: Any) -> str:
    if isinstance(thing, partial):
        given = [_named(value) for value in thing.args]
        given += [f"{name}={_named(value)}" for name, value in thing.keywords.items()]
        return f"partial({', '.join([_named(thing.func), *given])})"
    if isinstance(thing, MethodType):
        return f"{_named(thing.__self__)}.{thing.__name__}"
    if isinstance(thing, FunctionType) and ("<lambda>" in thing.__qualname__ or "<locals>" in thing.__qualname__):
        held = [*(thing.__defaults__ or ()), *(cell.cell_contents for cell in thing.__closure__ or ())]
        # A function that holds itself would never end.
        named = [list(_constants(v.__code__)) if isinstance(v, FunctionType) else _named(v) for v in held]
        words = repr([*_constants(thing.__code__), *named])
        line = f"line {thing.__code__.co_firstlineno} ({crc32(words.encode()):08x})"
        return f"{line} of {thing.__module__}, {thing.__qualname__}"  # what differs first: long settings are shown cut
    if hasattr(thing, "__qualname__"):  # functions and classes
        return f"{getattr(thing, '__module__', None)}.{thing.__qualname__}"
    own_words = type(thing).__repr__ is not object.__repr__  # the others hold an address, which is new in each process
    return repr(thing) if own_words else f"{_named(type(thing))}()"


def _constants(code: CodeType) -> Iterator[str]:
    """What a function's code uses by name, and the values in it."""
    yield from code.co_names
    for value in code.co_consts:
        if isinstance(value, CodeType):
            yield from _constants(value)
        else:
            yield repr(value)


class BlackBox:
    """An in-memory Optuna study over a design space, asked for one trial at a time.

    constraints: their names. Optuna's samplers prefer trials that meet them (Deb's rules), its best trials do.
    """

    def __init__(
        self,
        space: DesignSpace,
        sampler: str | SamplerFactory,
        seed: int,
        n_objectives: int = 2,
        constraints: Sequence[str] = (),
    ) -> None:
        self._space = space
        self._constraints = tuple(constraints)
        self._factory = sampler_factory(sampler)
        self._seed = seed
        self._distributions = distributions(space)
        self._storage = InMemoryStorage()
        self._study = quiet_study(self._storage, [StudyDirection.MINIMIZE] * n_objectives)
        self._study_id = self._storage.get_study_id_from_name(self._study.study_name)
        self._study_notes = self._storage.get_study_system_attrs(self._study_id)

    @property
    def study(self) -> optuna.Study:
        """Optuna's own object."""
        return self._study

    def restore(self, trials: Iterable[FinishedTrial]) -> None:
        """Adds finished trials, as a resumed run finds them on disk."""
        for trial in trials:
            params = self._space.free_values(trial.design)
            self._study.add_trial(
                create_trial(
                    params=params,
                    distributions={name: self._distributions[name] for name in params},
                    values=list(trial.values),
                    user_attrs=_attributes(trial.source, trial.proposal),
                    system_attrs=dict(trial.sampler_notes.get("trial", {})),
                    constraints=dict(zip(self._constraints, trial.violations, strict=True)),
                )
            )
            for name, note in trial.sampler_notes.get("study", {}).items():
                self._storage.set_study_system_attr(self._study_id, name, note)
        self._study_notes = self._storage.get_study_system_attrs(self._study_id)

    def draw(self, number: int, source: str) -> tuple[Trial, Design]:
        """The sampler's next design; uniformly random where source is `random`."""
        seed = derived_seed(self._seed, SAMPLING, number)
        sampler = self._factory(seed)
        self._study.sampler = _random(seed) if source == RANDOM else sampler
        trial = self._study.ask()
        design = self._suggested(trial)
        self._enlist(sampler, trial)
        for name, value in _attributes(source, None).items():
            trial.set_user_attr(name, value)
        return trial, design

    def inject(self, design: Design, number: int, source: str, proposal: str | None) -> tuple[Trial, Design]:
        """A trial for a design from elsewhere, which the sampler will learn from, and the design as the space has it.

        DesignError where it is not in the space.
        """
        # Checked here because Optuna takes out-of-range values with only a warning, and leaves a trial with an
        # unknown category RUNNING for ever.
        checked = self._space.design(design.params)
        sampler = self._study.sampler = self._factory(derived_seed(self._seed, SAMPLING, number))
        self._study.enqueue_trial(self._space.free_values(checked), user_attrs=_attributes(source, proposal))
        trial = self._study.ask()
        self._suggested(trial)
        self._enlist(sampler, trial)
        return trial, checked

    def tell(
        self, trial: Trial, values: Iterable[float], constraints: Iterable[float] = ()
    ) -> dict[str, dict[str, Any]]:
        """The trial's values, and how far it breaks each constraint; from now on the sampler learns from it.

        Returns what the sampler noted meanwhile on the trial and on the study (a genetic one: generations, parents):
        `restore` needs it.
        """
        for name, broken in zip(self._constraints, constraints, strict=True):
            trial.set_constraint(name, broken)
        told = self._study.tell(trial, list(values))
        before, self._study_notes = self._study_notes, self._storage.get_study_system_attrs(self._study_id)
        notes = {
            "trial": _notes(told.system_attrs, self._constraints),
            "study": {name: note for name, note in self._study_notes.items() if before.get(name) != note},
        }
        return {place: noted for place, noted in notes.items() if noted}

    def _suggested(self, trial: Trial) -> Design:
        """The design that a trial suggests: parameter by parameter, as some decide which of the others matter."""
        params: dict[str, ParameterValue] = {}
        for parameter in self._space.parameters:
            if not self._space.is_free(parameter.name, self._space.from_free_values(params).params):
                continue
            if isinstance(parameter, FloatParameter):
                params[parameter.name] = trial.suggest_float(
                    parameter.name, parameter.low, parameter.high, step=parameter.step or None
                )
            else:
                params[parameter.name] = trial.suggest_categorical(parameter.name, parameter.choices)
        return self._space.from_free_values(params)

    def _enlist(self, sampler: BaseSampler, trial: Trial) -> None:
        """Gives the trial a generation, where the sampler has such.

        Genetic samplers pass over trials without one, and give one only to trials whose values they draw.
        """
        enlist = getattr(sampler, "get_trial_generation", None)
        if enlist is not None:
            enlist(self._study, self._study.get_trials(deepcopy=False)[trial.number])


def _notes(attributes: Mapping[str, Any], constraints: Sequence[str]) -> dict[str, Any]:
    """What a sampler noted on a trial: without what Optuna itself keeps there."""
    own = {"fixed_params", *(f"constraints:{name}" for name in constraints)}
    return {name: note for name, note in attributes.items() if name not in own}


def _attributes(source: str, proposal: str | None) -> dict[str, Any]:
    return {"source": source} if proposal is None else {"source": source, "proposal": proposal}


def quiet_study(storage: InMemoryStorage, directions: Sequence[StudyDirection]) -> optuna.Study:
    """A new study that Optuna does not announce."""
    with quietly():
        return optuna.create_study(storage=storage, directions=directions)
