"""The page of a run, live: served to browsers on this machine while the run goes on, in this process or another.

It reads the run folder and writes what its user wants into control.json, so the study never waits for it, and neither
knows of the other. Needs the extra `live`.

    /               the page
    /run            the run, packed; ?designs=N&calls=M: what is new from there on
    /file           a design as text: ?design=N&format=urdf or mjcf
    /events         what the study does, as server-sent events
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
from collections.abc import AsyncGenerator, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, BinaryIO, Literal, cast

from pydantic import BaseModel, Field, TypeAdapter, ValidationError

from armwright.control import (
    CONTROL,
    LONGEST_HINT,
    STATUS,
    Hint,
    add_hint,
    pause_study,
    read_control,
    read_status,
    resume_study,
    stop_study,
)
from armwright.exceptions import ArmwrightError, FailureError, SettingsError
from armwright.extras import check_extra
from armwright.files import writable
from armwright.llm.transcript import TRANSCRIPTS, used_hints
from armwright.report.content import RunContent, design_files
from armwright.report.page import render_page
from armwright.results import SUMMARY
from armwright.run_folder import CONFIG, TRIALS, is_held, read_config

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.requests import Request

LOOPBACK = "127.0.0.1"
HTTP_PORT = 80  # which addresses leave out
LOOK_EVERY = 0.25  # [s] between two looks at the run folder
BEAT = 15.0  # [s] after which an event says that nothing has changed
GRACE = 3.0  # [s] that a server without its study waits for a page to look on
LINGER = 60.0  # [s] that it waits for one that has looked on, and may be a tab that is not seen
LARGEST_BODY = 64 * 1024  # [bytes] of a POST
WATCHED = (CONFIG, TRIALS, TRANSCRIPTS, SUMMARY, STATUS, CONTROL)
RECENT = 20  # trials, whose time says how long the others will take
RUNNING = ("evaluating", "asking", "paused")
HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Content-Security-Policy": "frame-ancestors 'none'",  # beside the page's own
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class ControlRequest(BaseModel, frozen=True, extra="forbid"):
    """What the page's user wants of the study."""

    action: Literal["pause", "resume", "stop"]


class HintRequest(BaseModel, frozen=True, extra="forbid"):
    """A hint for the next question to the model."""

    action: Literal["hint"]
    text: str = Field(min_length=1, max_length=LONGEST_HINT)


_REQUESTS: TypeAdapter[ControlRequest | HintRequest] = TypeAdapter(
    Annotated[ControlRequest | HintRequest, Field(discriminator="action")]
)
_ACTIONS: dict[str, Callable[[Path], None]] = {"pause": pause_study, "resume": resume_study, "stop": stop_study}


