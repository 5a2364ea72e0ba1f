"""The live page: serve a run to browsers on this machine while it goes on, in this process or another.

The server reads the run folder and writes the user's requests into control.json, so the study never waits for it.
Needs the extra `live`.

    /               the page
    /run            the run, packed; ?designs=N&calls=M: only what is new since then
    /file           a design as text: ?design=N&format=urdf or mjcf
    /events         the status of the study, as server-sent events
    /control        POST: pause, resume, stop, hint; with the page's token, from the page alone
"""

import asyncio
import ipaddress
import json
import secrets
import socket
import subprocess
import sys
import threading
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, BinaryIO, Literal, cast

from pydantic import BaseModel, Field, TypeAdapter, ValidationError

from armwright.exceptions import ArmwrightError, FailureError, SettingsError
from armwright.extras import check_extra
from armwright.files import replace_surrogates
from armwright.report.page import render_page
from armwright.runs.control import (
    LONGEST_HINT,
    add_hint,
    pause_study,
    resume_study,
    stop_study,
)

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.requests import Request
from armwright.report.live_run import LiveRun

LOOPBACK = "127.0.0.1"
HTTP_PORT = 80  # omitted in addresses
LOOK_EVERY = 0.25  # [s] between two checks of the run folder
BEAT = 15.0  # [s] between events while nothing changes
GRACE = 3.0  # [s] to wait for a first page after the study has ended
LINGER = 60.0  # [s] to wait for a page to come back, such as a tab in the background
LARGEST_BODY = 64 * 1024  # largest POST [bytes]
HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Content-Security-Policy": "frame-ancestors 'none'",  # in addition to the page's own policy
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class ControlRequest(BaseModel, frozen=True, extra="forbid"):
    """A request of the page's user to the study."""

    action: Literal["pause", "resume", "stop"]


class HintRequest(BaseModel, frozen=True, extra="forbid"):
    """A hint for the next prompt."""

    action: Literal["hint"]
    text: str = Field(min_length=1, max_length=LONGEST_HINT)


_REQUESTS: TypeAdapter[ControlRequest | HintRequest] = TypeAdapter(
    Annotated[ControlRequest | HintRequest, Field(discriminator="action")]
)
_ACTIONS: dict[str, Callable[[Path], None]] = {"pause": pause_study, "resume": resume_study, "stop": stop_study}


