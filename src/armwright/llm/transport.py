"""The HTTP client of model calls: no redirects, bounded responses, and completions that strict clients can read."""

import json
import re
from typing import Any, cast

import httpx2

from armwright.text import one_line

MAX_RESPONSE = 8 * 2**20  # bytes of a response that are read
# Fields of a completion, a choice and a message that armwright never reads, and that servers send in other types.
_UNUSED = {"system_fingerprint", "service_tier", "metadata", "moderation", "logprobs", "annotations", "audio"}
_TOKENS = ("prompt_tokens", "completion_tokens", "total_tokens")
_MARKUP = re.compile(r"<[^<>]*>")


Fields = dict[str, Any]  # of a JSON object


class ResponseError(ValueError):
    """A response that holds no answer; the message says why, in the words of the server if it gave any."""


def guard(client: httpx2.AsyncClient) -> httpx2.AsyncClient:
    """Return the client after making it refuse redirects and read bounded, uncompressed responses.

    A redirect would take the prompt, and with some clients the key, to an address that the user did not name.
    """
    client.follow_redirects = False
    client.headers["Accept-Encoding"] = "identity"  # a small compressed body may expand beyond any memory
    client.event_hooks = {**client.event_hooks, "response": [_examine]}
    return client


async def _examine(response: httpx2.Response) -> None:
    """Read a response before the vendor's client does, and replace a completion by its readable form."""
    if response.has_redirect_location:
        address = one_line(response.headers["Location"], 200)
        raise ResponseError(f"the server redirects to {address}, which is not followed; give the final base_url")
    encoding = response.headers.get("Content-Encoding", "identity")
    if encoding != "identity":
        raise ResponseError(f'expected an uncompressed response, got Content-Encoding "{one_line(encoding, 40)}"')
    content = await _content(response)
    if response.is_success and response.request.url.path.endswith("/chat/completions"):
        body = _parsed(content, response.headers.get("Content-Type", "no type"))
        response.status_code = _status(body, response.status_code)
        if response.is_success:
            body = readable_completion(body)
        content = json.dumps(body).encode()
        response.headers["Content-Type"] = "application/json"
    response.stream = httpx2.ByteStream(content)


async def _content(response: httpx2.Response) -> bytes:
    stream = cast("httpx2.AsyncByteStream", response.stream)
    content = bytearray()
    try:
        async for chunk in stream:
            content += chunk
            if len(content) > MAX_RESPONSE:
                raise ResponseError(f"the response is longer than {MAX_RESPONSE / 2**20:g} MiB")
    finally:
        await stream.aclose()
    return bytes(content)


def _parsed(content: bytes, content_type: str) -> Fields:
    try:
        body = json.loads(content)
    except (ValueError, RecursionError) as error:
        text = one_line(_MARKUP.sub(" ", content[:2000].decode(errors="replace")), 120)
        raise ResponseError(f"expected JSON, got {one_line(content_type, 40)}: {text or 'nothing'}") from error
    if not isinstance(body, dict):
        raise ResponseError(f"expected a JSON object, got {one_line(str(body), 120)}")
    return _fields(body)


def _status(body: Fields, status: int) -> int:
    """Return the status of a response: gateways report an error under status 200, with its own status in the body."""
    code = "" if body.get("choices") else str(_fields(body.get("error")).get("code"))
    return int(code) if re.fullmatch("[45][0-9][0-9]", code) else status


def readable_completion(body: Fields) -> Fields:
    """Return a chat completion with its first choice only, whose harmless oddities are those of OpenAI's protocol.

    Raises:
        ResponseError: There is no message.
    """
    choice = _fields(next(iter(_list(body.get("choices"))), None))
    message = _fields(choice.get("message"))
    if not message:
        said = next(filter(None, (_said(body.get(name)) for name in ("error", "message", "detail"))), None)
        raise ResponseError(said or f"the response has no message: {one_line(json.dumps(body), 120)}")
    reason, calls = choice.get("finish_reason"), message.get("tool_calls")
    message = _used(message) | {"role": "assistant", "tool_calls": _readable_calls(calls)}
    choice = _used(choice) | {"index": 0, "finish_reason": _text(reason) or None, "message": message}
    return _used(body) | {
        "id": _text(body.get("id")),
        "model": _text(body.get("model")),
        "object": "chat.completion",
        "created": 0,
        "choices": [choice],
        "usage": _readable_usage(_fields(body.get("usage"))),
    }


def _readable_calls(calls: Any) -> list[Fields] | None:
    """Return tool calls with ids, and with arguments as text; some servers send them as an object."""
    readable: list[Fields] = []
    for number, call in enumerate(_list(calls)):
        fields = _fields(call)
        function = _fields(fields.get("function"))
        arguments = function.get("arguments")
        text = arguments if isinstance(arguments, str) else json.dumps(arguments)
        identity = _text(fields.get("id")) or f"call_{number}"
        readable.append(fields | {"id": identity, "type": "function", "function": {**function, "arguments": text}})
    return readable or None


def _readable_usage(usage: Fields) -> Fields | None:
    counts = {name: usage.get(name) for name in _TOKENS}
    known = {name: int(n) for name, n in counts.items() if isinstance(n, int | float) and 0 <= n < 2**53}
    details = {name: _fields(value) for name, value in usage.items() if isinstance(value, dict)}
    return details | dict.fromkeys(_TOKENS, 0) | known if usage else None


def _fields(value: Any) -> Fields:
    return cast("Fields", value) if isinstance(value, dict) else {}


def _list(value: Any) -> list[Any]:
    return cast("list[Any]", value) if isinstance(value, list) else []


def _used(fields: Fields) -> Fields:
    return {name: value for name, value in fields.items() if name not in _UNUSED}


def _text(value: Any) -> str:
    return value if isinstance(value, str) else ""


def _said(error: Any) -> str:
    """Return the message of an error."""
    return one_line(_text(_fields(error).get("message") if isinstance(error, dict) else error), 300)
