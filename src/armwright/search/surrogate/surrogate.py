"""The surrogate of a problem: models fitted to evaluated designs, and the design with the largest expected gain."""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.pareto import feasible_mask, total_violation
from armwright.problem.problem import Problem
from armwright.problem.stated_bounds import stated_bounds, with_bounds
from armwright.runs.history import History
from armwright.search.surrogate.acquisition import Forecast, expected_gain
from armwright.search.surrogate.candidates import Candidates
from armwright.search.surrogate.cheap_features import CheapFeatures, Description, FeatureFunction
from armwright.search.surrogate.gaussian_process import GaussianProcess
from armwright.search.surrogate.response import (
    ResponseModel,
    SuccessModel,
    choose_model,
    choose_success_model,
    success_labels,
)
from armwright.seeding import derived_seed

REFRESH = 20  # trials after which new designs are screened
MUTANTS = 600  # variations of the present front
STARTUP = 5  # successful evaluations before objectives are modelled
RANDOM = 64  # random designs that are considered until then
GROWTH = 10  # models are chosen anew when the trials have grown by one tenth
FEWEST = 10  # designs whose errors mean something
LEAST_TRIALS = 15  # evaluations that succeeded; fewer teach too little to reject a proposal
LEAST_QUALITY = 0.5  # share of the variance of each objective that is predicted if each value is left out
LEAST_GAIN = 0.1  # of the best candidate's; such a proposal is worth less than a tenth of the sampler's own design


@dataclass(frozen=True)
class Observations:
    """The designs of a study so far."""

    matrix: Array  # (N, P) evaluated designs, by trial number
    values: Array  # (N, M) objectives, minimised
    failed: NDArray[np.bool_]  # (N,) True if the evaluation failed, so that the values mean nothing
    pending: Array  # (K, P) designs that are being evaluated

    def before(self, n: int) -> "Observations":
        """Return the first n evaluated designs."""
        return Observations(self.matrix[:n], self.values[:n], self.failed[:n], self.pending[:0])


