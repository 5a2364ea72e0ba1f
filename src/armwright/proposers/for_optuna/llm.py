"""The language model as a proposer for any Optuna study."""

import json
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import optuna

from armwright.exceptions import SettingsError
from armwright.llm.backend import OutputFormat
from armwright.llm.model_options import ModelOptions
from armwright.llm.session import LlmSession
from armwright.proposers.for_optuna.answer import answer_schema, read_answer, written_answer
from armwright.proposers.for_optuna.parameters import Parameter, Space, study_parameters
from armwright.proposers.for_optuna.prompt import parameters_prompt, study_prompt
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
        super().__init__(ModelClient(options), options.source, options)
        self.description = description
        self.given_space = dict(space or {})
        path = None if transcript is None else Path(transcript)
        if path is not None and not path.parent.is_dir():
            raise SettingsError(f"transcript {path}: there is no folder {path.parent}; make it first")
        self._begin(path)

    def propose(self, study: optuna.Study, seed: int, number: int) -> StudyProposal:
        """Ask the model for the next trial, from the trials so far."""
        trials = study.get_trials(deepcopy=False)
        parameters = study_parameters(self.space(study), trials)
        prompt = study_prompt(study, trials, parameters, self.description, seed, self.options)
        known = sum(trial.state == optuna.trial.TrialState.COMPLETE for trial in trials)
        text = self._ask(
            self._question(number, self._part_to_ask(prompt, number), known),
            self._output_format(parameters),
            partial(parameters_prompt, parameters),
        )
        params, reason = read_answer(json.loads(text), parameters)
        return StudyProposal(params, self.identity(number), reason)

    def _output_format(self, parameters: Sequence[Parameter]) -> OutputFormat:
        def read(content: Mapping[str, Any] | str) -> str:
            assert not isinstance(content, str)  # models answer in JSON
            params, reason = read_answer(content, parameters)
            return written_answer(params, reason, parameters, str(content.get("reasoning") or ""))

        return OutputFormat(answer_schema(parameters, self.options), read)
