"""What the editor's server refuses, and the headers of all their responses.

Other users of this machine can connect to a port, but do not know the key of its server. It is in the fragment of the
address that the terminal shows, which browsers do not send. The page (page/key.js) keeps it in the storage of its tab,
which belongs to one port, and sends it as a header. A cookie would reach the servers of other users on other ports.
"""

import asyncio
import secrets
from collections.abc import Callable, Collection
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import to_json
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route

from armwright.exceptions import ArmwrightError, UsageError

Body = TypeVar("Body", bound=BaseModel)

MAX_BODY = 64 * 1024  # [bytes] of a POST
KEY_HEADER = "x-armwright-key"
HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Content-Security-Policy": "frame-ancestors 'none'",  # in addition to the page's own policy
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class Guard:
    """Refuse requests for other hosts and without the key, and add the security headers to every response.

    `open_paths` need no key: a page without data, and an address that nobody can guess. `hosts` are the Host
    headers that name this server; others are refused (DNS rebinding).
    """

    def __init__(self, app: Any, key: str, open_paths: Collection[str], hosts: Collection[str]) -> None:
        self._app = app
        self._key = key.encode()
        self._open_paths = open_paths
        self._hosts = hosts

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        async def send_with_headers(message: Any) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        match scope["type"]:
            case "http":
                await (self._refusal(scope) or self._app)(scope, receive, send_with_headers)
            case "lifespan":
                await self._app(scope, receive, send)
            case _:  # no page opens a WebSocket
                await send({"type": "websocket.close"})

    def _refusal(self, scope: Any) -> Response | None:
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or hosts[0].lower() not in self._hosts:  # with two, a proxy might use the other one
            return PlainTextResponse("unknown host; use the address that the server printed", 421)
        if scope["path"] in self._open_paths:
            return None
        if secrets.compare_digest(headers.get(KEY_HEADER, "").encode(), self._key):
            return None
        return PlainTextResponse("the key is missing or wrong; use the address that the server printed", 403)


def post_route(path: str, schema: type[Body], handle: Callable[[Body], Any], limit: int = MAX_BODY) -> Route:
    """Return the route of a POST of the page itself with a body of this schema; all others are refused.

    `handle` runs in a thread and returns the content of the response, None for none.
    """

    async def answer(request: Request) -> Response:
        try:
            body = schema.model_validate_json(await _body(request, limit))
            content = await asyncio.to_thread(handle, body)
        except ValidationError:
            raise HTTPException(422, "the request is not one of the page") from None
        except ClientDisconnect:
            return Response(status_code=400)  # nobody receives it
        except ArmwrightError as fault:
            raise HTTPException(400 if isinstance(fault, UsageError) else 500, str(fault)) from None
        return Response(status_code=204) if content is None else to_response(content)

    return Route(path, answer, methods=["POST"])


def to_response(content: Any) -> Response:
    """Return content as JSON; numbers that it lacks become null, and dates text."""
    return Response(to_json(content, inf_nan_mode="null", fallback=str), media_type="application/json")


async def _body(request: Request, limit: int) -> bytes:
    if request.headers.get("origin", "") != f"{request.url.scheme}://{request.headers.get('host', '')}":
        raise HTTPException(403, "only the page itself may send this")
    if request.headers.get("content-type", "").partition(";")[0].strip() != "application/json":
        raise HTTPException(415, "expected application/json")
    body = b""
    async for part in request.stream():
        body += part
        if len(body) > limit:
            raise HTTPException(413, "request too long")
    return body
