"""Talking to a language model. Only this file and faults.py import pydantic-ai."""

import asyncio
import logging
import os
import re
import threading
import time
import warnings
from collections.abc import Coroutine, Mapping, Sequence
from concurrent.futures import CancelledError, Future
from dataclasses import dataclass, replace
from functools import cache
from ipaddress import ip_address
from typing import Any, TypeVar
from urllib.parse import urlsplit

from armwright.exceptions import MissingExtraError, SettingsError, UsageError
from armwright.extras import requires_extra
from armwright.llm.answer import without_words_around
from armwright.llm.backend import CHECK, MOST_REQUESTS, CallError, Interrupted, LlmBackend, Question, Reader, Reply
from armwright.llm.model_options import MODEL_SECONDS, ModelOptions
from armwright.llm.redaction import WithoutKeys, redacted, without_keys

with requires_extra("llm", "a language model"):
    from genai_prices import Usage, calc_price
    from openai import AsyncOpenAI, Omit
    from pydantic_ai import Agent, ModelRetry, NativeOutput, PromptedOutput, ToolOutput, capture_run_messages
    from pydantic_ai import exceptions as faults
    from pydantic_ai.messages import ModelMessage, ModelResponse, TextPart, ToolCallPart
    from pydantic_ai.models import Model, ModelRequestParameters, infer_model
    from pydantic_ai.models.openai import OpenAIChatModel
    from pydantic_ai.models.wrapper import WrapperModel
    from pydantic_ai.output import StructuredDict
    from pydantic_ai.providers.openai_compatible import OpenAICompatibleProvider
    from pydantic_ai.settings import ModelSettings
    from pydantic_ai.usage import UsageLimits

    from armwright.llm.errors import CALL_FAULTS, PASSING, describe_fault, kind_of_fault

# A price that cannot be known is no news to the user, who is told of costs by `describe_cost` and the budget.
warnings.filterwarnings("ignore", category=faults.CostCalculationFailedWarning)

CHECK_SECONDS = 60.0  # a server of one's own may have to load the model first
REASKS = MOST_REQUESTS - 1  # after a refused answer
RETRIES = 2  # after a fault that may pass
RETRY_SECONDS = 0.5  # before the first retry, where the server says nothing; doubled before the next
SERVER_KEY = "ARMWRIGHT_API_KEY"  # for base_url, if the server wants a key
NEAR = (".local", ".lan", ".home", ".internal")  # endings of names in a network of one's own

_OUTPUTS: Mapping[str, Any] = {"tool": ToolOutput, "native": NativeOutput, "prompted": PromptedOutput}

# Servers of one's own that have a name: where they listen, and the environment's words for address and key.
_LOCAL = {
    "ollama": ("http://localhost:11434/v1", "OLLAMA_BASE_URL", "OLLAMA_API_KEY"),
    "vllm": ("http://localhost:8000/v1", "VLLM_BASE_URL", "VLLM_API_KEY"),
}

# OPENAI_LOG=debug and its like show what a server sent, and what it was sent.
for _logger in ("openai._base_client", "anthropic._base_client", "httpx2", "httpcore2.http11"):
    logging.getLogger(_logger).addFilter(WithoutKeys())

_WRITTEN = "armwright: written"  # in a response's metadata: its text, where only its JSON was kept

Result = TypeVar("Result")


class _Server(WrapperModel):
    """A model that is asked again after a fault that may pass, and whose JSON may stand among words.

    Vendors' clients ask again, too, but also after a spent quota, and wait for an hour if they are told to; here a
    server that wants more patience than the deadline leaves has failed.
    """

    async def request(
        self,
        messages: list[ModelMessage],
        model_settings: ModelSettings | None,
        model_request_parameters: ModelRequestParameters,
    ) -> ModelResponse:
        deadline = time.monotonic() + (model_settings or {}).get("request_timeout", MODEL_SECONDS)
        retries = 0
        while True:
            try:
                response = await super().request(messages, model_settings, model_request_parameters)
                in_text = model_request_parameters.output_mode in ("native", "prompted")
                return _json_alone(response) if in_text else response
            except PASSING as fault:
                pause = RETRY_SECONDS * 2**retries if fault.retry_after is None else fault.retry_after
                if retries == RETRIES or time.monotonic() + pause >= deadline:
                    raise
            retries += 1
            await asyncio.sleep(pause)