@dataclass
class Surrogate:
    """Models of the objectives of a problem, and a search for the design with the largest expected gain.

    All results depend on the arguments only. What is kept in memory saves time.
    """

    problem: Problem  # the problem; its evaluator is never called
    function: FeatureFunction | None = None  # custom inputs of a design; None for none
    _memory: dict[str, tuple[Any, Any]] = field(default_factory=dict[str, "tuple[Any, Any]"])
    _known: dict[bytes, Description] = field(default_factory=dict[bytes, Description])

    def __post_init__(self) -> None:
        """Prepare inputs and sources of candidates."""
        self.features = CheapFeatures(self.problem, self.function)
        self._candidates = Candidates(self.problem)

    def choose(self, observations: Observations, seed: int) -> Array:
        """Return the (P,) design to evaluate next."""
        if (~observations.failed).sum() < STARTUP:
            return self._safest(observations, seed)
        screen = Screen(self, observations)
        matrix, known = self.considered(observations, screen, seed)
        return matrix[int(np.argmax(screen.score(matrix, known)))]

    def _safest(self, observations: Observations, seed: int) -> Array:
        """Return the (P,) design that is most probable to succeed, of random ones and variations of successful ones.

        Designs that violate constraints are left aside while there are others.
        """
        space, rng = self.problem.space, np.random.default_rng(seed)
        matrix = space.normalised(space.matrix(space.sample(RANDOM, seed)))
        matrix = np.vstack([matrix, self._mutants(observations, ~observations.failed, rng)])
        known, success = self.features.describe(matrix), self.success(observations)
        violation = total_violation(known.violations)
        probability = np.ones(len(matrix)) if success is None else success.probability(known.inputs)
        return matrix[int(np.lexsort((-probability, violation))[0])]

    def considered(self, observations: Observations, screen: "Screen", seed: int) -> tuple[Array, Description]:
        """Return the (N, P) candidates for the next design, and their description."""
        rng = np.random.default_rng(seed)
        matrix, known = self._screened(observations)
        mutants = self._mutants(observations, screen.feasible, rng)
        if len(mutants):
            matrix, known = np.vstack([matrix, mutants]), known + self.features.describe(mutants)
        return matrix, known

    def rejection(self, observations: Observations, row: Array, seed: int) -> tuple[float, tuple[float, ...]] | None:
        """Return why a design (P,) is not worth an evaluation; None if it is, or if too little is known to tell.

        Returns:
            Its expected gain of hypervolume, as a share of the best candidate's, and its predicted objectives.
        """
        if np.count_nonzero(~observations.failed) < LEAST_TRIALS:
            return None
        screen = Screen(self, observations)
        if screen.quality.min() < LEAST_QUALITY:
            return None
        best = float(screen.gain(self.considered(observations, screen, seed)[1]).max())
        known = self.describe_known(row[None])
        gain = float(screen.gain(known)[0])
        if gain >= LEAST_GAIN * best:
            return None
        return round(gain / best, 6), tuple(screen.predicted(known)[0].tolist())

    def left_out_errors(self, history: History) -> dict[str, Any] | None:
        """Return the leave-one-out errors for summary.json; None if fewer than ten designs were evaluated.

        An error is the root mean square over the standard deviation of the transformed objective; None if the objective
        is constant. Repeated designs count once, because predictions from their copies would be perfect.
        """
        trials = [trial for trial in history if trial.duplicate_of is None and trial.is_evaluated]
        if len(trials) < FEWEST:
            return None
        space = self.problem.space
        matrix = space.normalised(space.matrix([trial.design for trial in trials]))
        values = np.array([trial.values for trial in trials])
        quality = Screen(self, Observations(matrix, values, np.zeros(len(trials), dtype=bool), matrix[:0])).quality
        errors = {
            objective.name: round(float(np.sqrt(1.0 - share)), 4) if np.ptp(column) > 0.0 else None
            for objective, share, column in zip(self.problem.objectives, quality, values.T, strict=True)
        }
        return {"designs": len(trials), "errors": errors}

    def describe_known(self, matrix: Array) -> Description:
        """Return the description of evaluated or pending designs (N, P), each of which is computed once and alone."""
        found: list[Description] = []
        for row in matrix:
            key = row.tobytes()
            if key not in self._known:
                self._known[key] = self.features.describe(row[None])
            found.append(self._known[key])
        inputs = {name: np.vstack([one.inputs[name] for one in found]) for name in found[0].inputs}
        return Description(inputs, np.vstack([one.violations for one in found]))

    def models(self, observations: Observations) -> tuple[ResponseModel, ...]:
        """Return the model of each objective, chosen with the evaluated designs."""
        used = self._used(observations)
        used = used if (~used.failed).sum() >= STARTUP else observations
        kept = ~used.failed
        values = used.values[kept]

        def chosen() -> tuple[ResponseModel, ...]:
            inputs = self.describe_known(used.matrix[kept]).inputs
            return tuple(choose_model(inputs, column) for column in values.T)

        return self._remembered("models", (used.matrix.tobytes(), values.tobytes()), chosen)

    def success(self, observations: Observations) -> SuccessModel | None:
        """Return the model of the success of evaluations, chosen as those of the objectives; None if nothing failed."""
        if not observations.failed.any():
            return None
        used = self._used(observations)
        used = used if used.failed.any() else observations

        def chosen() -> ResponseModel:
            return choose_success_model(self.describe_known(used.matrix).inputs, used.failed)

        model = self._remembered("success", (used.matrix.tobytes(), used.failed.tobytes()), chosen)
        known = self.describe_known(observations.matrix).inputs[model.inputs]
        labels = success_labels(observations.failed)
        return SuccessModel(model.inputs, GaussianProcess(known, labels, model.hyperparameters))

    def _used(self, observations: Observations) -> Observations:
        """Return the designs that models are chosen with: all up to the last tenth."""
        n = len(observations.matrix)
        return observations.before(n - n % max(1, n // GROWTH))

    def reference_point(self, observations: Observations) -> Array:
        """Return the (M,) bound of the hypervolume that is to grow: as stated, else the worst values so far.

        The point that a study finds from its random trials only measures. It often excludes an end of the front.
        """
        stated = self.problem.reference_point
        n_objectives = observations.values.shape[1]
        if stated is not None and len(stated) == n_objectives:
            return np.array(stated)
        worst = observations.values[~observations.failed].max(axis=0)
        same = n_objectives == len(self.problem.objectives)
        return np.array(with_bounds(worst.tolist(), stated_bounds(self.problem))) if same else worst

    def _screened(self, observations: Observations) -> tuple[Array, Description]:
        """Return the candidates of the present twenty trials, and their description."""
        n = len(observations.matrix) + len(observations.pending)
        # Runs differ in their first design, so that they do not share their candidates.
        first = zlib.crc32(observations.matrix[0].tobytes())

        def screened() -> tuple[Array, Description]:
            matrix = self._candidates.screened(derived_seed(first, n // REFRESH))
            return matrix, self.features.describe(matrix)

        return self._remembered("screened", (first, n // REFRESH), screened)

    def _mutants(self, observations: Observations, feasible: NDArray[np.bool_], rng: np.random.Generator) -> Array:
        matrix, values = observations.matrix[feasible], observations.values[feasible]
        if not len(matrix):
            return observations.matrix[:0]
        return self._candidates.variations(matrix, values, self._candidates.scaled(MUTANTS), rng)

    def _remembered(self, name: str, key: Any, compute: Any) -> Any:
        """Return what `compute` returns, or what it returned for the same key last time."""
        if name not in self._memory or self._memory[name][0] != key:
            self._memory[name] = key, compute()
        return self._memory[name][1]


class Screen:
    """Forecasts and expected gains of designs, given those evaluated so far, at least two of them without a failure."""

    def __init__(self, surrogate: Surrogate, observations: Observations) -> None:
        self._surrogate = surrogate
        self._tried = {row.tobytes() for row in np.vstack([observations.matrix, observations.pending])}
        known = surrogate.describe_known(observations.matrix)
        kept = ~observations.failed
        self.feasible = kept & feasible_mask(known.violations)
        self._models = surrogate.models(observations)
        self._reference_point = self._transformed(surrogate.reference_point(observations)[None])[0]
        self._success = surrogate.success(observations)
        values = self._transformed(observations.values[kept])
        inputs = known[np.flatnonzero(kept)].inputs
        self._processes = self._learned = self._conditioned(inputs, values)
        self._front = self._transformed(observations.values[self.feasible])
        if len(observations.pending):
            self._imagine(surrogate.describe_known(observations.pending), inputs, values)

    def forecast(self, known: Description) -> Forecast:
        """Return the forecast of the transformed objectives of N designs."""
        pairs = [
            process.predict(known.inputs[model.inputs])
            for model, process in zip(self._models, self._processes, strict=True)
        ]
        return Forecast(np.column_stack([mean for mean, _ in pairs]), np.column_stack([d for _, d in pairs]))

    @property
    def quality(self) -> Array:
        """(M,) shares of the variance of the transformed objectives that are predicted, each value left out in turn."""
        shares = np.zeros(len(self._learned))
        for objective, process in enumerate(self._learned):
            variance = float(process.observations.var())
            if variance > 0.0:
                error = process.observations - process.left_out[0]
                shares[objective] = 1.0 - float((error**2).mean()) / variance
        return shares

    def predicted(self, known: Description) -> Array:
        """Return the (N, M) medians of the objectives of designs."""
        mean = self.forecast(known).mean
        return np.column_stack([m.transform.inverse(column) for m, column in zip(self._models, mean.T, strict=True)])

    def gain(self, known: Description) -> Array:
        """Return (N,) expected gains of transformed hypervolume, times probabilities of success; 0 if infeasible."""
        return self._gain(self.forecast(known), known)

    def score(self, matrix: Array, known: Description) -> Array:
        """Return (N,) scores of designs: their gain; below 0 for those that gain nothing, in order of preference.

        Deb's rules order these: the least violation first, then the smallest predicted distance from the reference box.
        """
        forecast = self.forecast(known)
        gain = self._gain(forecast, known)
        excess = np.maximum(forecast.mean - self._reference_point, 0.0)
        distance = excess.sum(axis=1) / self._probability(known)
        violation = total_violation(known.violations)
        behind = -np.where(violation > 0.0, 2.0 + violation, distance / (1.0 + distance)) - 1e-12
        score = np.where(gain > 0.0, gain, behind)
        tried = np.array([row.tobytes() in self._tried for row in matrix], dtype=bool)
        return np.where(tried, -np.inf, score)

    def _gain(self, forecast: Forecast, known: Description) -> Array:
        gain = expected_gain(forecast, self._front, self._reference_point)
        return np.where(feasible_mask(known.violations), gain * self._probability(known), 0.0)

    def _probability(self, known: Description) -> Array:
        """Return (N,) the probabilities that evaluations succeed."""
        if self._success is None:
            return np.ones(len(known.violations))
        return self._success.probability(known.inputs)

    def _transformed(self, values: Array) -> Array:
        """Return the (N, M) objectives as their models see them."""
        return np.column_stack([m.transform(column) for m, column in zip(self._models, values.T, strict=True)])

    def _conditioned(self, inputs: Mapping[str, Array], values: Array) -> list[GaussianProcess]:
        """Return the processes that know transformed objectives (N, M)."""
        return [
            GaussianProcess(inputs[model.inputs], column, model.hyperparameters)
            for model, column in zip(self._models, values.T, strict=True)
        ]

    def _imagine(self, pending: Description, inputs: Mapping[str, Array], values: Array) -> None:
        """Take pending designs for evaluated, with the values predicted.

        Kriging believer: Ginsbourger, Le Riche & Carraro, Kriging is well-suited to parallelize optimization, 2010.
        """
        imagined = self.forecast(pending).mean
        both = {name: np.vstack([table, pending.inputs[name]]) for name, table in inputs.items()}
        self._processes = self._conditioned(both, np.vstack([values, imagined]))
        self._front = np.vstack([self._front, imagined[feasible_mask(pending.violations)]])
