"""The language model as a proposer."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from armwright.llm.budget import CallBudget
from armwright.llm.conversation import RESULTS
from armwright.llm.feedback import N_LATEST, N_PARETO, N_RANDOM
from armwright.llm.model_options import ModelOptions
from armwright.llm.prompt import MAX_TOKENS, estimated_tokens, parameters_prompt
from armwright.llm.prompt_values import MAX_TARGETS
from armwright.problem.problem import Problem
from armwright.proposers.prompted import PromptedProposer
from armwright.runs.history import History

if TYPE_CHECKING:
    from armwright.llm.prices import ExpectedTokens

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
        self.client = ModelClient(options)
        super().__init__(self.client, options, options.source, budget=budget)
        self.options = options

    def settings(self) -> Mapping[str, Any]:
        """Return model, server, prompt and what is sent with it."""
        sent = {name: getattr(self.options, name) for name in ("output", "temperature", "seed", "origin")}
        return {"model": self.options.model, "base_url": self.options.base_url, **super().settings(), **sent}

    def forecast(self, problem: Problem, n: int) -> str:
        """Estimate the calls, tokens and cost of `n` proposals."""
        from armwright.llm.prices import describe_cost

        tokens = self._expected_tokens(problem, -(-n // self.options.proposals))
        estimate = (
            f"{n} proposals: about {tokens.requests + 1} calls, {_thousands(tokens.input)} tokens in, "
            f"{_thousands(tokens.output)} out"
        )
        return f"{estimate}; {describe_cost(self.options, tokens)}"

    def _expected_tokens(self, problem: Problem, n: int) -> "ExpectedTokens":
        """Return the tokens of `n` calls: from the mean so far, or the estimate for a full prompt."""
        from armwright.llm.prices import ExpectedTokens

        calls = [call for call in self._transcript.calls if call.proposal and call.fault is None]
        proposals = {call.proposal for call in calls}
        requests = (2 if self.options.form == "then-schema" else 1) * n
        written = self.options.proposals * PARAMETER_TOKENS + THOUGHT_TOKENS
        if proposals:
            written = sum(call.output_tokens for call in calls) // len(proposals)
        if proposals and not self.chat:
            given = sum(call.input_tokens for call in calls) // len(proposals)
            return ExpectedTokens(requests, n * given, n * written)
        prompt = self.prompt_for(History(problem, (), 0), 0, 0)
        whole = min(MAX_TOKENS, estimated_tokens(prompt) + self._feedback_tokens(problem))
        second = estimated_tokens(parameters_prompt(problem, "")) + THOUGHT_TOKENS if requests > n else 0
        if not self.chat:
            return ExpectedTokens(requests, n * (whole + second), n * written)
        problem_tokens = estimated_tokens(prompt.rpartition(RESULTS)[0])
        asked = self._chat_tokens(whole, whole - problem_tokens, written, n)
        return ExpectedTokens(requests, sum(asked) + n * second, n * written, sum(asked), sum(asked[:-1]))

    def _chat_tokens(self, whole: int, part: int, written: int, n: int) -> list[int]:
        """Return the tokens of the next `n` questions of a chat, each with all turns before it.

        Args:
            whole: Tokens of the first question of a chat.
            part: Tokens of a later question.
            written: Tokens of an answer.
            n: Number of questions.
        """
        turns = self._conversation().turns
        past = sum(estimated_tokens(turn.question) + estimated_tokens(turn.answer) for turn in turns)
        first = past + part if turns else whole
        return [min(first + k * (part + written), self.client.context_window) for k in range(n)]

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
