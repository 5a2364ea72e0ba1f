"""Talking to a language model. The only file that imports pydantic-ai."""

import asyncio
import os
import re
import threading
import time
from collections.abc import Callable, Coroutine, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, TypeVar

from pydantic import BaseModel

from armwright.exceptions import DesignError, MissingExtraError, ProposalError, SettingsError

try:
    from openai import AsyncOpenAI, Omit
    from pydantic_ai import Agent, ModelRetry, NativeOutput, ToolOutput, capture_run_messages
    from pydantic_ai import exceptions as faults
    from pydantic_ai.messages import ModelMessage, ModelResponse, TextPart, ToolCallPart
    from pydantic_ai.models import Model, infer_model
    from pydantic_ai.models.openai import OpenAIChatModel
    from pydantic_ai.providers.openai_compatible import OpenAICompatibleProvider
    from pydantic_ai.settings import ModelSettings
except ImportError as fault:
    raise MissingExtraError('language models need an extra: pip install "armwright[llm]"') from fault

CALL_SECONDS = 120.0  # of one request, all attempts of the client included
CHECK_SECONDS = 60.0  # a server of one's own may have to load the model first
REASKS = 2  # after a refused answer
SERVER_KEY = "ARMWRIGHT_API_KEY"  # for --base-url, where the server wants a key

Result = TypeVar("Result")

# The word for statistics, by the most specific class first.
_KINDS: tuple[tuple[type[Exception], str], ...] = (
    (faults.ModelAuthenticationError, "key"),
    (faults.ModelQuotaExceededError, "quota"),
    (faults.ModelRateLimitError, "rate_limit"),
    (faults.ModelNotFoundError, "unknown_model"),
    (faults.ModelContextWindowExceededError, "context"),
    (faults.ModelRequestRejectedError, "rejected"),
    (faults.ModelRequestTimeout, "timeout"),
    (faults.ModelTimeoutError, "timeout"),
    (faults.ModelConnectionError, "connection"),
    (faults.ModelUnavailableError, "server"),
    (faults.ModelServerError, "server"),
    (faults.ModelAPIError, "server"),
    (faults.ContentFilterError, "refused"),
    (faults.UnexpectedModelBehavior, "answer"),
    (faults.UsageLimitExceeded, "limit"),
    (faults.RunCancelled, "cancelled"),
)


# What pydantic-ai trips over in some malformed responses, such as an empty list of choices.
_MALFORMED = (LookupError, TypeError, ValueError, AttributeError)


@dataclass(frozen=True)
class Reply:
    """What came back, and what it took. text: the answer as the model wrote it."""

    text: str
    requests: int
    input_tokens: int
    output_tokens: int
    cost_usd: float | None
    seconds: float


class CallError(ProposalError):
    """A call that gave no usable answer; `reply` says what it cost all the same."""

    def __init__(self, kind: str, message: str, reply: Reply) -> None:
        super().__init__(kind, message)
        self.reply = reply


class Chat:
    """One model behind one server. Every call is new: the model remembers nothing between calls."""

    def __init__(self, model: str, base_url: str | None = None) -> None:
        self.name = model
        self._model = _model(model, base_url)
        # Servers of one's own constrain the answer by a JSON schema; hosted models are best at calling a tool.
        self._output: Any = NativeOutput if base_url else ToolOutput

    def check(self) -> Reply:
        """One tiny question, so that a wrong name, key or address is known before any work is done."""
        return self._run(Agent(self._model), "Answer with one word: ready", CHECK_SECONDS)[1]

    def ask(self, prompt: str) -> Reply:
        """The free answer to a prompt."""
        reply = self._run(Agent(self._model, retries=REASKS), prompt, CALL_SECONDS)[1]
        if not reply.text.strip():
            raise CallError("answer", f"{self.name} gave an empty answer", reply)
        return reply

    def ask_for(self, prompt: str, schema: type[BaseModel], check: Callable[[BaseModel], object]) -> Reply:
        """The answer as JSON of `schema` that `check` accepts; its refusal (DesignError) goes back in its words."""

        def accept(answer: BaseModel) -> BaseModel:
            try:
                check(answer)
            except DesignError as refusal:
                raise ModelRetry(str(refusal)) from refusal
            return answer

        agent: Agent[None, BaseModel] = Agent(self._model, output_type=self._output(schema), retries=REASKS)
        agent.output_validator(accept)
        output, reply = self._run(agent, prompt, CALL_SECONDS)
        return replace(reply, text=output.model_dump_json())

    def _run(self, agent: Agent[None, Any], prompt: str, seconds: float) -> tuple[Any, Reply]:
        started = time.perf_counter()
        settings = ModelSettings(temperature=0.0, request_timeout=seconds)
        with capture_run_messages() as messages:
            try:
                output = _wait(agent.run(prompt, model_settings=settings)).output
            except (faults.AgentRunError, faults.UserError, *_MALFORMED) as fault:
                reply = _reply(messages, time.perf_counter() - started)
                raise CallError(_kind(fault), f"{self.name}: {_first_line(fault)}", reply) from fault
        return output, _reply(messages, time.perf_counter() - started)


