"""The base class of proposers that ask a language model or a person, or repeat what one of them answered."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from armwright.exceptions import DesignError, ProposalError
from armwright.llm.answer import answer_schema, read_answer, read_text, written_answer
from armwright.llm.backend import LlmBackend, OutputFormat, Question
from armwright.llm.model_options import PromptOptions
from armwright.llm.prompt import design_prompt, parameters_prompt
from armwright.llm.session import LlmSession
from armwright.llm.transcript import LAST_STEPS, TRANSCRIPTS
from armwright.problem.problem import Problem
from armwright.proposers.proposer import Proposal, Proposer
from armwright.runs.history import History


class PromptedProposer(LlmSession, Proposer):
    """Ask a backend for each proposal, and record questions and answers.

    `name` is the `source` of its trials. The options say how designs are asked for, and what the whole run may spend.
    """

    def __init__(self, backend: LlmBackend, name: str, options: PromptOptions) -> None:
        super().__init__(backend, name, options)
        self.overlaps = self.overlaps and not self.chat  # a turn follows the one before it

    def settings(self) -> Mapping[str, Any]:
        """Return prompt, memory and form of the answer."""
        return self.options.model_dump(include=set(PromptOptions.model_fields))

    def open(self, folder: Path | None) -> None:
        """Open the run's transcript."""
        self._begin(None if folder is None else folder / TRANSCRIPTS)

    def unused(self, history: History) -> Sequence[Proposal]:
        """Return recorded designs of a killed run that no trial has used yet."""
        used = {trial.answer for trial in history}
        recorded: dict[str, Proposal] = {}
        for call in self._transcript.calls:
            if call.step in LAST_STEPS and call.fault is None:
                with suppress(DesignError):  # a transcript edited by hand: asked again
                    recorded[call.proposal] = proposal_of(call, call.answer, history.problem)
        return [proposal for proposal in recorded.values() if proposal.id not in used]

    def propose(self, history: History, seed: int, number: int) -> Proposal:
        """Propose the next design; recorded thoughts of a killed run are used rather than asked for again."""
        question, problem = self._next_question(history, seed, number), history.problem
        try:
            text = self._ask(question, self.output_format(problem), partial(parameters_prompt, problem))
        except ProposalError as fault:
            fault.known = question.known
            raise
        return proposal_of(question, text, problem)

    def _next_question(self, history: History, seed: int, number: int) -> Question:
        """Return the next question for trial `number`: the second one if the reasoning is recorded already."""
        thoughts = self._transcript.answered(self.identity(number), "reasoning")
        if thoughts is not None:
            prompt = parameters_prompt(history.problem, thoughts.answer)
            return Question(self.identity(number), "parameters", prompt, thoughts.known)
        return self._question(number, self.prompt_for(history, seed, number), len(history))

    def prompt_for(self, history: History, seed: int, number: int) -> str:
        """Return the prompt for trial `number`; in a chat, the part of it that is new."""
        return self._part_to_ask(design_prompt(history, seed, self.options, name=self.name), number)

    def output_format(self, problem: Problem) -> OutputFormat:
        """Return the form of the answer that holds the design; it is recorded as JSON that `read_text` reads."""

        def read(content: Mapping[str, Any] | str) -> str:
            if isinstance(content, str):
                return written_answer(read_text(content, problem))
            return written_answer(read_answer(content, problem), str(content.get("reasoning", "")))

        return OutputFormat(answer_schema(problem, self.options), read)


def proposal_of(question: Question, text: str, problem: Problem, note: str = "") -> Proposal:
    """Return the proposal that a recorded answer holds; raises DesignError if there is none."""
    answer = read_text(text, problem)
    return Proposal(answer.design, question.proposal, answer.reason, question.trial, question.known, note)
