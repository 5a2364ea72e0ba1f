"""What the surrogate learned of the objectives of a run: quality of predictions, inputs that matter, corrections."""

from collections.abc import Sequence

import numpy as np

from armwright.arrays import Array
from armwright.runs.history import History
from armwright.runs.surrogate_summary import Effect, LearnedObjective, SurrogateSummary
from armwright.search.surrogate.correction import describe_correction
from armwright.search.surrogate.gaussian_process import GaussianProcess
from armwright.search.surrogate.response import ResponseModel
from armwright.search.surrogate.surrogate import Observations, Surrogate

FEWEST = 10  # designs from which a summary is made
LEAST_EXPLAINED = 0.3  # share of the variance from which inputs are named
LEAST_EFFECT = 0.05  # of an input that is named
NAMED = 3  # inputs at most
PERMUTATIONS = 20


def summarize_surrogate(surrogate: Surrogate, history: History) -> SurrogateSummary | None:
    """Return what the surrogate learned from the trials of a run; None if too few evaluations succeeded.

    Designs that were repeated count once, because a prediction from their copy would be perfect.
    """
    trials = [trial for trial in history if trial.duplicate_of is None and trial.failure is None]
    if len(trials) < FEWEST:
        return None
    space = surrogate.problem.space
    matrix = space.normalised(space.matrix([trial.design for trial in trials]))
    values = np.array([trial.values for trial in trials])
    models = surrogate.models(Observations(matrix, values, np.zeros(len(trials), dtype=bool), matrix[:0]))
    inputs = surrogate.describe_known(matrix).inputs
    quantities = surrogate.quantities(matrix)
    evaluator = surrogate.problem.evaluator
    measured = () if evaluator is None else evaluator.objectives
    learned: list[LearnedObjective] = []
    for objective, model, column in zip(surrogate.problem.objectives, models, values.T, strict=True):
        explained, error = quality(model, inputs[model.inputs], column)
        is_predicted = explained is not None and explained >= LEAST_EXPLAINED
        names = surrogate.input_names[model.inputs]
        effects = largest_effects(model, names, inputs[model.inputs], column) if is_predicted else ()
        learned.append(
            LearnedObjective(
                name=objective.name,
                explained=explained,
                relative_error=error,
                inputs=model.inputs,
                effects=effects,
                correction=describe_correction(objective, column, quantities) if objective in measured else "",
                predicted=left_out(model, inputs[model.inputs], column),
                log_shift=model.transform.shift if model.transform.is_log else None,
            )
        )
    return SurrogateSummary(len(trials), [trial.number for trial in trials], learned)


def quality(model: ResponseModel, inputs: Array, values: Array) -> tuple[float | None, float | None]:
    """Return the share of variance explained and the median relative error of predictions of designs left out.

    Rasmussen & Williams, equation 5.12, with the hyperparameters of all designs.

    Args:
        model: of an objective.
        inputs: (N, F) of its set.
        values: (N,) of the objective.
    """
    process = _process(model, inputs, values)
    predicted, _ = process.left_out
    variance = float(process.observations.var())
    if variance == 0.0:
        return None, None
    explained = 1.0 - float(np.mean((predicted - process.observations) ** 2)) / variance
    off = np.abs(model.transform.inverse(predicted) - values)
    size = np.abs(values)
    relative = float(np.median(np.divide(off, size, out=np.full(len(values), np.inf), where=size > 0.0)))
    return round(max(0.0, explained), 4), round(relative, 4) if np.isfinite(relative) else None


def left_out(model: ResponseModel, inputs: Array, values: Array) -> list[float]:
    """Return the values of N designs, each predicted from all others, to six digits.

    Args:
        model: of an objective.
        inputs: (N, F) of its set.
        values: (N,) of the objective.
    """
    predicted, _ = _process(model, inputs, values).left_out
    return [float(f"{value:.6g}") for value in model.transform.inverse(predicted)]


def largest_effects(model: ResponseModel, names: Sequence[str], inputs: Array, values: Array) -> list[Effect]:
    """Return the inputs whose permutation changes the predictions most.

    The total effect of Jansen, Computer Physics Communications 117, 1999, of the mean of the process.

    Args:
        model: of an objective.
        names: of the F inputs.
        inputs: (N, F) of its set.
        values: (N,) of the objective.
    """
    process = _process(model, inputs, values)
    variance = float(process.observations.var())
    rng = np.random.default_rng(0)
    orders = [rng.permutation(len(inputs)) for _ in range(PERMUTATIONS)]
    whole, _ = process.predict(inputs)
    effects: list[Effect] = []
    for column, name in enumerate(names):
        changed = np.vstack([inputs] * PERMUTATIONS)
        changed[:, column] = np.concatenate([inputs[order, column] for order in orders])
        means, _ = process.predict(changed)
        share = 0.5 * float(np.mean((means - np.tile(whole, PERMUTATIONS)) ** 2)) / variance
        effects.append(Effect(name, round(share, 4)))
    effects = [effect for effect in effects if effect.share >= LEAST_EFFECT]
    return sorted(effects, key=lambda effect: -effect.share)[:NAMED]


def _process(model: ResponseModel, inputs: Array, values: Array) -> GaussianProcess:
    return GaussianProcess(inputs, model.transform(values), model.hyperparameters)
