"""Options of a language model: which one answers, what it is asked, how it is called, what it may spend.

The same model validates `--model-options`, the user's config.yaml, the methods of an experiment and the Python API.
"""

from collections.abc import Iterable, Mapping
from typing import Any, Literal, Self

from pydantic import BaseModel, Field, PrivateAttr

MODEL_SECONDS = 120.0  # default timeout


class PromptOptions(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """How designs are asked for."""

    # "plus" (with instructions on how to analyse the parameters), "minus", or "full" (also with the whole front, the
    # gains of its own designs, joint angles and mechanics)
    prompt: Literal["plus", "minus", "full"] = "plus"
    memory: Literal["none", "chat"] = "none"  # each call is new, or all proposals of a run are one conversation
    # "two-step" (free reasoning, then a second call into the schema), "one-step" (JSON), or "text" (manual answers)
    answer: Literal["two-step", "one-step", "text"] = "two-step"

    @property
    def given(self) -> dict[str, Any]:
        """The fields that were set, in the order of their declaration."""
        return {name: getattr(self, name) for name in type(self).model_fields if name in self.model_fields_set}


class ModelOptions(PromptOptions, frozen=True, extra="forbid", allow_inf_nan=False):
    """Which language model answers, what it is asked, how it is called, what it may spend."""

    # Vendor and name (`openai-chat:gpt-4o`, `anthropic:...`, `google:...`, `azure:...`, `openrouter:...`, `ollama:...`,
    # `vllm:...`); None for the configured one
    model: str | None = None
    base_url: str | None = None  # address of an OpenAI-compatible server, in place of the vendor's
    temperature: float | None = Field(default=None, ge=0.0)  # sent only if set
    seed: int | None = None  # sent only if set
    # How an answer is held to a schema: "tool", "native" or "prompted"; "auto" takes the first that the server accepts
    output: Literal["auto", "tool", "native", "prompted"] = "auto"
    timeout: float = Field(default=MODEL_SECONDS, gt=0.0)  # limit of one request, retries included [s]
    in_flight: int | None = Field(default=None, ge=1)  # calls while black-box trials run; None to wait for each answer
    max_calls: int | None = Field(default=None, ge=1)  # limit of requests in the whole run
    max_cost: float | None = Field(default=None, gt=0.0)  # limit of the cost of the whole run [USD]
    origin: Literal["model", "scripted"] = "model"  # recorded with every call; "scripted" for a stand-in
    _named_in: str = PrivateAttr(default="")  # the file that names base_url, if it may be somebody else's

    @property
    def keyless(self) -> str:
        """The file that names base_url, which therefore receives no key; empty if the user names it."""
        return self._named_in

    def named_in(self, file: str) -> Self:
        """Return the options as those of a file that may be somebody else's."""
        return self._copy({}, file if self.base_url else "")

    def approved(self, addresses: Iterable[str | None]) -> Self:
        """Return the options as the user's own if base_url is among these addresses."""
        same = (self.base_url or "").rstrip("/") in {address.rstrip("/") for address in addresses if address}
        return self.named_in("") if same else self

    @property
    def source(self) -> str:
        """Source of the trials; a stand-in has its own, since its trials must not count as a model's."""
        return "llm" if self.origin == "model" else self.origin

    @classmethod
    def of(cls, options: "ModelOptions | str | None") -> "ModelOptions":
        """Return options as they are, or those of a model's name."""
        if isinstance(options, ModelOptions):
            return options
        return cls() if options is None else cls(model=options)

    def with_defaults(self, defaults: Self) -> Self:
        """Return these options, with `defaults` for the fields that are not set here."""
        return defaults._copy(self.given, self._named_in if self.base_url else defaults._named_in)

    def _copy(self, update: Mapping[str, Any], file: str) -> Self:
        copy = self.model_copy(update=update)
        copy._named_in = file  # pyright: ignore[reportAttributeAccessIssue] (frozen are only the fields)
        return copy
