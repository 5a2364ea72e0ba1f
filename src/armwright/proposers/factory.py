"""Which proposer a run gets."""

from collections.abc import Collection
from dataclasses import dataclass, fields
from pathlib import Path

from armwright.exceptions import SettingsError, did_you_mean
from armwright.llm.configuration import ModelName, configured_model
from armwright.llm.prompt import load_prompt
from armwright.proposers.prompted import Asking
from armwright.proposers.proposer import Proposer
from armwright.proposers.rules import RulesProposer

PROPOSERS = ("auto", "none", "rules", "llm")
WITH_PLACE = ("replay", "manual")  # written replay:RUN and manual:DIR


@dataclass(frozen=True)
class Wishes:
    """What a user says of the proposer; the fields are LlmProposer's, ReplayProposer's and ManualProposer's.

    None: nothing is said. What is said and has no use is refused.
    """

    name: str = "auto"
    model: str | None = None
    base_url: str | None = None
    prompt: str | None = None
    memory: str | None = None
    answer: str | None = None
    proposals: int | None = None
    temperature: float | None = None
    model_seed: int | None = None
    output: str | None = None
    origin: str | None = None
    max_calls: int | None = None
    max_cost: float | None = None
    replay_strict: bool = False
    once: bool = False

    @property
    def asking(self) -> Asking:
        """How designs are asked for."""
        said = {name: getattr(self, name) for name in ("prompt", "memory", "answer", "proposals")}
        return Asking(**{name: value for name, value in said.items() if value is not None})

    def unused(self, used: Collection[str]) -> str:
        """The first option that is said and not among `used`, with its value; empty where there is none."""
        for name in _OF_MODELS:
            value = getattr(self, name)
            if value is not None and name not in used:
                return f"--{name.replace('_', '-')} {value}"
        return ""


_OF_MODELS = tuple(f.name for f in fields(Wishes) if f.name not in ("name", "replay_strict", "once"))
_USED = {
    "manual": ("prompt", "memory", "proposals"),  # people answer in text, and cost nothing
    "replay": ("prompt", "memory", "answer", "proposals"),  # for a transcript alone; what contradicts it is refused
}


@dataclass(frozen=True)
class Choice:
    """A proposer (None: black-box trials only), and what was chosen and why, in one line for the user."""

    proposer: Proposer | None
    reason: str


def choose_proposer(wishes: Wishes | str = "auto") -> Choice:
    """The proposer of a name, or of all wishes.

    auto: a language model where one is named by --model, ARMWRIGHT_MODEL or the configuration file; else the
    built-in rules. A key lying in the environment alone spends no money.
    """
    if isinstance(wishes, str):
        wishes = Wishes(wishes)
    kind, colon, place = wishes.name.partition(":")
    _check(wishes, kind, colon, place)
    if kind == "none":
        return Choice(None, "proposer: none (black-box trials only)")
    if kind == "replay":
        return _replay(wishes, place)
    if kind == "manual":
        return _manual(wishes, place)
    configured = configured_model(wishes.model, wishes.base_url) if kind != "rules" else None
    if configured is not None:
        return _language_model(wishes, configured)
    if kind == "llm":
        raise SettingsError(
            "--proposer llm needs a language model: give --model openai-chat:gpt-4o (with its key in the environment), "
            "set ARMWRIGHT_MODEL, or take --proposer rules"
        )
    if wishes.base_url:
        raise SettingsError(f"--base-url {wishes.base_url} needs --model NAME, the name of a model on that server")
    if unused := wishes.unused(()):
        raise SettingsError(
            f"{unused} goes with a language model, and none is configured: name one by --model, or leave it out"
        )
    why = "as asked" if kind == "rules" else "no language model is configured; --model names one"
    return Choice(RulesProposer(), f"proposer: rules ({why})")


def _check(wishes: Wishes, kind: str, colon: str, place: str) -> None:
    """SettingsError for names that do not exist and wishes that do not go together."""
    names = (*PROPOSERS, *WITH_PLACE)
    if kind not in names or (colon and kind not in WITH_PLACE):
        raise SettingsError(
            f'unknown proposer "{wishes.name}".{did_you_mean(kind, names)} '
            f"Proposers: {', '.join(PROPOSERS)}, replay:RUN, manual:DIR"
        )
    if kind in WITH_PLACE and not place:
        raise SettingsError(f"--proposer {kind} needs a {'run' if kind == 'replay' else 'folder'}: {kind}:PATH")
    load_prompt(wishes.asking.prompt)
    if kind in ("none", "rules", *WITH_PLACE):
        if wishes.model:
            raise SettingsError(
                f"--proposer {wishes.name} uses no language model; leave out --model {wishes.model}, "
                "or take --proposer llm"
            )
        if wishes.base_url:
            raise SettingsError(
                f"--proposer {wishes.name} uses no language model; leave out --base-url {wishes.base_url}"
            )
        if unused := wishes.unused(_USED.get(kind, ())):
            raise SettingsError(f"--proposer {wishes.name} does not use {unused}; leave it out, or take --proposer llm")
    for value, option, needed in (
        (wishes.once, "--once", "manual"),
        (wishes.replay_strict, "--replay-strict", "replay"),
    ):
        if value and kind != needed:
            raise SettingsError(f"{option} goes with --proposer {needed}:PATH")


def _language_model(wishes: Wishes, configured: ModelName) -> Choice:
    from armwright.proposers.llm import LlmProposer

    asking = wishes.asking
    proposer = LlmProposer(
        configured.model,
        configured.base_url,
        asking.prompt,
        memory=asking.memory,
        answer=asking.answer,
        proposals=asking.proposals,
        temperature=wishes.temperature,
        seed=wishes.model_seed,
        output="auto" if wishes.output is None else wishes.output,
        origin="model" if wishes.origin is None else wishes.origin,
        max_calls=wishes.max_calls,
        max_cost=wishes.max_cost,
    )
    server = f" at {configured.base_url}" if configured.base_url else ""
    return Choice(
        proposer, f"proposer: llm ({configured.model}{server}, named by {configured.named_by}; prompt {asking.prompt})"
    )


def _replay(wishes: Wishes, place: str) -> Choice:
    from armwright.proposers.replay import ReplayProposer

    proposer = ReplayProposer(place, wishes.replay_strict, wishes.asking)
    recording = proposer.recording
    return Choice(
        proposer,
        f"proposer: {proposer.name}, replayed from {place} ({len(recording.calls)} recorded calls to "
        f"{recording.model}, origin {recording.origin}; no network)",
    )


def _manual(wishes: Wishes, place: str) -> Choice:
    from armwright.proposers.manual import ManualProposer

    asking = wishes.asking
    proposer = ManualProposer(
        Path(place), asking.prompt, memory=asking.memory, proposals=asking.proposals, wait=not wishes.once
    )
    return Choice(proposer, f"proposer: manual (questions and answers in {place}/; prompt {asking.prompt})")
