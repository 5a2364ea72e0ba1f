"""Which proposer a run gets."""

from dataclasses import dataclass

from armwright.exceptions import SettingsError, did_you_mean
from armwright.llm.configuration import ModelName, configured_model
from armwright.llm.prompt import PROMPTS
from armwright.proposers.proposer import Proposer
from armwright.proposers.rules import RulesProposer

PROPOSERS = ("auto", "none", "rules", "llm")


@dataclass(frozen=True)
class Choice:
    """A proposer (None: black-box trials only), and what was chosen and why, in one line for the user."""

    proposer: Proposer | None
    reason: str


def choose_proposer(
    name: str = "auto", model: str | None = None, base_url: str | None = None, prompt: str = "plus"
) -> Choice:
    """The proposer of a name.

    auto: a language model where one is named by --model, ARMWRIGHT_MODEL or the configuration file; else the
    built-in rules. A key lying in the environment alone spends no money.
    """
    if name not in PROPOSERS:
        raise SettingsError(
            f'unknown proposer "{name}".{did_you_mean(name, PROPOSERS)} Proposers: {", ".join(PROPOSERS)}'
        )
    if prompt not in PROMPTS:
        raise SettingsError(f'unknown prompt "{prompt}".{did_you_mean(prompt, PROMPTS)} Prompts: {", ".join(PROMPTS)}')
    if base_url and not model and name in ("none", "rules"):
        raise SettingsError(f"--proposer {name} uses no language model; leave out --base-url {base_url}")
    if model and name in ("none", "rules"):
        raise SettingsError(
            f"--proposer {name} uses no language model; leave out --model {model}, or take --proposer llm"
        )
    if name == "none":
        return Choice(None, "proposer: none (black-box trials only)")
    configured = configured_model(model, base_url) if name != "rules" else None
    if configured is not None:
        return _language_model(configured, prompt)
    if name == "llm":
        raise SettingsError(
            "--proposer llm needs a language model: give --model openai-chat:gpt-4o (with its key in the environment), "
            "set ARMWRIGHT_MODEL, or take --proposer rules"
        )
    if base_url:
        raise SettingsError(f"--base-url {base_url} needs --model NAME, the name of a model on that server")
    why = "as asked" if name == "rules" else "no language model is configured; --model names one"
    return Choice(RulesProposer(), f"proposer: rules ({why})")


def _language_model(configured: ModelName, prompt: str) -> Choice:
    from armwright.proposers.llm import LlmProposer

    proposer = LlmProposer(configured.model, configured.base_url, prompt)
    server = f" at {configured.base_url}" if configured.base_url else ""
    return Choice(
        proposer, f"proposer: llm ({configured.model}{server}, named by {configured.named_by}; prompt {prompt})"
    )
