"""Prompts for an Optuna study, rendered from llm/templates/study.md.j2."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import optuna
from optuna.study import StudyDirection
from optuna.trial import FrozenTrial, TrialState

from armwright.llm.feedback import N_PARETO, N_RANDOM, draw_in_order
from armwright.llm.model_options import PromptOptions
from armwright.llm.prompt import fenced, rendered, shortened
from armwright.proposers.for_optuna.parameter_values import value_text
from armwright.proposers.for_optuna.parameters import Parameter, unique_keys
from armwright.proposers.for_optuna.study_view import best_trials, given_params

DIRECTIONS = {StudyDirection.MINIMIZE: "minimised", StudyDirection.MAXIMIZE: "maximised"}


def study_prompt(
    study: optuna.Study,
    trials: Sequence[FrozenTrial],
    parameters: Sequence[Parameter],
    description: str,
    seed: int,
    options: PromptOptions,
) -> str:
    """Return the prompt for the next trial, with the user's description of the problem.

    Fewer trials are shown until the prompt has at most about MAX_TOKENS, unless description and parameters alone are
    longer. The seed draws the trials that are shown. Of the options, the form of the answer is used.
    """
    complete = [trial for trial in trials if trial.state == TrialState.COMPLETE]
    objectives = _objectives(study)
    rng, on_front = np.random.default_rng(seed), best_trials(complete, study.directions)
    numbers = {trial.number for trial in on_front}
    groups = [
        on_front if len(objectives) == 1 else draw_in_order(on_front, N_PARETO, rng),  # those of one are ranked
        draw_in_order([trial for trial in complete if trial.number not in numbers], N_RANDOM, rng),
    ]
    best, others = ([_record(trial, parameters, objectives) for trial in group] for group in groups)
    unfinished = [trial for trial in trials if not trial.state.is_finished()]
    under_way = [_params(given_params(trial), parameters) for trial in unfinished if "proposal" in trial.user_attrs]
    values = {
        "description": description.strip(),
        "parameters": parameters,
        "objectives": objectives,
        "constraints": sorted({c for trial in complete for c in trial.constraints}),
        "n_complete": len(complete),
        "n_pruned": sum(trial.state == TrialState.PRUNED for trial in trials),
        "n_failed": sum(trial.state == TrialState.FAIL for trial in trials),
        "under_way": under_way[-N_RANDOM:],
        "form": options.answer,
    }

    def render(most: int) -> str:
        n_others = min(len(others), most // 2)
        return rendered("study.md.j2", {**values, "best": best[: most - n_others], "others": others[:n_others]})

    return shortened(render, N_PARETO + N_RANDOM, lambda most: max(1, most - 1))


def parameters_prompt(parameters: Sequence[Parameter], answer: str) -> str:
    """Return the prompt of the second call, which extracts the parameters from a free answer."""
    return rendered("study_parameters.md.j2", {"parameters": parameters, **fenced(answer)})


def _objectives(study: optuna.Study) -> list[dict[str, str]]:
    """Return the study's objectives, under their metric names if it has any."""
    n = len(study.directions)
    names = study.metric_names or (["value"] if n == 1 else [f"value_{i}" for i in range(1, n + 1)])
    directions = [DIRECTIONS.get(direction, "open") for direction in study.directions]
    named = zip(names, unique_keys(names), directions, strict=True)
    return [{"name": name, "key": key, "direction": direction} for name, key, direction in named]


def _record(
    trial: FrozenTrial, parameters: Sequence[Parameter], objectives: Sequence[Mapping[str, str]]
) -> Mapping[str, Any]:
    outcome = [f"{o['key']} = {value:.6g}" for o, value in zip(objectives, trial.values, strict=True)]
    violated = [f"{name} = {value:.6g}" for name, value in trial.constraints.items() if not value <= 0.0]
    return {
        "number": trial.number,
        "proposed": "proposal" in trial.user_attrs,
        "params": _params(trial.params, parameters),
        "outcome": ", ".join(outcome),
        "violated": ", ".join(violated),
    }


def _params(params: Mapping[str, Any], parameters: Sequence[Parameter]) -> str:
    return ", ".join(f"{p.key} = {value_text(params[p.name], p.distribution)}" for p in parameters if p.name in params)