class ModelClient(LlmBackend):
    """One model behind one server. Every call is new: the model remembers nothing between calls.

    By "auto", an answer is held to its schema by a tool call with hosted models, and natively with other servers.
    """

    def __init__(self, options: ModelOptions) -> None:
        model = options.model or ""
        if not model.rpartition(":")[2].strip():
            raise SettingsError(f'model "{model}" names no model: openai-chat:gpt-4o would')
        self.model = model
        self.origin = options.origin
        self.timeout = options.timeout
        self._place = _place(model, options.base_url)
        self._model = _Server(_model(model) if self._place is None else _own_server(self._place))
        hosted = "tool" if self._place is None else "native"
        self._output = _OUTPUTS[hosted if options.output == "auto" else options.output]
        self._settings = ModelSettings()
        if options.temperature is not None:
            self._settings["temperature"] = options.temperature
        if options.seed is not None:
            self._settings["seed"] = options.seed
        self._pending: set[Future[Any]] = set()
        self._cancelled = False

    def begin(self) -> None:
        """Start a session."""
        self._cancelled = False

    def check(self, question: Question = CHECK) -> Reply:
        """One tiny question, so that a wrong name, key or address is known before any work is done."""
        return self._run(Agent(self._model), question, CHECK_SECONDS)

    def ask(self, question: Question) -> Reply:
        """Return the free answer to a prompt."""
        reply = self._run(Agent(self._model, retries=REASKS), question, self.timeout)
        if not reply.text.strip():
            raise CallError("answer", f"{self.model} gave an empty answer", reply)
        return reply

    def ask_for(self, question: Question, schema: Mapping[str, Any], read: Reader) -> Reply:
        """Return an answer as JSON of `schema` that `read` accepts; its refusals are sent back to the model."""
        accepted: list[str] = []
        refusals: list[str] = []

        def accept(answer: dict[str, Any]) -> dict[str, Any]:
            try:
                # Keys are blotted out before, not after: what is kept is what was read, and can be read again.
                accepted.append(_printable(read(without_keys(answer))))
            except UsageError as refusal:
                refusals.append(str(refusal))
                raise ModelRetry(str(refusal)) from refusal
            return answer

        output = self._output(StructuredDict(dict(schema)))
        agent: Agent[None, Any] = Agent(self._model, output_type=output, retries=REASKS)
        agent.output_validator(accept)
        try:
            reply = self._run(agent, question, self.timeout)
        except CallError as fault:
            if fault.kind != "limit" or not refusals:
                raise
            message = f"{self.model}: max_calls leaves no request after an invalid answer ({_one_line(refusals[-1])})"
            raise CallError(fault.kind, message, fault.reply) from fault
        return replace(reply, text=accepted[-1])

    def cancel(self) -> None:
        """Cancel all calls, including those about to start."""
        self._cancelled = True
        for future in list(self._pending):
            future.cancel()

    def _run(self, agent: Agent[None, Any], question: Question, seconds: float) -> Reply:
        started = time.perf_counter()
        settings: ModelSettings = {**self._settings, "request_timeout": seconds, "max_retries": 0}
        limits = UsageLimits(request_limit=question.most_requests)
        with capture_run_messages() as messages:
            try:
                self._wait(agent.run(question.prompt, model_settings=settings, usage_limits=limits))
            except CancelledError as fault:
                reply = self._reply(messages, time.perf_counter() - started)
                raise CallError("cancelled", f"{self.model}: the call was ended", reply) from fault
            except KeyboardInterrupt as fault:
                raise Interrupted(self._reply(messages, time.perf_counter() - started)) from fault
            except CALL_FAULTS as fault:
                reply = self._reply(messages, time.perf_counter() - started)
                raise CallError(
                    kind_of_fault(fault), f"{self.model}: {_one_line(describe_fault(fault))}", reply
                ) from fault
        return self._reply(messages, time.perf_counter() - started)

    def _reply(self, messages: Sequence[ModelMessage], seconds: float) -> Reply:
        responses = [message for message in messages if isinstance(message, ModelResponse)]
        costs = [_cost(response, self._place) for response in responses]
        return Reply(
            text=_text(responses[-1]) if responses else "",
            requests=len(responses),
            input_tokens=sum(response.usage.input_tokens for response in responses),
            output_tokens=sum(response.usage.output_tokens for response in responses),
            cost_usd=sum(cost for cost in costs if cost is not None) if costs and None not in costs else None,
            seconds=seconds,
        )

    def _wait(self, coroutine: Coroutine[Any, Any, Result]) -> Result:
        """Run the coroutine in the event-loop thread and return its result.

        One loop serves all callers: connections are kept open in it, and it works from any thread, also inside
        a notebook's running loop.
        """
        future = asyncio.run_coroutine_threadsafe(coroutine, _loop())
        self._pending.add(future)
        if self._cancelled:  # asked for only after the future was listed: `cancel` misses none
            future.cancel()
        try:
            return future.result()
        except BaseException:
            future.cancel()  # Ctrl-C: the request ends, too
            raise
        finally:
            self._pending.discard(future)