def live_app(folder: Path, token: str, is_allowed: Callable[[str], bool], pages: "Pages") -> "Starlette":
    """Return the server's application.

    Args:
        folder: The run folder.
        token: Required by requests that change anything.
        is_allowed: Tells whether a Host header names this server; others are refused (DNS rebinding).
        pages: Counts the open pages.
    """
    from starlette.applications import Starlette
    from starlette.middleware import Middleware
    from starlette.requests import ClientDisconnect, Request
    from starlette.responses import PlainTextResponse, Response, StreamingResponse
    from starlette.routing import Route

    run = LiveRun(folder)
    changed = asyncio.Condition()

    async def watch() -> None:
        told = run.status
        while True:
            await asyncio.to_thread(run.look)
            if run.status != told:
                told = run.status
                async with changed:
                    changed.notify_all()
            await asyncio.sleep(LOOK_EVERY)

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncGenerator[None]:
        watching = asyncio.create_task(watch())
        yield
        watching.cancel()

    async def page(request: Request) -> Response:
        html = render_page(replace_surrogates(f"{folder.resolve().name}: armwright, live"), token=token)
        return Response(html, media_type="text/html; charset=utf-8")

    async def packed(request: Request) -> Response:
        designs, calls = (_whole(request, name) for name in ("designs", "calls"))
        try:
            data = await asyncio.to_thread(run.packed, designs, calls)
        except ValueError as fault:  # damaged numbers in the folder's files
            return PlainTextResponse(f"the run cannot be shown: {fault}", status_code=500)
        if data is None:
            return PlainTextResponse(run.fault or "the run has not begun yet", status_code=503)
        return Response(data, media_type="application/octet-stream")

    async def file(request: Request) -> Response:
        said, kind = request.query_params.get("design", ""), request.query_params.get("format", "")
        text = await asyncio.to_thread(run.file, int(said), kind) if _is_whole(said) else None
        if text is None:
            return PlainTextResponse("no such file", status_code=404)
        return Response(text, media_type="application/xml")

    async def events(request: Request) -> Response:
        if request.method == "HEAD":  # the stream would never end
            return Response(media_type="text/event-stream")
        return StreamingResponse(_told(), media_type="text/event-stream")

    async def _told() -> AsyncGenerator[str]:
        pages.open += 1
        pages.were_open = True
        told, since = None, 0.0
        try:
            while not pages.is_closing:
                now = asyncio.get_running_loop().time()
                if run.status is not told or now - since > BEAT:
                    told, since = run.status, now
                    yield f"event: status\ndata: {json.dumps(told)}\n\n"
                async with changed:
                    with suppress(TimeoutError):
                        await asyncio.wait_for(changed.wait(), LOOK_EVERY)
        finally:
            pages.open -= 1

    async def control(request: Request) -> Response:
        if not secrets.compare_digest(request.headers.get("x-armwright-token", "").encode(), token.encode()):
            return PlainTextResponse("the token of the page is missing or wrong; reload the page", status_code=403)
        origin = request.headers.get("origin", "")
        if origin != f"{request.url.scheme}://{request.headers.get('host', '')}":
            return PlainTextResponse("only the page itself may send this", status_code=403)
        if request.headers.get("content-type", "").partition(";")[0].strip() != "application/json":
            return PlainTextResponse("expected application/json", status_code=415)
        body = b""
        try:
            async for part in request.stream():
                body += part
                if len(body) > LARGEST_BODY:
                    return PlainTextResponse("request too long", status_code=413)
        except ClientDisconnect:
            return Response(status_code=400)  # nobody receives it
        try:
            asked = _REQUESTS.validate_json(body)
            if not folder.is_dir():
                return PlainTextResponse("the run folder is gone", status_code=409)
            if isinstance(asked, HintRequest):
                await asyncio.to_thread(add_hint, folder, asked.text)
            else:
                await asyncio.to_thread(_ACTIONS[asked.action], folder)
        except ValidationError:
            return PlainTextResponse("expected pause, resume, stop or hint", status_code=422)
        except ArmwrightError as fault:
            return PlainTextResponse(str(fault), status_code=409)
        await asyncio.to_thread(run.look)
        async with changed:
            changed.notify_all()
        return Response(status_code=204)

    routes = [
        Route("/", page),
        Route("/run", packed),
        Route("/file", file),
        Route("/events", events, methods=["GET"]),
        Route("/control", control, methods=["POST"]),
    ]
    guard = Middleware(_Guard, is_allowed=is_allowed)
    return Starlette(routes=routes, middleware=[guard], lifespan=lifespan)


class _Guard:
    """Refuse requests for other hosts, and add the security headers to every response."""

    def __init__(self, app: Any, is_allowed: Callable[[str], bool]) -> None:
        self._app = app
        self._is_allowed = is_allowed

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        from starlette.responses import PlainTextResponse

        hosts: list[str] = [value.decode("latin-1") for name, value in scope["headers"] if name == b"host"]

        async def sent(message: Any) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], *((k.encode(), v.encode()) for k, v in HEADERS.items())]
            await send(message)

        if len(hosts) != 1 or not self._is_allowed(hosts[0]):  # with two, a proxy might use the other one
            await PlainTextResponse("unknown host; use the address that the server printed", 421)(scope, receive, sent)
            return
        await self._app(scope, receive, sent)


def _whole(request: "Request", name: str) -> int:
    """Return a whole number from the query; 0 if it is missing or invalid."""
    said = request.query_params.get(name, "")
    return int(said) if _is_whole(said) else 0


def _is_whole(said: str) -> bool:
    return said.isascii() and said.isdigit() and len(said) < 10


