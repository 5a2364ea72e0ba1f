"""The language model as a proposer."""

from collections.abc import Mapping
from typing import Any

from armwright.exceptions import SettingsError
from armwright.llm.feedback import N_PARETO, N_RANDOM
from armwright.llm.prompt import MOST_TOKENS, estimated_tokens, parameters_prompt
from armwright.llm.prompt_values import MOST_TARGETS
from armwright.problem.problem import Problem
from armwright.proposers.prompted import Asking, PromptedProposer
from armwright.runs.history import History

TOKENS_A_NUMBER, TOKENS_A_DESIGN = 5, 100  # of feedback, by what prompts came to
THOUGHT_TOKENS, PARAMETER_TOKENS = 1000, 200  # that a model is taken to write, for an estimate


class LlmProposer(PromptedProposer):
    """Asks a language model for each proposal, and keeps what was said.

    model: vendor and name, `openai-chat:gpt-4o`, `anthropic:claude-…`, `google:…`, `azure:…`, `openrouter:…`,
        `ollama:…`, `vllm:…`.
    base_url: the address of any OpenAI-compatible server instead.
    prompt: "plus" (with instructions on how to analyse the parameters), "minus", or a template file.
    memory: "none" (every call is new), or "own": the earlier proposals of the run are shown.
    answer: "two-step" (free reasoning, then a second call into the schema) or "one-step".
    proposals: designs a call.
    temperature, seed: sent only if they are set.
    output: how an answer is held to a schema: "tool", "native", "prompted"; "auto" chooses by the server.
    max_calls, max_cost: after so many calls, or [USD], of the whole run it asks no more.
    origin: "scripted" where a stand-in answers instead of a model: written with every call, and the trials' source.
    """

    def __init__(
        self,
        model: str,
        base_url: str | None = None,
        prompt: str = "plus",
        *,
        memory: str = "none",
        answer: str = "two-step",
        proposals: int = 1,
        temperature: float | None = None,
        seed: int | None = None,
        output: str = "auto",
        max_calls: int | None = None,
        max_cost: float | None = None,
        origin: str = "model",
    ) -> None:
        from armwright.llm.client import ModelClient

        asking = Asking(prompt, memory, answer, proposals)
        if answer == "text":
            raise SettingsError('answer "text" is for people; a model needs "two-step" or "one-step"')
        chat = ModelClient(model, base_url, output=output, temperature=temperature, seed=seed, origin=origin)
        # A stand-in's designs must never be taken for a model's: they have a source of their own.
        name = "llm" if origin == "model" else origin
        super().__init__(chat, asking, name, max_calls=max_calls, max_cost=max_cost)
        self.model = model
        self.base_url = base_url
        self._sent = {"output": output, "temperature": temperature, "seed": seed, "origin": origin}

    def settings(self) -> Mapping[str, Any]:
        """Model, server, prompt and what is sent with it."""
        return {"model": self.model, "base_url": self.base_url, **super().settings(), **self._sent}

    def forecast(self, problem: Problem, n: int) -> str:
        """About what `n` proposals will take, before any is asked for."""
        from armwright.llm.client import describe_cost

        calls = -(-n // self.asking.proposals)
        given, written = self._tokens_each(problem)
        steps = 2 if self._form == "then-schema" else 1
        words = (
            f"{n} proposals: about {steps * calls + 1} calls, {_thousands(calls * given)} tokens in, "
            f"{_thousands(calls * written)} out"
        )
        return f"{words}; {describe_cost(self.model, self.base_url, calls * given, calls * written)}"

    def _tokens_each(self, problem: Problem) -> tuple[int, int]:
        """Tokens in and out of one proposal: as those so far in this run, else as a full prompt has."""
        said = [call for call in self._transcript.calls if call.proposal and call.fault is None]
        asked = {call.proposal for call in said}
        if asked:
            return tuple(
                sum(n) // len(asked) for n in zip(*((c.input_tokens, c.output_tokens) for c in said), strict=True)
            )  # pyright: ignore[reportReturnType]
        given = min(
            MOST_TOKENS, estimated_tokens(self.prompt_for(History(problem, (), 0), 0)) + _feedback_tokens(problem)
        )
        written = self.asking.proposals * PARAMETER_TOKENS + THOUGHT_TOKENS
        if self._form == "then-schema":
            given += estimated_tokens(parameters_prompt(problem, "")) + THOUGHT_TOKENS
        return given, written


def _feedback_tokens(problem: Problem) -> int:
    """Of the feedback in a full prompt, without evaluating anything: an evaluator can be slow."""
    joints, targets = problem.space.max_joints, min(len(problem.task.targets), MOST_TARGETS)
    numbers = targets * (len(problem.objectives) + 3 + joints) + 2 * joints + len(problem.objectives) + 3
    return (N_PARETO + N_RANDOM) * (TOKENS_A_NUMBER * numbers + TOKENS_A_DESIGN)


def _thousands(n: int) -> str:
    return f"{n:,}" if n < 10_000 else f"{round(n, -3):,}"
