"""What a model is told of any Optuna study. The words are in llm/templates/study.md.j2."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import optuna
from optuna.study import StudyDirection
from optuna.trial import FrozenTrial, TrialState

from armwright.llm.feedback import N_PARETO, N_RANDOM, draw_in_order
from armwright.llm.prompt import MOST_PROPOSED, MOST_TOKENS, Form, estimated_tokens, fenced, rendered
from armwright.proposers.for_optuna.parameters import Parameter, keys, value_text
from armwright.proposers.for_optuna.trials import best_trials

FEWEST_PROPOSED = 1


@dataclass(frozen=True)
class Told:
    """An objective as a model is told of it: its name, a plain one for a schema, and its direction."""

    name: str
    key: str
    direction: str


def told_objectives(study: optuna.Study) -> list[Told]:
    """The study's objectives by their metric names, where it has such."""
    n = len(study.directions)
    names = study.metric_names or (["value"] if n == 1 else [f"value_{i}" for i in range(1, n + 1)])
    words = {StudyDirection.MINIMIZE: "minimised", StudyDirection.MAXIMIZE: "maximised"}
    told = [words.get(direction, "open") for direction in study.directions]
    return [Told(*objective) for objective in zip(names, keys(names), told, strict=True)]


def study_prompt(
    study: optuna.Study,
    trials: Sequence[FrozenTrial],
    parameters: Sequence[Parameter],
    description: str,
    seed: int,
    *,
    memory: str,
    name: str,
    form: Form,
) -> str:
    """The prompt for the next trial after `trials`; which of them it shows is drawn from `seed`.

    memory: "own" shows the earlier proposals of the proposer `name`, too.

    At most about MOST_TOKENS long, as long as description and parameters leave room: fewer trials are shown.
    """
    complete = [trial for trial in trials if trial.state == TrialState.COMPLETE]
    objectives = told_objectives(study)
    best = best_trials(complete, study.directions)
    drawn = _drawn(complete, best, seed, ranked=len(objectives) == 1)
    own = [trial for trial in complete if _is_of(trial, name)] if memory == "own" else []
    under_way = [_params(_given(trial), parameters) for trial in trials if _is_proposal_under_way(trial)]
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
        "expected": memory == "own",
        "form": form,
    }
    records = [[_record(trial, parameters, objectives, best) for trial in some] for some in (*drawn, own)]
    most_shown, most_proposed = N_PARETO + N_RANDOM, MOST_PROPOSED
    while True:
        others = records[1][: most_shown // 2]
        best_shown = records[0][: most_shown - len(others)]
        shown = {"best": best_shown, "others": others, "proposed": records[2][-most_proposed:]}
        text = rendered("study.md.j2", {**common, **shown})
        if estimated_tokens(text) <= MOST_TOKENS or (most_shown, most_proposed) == (1, FEWEST_PROPOSED):
            return text
        most_shown, most_proposed = max(1, most_shown - 1), max(FEWEST_PROPOSED, 3 * most_proposed // 4)


def parameters_prompt(parameters: Sequence[Parameter], objectives: Sequence[Told], answer: str, expected: bool) -> str:
    """The prompt of the second call: the free answer turned into parameters."""
    values = {"parameters": parameters, "objectives": objectives, "expected": expected, **fenced(answer)}
    return rendered("study_parameters.md.j2", values)


def _drawn(
    complete: Sequence[FrozenTrial], best: Sequence[FrozenTrial], seed: int, *, ranked: bool
) -> tuple[list[FrozenTrial], list[FrozenTrial]]:
    """Some of the best (all, where they are ranked), and some of the other complete trials."""
    rng = np.random.default_rng(seed)
    among = {trial.number for trial in best}
    others = [trial for trial in complete if trial.number not in among]
    return list(best) if ranked else draw_in_order(best, N_PARETO, rng), draw_in_order(others, N_RANDOM, rng)


def _record(
    trial: FrozenTrial, parameters: Sequence[Parameter], objectives: Sequence[Told], best: Sequence[FrozenTrial]
) -> Mapping[str, Any]:
    violated = [f"{name} = {_short(value)}" for name, value in trial.constraints.items() if not value <= 0.0]
    expected = trial.user_attrs.get("expected")
    return {
        "number": trial.number,
        "proposed": "proposal" in trial.user_attrs,
        "params": _params(trial.params, parameters),
        "outcome": _values(trial.values, objectives),
        "violated": ", ".join(violated),
        "expected": "not said" if expected is None else _values(expected, objectives),
        "reason": trial.user_attrs.get("reason") or "not said",
        "best": any(trial.number == other.number for other in best),
    }


def _params(params: Mapping[str, Any], parameters: Sequence[Parameter]) -> str:
    return ", ".join(f"{p.key} = {value_text(params[p.name], p.distribution)}" for p in parameters if p.name in params)


def _is_proposal_under_way(trial: FrozenTrial) -> bool:
    return "proposal" in trial.user_attrs and not trial.state.is_finished()


def _given(trial: FrozenTrial) -> Mapping[str, Any]:
    """What an enqueued trial will be evaluated with, as far as that is fixed."""
    return {**trial.system_attrs.get("fixed_params", {}), **trial.params}


def _values(values: Sequence[float], objectives: Sequence[Told]) -> str:
    return ", ".join(f"{o.key} = {_short(value)}" for o, value in zip(objectives, values, strict=True))


def _short(value: float) -> str:
    return f"{value:.6g}"


def _is_of(trial: FrozenTrial, name: str) -> bool:
    return trial.user_attrs.get("source") == name and "proposal" in trial.user_attrs
