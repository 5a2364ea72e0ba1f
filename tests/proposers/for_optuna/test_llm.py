"""The language model proposer for any Optuna study, against a local server."""

import json
import re
from pathlib import Path
from typing import Any

import optuna
import pytest
from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.samplers import NSGAIISampler, TPESampler
from optuna.trial import TrialState, create_trial

from armwright import ModelOptions, PromptOptions, ProposalCallback, StudyLlmProposer
from armwright.exceptions import ModelError, ProposalError, SettingsError
from armwright.llm.prompt import MAX_TOKENS, estimated_tokens
from armwright.llm.transcript import Transcript
from armwright.proposers.for_optuna.parameters import observed_space, study_parameters
from armwright.proposers.for_optuna.prompt import study_prompt
from armwright.proposers.for_optuna.study_view import best_trials
from tests.support.chat_server import Answer, ChatServer, Request

GOOD = {"kernel": "RBF", "C": "10.0", "gamma": 0.01, "degree": None, "shrinking": "true"}
DESCRIPTION = "A support vector machine for letters; few samples, many features."


def objective(trial: optuna.Trial) -> float:
    """Categorical, log, conditional, whole and bool parameters; 1 at best."""
    kernel = trial.suggest_categorical("kernel", ["rbf", "poly", "linear"])
    c = trial.suggest_float("C", 1e-3, 1e3, log=True)
    if kernel == "rbf":
        c += trial.suggest_float("gamma", 1e-4, 1.0, log=True)
    if kernel == "poly":
        c += trial.suggest_int("degree", 2, 6, step=2)
    trial.suggest_categorical("shrinking", [True, False])
    return 1.0 / (1.0 + c)


def answering(values: dict[str, Any] | None = None, **others: Any) -> Any:
    """Thinks on a free question; else gives these values."""

    def answer(request: Request) -> Answer:
        if "response_format" not in request:
            return "C = 10 with the rbf kernel, I should say."
        return json.dumps({"parameters": values or GOOD, "reason": "a usual start", **others})

    return answer


def proposer(server: ChatServer, **settings: Any) -> StudyLlmProposer:
    kept = {name: settings.pop(name) for name in ("space", "transcript") if name in settings}
    options = ModelOptions(model="test-model", base_url=server.url, origin="scripted", **settings)
    return StudyLlmProposer(options, DESCRIPTION, **kept)


def study_of(n_trials: int = 0, callback: ProposalCallback | None = None, **settings: Any) -> optuna.Study:
    study = optuna.create_study(**{"sampler": TPESampler(seed=0), "direction": "maximize", **settings})
    study.optimize(objective, n_trials=n_trials, callbacks=[callback] if callback else None)
    return study


def test_model_parameters_are_evaluated_unchanged(chat_server: ChatServer, tmp_path: Path) -> None:
    chat_server.answer = answering()
    callback = ProposalCallback(proposer(chat_server, transcript=tmp_path / "calls.jsonl"), every=10)
    study = study_of(20, callback)
    for number in (9, 19):
        trial = study.trials[number]
        assert trial.params == {"kernel": "rbf", "C": 10.0, "gamma": 0.01, "shrinking": True}
        own = {"source": "scripted", "proposal": f"scripted-{number:04d}", "reason": "a usual start"}
        assert trial.user_attrs == own
        assert trial.state is TrialState.COMPLETE
    assert (callback.proposed, callback.faults) == (2, {})
    calls = Transcript(tmp_path / "calls.jsonl").calls
    assert [(call.proposal, call.step, call.known, call.origin) for call in calls] == [
        (f"scripted-{number:04d}", step, number, "scripted")
        for number in (9, 19)
        for step in ("reasoning", "parameters")
    ]
    assert json.loads(calls[1].answer)["parameters"]["C"] == 10.0
    assert callback.proposer.summary().calls == 4


