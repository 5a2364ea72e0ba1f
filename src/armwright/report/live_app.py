"""The live page's HTTP application. Needs the extra `live`.

/               the page
/run            the run, packed; ?designs=N&calls=M: only what is new since then
/file           a design as text: ?design=N&format=urdf or mjcf
/events         the status of the study, as server-sent events
/control        POST: pause, resume, stop, hint; with the page's token, from the page alone
"""

import asyncio
import json
import secrets
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ValidationError
from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware import Middleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route

from armwright.exceptions import ArmwrightError
from armwright.files import replace_surrogates
from armwright.report.live_run import LiveRun
from armwright.report.page import render_page
from armwright.runs.control import add_hint, pause_study, resume_study, stop_study

POLL = 0.25  # [s] between two checks of the run folder
HEARTBEAT = 15.0  # [s] between events while nothing changes
MAX_BODY = 64 * 1024  # largest POST [bytes]
HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Content-Security-Policy": "frame-ancestors 'none'",  # in addition to the page's own policy
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class ControlRequest(BaseModel, frozen=True, extra="forbid"):
    """A request of the page's user to the study; text: that of a hint for the next prompt."""

    action: Literal["pause", "resume", "stop", "hint"]
    text: str = ""


_ACTIONS: dict[str, Callable[[Path], None]] = {"pause": pause_study, "resume": resume_study, "stop": stop_study}


class OpenPages:
    """The open pages of a server."""

    def __init__(self) -> None:
        self.count = 0
        self.were_open = False  # at any time
        self.is_closing = False  # whether the server is shutting down


def live_app(folder: Path, token: str, is_allowed: Callable[[str], bool], pages: OpenPages) -> Starlette:
    """Return the server's application.

    Args:
        folder: The run folder.
        token: Required by requests that change anything.
        is_allowed: Tells whether a Host header names this server; others are refused (DNS rebinding).
        pages: Counts the open pages.
    """
    handlers = _Handlers(folder, token, pages)
    routes = [
        Route("/", handlers.page),
        Route("/run", handlers.packed),
        Route("/file", handlers.file),
        Route("/events", handlers.events, methods=["GET"]),
        Route("/control", handlers.control, methods=["POST"]),
    ]
    guard = Middleware(_Guard, is_allowed=is_allowed)
    return Starlette(routes=routes, middleware=[guard], lifespan=handlers.lifespan)


class _Handlers:
    def __init__(self, folder: Path, token: str, pages: OpenPages) -> None:
        self._folder = folder
        self._token = token
        self._pages = pages
        self._run = LiveRun(folder)

    @asynccontextmanager
    async def lifespan(self, app: Starlette) -> AsyncGenerator[None]:
        watching = asyncio.create_task(self._watch())
        yield
        watching.cancel()

    async def page(self, request: Request) -> Response:
        title = replace_surrogates(f"{self._folder.resolve().name}: armwright, live")
        return Response(render_page(title, token=self._token), media_type="text/html; charset=utf-8")

    async def packed(self, request: Request) -> Response:
        designs, calls = (_natural(request, name) or 0 for name in ("designs", "calls"))
        try:
            data = await asyncio.to_thread(self._run.packed, designs, calls)
        except ValueError as fault:  # damaged numbers in the folder's files
            return PlainTextResponse(f"the run cannot be shown: {fault}", status_code=500)
        if data is None:
            return PlainTextResponse(self._run.fault or "the run has not started yet", status_code=503)
        return Response(data, media_type="application/octet-stream")

    async def file(self, request: Request) -> Response:
        number, kind = _natural(request, "design"), request.query_params.get("format", "")
        text = None if number is None else await asyncio.to_thread(self._run.file, number, kind)
        if text is None:
            return PlainTextResponse("no such file", status_code=404)
        return Response(text, media_type="application/xml")

    async def events(self, request: Request) -> Response:
        if request.method == "HEAD":  # the stream would never end
            return Response(media_type="text/event-stream")
        return StreamingResponse(self._statuses(), media_type="text/event-stream")

    async def control(self, request: Request) -> Response:
        refusal = self._refusal(request)
        if refusal is not None:
            return refusal
        body = b""
        try:
            async for part in request.stream():
                body += part
                if len(body) > MAX_BODY:
                    return PlainTextResponse("request too long", status_code=413)
        except ClientDisconnect:
            return Response(status_code=400)  # nobody receives it
        try:
            await asyncio.to_thread(self._apply, ControlRequest.model_validate_json(body))
        except ValidationError:
            return PlainTextResponse("expected pause, resume, stop or hint", status_code=422)
        except ArmwrightError as fault:
            return PlainTextResponse(str(fault), status_code=409)
        except FileNotFoundError:
            return PlainTextResponse("the run folder is gone", status_code=409)
        return Response(status_code=204)

    def _refusal(self, request: Request) -> Response | None:
        """Return why a request may not change anything; None if it may."""
        if not secrets.compare_digest(request.headers.get("x-armwright-token", "").encode(), self._token.encode()):
            return PlainTextResponse("the token of the page is missing or wrong; reload the page", status_code=403)
        origin = request.headers.get("origin", "")
        if origin != f"{request.url.scheme}://{request.headers.get('host', '')}":
            return PlainTextResponse("only the page itself may send this", status_code=403)
        if request.headers.get("content-type", "").partition(";")[0].strip() != "application/json":
            return PlainTextResponse("expected application/json", status_code=415)
        return None

    def _apply(self, request: ControlRequest) -> None:
        if not self._folder.is_dir():
            raise FileNotFoundError(self._folder)
        if request.action == "hint":
            add_hint(self._folder, request.text)
        else:
            _ACTIONS[request.action](self._folder)
        self._run.look()

    async def _watch(self) -> None:
        while True:
            await asyncio.to_thread(self._run.look)
            await asyncio.sleep(POLL)

    async def _statuses(self) -> AsyncGenerator[str]:
        """Yield the status as an event whenever it changes, and at intervals while it does not."""
        self._pages.count += 1
        self._pages.were_open = True
        sent, since = None, 0.0
        try:
            while not self._pages.is_closing:
                now = asyncio.get_running_loop().time()
                if self._run.status != sent or now - since > HEARTBEAT:
                    sent, since = self._run.status, now
                    yield f"event: status\ndata: {json.dumps(sent)}\n\n"
                await asyncio.sleep(POLL)
        finally:
            self._pages.count -= 1


class _Guard:
    """Refuse requests for other hosts, and add the security headers to every response."""

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


def _natural(request: Request, name: str) -> int | None:
    """Return a whole number from the query; None if it is missing or invalid."""
    text = request.query_params.get(name, "")
    return int(text) if text.isascii() and text.isdigit() and len(text) < 10 else None
