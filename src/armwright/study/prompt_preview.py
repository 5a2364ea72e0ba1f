"""Preview of the prompt that a run would send to a language model."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from armwright.llm.backend import LlmBackend
from armwright.llm.model_options import PromptOptions
from armwright.llm.prompt import estimated_tokens
from armwright.problem.problem import Problem
from armwright.proposers.prompted import PromptedProposer
from armwright.proposers.replay import recorded_options
from armwright.runs.folder import read_run
from armwright.study.overlapping_schedule import request_schedule
from armwright.study.proposal_requests import ProposalRequests, proposal_seed
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
    return _preview(proposer, problem, n_init, text)


def preview_after(run: Path, options: PromptOptions | None = None) -> Preview:
    """Return the prompt for the next proposal of a run, requested as the run would.

    Options that are set replace those of the run.
    """
    config, history = read_run(run)
    stated = {} if options is None else options.given
    given = {name: value for name, value in stated.items() if name in PromptOptions.model_fields}
    asked = recorded_options(config).model_copy(update=given)
    settings = config.study.proposer or {}
    proposer = PromptedProposer(LlmBackend(), settings["name"] if "prompt" in settings else "llm", asked)
    proposer.open_read_only(run)
    requests = ProposalRequests(proposer, config.seed, config.study, lambda: history)
    number = request_schedule(requests).upcoming(len(history))
    # With other options the new prompt is shown, even if the run waits for the second call of an answer.
    if given:
        text = proposer.prompt_for(history, proposal_seed(config.seed, number), number, proposer.next_hints())
    else:
        text = proposer.question(history, proposal_seed(config.seed, number), number).prompt
    return _preview(proposer, history.problem, number, text)


def _preview(proposer: PromptedProposer, problem: Problem, number: int, text: str) -> Preview:
    return Preview(number, text, estimated_tokens(text), dict(proposer.output_format(problem).schema))
