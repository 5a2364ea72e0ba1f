"""The language model as a proposer for any Optuna study."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import optuna

from armwright.exceptions import ModelError, ProposalError, SettingsError
from armwright.llm.backend import CHECK, Question, Reply
from armwright.llm.budget import CallBudget
from armwright.llm.model_options import ModelOptions
from armwright.llm.session import LlmSession
from armwright.proposers.for_optuna.answer import StudyAnswer, answer_schema, read_answer, written_answer
from armwright.proposers.for_optuna.parameters import Parameter, Space, study_parameters
from armwright.proposers.for_optuna.prompt import StudyObjective, parameters_prompt, study_objectives, study_prompt
from armwright.proposers.for_optuna.proposer import StudyProposal, StudyProposer


class StudyLlmProposer(LlmSession, StudyProposer):
    """Ask a language model for each proposal, from the study's trials and a description of the problem.

    Args:
        options: Which model, how it is called, what it may spend; or a model's name. Of the prompt options, memory
            and answer are used.
        description: What is searched and what is known of it, beyond what the names of the parameters say.
        space: The parameters' distributions; None for those of the trials so far, which these take precedence over.
        transcript: A file that keeps every call; each process needs its own.
    """

    def __init__(
        self,
        options: ModelOptions | str,
        description: str,
        *,
        space: Space | None = None,
        transcript: str | Path | None = None,
    ) -> None:
        from armwright.llm.client import ModelClient

        options = ModelOptions.of(options)
        if options.answer == "text":
            raise SettingsError('answer "text" is for manual answers; a model needs "two-step" or "one-step"')
        super().__init__(ModelClient(options), options.source, CallBudget(options.max_calls, options.max_cost))
        self.description = description
        self.options = options
        self.given_space = dict(space or {})
        path = None if transcript is None else Path(transcript)
        if path is not None and not path.parent.is_dir():
            raise SettingsError(f"transcript {path}: there is no folder {path.parent}; make it first")
        self._begin(path)

    def check(self) -> None:
        """Ask a test question before any trial.

        Raises:
            ModelError: The model gives no answers, or its price is unknown under a cost limit.
        """
        try:
            self._call(CHECK, lambda _: self.backend.check(), self._over)
        except ProposalError as error:
            raise ModelError(f"{error}. Check the model, its key and base_url") from error
        if self._budget.price_is_missing:
            raise ModelError(f"the price of {self.backend.model} is unknown, so max_cost cannot hold; use max_calls")

    def propose(self, study: optuna.Study, seed: int, number: int) -> StudyProposal:
        """Ask the model for the next trial, from the trials so far."""
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
            memory=self.options.memory,
            source=self.name,
            form=self.options.form,
        )
        known = sum(trial.state == optuna.trial.TrialState.COMPLETE for trial in trials)
        step = "answer"
        if self.options.form == "then-schema":
            thoughts = self._call(Question(identity, "reasoning", prompt, known), self.backend.ask, self._over)
            prompt, step = parameters_prompt(parameters, objectives, thoughts, self.options.expects), "parameters"
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

        reasoning = self.options.form == "schema"
        schema = answer_schema(parameters, objectives, reasoning=reasoning, expected=self.options.expects)
        return self.backend.ask_for(question, schema, read)