class LiveRun:
    """The run folder as it is now; there need not be a run in it yet. Several threads may ask."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.fault = ""  # why the folder cannot be read
        self._content: RunContent | None = None
        self._seen: list[tuple[int, ...] | None] = []
        self._server = secrets.token_hex(8)  # another at this address is another run to a page
        self._run = 0  # how many runs lay here since the server began
        self._lock = threading.Lock()
        self.status = self._status()

    def look(self) -> None:
        """Reads what has changed."""
        with self._lock:
            seen = [_stamp(self.folder / name) for name in WATCHED]
            if seen == self._seen and not (self.status["doing"] in RUNNING and not is_held(self.folder)):
                return
            self._seen = seen
            try:
                self._read()
                self.fault = ""
            except ArmwrightError as fault:
                self.fault = str(fault)  # such as a file that is just being written anew; read again when it changes
            except Exception as fault:  # noqa: BLE001 (whatever lies in a folder, the server goes on looking)
                self.fault = f"the run folder cannot be read: {type(fault).__name__}: {fault}"
            self.status = self._status()

    def packed(self, designs: int, calls: int) -> bytes | None:
        """What is new for a page; None as long as there is no run."""
        with self._lock:
            return None if self._content is None else self._content.packed(designs, calls, with_files=False)

    def file(self, number: int, kind: str) -> str | None:
        """A design as text; None where there is none."""
        with self._lock:
            if self._content is None or number >= len(self._content.history) or kind not in ("urdf", "mjcf"):
                return None
            return design_files(self._content.history, number)[kind]

    def _read(self) -> None:
        if not (self.folder / CONFIG).is_file():
            return
        if self._content is None or not self._content.is_still(read_config(self.folder)):
            self._content = None  # what cannot be read is not shown as what was read before
            self._run += 1
            self._content = RunContent(self.folder)
        elif self._content.refresh():
            self._run += 1

    def _status(self) -> dict[str, Any]:
        """What the bar of the page says."""
        content, said, asked = self._content, read_status(self.folder), read_control(self.folder)
        history = None if content is None else content.history
        study = None if content is None else content.study
        planned = None if study is None else study.n_trials
        n = 0 if history is None else len(history)
        doing = "unknown" if said is None else said.doing
        if doing in RUNNING and not is_held(self.folder):
            doing = "gone"
        if said is None and content is not None and content.summary is not None:
            doing = "finished"
        recent = [] if history is None else [trial.seconds.get("total", 0.0) for trial in history.trials[-RECENT:]]
        left = None if planned is None or not recent else (planned - n) * sum(recent) / len(recent)
        calls = () if content is None else content.calls
        used = used_hints(calls)
        return {
            "run": f"{self._server}-{self._run}",
            "doing": doing,
            "since": 0.0 if said is None else said.since,
            "designs": n,
            "calls": len(calls),
            "planned": planned,
            "finished": content is not None and content.summary is not None,
            "left": left,
            "paused": asked.paused,
            "fault": self.fault or ("" if said is None else said.fault),
            "takes_hints": study is not None and _asks_a_model(study.proposer or {}),
            "hints": [
                {"text": hint.text, "used": _iteration(used, hint, 0 if study is None else study.n_init)}
                for hint in asked.hints
            ],
        }


def _asks_a_model(proposer: Mapping[str, Any]) -> bool:
    """Whether a hint has a reader: not the rules, not people with a question on their desk, not a recorded run."""
    return "prompt" in proposer and "replay" not in proposer and proposer["name"] != "manual"


def _iteration(used: dict[Hint, str], hint: Hint, n_init: int) -> int | None:
    """The iteration whose question carried a hint."""
    if hint not in used:
        return None
    return int(used[hint].rpartition("-")[2]) - n_init + 1


def _stamp(path: Path) -> tuple[int, ...] | None:
    try:
        there = path.stat()
    except OSError:
        return None
    return there.st_mtime_ns, there.st_ctime_ns, there.st_size, there.st_ino


def live_app(folder: Path, token: str, is_allowed: Callable[[str], bool], pages: "Pages") -> "Starlette":
    """The server's application.

    is_allowed: whether a request for this host is for us; any other is a web page's that had its name point here.
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
        html = render_page(writable(f"{folder.resolve().name}: armwright, live"), token=token)
        return Response(html, media_type="text/html; charset=utf-8")

    async def packed(request: Request) -> Response:
        designs, calls = (_whole(request, name) for name in ("designs", "calls"))
        try:
            data = await asyncio.to_thread(run.packed, designs, calls)
        except ValueError as fault:  # numbers in the folder's files that are none
            return PlainTextResponse(f"the run cannot be shown: {fault}", status_code=500)
        if data is None:
            return PlainTextResponse(run.fault or "the run has not begun yet", status_code=503)
        return Response(data, media_type="application/octet-stream")

    async def file(request: Request) -> Response:
        said, kind = request.query_params.get("design", ""), request.query_params.get("format", "")
        text = await asyncio.to_thread(run.file, int(said), kind) if _is_whole(said) else None
        if text is None:
            return PlainTextResponse("there is no such file", status_code=404)
        return Response(text, media_type="application/xml")

    async def events(request: Request) -> Response:
        if request.method == "HEAD":  # which has no end of its own
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
            return PlainTextResponse("only the page itself may ask for this", status_code=403)
        if request.headers.get("content-type", "").partition(";")[0].strip() != "application/json":
            return PlainTextResponse("JSON is wanted", status_code=415)
        body = b""
        try:
            async for part in request.stream():
                body += part
                if len(body) > LARGEST_BODY:
                    return PlainTextResponse("that is too long", status_code=413)
        except ClientDisconnect:
            return Response(status_code=400)  # to nobody
        try:
            asked = _REQUESTS.validate_json(body)
            if not folder.is_dir():
                return PlainTextResponse("the run folder is gone", status_code=409)
            if isinstance(asked, HintRequest):
                await asyncio.to_thread(add_hint, folder, asked.text)
            else:
                await asyncio.to_thread(_ACTIONS[asked.action], folder)
        except ValidationError:
            return PlainTextResponse("that is no pause, resume, stop or hint", status_code=422)
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
    """Refuses requests for other hosts, and says with every answer what a browser may do with it."""

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

        if len(hosts) != 1 or not self._is_allowed(hosts[0]):  # of two, others might believe the other one
            await PlainTextResponse("this server answers on its own address only", 421)(scope, receive, sent)
            return
        await self._app(scope, receive, sent)


