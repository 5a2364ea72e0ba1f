"""The language model as a proposer."""

from collections.abc import Mapping
from typing import Any

from armwright.llm.conversation import RESULTS, conversation
from armwright.llm.model_options import ModelOptions
from armwright.llm.prompt import MAX_TOKENS, estimated_tokens, parameters_prompt
from armwright.problem.problem import Problem
from armwright.proposers.prompted import PromptedProposer
from armwright.runs.history import History

# Tokens of a number and of a design in the feedback, of an analysis and of the parameters after it, for estimates.
NUMBER_TOKENS, DESIGN_TOKENS, ANALYSIS_TOKENS, PARAMETER_TOKENS = 5, 100, 1000, 200
SHOWN_DESIGNS, LISTED_DESIGNS = 10, 40  # in detail, and in one line each, late in a run


class LlmProposer(PromptedProposer):
    """Ask a language model for each proposal, and record questions and answers.

    Args:
        options: Which model, what it is asked, how it is called, what it may spend; or a model's name.
    """

    def __init__(self, options: ModelOptions | str) -> None:
        from armwright.llm.client import ModelClient

        options = ModelOptions.of(options)
        super().__init__(ModelClient(options), options.source, options)
        self.options = options

    def settings(self) -> Mapping[str, Any]:
        """Return model, server, prompt and what is sent with it."""
        sent = {name: getattr(self.options, name) for name in ("output", "temperature", "seed", "origin")}
        return {"model": self.options.model, "base_url": self.options.base_url, **super().settings(), **sent}

    def forecast(self, problem: Problem, n: int) -> str:
        """Estimate the calls, tokens and cost of `n` proposals."""
        from armwright.llm.prices import describe_cost

        requests = (2 if self.options.answer == "two-step" else 1) * n
        given, written = self._expected_tokens(problem, n)
        cost = describe_cost(self.options, requests, given, written)
        return (
            f"{n} proposals: about {requests + 1} calls, {_thousands(given)} tokens in, {_thousands(written)} out; "
            f"{cost}"
        )

    def _expected_tokens(self, problem: Problem, n: int) -> tuple[int, int]:
        """Return the tokens of the prompts and of the answers of `n` proposals."""
        written = ANALYSIS_TOKENS + PARAMETER_TOKENS
        prompt = self.prompt_for(History(problem, (), 0), 0, 0)
        whole = min(MAX_TOKENS, estimated_tokens(prompt) + self._feedback_tokens(problem))
        in_steps = self.options.answer == "two-step"
        second = estimated_tokens(parameters_prompt(problem, "")) + ANALYSIS_TOKENS if in_steps else 0
        if not self.chat:
            return n * (whole + second), n * written
        turns = conversation(self._transcript.calls)
        past = sum(estimated_tokens(turn.question) + estimated_tokens(turn.answer) for turn in turns)
        part = whole - estimated_tokens(prompt.rpartition(RESULTS)[0])  # of a question after the first
        first = past + part if turns else whole
        asked = n * first + n * (n - 1) // 2 * (part + written)
        return asked + n * second, n * written

    def _feedback_tokens(self, problem: Problem) -> int:
        """Estimate the tokens of the feedback late in a run without evaluating designs, which may be slow."""
        lists_all = self.options.prompt == "full"
        joints = problem.space.max_joints
        each = len(problem.objectives) + 3 + joints * (2 if lists_all else 1)  # numbers of a target
        alone = 2 * joints + len(problem.objectives) + 3
        numbers = len(problem.task.targets) * each + alone
        designs = SHOWN_DESIGNS * (NUMBER_TOKENS * numbers + DESIGN_TOKENS)
        return designs + (LISTED_DESIGNS * NUMBER_TOKENS * alone if lists_all else 0)


def _thousands(n: int) -> str:
    return f"{n:,}" if n < 10_000 else f"{round(n, -3):,}"