def test_prompt_states_problem_parameters_and_results(chat_server: ChatServer) -> None:
    chat_server.answer = answering()
    study = study_of(20, ProposalCallback(proposer(chat_server), every=10))
    thinking, extracting = chat_server.prompts()[2:4]
    assert DESCRIPTION in thinking
    assert "- C: number, 0.001 to 1000, on a log scale\n" in thinking
    assert "- value: maximised\n" in thinking
    n = sum("gamma" in trial.params for trial in study.trials[:19])
    assert f"conditional: in {n} of 19 trials, always with kernel = rbf." in thinking
    assert thinking.count("\nTrial ") == 10
    best = max(study.trials[:19], key=lambda trial: trial.value)
    first = thinking.split("\nTrial ")[1]
    assert first.startswith(str(best.number))
    assert f"VALUES: value = {best.value:.6g}\n" in first
    assert "C = 10 with the rbf kernel, I should say." in extracting
    schema = chat_server.requests[3]["response_format"]["json_schema"]["schema"]["properties"]["parameters"]
    assert set(schema["properties"]) == {"kernel", "C", "gamma", "degree", "shrinking"}
    assert set(schema["required"]) == {"kernel", "C", "shrinking"}


@pytest.mark.filterwarnings("ignore::optuna.exceptions.ExperimentalWarning")
def test_prompt_names_objectives_and_constraints(chat_server: ChatServer) -> None:
    def two(trial: optuna.Trial) -> tuple[float, float]:
        x = trial.suggest_float("x", 0.0, 1.0)
        trial.set_constraint("too wide", x - 0.9)
        if trial.number == 3:
            raise optuna.TrialPruned
        return x, 1.0 - x

    chat_server.answer = answering({"x": 0.25})
    study = optuna.create_study(directions=["minimize", "maximize"], sampler=NSGAIISampler(seed=1))
    study.set_metric_names(["cost [EUR]", "accuracy"])
    study.enqueue_trial({"x": 0.95})
    study.optimize(two, n_trials=10, callbacks=[ProposalCallback(proposer(chat_server), every=10)])
    prompt = chat_server.prompts()[0]
    assert "- cost__EUR_ (cost [EUR]): minimised\n- accuracy: maximised\n" in prompt
    assert "A trial is feasible where each of these is <= 0: too wide." in prompt
    assert "infeasible, by too wide = 0.05" in prompt.split("## Some of the other trials")[1]
    assert study.trials[9].params == {"x": 0.25}


def test_repeatedly_refused_answer_is_a_fault(chat_server: ChatServer) -> None:
    chat_server.answer = answering({**GOOD, "C": 0})
    callback = ProposalCallback(proposer(chat_server), every=10)
    study = study_of(12, callback)
    assert callback.faults == {"answer": 1}
    assert len(chat_server.requests) == 1 + 3  # asked again at most twice
    assert {trial.state for trial in study.trials} == {TrialState.COMPLETE}
    assert not any(trial.user_attrs for trial in study.trials)


def test_invalid_key_is_found_before_the_first_trial(chat_server: ChatServer) -> None:
    chat_server.answer = lambda request: (401, '{"error": {"message": "no such key"}}')
    with pytest.raises(ModelError, match="no such key"):
        proposer(chat_server).check()


def test_given_space_needs_no_trial_and_narrows_the_observed_one(chat_server: ChatServer) -> None:
    space = {"C": FloatDistribution(1.0, 5.0), "kernel": CategoricalDistribution(["linear", "rbf"])}
    chat_server.answer = answering({"C": 2, "kernel": "linear"})
    llm = proposer(chat_server, space=space)
    study = study_of()
    assert dict(llm.propose(study, 0, 0).params) == {"C": 2.0, "kernel": "linear"}
    study.optimize(objective, n_trials=3)
    chat_server.answer = answering({**GOOD, "C": 6.0})
    with pytest.raises(ProposalError, match="retries"):
        llm.propose(study, 0, 3)
    assert "C = 6 is outside 1 <= C <= 5" in chat_server.prompts()[-1]


