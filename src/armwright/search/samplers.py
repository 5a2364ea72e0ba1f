"""Black-box search by Optuna: samplers, and an in-memory study that is asked for one trial at a time.

Each trial is drawn by a new sampler, seeded from (seed, trial number). One sampler with one seed for the whole run
would repeat its first draws after a resume.
"""

import threading
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, cast

import optuna
from optuna.distributions import BaseDistribution, CategoricalDistribution, IntDistribution
from optuna.exceptions import ExperimentalWarning
from optuna.samplers import BaseSampler, GPSampler, NSGAIISampler, RandomSampler, TPESampler
from optuna.storages import InMemoryStorage
from optuna.study import StudyDirection
from optuna.trial import Trial, create_trial

from armwright.exceptions import SettingsError, did_you_mean
from armwright.extras import check_extra
from armwright.problem.problem import Problem
from armwright.runs.history import RANDOM
from armwright.runs.trial import FinishedTrial
from armwright.search.callable_names import name_of
from armwright.search.surrogate.cheap_features import FeatureFunction
from armwright.search.surrogate.sampler import SurrogateFactory, surrogate_sampler
from armwright.seeding import SAMPLING, derived_seed
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.optuna_distributions import distributions
from armwright.spaces.parameters import Design, ParameterValue

SamplerFactory = Callable[[int], BaseSampler]

# Population of NSGA-II; the 10 random trials are its first generation. Mean hypervolume over the iterations, target-1
# to -3, three seeds each:
#
#   population            5    10    20    30    50   (TPE)
#   without proposals  10.3  10.4   8.8   9.8   8.7    12.0
#
# Three seeds separate 10 from 50, but not from 5.
POPULATION = 10
_verbosity = threading.Lock()  # global to the process: two threads would restore each other's level
FAILED = "evaluation failed"  # the constraint that failed trials violate by 1


def _gp(seed: int) -> BaseSampler:
    with warnings.catch_warnings():
        # Optuna calls the argument experimental. It declares that the objectives have no noise.
        warnings.simplefilter("ignore", ExperimentalWarning)
        return GPSampler(n_startup_trials=10, deterministic_objective=True, seed=seed)


SAMPLERS: dict[str, SamplerFactory] = {
    "tpe": lambda seed: TPESampler(n_startup_trials=10, multivariate=False, constant_liar=True, seed=seed),
    "tpe-multivariate": lambda seed: TPESampler(n_startup_trials=10, multivariate=True, constant_liar=True, seed=seed),
    "nsga2": lambda seed: NSGAIISampler(population_size=POPULATION, seed=seed),
    "gp": _gp,
    "random": lambda seed: RandomSampler(seed=seed),
}
AUTO, SURROGATE = "auto", "surrogate"  # names of samplers that depend on the problem
NAMES = (AUTO, SURROGATE, *SAMPLERS)


def sampler_for(
    problem: Problem, sampler: str | SamplerFactory, features: FeatureFunction | None = None
) -> str | SamplerFactory:
    """Return the sampler of a problem: the factory of `surrogate`, and for `auto` this one or `tpe`.

    Evaluators take long as a rule, which is when the surrogate pays; the built-in physics does not.

    Raises:
        SettingsError: there are features, inputs of the surrogate alone, and the sampler is another one.
    """
    if sampler == AUTO:
        sampler = "tpe" if problem.evaluator is None else SURROGATE
    if sampler == SURROGATE:
        return surrogate_sampler(problem, features)
    if features is not None:
        raise SettingsError(
            f'features: expected the sampler "{SURROGATE}", which alone reads them, got {sampler_name(sampler)}; try '
            f'sampler="{SURROGATE}", or aw.surrogate_sampler(problem, features=...) as the sampler'
        )
    return sampler


