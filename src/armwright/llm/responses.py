"""Responses of models: their text, their cost, and the forms in which they go back to a model."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from genai_prices import Usage, calc_price
from pydantic_ai.messages import ModelMessage, ModelResponse, TextPart, ThinkingPart, ToolCallPart

from armwright.files import replace_surrogates
from armwright.llm.answer import last_json_object
from armwright.llm.redaction import redacted
from armwright.llm.servers import Server

_WRITTEN = "armwright: written"  # key of the full text in the metadata of a response reduced to its JSON


def json_alone(response: ModelResponse) -> ModelResponse:
    """Return the response without the text around its JSON; `text_of` reads that from its metadata."""
    parts = [replace(p, content=last_json_object(p.content)) if isinstance(p, TextPart) else p for p in response.parts]
    return replace(response, parts=parts, metadata={**(response.metadata or {}), _WRITTEN: text_of(response)})


def _is_empty(response: ModelResponse) -> bool:
    """Return whether a response has neither text nor a tool call."""
    return not any(isinstance(p, ToolCallPart) or (isinstance(p, TextPart) and p.content) for p in response.parts)


def not_empty(message: ModelMessage) -> ModelMessage:
    """Return an earlier message, with a text if it is an empty answer: strict chat templates refuse a gap."""
    if isinstance(message, ModelResponse) and _is_empty(message):
        return replace(message, parts=[TextPart("(no answer)")])
    return message


def only_reasoning(messages: Sequence[ModelMessage]) -> str:
    """Return an error if the last response has reasoning and nothing else; empty otherwise."""
    last = next((message for message in reversed(messages) if isinstance(message, ModelResponse)), None)
    if last is None or not _is_empty(last) or not any(isinstance(part, ThinkingPart) for part in last.parts):
        return ""
    return "the answer is empty after the model's reasoning; raise the server's limit of tokens, or turn reasoning off"


def text_of(response: ModelResponse) -> str:
    """Return all text of the model, tool-call arguments included, so that a refused answer can be inspected."""
    if response.metadata and _WRITTEN in response.metadata:
        return response.metadata[_WRITTEN]
    # Some servers send null.
    written = [str(part.content or "") for part in response.parts if isinstance(part, TextPart)]
    calls = [part for part in response.parts if isinstance(part, ToolCallPart)]
    written += [call.args if isinstance(call.args, str) else call.args_as_json_str() for call in calls]
    return redacted(replace_surrogates("\n".join(written)))


def cost_of(response: ModelResponse, server: Server | None) -> float | None:
    """Return the cost of a response [USD]; None if the price is unknown."""
    name: Any = response.model_name  # stated by the server: may be anything
    if name is not None and not isinstance(name, str):
        return None
    try:
        if server is not None:  # refuses a price by the model's name alone, wherever it runs
            calc_price(Usage(), model_ref=response.model_name or server.model, provider_api_url=server.address)
        return float(response.cost().total_price)
    except (LookupError, ValueError, AssertionError):
        return None