def estimated_cost(options: ModelOptions, input_tokens: int, output_tokens: int) -> float | None:
    """Return about what so many tokens cost [USD], by the prices that calls are accounted with; None if unknown."""
    place = _place(options.model or "", options.base_url)
    vendor, _, name = (options.model or "").partition(":")
    usage = Usage(input_tokens=input_tokens, output_tokens=output_tokens)
    try:
        if place is None:
            price = calc_price(usage, model_ref=name, provider_id=vendor.removesuffix("-chat"))
        else:
            price = calc_price(usage, model_ref=place.name, provider_api_url=place.address)
    except LookupError:
        return None
    return float(price.total_price)


def describe_cost(options: ModelOptions, input_tokens: int, output_tokens: int) -> str:
    """Return the estimated cost in one phrase."""
    cost = estimated_cost(options, input_tokens, output_tokens)
    if cost is not None:
        return f"about {cost:.2f} USD by public prices"
    place = _place(options.model or "", options.base_url)
    if place is None:
        return "price not known"
    return "on a server of your own" if place.is_near else f"at {place.address}; its price is not known"


@dataclass(frozen=True)
class _Place:
    """A server that is not found by the vendor's name: where it listens, and what it calls the model.

    key: the environment's word for its key.
    """

    address: str
    name: str
    key: str

    @property
    def is_near(self) -> bool:
        """Whether it is this machine or one of the same network, where nobody sends a bill that we know of."""
        host = urlsplit(self.address).hostname or ""
        try:
            return ip_address(host).is_private
        except ValueError:
            return "." not in host or host.endswith(NEAR)


def _place(model: str, base_url: str | None) -> _Place | None:
    """Return the address of a model's server; None for the vendor's own."""
    vendor, _, bare = model.partition(":")
    if base_url:
        return _Place(base_url, model.removeprefix("openai-chat:"), SERVER_KEY)
    if vendor in _LOCAL:
        default, address, key = _LOCAL[vendor]
        return _Place(os.environ.get(address) or default, bare, key if os.environ.get(key) else SERVER_KEY)
    return None


