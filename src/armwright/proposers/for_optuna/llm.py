"""The language model as a proposer for any Optuna study."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import optuna

from armwright.exceptions import ModelError, ProposalError, SettingsError
from armwright.llm.backend import CHECK, Question, Reply
from armwright.llm.prompt import Form
from armwright.llm.session import LlmSession
from armwright.proposers.for_optuna.answer import StudyAnswer, answer_schema, read_answer, written_answer
from armwright.proposers.for_optuna.parameters import Parameter, Space, stated_space, study_parameters
from armwright.proposers.for_optuna.prompt import StudyObjective, parameters_prompt, study_objectives, study_prompt
from armwright.proposers.for_optuna.proposer import StudyProposal, StudyProposer
from armwright.proposers.prompted import ANSWERS, Asking


class StudyLlmProposer(LlmSession, StudyProposer):
    """Asks a language model for each proposal, from the study's trials and a description in words.

    model: vendor and name, as of LlmProposer: `openai-chat:gpt-4o`, `anthropic:…`, `ollama:…`, …
    description: what is searched and what is known of it; all that the names of the parameters do not say.
    base_url: the address of any OpenAI-compatible server instead.
    space: the parameters' distributions; None: those of the trials so far. What is given here goes before those.
    memory: "none" (every call is new), or "own": its earlier proposals are shown with what came of them.
    answer: "two-step" (free reasoning, then a second call into the schema) or "one-step".
    transcript: a file that keeps every call; of several processes each needs its own.
    temperature, seed: sent only if they are set.
    output: how an answer is held to a schema: "tool", "native", "prompted"; "auto" chooses by the server.
    max_calls, max_cost: after so many calls, or [USD], of the whole transcript it asks no more.
    origin: "scripted" where a stand-in answers instead of a model: written with every call, and the trials' source.
    """

    def __init__(
        self,
        model: str,
        description: str,
        base_url: str | None = None,
        *,
        space: Space | None = None,
        memory: str = "none",
        answer: str = "two-step",
        transcript: str | Path | None = None,
        temperature: float | None = None,
        seed: int | None = None,
        output: str = "auto",
        max_calls: int | None = None,
        max_cost: float | None = None,
        origin: str = "model",
    ) -> None:
        from armwright.llm.client import ModelClient

        Asking(memory=memory, answer=answer)  # refuses names that do not exist
        if answer == "text":
            raise SettingsError('answer "text" is for people; a model needs "two-step" or "one-step"')
        chat = ModelClient(model, base_url, output=output, temperature=temperature, seed=seed, origin=origin)
        # A stand-in's trials must never be taken for a model's: they have a source of their own.
        super().__init__(chat, "llm" if origin == "model" else origin, max_calls=max_calls, max_cost=max_cost)
        self.description = description
        self.memory = memory
        self._form: Form = ANSWERS[answer]
        self._space = dict(space or {})
        path = None if transcript is None else Path(transcript)
        if path is not None and not path.parent.is_dir():
            raise SettingsError(f"transcript {path}: there is no folder {path.parent}; make it first")
        self._begin(path)

    def space(self, study: optuna.Study) -> Space:
        """What was given, and what the trials have shown besides."""
        return stated_space(study, self._space)

    def check(self) -> None:
        """Makes sure that answers are to be had, before any trial; ModelError where not."""
        try:
            self._call(CHECK, lambda question: self.backend.check(), self._over)
        except ProposalError as fault:
            raise ModelError(f"{fault}. Check the model, its key and base_url") from fault
        if self._budget.price_is_missing:
            raise ModelError(f"the price of {self.backend.model} is not known, so max_cost cannot hold; use max_calls")

    def propose(self, study: optuna.Study, seed: int, number: int) -> StudyProposal:
        """The next trial, from what the study has found."""
        trials = study.get_trials(deepcopy=False)
        parameters = study_parameters(self.space(study), trials)
        if not parameters:
            raise ProposalError("space", "no trial has shown a parameter yet; give StudyLlmProposer(space=…)")
        objectives = study_objectives(study)
        identity = f"{self.name}-{number:04d}"
        prompt = study_prompt(
            study,
            trials,
            parameters,
            self.description,
            seed,
            memory=self.memory,
            source=self.name,
            form=self._form,
        )
        known = sum(trial.state == optuna.trial.TrialState.COMPLETE for trial in trials)
        step = "answer"
        if self._form == "then-schema":
            thoughts = self._call(Question(identity, "reasoning", prompt, known), self.backend.ask, self._over)
            prompt, step = parameters_prompt(parameters, objectives, thoughts, self._expects), "parameters"
        question = Question(identity, step, prompt, known)
        text = self._call(question, lambda asked: self._ask_for(asked, parameters, objectives), self._over)
        answer = read_answer(json.loads(text), parameters, objectives)
        return StudyProposal(answer.params, identity, answer.reason, answer.expected)

    def _ask_for(
        self, question: Question, parameters: Sequence[Parameter], objectives: Sequence[StudyObjective]
    ) -> Reply:
        def read(content: Mapping[str, Any]) -> str:
            answer: StudyAnswer = read_answer(content, parameters, objectives)
            return written_answer(answer, parameters, objectives, str(content.get("reasoning") or ""))

        reasoning = self._form == "schema"
        schema = answer_schema(parameters, objectives, reasoning=reasoning, expected=self._expects)
        return self.backend.ask_for(question, schema, read)

    @property
    def _expects(self) -> bool:
        return self.memory == "own"