class Pages:
    """The open pages."""

    def __init__(self) -> None:
        self.open = 0
        self.were_open = False  # at any time
        self.is_closing = False  # whether the server is shutting down


def serve(
    folder: Path, tell: Callable[[str], None], host: str = LOOPBACK, port: int = 0, study: BinaryIO | None = None
) -> None:
    """Serve the page of a run until Ctrl-C.

    Args:
        folder: The run folder.
        tell: Called with the page's address once it can be opened.
        host: Address to listen on.
        port: Port to listen on; 0 for any free one.
        study: A pipe that closes when the study's process ends; the server then ends as soon as no page is open.

    Raises:
        MissingExtraError: The extra `live` is not installed.
        FailureError: The address cannot be used.
    """
    check_extra("live", "the live page")
    import uvicorn

    listener = _listen(host, port)
    port = listener.getsockname()[1]
    pages = Pages()
    app = live_app(folder, secrets.token_urlsafe(24), _hosts(host, listener), pages)
    settings = uvicorn.Config(
        app, log_config=None, access_log=False, lifespan="on", timeout_graceful_shutdown=1, server_header=False
    )
    server = uvicorn.Server(settings)
    tell(f"http://{f'[{host}]' if ':' in host else host}:{port}/")

    is_alone = threading.Event()
    if study is not None:
        threading.Thread(target=lambda: (study.read(), is_alone.set()), daemon=True).start()

    async def end() -> None:
        idle = 0.0
        while not server.should_exit:
            await asyncio.sleep(LOOK_EVERY)
            idle = idle + LOOK_EVERY if pages.open == 0 and is_alone.is_set() else 0.0
            if idle >= (LINGER if pages.were_open else GRACE):
                server.should_exit = True
        pages.is_closing = True

    async def run() -> None:
        ending = asyncio.create_task(end())
        await server.serve(sockets=[listener])
        ending.cancel()

    with suppress(KeyboardInterrupt):
        asyncio.run(run())


def _listen(host: str, port: int) -> socket.socket:
    if not host:
        raise SettingsError("--host is empty; 127.0.0.1 is this machine alone")
    try:
        kind = socket.AF_INET6 if ":" in host else socket.AF_INET
        listener = socket.socket(kind, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
        listener.listen(128)  # accepts connections before the address is announced
    except OSError as fault:
        raise FailureError(f"cannot listen on {host}, port {port}: {fault.strerror or fault}") from fault
    except OverflowError as fault:
        raise SettingsError(f"--port {port}: a whole number from 0 to 65535 is needed") from fault
    return listener


def _hosts(host: str, listener: socket.socket) -> Callable[[str], bool]:
    """Return the check of Host headers for this address."""
    address, port = cast("tuple[str, int]", listener.getsockname()[:2])
    if not _is_loopback(address):
        return lambda asked: True  # on a network, any name may lead here
    names = {f"[{name}]" if ":" in name else name for name in (host.lower(), address, "localhost", LOOPBACK, "::1")}
    known = {f"{name}:{port}" for name in names}
    return lambda asked: asked.lower() in known or (port == HTTP_PORT and asked.lower() in names)


def _is_loopback(address: str) -> bool:
    ip = ipaddress.ip_address(address)
    mapped = ip.ipv4_mapped if isinstance(ip, ipaddress.IPv6Address) else None
    return (mapped or ip).is_loopback


def begin_server(folder: Path) -> str:
    """Start a process that serves the page of this process's study, and return the page's address.

    The server outlives the study while a page is open. If it crashes, the study goes on.
    """
    check_extra("live", "the live page")
    # -P: never import modules from the working directory.
    command = [sys.executable, "-P", "-m", "armwright", "live", str(folder.absolute()), "--follow"]
    # A new session: after Ctrl-C the page still shows the results.
    server = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True)
    assert server.stdout is not None
    address = server.stdout.readline().decode().strip()
    if not address.startswith("http://"):
        raise FailureError("the live page's server did not start; its output is above")
    _pipes.append(server)
    return address


_pipes: list[subprocess.Popen[bytes]] = []  # kept open: their closing tells the servers that the study has ended
