"""Preview of the first prompt that a new run would send to a language model."""

from dataclasses import replace

from armwright.llm.backend import LlmBackend
from armwright.llm.model_options import PromptOptions
from armwright.problem.problem import Problem
from armwright.proposers.prompted import PromptedProposer
from armwright.study.proposal_requests import proposal_seed
from armwright.study.study import optimize


def first_prompt(problem: Problem, options: PromptOptions, n_init: int, n_total: int, seed: int) -> str:
    """Return the first prompt of a new run."""
    history = optimize(problem, proposer="none", n_init=n_init, n_total=1, seed=seed).history.before(n_init)
    assert history.method is not None
    history = replace(history, method=history.method.model_copy(update={"n_total": n_total}))
    return PromptedProposer(LlmBackend(), "llm", options).prompt_for(history, proposal_seed(seed, n_init), n_init)