def sampler_factory(sampler: str | SamplerFactory) -> SamplerFactory:
    """Return the factory `seed -> Optuna sampler` of a name that needs no problem, or the given factory.

    Raises:
        SettingsError: the name is unknown, or `sampler` is not a factory.
        MissingExtraError: the packages of `gp` are not installed.
    """
    if isinstance(sampler, BaseSampler) or not (isinstance(sampler, str) or callable(sampler)):
        raise SettingsError(
            f"expected a sampler name ({', '.join(NAMES)}) or a factory seed -> sampler, got {sampler!r}; every "
            "trial needs a new sampler"
        )
    if not isinstance(sampler, str):
        return sampler
    if sampler not in SAMPLERS:
        raise SettingsError(f'unknown sampler "{sampler}".{did_you_mean(sampler, NAMES)} Available: {", ".join(NAMES)}')
    if sampler == "gp":
        check_extra("gp", "the sampler gp")
    return SAMPLERS[sampler]


def sampler_name(sampler: str | SamplerFactory) -> str:
    """Return the name of a sampler in the settings of a run, which resumes only with the same one."""
    factory = sampler_factory(sampler)
    return sampler if isinstance(sampler, str) else name_of(factory)


class BlackBox:
    """In-memory Optuna study over a design space; all objectives are minimised.

    Args:
        constraints: names of the constraints; Optuna's samplers prefer trials that satisfy them (Deb's rules).
        can_fail: whether evaluations can fail. Samplers then see one more constraint, which failed trials violate, and
            infinite values of these.
    """

    def __init__(
        self,
        space: DesignSpace,
        sampler: str | SamplerFactory,
        seed: int,
        n_objectives: int = 2,
        constraints: Sequence[str] = (),
        can_fail: bool = False,
    ) -> None:
        self._space = space
        self._can_fail = can_fail
        self._constraints = (*constraints, FAILED) if can_fail else tuple(constraints)
        self._factory = sampler_factory(sampler)
        self._seed = seed
        self._distributions = distributions(space)
        self._storage = InMemoryStorage()
        self.study = quiet_study(self._storage, [StudyDirection.MINIMIZE] * n_objectives)
        self._study_id = self._storage.get_study_id_from_name(self.study.study_name)
        self._study_notes = self._storage.get_study_system_attrs(self._study_id)

    def restore(self, trials: Iterable[FinishedTrial]) -> None:
        """Add the finished trials of a run that is resumed."""
        for trial in trials:
            params = self._space.free_values(trial.design)
            self.study.add_trial(
                create_trial(
                    params=params,
                    distributions={name: self._distributions[name] for name in params},
                    values=list(trial.values),
                    system_attrs=dict(trial.sampler_notes.get("trial", {})),
                    constraints=self._constraint_values(trial.violations, trial.failure is not None),
                )
            )
            for name, note in trial.sampler_notes.get("study", {}).items():
                self._storage.set_study_system_attr(self._study_id, name, note)
        self._study_notes = self._storage.get_study_system_attrs(self._study_id)

    def draw(self, number: int, source: str) -> tuple[Trial, Design]:
        """Return a trial with the sampler's next design, drawn uniformly if `source` is `random`."""
        seed = derived_seed(self._seed, SAMPLING, number)
        sampler = self._factory(seed)
        self.study.sampler = RandomSampler(seed=seed) if source == RANDOM else sampler
        with warnings.catch_warnings():  # of infinite values, which failed trials have
            warnings.filterwarnings("ignore", "Clip non-finite values", UserWarning)
            trial = self.study.ask()
            design = self._suggest(trial)
        self._assign_generation(sampler, trial)
        return trial, design

    def inject(self, design: Design, number: int) -> tuple[Trial, Design]:
        """Return a trial with a design from another source, and the design with normalised parameters.

        Raises:
            DesignError: the design is not in the space.
        """
        # Optuna only warns of values out of range, and leaves a trial with an unknown category RUNNING for ever.
        checked = self._space.design(design.params)
        sampler = self.study.sampler = self._factory(derived_seed(self._seed, SAMPLING, number))
        self.study.enqueue_trial(self._space.free_values(checked))
        trial = self.study.ask()
        self._suggest(trial)
        self._assign_generation(sampler, trial)
        return trial, checked

    def rejection(self, design: Design, number: int) -> tuple[float, tuple[float, ...]] | None:
        """Return the gain and the prediction of a design that the surrogate would not evaluate in trial `number`."""
        if not isinstance(self._factory, SurrogateFactory):
            return None
        return self._factory(derived_seed(self._seed, SAMPLING, number)).rejection(self.study, design)

    def tell(
        self, trial: Trial, values: Iterable[float], violations: Iterable[float] = (), has_failed: bool = False
    ) -> dict[str, dict[str, Any]]:
        """Pass the result of a trial to the sampler.

        Returns:
            Notes of the sampler on the trial and on the study, such as generations and parents; needed by `restore`.
        """
        for name, violation in self._constraint_values(violations, has_failed).items():
            trial.set_constraint(name, violation)
        finished = self.study.tell(trial, list(values))
        before, self._study_notes = self._study_notes, self._storage.get_study_system_attrs(self._study_id)
        notes = {
            "trial": _notes(finished.system_attrs, self._constraints),
            "study": {name: note for name, note in self._study_notes.items() if before.get(name) != note},
        }
        return {level: noted for level, noted in notes.items() if noted}

    def _constraint_values(self, violations: Iterable[float], has_failed: bool) -> dict[str, float]:
        # Models of constraints then expect success where nothing is known, and the border half-way.
        failure = (1.0 if has_failed else -1.0,) if self._can_fail else ()
        return dict(zip(self._constraints, (*violations, *failure), strict=True))

    def _suggest(self, trial: Trial) -> Design:
        """Return the design that a trial suggests; earlier parameters decide which of the later ones are free."""
        params: dict[str, ParameterValue] = {}
        for parameter in self._space.parameters:
            if not self._space.is_free(parameter.name, self._space.from_free_values(params).params):
                continue
            params[parameter.name] = _suggested(trial, parameter.name, self._distributions[parameter.name])
        return self._space.from_free_values(params)

    def _assign_generation(self, sampler: BaseSampler, trial: Trial) -> None:
        """Assign a generation: genetic samplers ignore trials without one, and assign it only if they draw values."""
        assign = getattr(sampler, "get_trial_generation", None)
        if assign is not None:
            assign(self.study, self.study.get_trials(deepcopy=False)[trial.number])


