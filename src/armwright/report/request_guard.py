"""What the local servers refuse, and the headers of all their responses."""

import secrets
from collections.abc import Callable
from typing import Any

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect, Request
from starlette.responses import PlainTextResponse, Response

HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Content-Security-Policy": "frame-ancestors 'none'",  # in addition to the page's own policy
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class Guard:
    """Refuse requests for other hosts, and add the security headers to every response.

    Args:
        app: The guarded application.
        is_allowed: Tells whether a Host header names this server; others are refused (DNS rebinding).
    """

    def __init__(self, app: Any, is_allowed: Callable[[str], bool]) -> None:
        self._app = app
        self._is_allowed = is_allowed

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_with_headers(message: Any) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        hosts = Headers(scope=scope).getlist("host")
        app = self._app
        if len(hosts) != 1 or not self._is_allowed(hosts[0]):  # with two, a proxy might use the other one
            app = PlainTextResponse("unknown host; use the address that the server printed", 421)
        await app(scope, receive, send_with_headers)


async def read_request(request: Request, token: str, limit: int) -> bytes | Response:
    """Return the body of a POST of the page itself, or the refusal of any other.

    Args:
        request: The request.
        token: The token that only the page knows.
        limit: Largest body [bytes].
    """
    refusal = _refusal(request, token)
    if refusal is not None:
        return refusal
    body = b""
    try:
        async for part in request.stream():
            body += part
            if len(body) > limit:
                return PlainTextResponse("request too long", status_code=413)
    except ClientDisconnect:
        return Response(status_code=400)  # nobody receives it
    return body


def _refusal(request: Request, token: str) -> Response | None:
    """Return why a request may not change anything; None if it may."""
    if not secrets.compare_digest(request.headers.get("x-armwright-token", "").encode(), token.encode()):
        return PlainTextResponse("the token of the page is missing or wrong; reload the page", status_code=403)
    origin = request.headers.get("origin", "")
    if origin != f"{request.url.scheme}://{request.headers.get('host', '')}":
        return PlainTextResponse("only the page itself may send this", status_code=403)
    if request.headers.get("content-type", "").partition(";")[0].strip() != "application/json":
        return PlainTextResponse("expected application/json", status_code=415)
    return None