def test_parameter_names_invalid_for_vendors_get_plain_keys(chat_server: ChatServer) -> None:
    chat_server.answer = answering({"layer_1_units": 4})
    study = optuna.create_study(sampler=TPESampler(seed=0))
    callback = ProposalCallback(proposer(chat_server), every=2)
    study.optimize(lambda trial: trial.suggest_int("layer 1/units", 1, 9), n_trials=2, callbacks=[callback])
    assert study.trials[1].params == {"layer 1/units": 4}
    assert "- layer_1_units (layer 1/units): whole number, 1 to 9" in chat_server.prompts()[0]


def test_given_space_of_another_kind_is_refused(chat_server: ChatServer) -> None:
    llm = proposer(chat_server, space={"C": IntDistribution(1, 9)})
    with pytest.raises(SettingsError, match="C is whole number, 1 to 9; in the study's trials it is number"):
        llm.propose(study_of(2), 0, 2)


def shown(study: optuna.Study, seed: int) -> str:
    parameters = study_parameters(observed_space(study), study.trials)
    return study_prompt(study, study.trials, parameters, "d", seed, PromptOptions())


def test_shown_trials_depend_only_on_the_seed() -> None:
    study = study_of(30)
    assert shown(study, 1) == shown(study, 1) != shown(study, 2)
    assert shown(study, 1).count("\nTrial ") == 10


def test_long_prompt_shows_fewer_trials() -> None:
    study = optuna.create_study(sampler=TPESampler(seed=0, n_startup_trials=100))
    space = {f"x{i}": FloatDistribution(0.0, 1.0) for i in range(150)}
    for number in range(40):
        study.tell(study.ask(space), float(number))
    text = shown(study, 0)
    assert MAX_TOKENS / 2 < estimated_tokens(text) <= MAX_TOKENS
    assert text.count("\n- x") == 150
    assert len(re.findall(r"## The best trials\n\nTrial 0\n", text)) == 1


def completed(values: list[float], constraint: float | None = None) -> optuna.trial.FrozenTrial:
    return create_trial(values=values, system_attrs={} if constraint is None else {"constraints": [constraint]})


def test_best_trials_are_feasible_and_respect_directions() -> None:
    study = optuna.create_study(directions=["maximize", "minimize"])
    study.add_trials([completed([1.0, 1.0]), completed([2.0, 1.0]), completed([9.0, 0.0], 0.5), completed([0.0, 0.0])])
    assert [trial.number for trial in best_trials(study.trials, study.directions)] == [1, 3]
    assert {trial.number for trial in study.best_trials} == {1, 3}
    single = optuna.create_study(direction="maximize")
    single.add_trials([completed([float(i % 7)], 0.1 if i == 6 else -1.0) for i in range(12)])
    assert [trial.value for trial in best_trials(single.trials, single.directions)] == [5.0, 4.0, 4.0, 3.0, 3.0]


def test_nearest_trials_are_best_without_a_feasible_one() -> None:
    study = optuna.create_study()
    study.add_trials([completed([0.0], float(10 - i)) for i in range(8)])
    study.add_trial(completed([0.0], float("nan")))
    assert [trial.number for trial in best_trials(study.trials, study.directions)] == [7, 6, 5, 4, 3]


def test_prompt_lists_pending_proposals() -> None:
    study = study_of(5)
    for number in (5, 6):
        own = {"source": "llm", "proposal": f"llm-{number}"}
        study.enqueue_trial({"kernel": "linear", "C": number}, user_attrs=own)
    study.ask()
    under_way = shown(study, 0).split("## Proposals under way, without results yet\n\n")[1]
    assert under_way.startswith("PARAMETERS: kernel = linear, C = 5\nPARAMETERS: kernel = linear, C = 6\n\n")
    assert "under way" not in shown(study_of(5), 0)
