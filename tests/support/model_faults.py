"""Faults of model servers, as OpenAI and Anthropic report them.

Each fault is an answer for ChatServer. FAULTS groups them by armwright's kind of fault.
"""

import json
from collections.abc import Mapping
from typing import Any

from tests.support.chat_server import Response, completion, message, streamed

Fault = Mapping[str, Response]  # by wire format


def openai_error(
    status: int, words: str, type_: str, code: str | None = None, headers: Mapping[str, str] | None = None
) -> Response:
    content = {"error": {"message": words, "type": type_, "param": None, "code": code}}
    return Response(json.dumps(content), status, headers or {})


def anthropic_error(status: int, words: str, type_: str, headers: Mapping[str, str] | None = None) -> Response:
    content = {"type": "error", "error": {"type": type_, "message": words}, "request_id": "req_1"}
    return Response(json.dumps(content), status, headers or {})


def both(response: Response) -> Fault:
    return {"openai": response, "anthropic": response}


def errors(openai: tuple[Any, ...], anthropic: tuple[Any, ...]) -> Fault:
    """The same error in the words of both: arguments of openai_error and anthropic_error."""
    return {"openai": openai_error(*openai), "anthropic": anthropic_error(*anthropic)}


def rate_limit(**headers: str) -> Fault:
    """headers: retry_after="1" is Retry-After: 1."""
    sent = {name.replace("_", "-"): value for name, value in headers.items()}
    words = "Rate limit reached for gpt-4o in organization org-1 on tokens per min (TPM): Limit 30000, Used 29500."
    return errors(
        (429, words, "tokens", "rate_limit_exceeded", sent),
        (429, "This request would exceed your rate limit.", "rate_limit_error", sent),
    )


def said(text: str | None, finish_reason: str, stop_reason: str, **more: Any) -> Fault:
    """An answer that ends for another reason than being complete; more: fields of OpenAI's message."""
    return {
        "openai": Response(json.dumps(completion(text, {}, finish_reason, **more))),
        "anthropic": Response(streamed(message(text, {}, stop_reason)), content_type="text/event-stream"),
    }


def _stream_broken(event: Mapping[str, Any], pace: Any = "whole") -> Response:
    """Anthropic's stream that begins well."""
    begun = streamed(message("ORIGIN: (0, ", {})).partition("event: content_block_stop")[0]
    end = f"event: {event['type']}\ndata: {json.dumps(event)}\n\n" if event else ""
    return Response(begun + end, content_type="text/event-stream", pace=pace)


def _events(data: str) -> Response:
    """The beginning of Anthropic's stream."""
    return Response(f"event: message_start\ndata: {data}\n\n", content_type="text/event-stream")


_OVERLOADED = {"type": "error", "error": {"type": "overloaded_error", "message": "Overloaded"}}
_HTML = "<!DOCTYPE html>\n<html><head><title>{0}</title></head><body><h1>{0}</h1></body></html>"
_CUT = {
    "openai": Response(json.dumps(completion("ORIGIN: (0, 0.01, -0.1)", {})), pace="cut"),
    "anthropic": _stream_broken({}, "cut"),
}

_INVALID = "invalid_request_error"
FAULTS: Mapping[str, Mapping[str, Fault]] = {
    "rate_limit": {
        "rate limit": rate_limit(),
        "rate limit for a day": rate_limit(retry_after="86400"),
    },
    "server": {
        "server error": errors(
            (500, "The server had an error while processing your request.", "server_error"),
            (500, "Internal server error", "api_error"),
        ),
        "overloaded": errors(
            (503, "The engine is currently overloaded, please try again later.", "server_error"),
            (529, "Overloaded", "overloaded_error"),
        ),
        "overloaded later": {
            "openai": openai_error(503, "Service Unavailable", "service_unavailable_error"),
            "anthropic": _stream_broken(_OVERLOADED),
        },
        "bad gateway": both(Response(_HTML.format("502 Bad Gateway"), 502, content_type="text/html")),
    },
    "timeout": {
        "slow first byte": both(Response(pace="never")),
        "dripping body": both(Response(pace="drip")),
    },
    "connection": {"cut connection": _CUT, "not a byte": both(Response(pace="gone"))},
    "answer": {
        "HTML": both(Response(_HTML.format("Sign in to the network"), content_type="text/html")),
        "broken JSON": {
            "openai": Response(json.dumps(completion("ready", {}))[:-40]),
            "anthropic": _events('{"type": "mess'),
        },
        "wrong shape": {
            "openai": Response('{"choices": [{"message": "ready"}]}'),
            "anthropic": _events('{"type": "message_start", "message": "ready"}'),
        },
        "JSON for a stream": both(Response('{"status": "ok"}')),
        "empty answer": said("", "stop", "end_turn"),
        "nothing at all": said(None, "stop", "end_turn"),
    },
    "refused": {
        "refusal": said(None, "stop", "refusal", refusal="I'm sorry, I can't assist with that request."),
        "content filter": said(None, "content_filter", "refusal"),
    },
    "context": {
        "context too long": errors(
            (400, "This model's maximum context length is 8192 tokens. However, your messages resulted in 9999 tokens.",
             _INVALID, "context_length_exceeded"),
            (400, "prompt is too long: 210000 tokens > 200000 maximum", _INVALID),
        ),
    },
    "quota": {
        "quota gone": errors(
            (429, "You exceeded your current quota, please check your plan and billing details.",
             "insufficient_quota", "insufficient_quota"),
            (400, "Your credit balance is too low to access the Anthropic API. Please go to Plans & Billing.",
             _INVALID),
        ),
    },
    "key": {
        "wrong key": errors(
            (401, "Incorrect API key provided: sk-proj-**********ABCD. You can find your API key at "
             "https://platform.openai.com/account/api-keys.", _INVALID, "invalid_api_key"),
            (401, "invalid x-api-key", "authentication_error"),
        ),
        "forbidden": errors(
            (403, "Country, region, or territory not supported", "request_forbidden"),
            (403, "Your API key may not use this resource.", "permission_error"),
        ),
    },
    "unknown_model": {
        "unknown model": errors(
            (404, "The model `gpt-5x` does not exist", _INVALID, "model_not_found"),
            (404, "model: claude-x", "not_found_error"),
        ),
    },
    "rejected": {
        "rejected": errors(
            (400, "Unsupported value: 'temperature'", _INVALID, "unsupported_value"),
            (400, "temperature: Extra inputs are not permitted", _INVALID),
        ),
    },
}  # fmt: skip
