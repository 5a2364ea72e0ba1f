"""The language model as a proposer."""

from collections.abc import Mapping
from typing import Any

from armwright.llm.budget import CallBudget
from armwright.llm.feedback import N_LATEST, N_PARETO, N_RANDOM
from armwright.llm.model_options import ModelOptions
from armwright.llm.prompt import MAX_TOKENS, estimated_tokens, parameters_prompt
from armwright.llm.prompt_values import MAX_TARGETS
from armwright.problem.problem import Problem
from armwright.proposers.prompted import PromptedProposer
from armwright.runs.history import History

TOKENS_A_NUMBER, TOKENS_A_DESIGN = 5, 100  # of feedback, measured on prompts
LINES = 40  # of designs in one line each that a prompt has on average
THOUGHT_TOKENS, PARAMETER_TOKENS = 1000, 200  # of an answer, for estimates


class LlmProposer(PromptedProposer):
    """Ask a language model for each proposal, and record questions and answers.

    Args:
        options: Which model, what it is asked, how it is called, what it may spend; or a model's name.
    """

    def __init__(self, options: ModelOptions | str) -> None:
        from armwright.llm.client import ModelClient

        options = ModelOptions.of(options)
        budget = CallBudget(options.max_calls, options.max_cost)
        super().__init__(ModelClient(options), options, options.source, budget=budget)
        self.options = options

    def settings(self) -> Mapping[str, Any]:
        """Return model, server, prompt and what is sent with it."""
        sent = {name: getattr(self.options, name) for name in ("output", "temperature", "seed", "origin")}
        return {"model": self.options.model, "base_url": self.options.base_url, **super().settings(), **sent}

    def forecast(self, problem: Problem, n: int) -> str:
        """Estimate the calls, tokens and cost of `n` proposals."""
        from armwright.llm.client import describe_cost

        calls = -(-n // self.options.proposals)
        given, written = self._tokens_each(problem)
        steps = 2 if self.options.form == "then-schema" else 1
        estimate = (
            f"{n} proposals: about {steps * calls + 1} calls, {_thousands(calls * given)} tokens in, "
            f"{_thousands(calls * written)} out"
        )
        return f"{estimate}; {describe_cost(self.options, calls * given, calls * written)}"

    def _tokens_each(self, problem: Problem) -> tuple[int, int]:
        """Return input and output tokens per proposal: the mean so far, or the estimate for a full prompt."""
        calls = [call for call in self._transcript.calls if call.proposal and call.fault is None]
        proposals = {call.proposal for call in calls}
        if proposals:
            tokens = sum(call.input_tokens for call in calls), sum(call.output_tokens for call in calls)
            return tokens[0] // len(proposals), tokens[1] // len(proposals)
        given = min(
            MAX_TOKENS, estimated_tokens(self.prompt_for(History(problem, (), 0), 0)) + self._feedback_tokens(problem)
        )
        written = self.options.proposals * PARAMETER_TOKENS + THOUGHT_TOKENS
        if self.options.form == "then-schema":
            given += estimated_tokens(parameters_prompt(problem, "")) + THOUGHT_TOKENS
        return given, written

    def _feedback_tokens(self, problem: Problem) -> int:
        """Estimate the tokens of the feedback late in a run without evaluating designs, which may be slow."""
        lists_all = self.prompt.name == "full"
        joints, targets = problem.space.max_joints, min(len(problem.task.targets), MAX_TARGETS)
        each = len(problem.objectives) + 3 + joints * (2 if lists_all else 1)  # numbers of a target
        alone = 2 * joints + len(problem.objectives) + 3
        n_designs = N_LATEST + (N_PARETO + N_RANDOM) // 2 if lists_all else N_PARETO + N_RANDOM
        designs = n_designs * (TOKENS_A_NUMBER * (targets * each + alone) + TOKENS_A_DESIGN)
        return designs + (LINES * TOKENS_A_NUMBER * alone if lists_all else 0)


def _thousands(n: int) -> str:
    return f"{n:,}" if n < 10_000 else f"{round(n, -3):,}"
