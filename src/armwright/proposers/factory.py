"""Choose the proposer of a run from its name and its options."""

from collections.abc import Collection
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from armwright.exceptions import SettingsError, did_you_mean
from armwright.llm.configuration import ConfiguredModel, configured_model
from armwright.llm.model_options import ModelOptions
from armwright.proposers.proposer import Proposer
from armwright.proposers.rules import RulesProposer

PROPOSERS = ("auto", "none", "rules", "llm")
WITH_PLACE = ("replay", "manual")  # written replay:RUN and manual:DIR

# The options that each proposer uses; the others are refused.
_USED: dict[str, Collection[str]] = {
    "none": (),
    "rules": (),
    "manual": ("prompt", "memory"),  # answers are text and cost nothing
    "replay": ("in_flight",),
    "llm": list(ModelOptions.model_fields),
}


@dataclass(frozen=True)
class Choice:
    """A proposer, the options that it was made from, and the reason for the choice."""

    proposer: Proposer | None  # None for black-box trials only
    reason: str  # what was chosen and why, in one line for the user
    options: ModelOptions  # the given ones, completed by the configuration if a model is used


def choose_proposer(name: str = "auto", options: ModelOptions | None = None) -> Choice:
    """Return the proposer of a name.

    Args:
        name: "auto", "none", "rules", "llm", "replay:RUN" or "manual:DIR". "auto" takes a language model if one is
            named by the options, ARMWRIGHT_MODEL or the configuration file, and the built-in rules if not. A key in
            the environment alone spends no money.
        options: Options of the model. Those that the proposer does not use are refused.

    Raises:
        SettingsError: The name is unknown, no model is configured, or an option has no effect.
    """
    options = options or ModelOptions()
    kind, colon, place = name.partition(":")
    names = (*PROPOSERS, *WITH_PLACE)
    if kind not in names or (colon and kind not in WITH_PLACE):
        raise SettingsError(
            f'unknown proposer "{name}".{did_you_mean(kind, names)} '
            f"Proposers: {', '.join(PROPOSERS)}, replay:RUN, manual:DIR"
        )
    if kind in WITH_PLACE and not place:
        raise SettingsError(f"--proposer {kind} needs a {'run' if kind == 'replay' else 'folder'}: {kind}:PATH")
    configured = configured_model(options) if kind in ("auto", "llm") else None
    if configured is not None or kind == "llm":
        import_module("armwright.llm.client")  # names the extra `llm`, which brings all that follows
    if configured is None and kind == "llm":
        raise SettingsError(
            "--proposer llm needs a language model: give --model openai-chat:gpt-4o (with its key in the environment), "
            "set ARMWRIGHT_MODEL, or use --proposer rules"
        )
    used = "llm" if configured is not None else "rules" if kind == "auto" else kind
    _check_options(name, options, _USED[used])
    options = options if configured is None else configured.options
    proposer, description = _proposer(kind, place, options, configured)
    return Choice(proposer, f"proposer: {description}", options)


def _check_options(name: str, options: ModelOptions, used: Collection[str]) -> None:
    """Raise SettingsError for the first option that is given and not used."""
    for key, value in options.given.items():
        if key in used:
            continue
        if name == "auto" and key in _USED["llm"]:
            raise SettingsError(
                f"{key} = {value} needs a language model, and none is configured; name one by --model, "
                f"or leave out {key}"
            )
        raise SettingsError(
            f"--proposer {name} does not use {key} = {value}; leave it out, or choose another --proposer"
        )


def _proposer(
    kind: str, place: str, options: ModelOptions, configured: ConfiguredModel | None
) -> tuple[Proposer | None, str]:
    """Return a proposer, which is a language model if one is configured, and its description."""
    if configured is not None:
        from armwright.proposers.llm import LlmProposer

        return LlmProposer(options), f"llm ({configured}; prompt {options.prompt})"
    if kind == "none":
        return None, "none (black-box trials only)"
    if kind == "replay":
        from armwright.proposers.replay import ReplayProposer

        replayed = ReplayProposer(place)
        recording, backend = replayed.recording, replayed.backend
        settings = f", recorded with {recording.options}" if recording.provenance else ""
        return replayed, (
            f"{replayed.name}, replayed from {place} ({len(recording.calls)} recorded calls to {backend.model}, origin "
            f"{backend.origin}{settings}; no network)"
        )
    if kind == "manual":
        from armwright.proposers.manual import ManualProposer

        description = f"manual (questions and answers in {place}/; prompt {options.prompt})"
        return ManualProposer(Path(place), options), description
    reason = "as requested" if kind == "rules" else "no language model is configured; --model names one"
    return RulesProposer(), f"rules ({reason})"