def _model(name: str, base_url: str | None) -> Model:
    """The model by its name; SettingsError where the name is unknown or its key is not set."""
    if base_url:
        if not base_url.startswith(("http://", "https://")):
            raise SettingsError(f"--base-url {base_url}: an address that begins with http:// or https:// is needed")
        if "@" in base_url.partition("://")[2].partition("/")[0]:
            raise SettingsError(f"--base-url holds a user name or password; put the server's key into {SERVER_KEY}")
        # Nothing that belongs to a vendor goes to another host: neither its key nor its account's names.
        client = AsyncOpenAI(
            base_url=base_url,
            api_key=os.environ.get(SERVER_KEY) or "no-key",
            default_headers={"OpenAI-Organization": Omit(), "OpenAI-Project": Omit()},  # pyright: ignore[reportArgumentType]
        )
        provider = OpenAICompatibleProvider("openai-compatible", openai_client=client)
        return OpenAIChatModel(name.removeprefix("openai-chat:"), provider=provider)
    if ":" not in name:
        raise SettingsError(
            f'model "{name}": a vendor is needed before it, like openai-chat:{name}; or give --base-url'
        )
    try:
        return infer_model(name)
    except faults.UserError as fault:
        key = re.search(r"\b[A-Z_]+_API_KEY\b", str(fault))
        words = f"needs its key: set {key[0]} in the environment" if key else f"cannot be used: {_first_line(fault)}"
        raise SettingsError(f"model {name} {words}") from fault
    except ImportError as fault:
        raise MissingExtraError(f"model {name} needs another package: {_first_line(fault)}") from fault


def _reply(messages: Sequence[ModelMessage], seconds: float) -> Reply:
    responses = [message for message in messages if isinstance(message, ModelResponse)]
    costs = [_cost(response) for response in responses]
    return Reply(
        text=_text(responses[-1]) if responses else "",
        requests=len(responses),
        input_tokens=sum(response.usage.input_tokens for response in responses),
        output_tokens=sum(response.usage.output_tokens for response in responses),
        cost_usd=sum(cost for cost in costs if cost is not None) if costs and None not in costs else None,
        seconds=seconds,
    )


def _text(response: ModelResponse) -> str:
    """What the model wrote, the arguments of a tool call included, so that a refused answer can be read later.

    Without lone surrogates, which JSON can carry and UTF-8 cannot.
    """
    written = [part.content for part in response.parts if isinstance(part, TextPart)]
    written += [part.args_as_json_str() for part in response.parts if isinstance(part, ToolCallPart)]
    return "\n".join(written).encode("utf-8", "replace").decode("utf-8")


def _cost(response: ModelResponse) -> float | None:
    """[USD], where the price of the model is known."""
    try:
        return float(response.cost().total_price)
    except (LookupError, ValueError, AssertionError):
        return None


def _kind(fault: Exception) -> str:
    if isinstance(fault, _MALFORMED):
        return "answer"
    return next((kind for cls, kind in _KINDS if isinstance(fault, cls)), "settings")


def _first_line(fault: BaseException) -> str:
    text = " ".join(str(fault).split()).rstrip(".")
    return text if len(text) <= 300 else text[:297] + "..."


def _wait(coroutine: Coroutine[Any, Any, Result]) -> Result:
    """The coroutine's result, from an event loop in a thread of its own.

    One loop serves all callers: connections are kept open in it, and it works from any thread, also inside
    a notebook's running loop.
    """
    future = asyncio.run_coroutine_threadsafe(coroutine, _loop())
    try:
        return future.result()
    except BaseException:
        future.cancel()  # Ctrl-C: the request ends, too
        raise


@cache
def _loop() -> asyncio.AbstractEventLoop:
    loop = asyncio.new_event_loop()
    threading.Thread(target=loop.run_forever, name="armwright-chat", daemon=True).start()
    return loop