def _whole(request: "Request", name: str) -> int:
    """A whole number of the address, 0 where it is none."""
    said = request.query_params.get(name, "")
    return int(said) if _is_whole(said) else 0


def _is_whole(said: str) -> bool:
    return said.isascii() and said.isdigit() and len(said) < 10


class Pages:
    """The pages that look on."""

    def __init__(self) -> None:
        self.open = 0
        self.were_open = False  # ever
        self.is_closing = False  # the server


def serve(
    folder: Path, tell: Callable[[str], None], host: str = LOOPBACK, port: int = 0, study: BinaryIO | None = None
) -> None:
    """Serves the page of a run until Ctrl-C.

    tell: called with the page's address when it can be opened. port: 0 for any that is free.
    study: a pipe that ends with the process of the study; then the server ends, too, as soon as no page looks on.
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
        listener.listen(128)  # so that whoever is told the address can connect, however soon
    except OSError as fault:
        raise FailureError(f"cannot listen on {host}, port {port}: {fault.strerror or fault}") from fault
    except OverflowError as fault:
        raise SettingsError(f"--port {port}: a whole number from 0 to 65535 is needed") from fault
    return listener


def _hosts(host: str, listener: socket.socket) -> Callable[[str], bool]:
    """Which names a browser may have called us by."""
    address, port = cast("tuple[str, int]", listener.getsockname()[:2])
    if not _is_loopback(address):
        return lambda asked: True  # whoever opens it to a network knows by what names it is reached
    names = {f"[{name}]" if ":" in name else name for name in (host.lower(), address, "localhost", LOOPBACK, "::1")}
    known = {f"{name}:{port}" for name in names}
    return lambda asked: asked.lower() in known or (port == HTTP_PORT and asked.lower() in names)


def _is_loopback(address: str) -> bool:
    ip = ipaddress.ip_address(address)
    mapped = ip.ipv4_mapped if isinstance(ip, ipaddress.IPv6Address) else None
    return (mapped or ip).is_loopback


def begin_server(folder: Path) -> str:
    """Begins a process that serves the page of the study of this process; the page's address.

    It outlives the study as long as a page looks on, and its crash is no matter to the study.
    """
    check_extra("live", "the live page")
    # Nothing of the folder that the user stands in is taken for a module (-P).
    command = [sys.executable, "-P", "-m", "armwright", "live", str(folder.absolute()), "--follow"]
    # A session of its own: Ctrl-C ends the study, and the page still shows what it came to.
    server = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True)
    assert server.stdout is not None
    address = server.stdout.readline().decode().strip()
    if not address.startswith("http://"):
        raise FailureError("the live page's server did not begin; its words stand above")
    _pipes.append(server)
    return address


_pipes: list[subprocess.Popen[bytes]] = []  # kept, as their ends tell the servers that the study is gone