def _suggested(trial: Trial, name: str, distribution: BaseDistribution) -> ParameterValue:
    """Return the value that a trial suggests for a parameter."""
    if isinstance(distribution, CategoricalDistribution):
        return trial.suggest_categorical(name, cast("tuple[str, ...]", distribution.choices))
    low, high, step, log = (getattr(distribution, key) for key in ("low", "high", "step", "log"))
    suggest = trial.suggest_int if isinstance(distribution, IntDistribution) else trial.suggest_float
    return suggest(name, low, high, step=step, log=log)


def _notes(attributes: Mapping[str, Any], constraints: Sequence[str]) -> dict[str, Any]:
    """Return the system attributes of a trial that the sampler wrote, without those of Optuna itself."""
    own = {"fixed_params", *(f"constraints:{name}" for name in constraints)}
    return {name: note for name, note in attributes.items() if name not in own}


def quiet_study(storage: InMemoryStorage, directions: Sequence[StudyDirection]) -> optuna.Study:
    """Create a study without Optuna's log message; the user's verbosity is restored afterwards."""
    with _verbosity:
        verbosity = optuna.logging.get_verbosity()
        optuna.logging.set_verbosity(max(verbosity, optuna.logging.WARNING))
        try:
            return optuna.create_study(storage=storage, directions=directions)
        finally:
            optuna.logging.set_verbosity(verbosity)
