"""Preview of the first prompt that a new run would send to a language model."""

from dataclasses import dataclass, replace
from typing import Any

from armwright.llm.backend import LlmBackend
from armwright.llm.model_options import PromptOptions
from armwright.llm.prompt import estimated_tokens
from armwright.problem.problem import Problem
from armwright.proposers.prompted import PromptedProposer
from armwright.study.proposal_requests import proposal_seed
from armwright.study.study import optimize


@dataclass(frozen=True)
class Preview:
    """Prompt for a trial."""

    number: int
    prompt: str
    tokens: int  # estimated length of the prompt
    schema: dict[str, Any]  # JSON schema of the answer


def preview(
    problem: Problem, options: PromptOptions, *, n_init: int = 10, n_total: int = 200, seed: int = 0
) -> Preview:
    """Return the first prompt of a new run."""
    history = optimize(problem, proposer="none", n_init=n_init, n_total=1, seed=seed).history.before(n_init)
    assert history.method is not None
    history = replace(history, method=history.method.model_copy(update={"n_total": n_total}))
    proposer = PromptedProposer(LlmBackend(), "llm", options)
    text = proposer.prompt_for(history, proposal_seed(seed, n_init), n_init)
    return Preview(n_init, text, estimated_tokens(text), dict(proposer.output_format(problem).schema))
