"""The live page's HTTP application. Needs the extra `live`.

/               the page, without data
/run            the run, packed; ?designs=N&calls=M: only what is new since then
/file           a design as text: ?design=N&format=urdf, mjcf or datasheet
/events         the status of the study whenever it changes, as lines of JSON
/control        POST: pause, resume, stop, hint; from the page alone

All but the page need the server's key (request_guard.py).
"""

import asyncio
import json
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ValidationError
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route

from armwright.exceptions import ArmwrightError, RunFolderError
from armwright.page.live_run import LiveRun
from armwright.page.page import live_shell
from armwright.page.request_guard import read_request
from armwright.runs.control import add_hint, pause_study, resume_study, stop_study

POLL = 0.25  # [s] between two checks of the run folder
HEARTBEAT = 15.0  # [s] between lines while nothing changes
MAX_BODY = 64 * 1024  # largest POST [bytes]
LINES = "application/x-ndjson"


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


def live_app(folder: Path, pages: OpenPages) -> Starlette:
    """Return the server's application, to be guarded; `pages` counts the open pages."""
    page = LivePage(folder, pages)

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncGenerator[None]:
        watching = asyncio.create_task(page.watch())
        yield
        watching.cancel()

    return Starlette(routes=[Route("/", show_shell), *page.routes()], lifespan=lifespan)


async def show_shell(request: Request) -> Response:
    """Answer with the live page, without data."""
    return Response(live_shell(), media_type="text/html; charset=utf-8")


class LivePage:
    """The requests of the page of a run folder; `pages` counts the open pages."""

    def __init__(self, folder: Path, pages: OpenPages) -> None:
        self._folder = folder
        self._pages = pages
        self._run = LiveRun(folder)

    def routes(self) -> list[Route]:
        """Return the routes below the page's address."""
        return [
            Route("/run", self.packed),
            Route("/file", self.file),
            Route("/events", self.events, methods=["GET"]),
            Route("/control", self.control, methods=["POST"]),
        ]

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
        try:
            text = None if number is None else await asyncio.to_thread(self._run.file, number, kind)
        except ArmwrightError as fault:  # the arm of a data sheet that cannot be made
            return PlainTextResponse(str(fault), status_code=500)
        if text is None:
            return PlainTextResponse("no such file", status_code=404)
        return Response(text, media_type="text/plain; charset=utf-8")  # the page saves it; nothing runs here

    async def events(self, request: Request) -> Response:
        if request.method == "HEAD":  # the stream would never end
            return Response(media_type=LINES)
        return StreamingResponse(self._statuses(), media_type=LINES)

    async def control(self, request: Request) -> Response:
        body = await read_request(request, MAX_BODY)
        if isinstance(body, Response):
            return body
        try:
            await asyncio.to_thread(self._apply, ControlRequest.model_validate_json(body))
        except ValidationError:
            return PlainTextResponse("expected pause, resume, stop or hint", status_code=422)
        except ArmwrightError as fault:
            return PlainTextResponse(str(fault), status_code=409)
        return Response(status_code=204)

    def _apply(self, request: ControlRequest) -> None:
        if not self._folder.is_dir():
            raise RunFolderError("the run folder is gone")
        if request.action == "hint":
            add_hint(self._folder, request.text)
        else:
            _ACTIONS[request.action](self._folder)
        self._run.look()

    async def watch(self) -> None:
        """Read the run folder whenever it changes, without end."""
        while True:
            await asyncio.to_thread(self._run.look)
            await asyncio.sleep(POLL)

    async def _statuses(self) -> AsyncGenerator[str]:
        """Yield the status as a line whenever it changes, and at intervals while it does not."""
        self._pages.count += 1
        self._pages.were_open = True
        sent, since = None, 0.0
        try:
            while not self._pages.is_closing:
                now = asyncio.get_running_loop().time()
                if self._run.status != sent or now - since > HEARTBEAT:
                    sent, since = self._run.status, now
                    yield f"{json.dumps(sent)}\n"
                await asyncio.sleep(POLL)
        finally:
            self._pages.count -= 1


def _natural(request: Request, name: str) -> int | None:
    """Return a whole number from the query; None if it is missing or invalid."""
    text = request.query_params.get(name, "")
    return int(text) if text.isascii() and text.isdigit() and len(text) < 10 else None