def _model(name: str) -> Model:
    """Return a vendor's model; raises SettingsError if its name is unknown or its key is not set."""
    if ":" not in name:
        raise SettingsError(f'model "{name}": a vendor is needed before it, like openai-chat:{name}; or set base_url')
    try:
        return infer_model(name)
    except faults.UserError as fault:
        key = re.search(r"\b[A-Z_]+_(?:API_KEY|ENDPOINT)\b", str(fault))
        words = f"needs {key[0]}: set it in the environment" if key else f"cannot be used: {_one_line(fault)}"
        raise SettingsError(f"model {name} {words}") from fault
    except ImportError as fault:
        raise MissingExtraError(f"model {name} needs another package: {_one_line(fault)}") from fault


def _own_server(at: _Place) -> Model:
    """Return a model behind an OpenAI-compatible server, which never receives a vendor's key."""
    base_url = at.address
    if not base_url.startswith(("http://", "https://")):
        raise SettingsError(f"base_url {base_url}: an address that begins with http:// or https:// is needed")
    place = base_url.partition("://")[2]
    if "@" in place.partition("/")[0] or "?" in place or "#" in place:
        raise SettingsError(f"base_url holds more than an address; put the server's key into {SERVER_KEY}")
    if not _is_address(base_url):
        raise SettingsError(f"base_url {base_url} is no address, such as http://localhost:8080/v1")
    client = AsyncOpenAI(
        base_url=base_url,
        api_key=os.environ.get(at.key) or "no-key",
        default_headers={"OpenAI-Organization": Omit(), "OpenAI-Project": Omit()},  # pyright: ignore[reportArgumentType]
    )
    return OpenAIChatModel(at.name, provider=OpenAICompatibleProvider("openai-compatible", openai_client=client))


def _is_address(url: str) -> bool:
    """Whether a host, and a port if there is one, can be told from it."""
    try:
        place = urlsplit(url)
        return bool(place.hostname) and place.port != 0 and url.isascii() and url.isprintable() and " " not in url
    except ValueError:  # of brackets or ports that are none
        return False


def _json_alone(response: ModelResponse) -> ModelResponse:
    """Return the response without the text around its JSON; `_text` reads that from its metadata."""
    parts = [
        replace(p, content=without_words_around(p.content)) if isinstance(p, TextPart) else p for p in response.parts
    ]
    return replace(response, parts=parts, metadata={**(response.metadata or {}), _WRITTEN: _text(response)})


def _text(response: ModelResponse) -> str:
    """Return all text of the model, tool-call arguments included, so that a refused answer can be inspected."""
    if response.metadata and _WRITTEN in response.metadata:
        return response.metadata[_WRITTEN]
    written = [str(part.content or "") for part in response.parts if isinstance(part, TextPart)]  # null, from some
    calls = [part for part in response.parts if isinstance(part, ToolCallPart)]
    written += [call.args if isinstance(call.args, str) else call.args_as_json_str() for call in calls]
    return _clean("\n".join(written))


def _cost(response: ModelResponse, place: _Place | None) -> float | None:
    """[USD], where the price of the model is known."""
    name: Any = response.model_name  # as the server says it, which may be anything
    if name is not None and not isinstance(name, str):
        return None
    try:
        if place is not None:  # else a model would have its price by its name alone, wherever it runs
            calc_price(Usage(), model_ref=response.model_name or place.name, provider_api_url=place.address)
        return float(response.cost().total_price)
    except (LookupError, ValueError, AssertionError):
        return None


def _clean(text: str) -> str:
    """Without keys, and printable."""
    return redacted(_printable(text))


def _printable(text: str) -> str:
    """Without lone surrogates, which JSON can carry and UTF-8 cannot."""
    return text.encode("utf-8", "replace").decode("utf-8")


def _one_line(text: object) -> str:
    line = _clean(" ".join(str(text).split())).rstrip(".")
    return line if len(line) <= 300 else line[:297] + "..."


@cache
def _loop() -> asyncio.AbstractEventLoop:
    loop = asyncio.new_event_loop()
    threading.Thread(target=loop.run_forever, name="armwright-chat", daemon=True).start()
    return loop
