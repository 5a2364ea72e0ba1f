"""Prompts for an Optuna study, rendered from llm/templates/study.md.j2."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import optuna
from optuna.study import StudyDirection
from optuna.trial import FrozenTrial, TrialState

from armwright.llm.feedback import MAX_PROPOSED, N_PARETO, N_RANDOM, draw_in_order
from armwright.llm.model_options import PromptOptions
from armwright.llm.prompt import MAX_TOKENS, estimated_tokens, fenced, rendered
from armwright.proposers.for_optuna.parameter_values import value_text
from armwright.proposers.for_optuna.parameters import Parameter, unique_keys
from armwright.proposers.for_optuna.study_view import best_trials, given_params

MIN_PROPOSED = 1
DIRECTIONS = {StudyDirection.MINIMIZE: "minimised", StudyDirection.MAXIMIZE: "maximised"}


@dataclass(frozen=True)
class StudyObjective:
    """An objective in prompts and schemas; `key` is its name, or a valid property name in its place."""

    name: str
    key: str
    direction: str


def study_objectives(study: optuna.Study) -> list[StudyObjective]:
    """Return the study's objectives, under their metric names if it has any."""
    n = len(study.directions)
    names = study.metric_names or (["value"] if n == 1 else [f"value_{i}" for i in range(1, n + 1)])
    directions = [DIRECTIONS.get(direction, "open") for direction in study.directions]
    return [StudyObjective(*objective) for objective in zip(names, unique_keys(names), directions, strict=True)]


def study_prompt(
    study: optuna.Study,
    trials: Sequence[FrozenTrial],
    parameters: Sequence[Parameter],
    description: str,
    seed: int,
    options: PromptOptions,
    source: str,
) -> str:
    """Return the prompt for the next trial.

    Fewer trials are shown until the prompt has at most about MAX_TOKENS, unless description and parameters alone are
    longer.

    Args:
        study: gives the objectives and their directions.
        trials: the trials so far.
        parameters: what the model may choose.
        description: the user's description of the problem.
        seed: of the draw of the trials that are shown.
        options: memory and form of the answer.
        source: name of the proposer, whose earlier proposals are shown if the memory is "own".
    """
    complete = [trial for trial in trials if trial.state == TrialState.COMPLETE]
    objectives = study_objectives(study)
    best = best_trials(complete, study.directions)
    own = [trial for trial in complete if options.expects and _is_proposal(trial, source)]
    best_records, other_records, own_records = (
        [_record(trial, parameters, objectives, {t.number for t in best}) for trial in group]
        for group in (*_sample(complete, best, seed, ranked=len(objectives) == 1), own)
    )
    under_way = [_params(given_params(trial), parameters) for trial in trials if _is_proposal_under_way(trial)]
    common = {
        "description": description.strip(),
        "parameters": parameters,
        "objectives": objectives,
        "constraints": sorted({c for trial in complete for c in trial.constraints}),
        "n_complete": len(complete),
        "n_pruned": sum(trial.state == TrialState.PRUNED for trial in trials),
        "n_failed": sum(trial.state == TrialState.FAIL for trial in trials),
        "under_way": under_way[-N_RANDOM:],
        "n_proposed": len(own),
        "expected": options.expects,
        "form": options.form,
    }
    most_shown, most_proposed = N_PARETO + N_RANDOM, MAX_PROPOSED
    while True:
        others = other_records[: most_shown // 2]
        shown = {
            "best": best_records[: most_shown - len(others)],
            "others": others,
            "proposed": own_records[-most_proposed:],
        }
        text = rendered("study.md.j2", {**common, **shown})
        if estimated_tokens(text) <= MAX_TOKENS or (most_shown, most_proposed) == (1, MIN_PROPOSED):
            return text
        most_shown, most_proposed = max(1, most_shown - 1), max(MIN_PROPOSED, 3 * most_proposed // 4)


def _sample(
    complete: Sequence[FrozenTrial], best: Sequence[FrozenTrial], seed: int, *, ranked: bool
) -> tuple[Sequence[FrozenTrial], Sequence[FrozenTrial]]:
    """Draw some of the best trials, or take all if they are ranked, and draw some of the others."""
    rng = np.random.default_rng(seed)
    numbers = {trial.number for trial in best}
    others = [trial for trial in complete if trial.number not in numbers]
    return best if ranked else draw_in_order(best, N_PARETO, rng), draw_in_order(others, N_RANDOM, rng)


def parameters_prompt(
    parameters: Sequence[Parameter], objectives: Sequence[StudyObjective], answer: str, expected: bool
) -> str:
    """Return the prompt of the second call, which extracts the parameters from a free answer."""
    values = {"parameters": parameters, "objectives": objectives, "expected": expected, **fenced(answer)}
    return rendered("study_parameters.md.j2", values)


def _record(
    trial: FrozenTrial, parameters: Sequence[Parameter], objectives: Sequence[StudyObjective], best: set[int]
) -> Mapping[str, Any]:
    violated = [f"{name} = {value:.6g}" for name, value in trial.constraints.items() if not value <= 0.0]
    expected = trial.user_attrs.get("expected")
    return {
        "number": trial.number,
        "proposed": "proposal" in trial.user_attrs,
        "params": _params(trial.params, parameters),
        "outcome": _values(trial.values, objectives),
        "violated": ", ".join(violated),
        "expected": "not said" if expected is None else _values(expected, objectives),
        "reason": trial.user_attrs.get("reason") or "not said",
        "best": trial.number in best,
    }


def _params(params: Mapping[str, Any], parameters: Sequence[Parameter]) -> str:
    return ", ".join(f"{p.key} = {value_text(params[p.name], p.distribution)}" for p in parameters if p.name in params)


def _values(values: Sequence[float], objectives: Sequence[StudyObjective]) -> str:
    return ", ".join(f"{o.key} = {value:.6g}" for o, value in zip(objectives, values, strict=True))


def _is_proposal_under_way(trial: FrozenTrial) -> bool:
    return "proposal" in trial.user_attrs and not trial.state.is_finished()


def _is_proposal(trial: FrozenTrial, source: str) -> bool:
    return trial.user_attrs.get("source") == source and "proposal" in trial.user_attrs
