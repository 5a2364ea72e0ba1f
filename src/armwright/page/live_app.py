"""The live page's HTTP application. Needs the extra `live`.

/               the page, without data
/run            the run, packed
/file           a design as text: ?design=N&format=urdf, mjcf or datasheet
/status         the status of the study, which a page that is looked at asks for twice a second
/control        POST: stop; from the page alone

All but the page need the server's key (request_guard.py).
"""

import asyncio
from pathlib import Path
from typing import Literal

from pydantic import BaseModel
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route

from armwright.exceptions import ArmwrightError, RunFolderError
from armwright.page.assembly import assemble
from armwright.page.live_run import LiveRun
from armwright.page.page import PAGE
from armwright.page.request_guard import post_route
from armwright.runs.control import stop_study


class ControlRequest(BaseModel, frozen=True, extra="forbid"):
    """A request of the page's user to the study."""

    action: Literal["stop"]


def live_app(folder: Path) -> Starlette:
    """Return the server's application, to be guarded."""
    return Starlette(routes=[Route("/", show_shell), *LivePage(folder).routes()])


async def show_shell(request: Request) -> Response:
    """Answer with the live page, without data."""
    return HTMLResponse(assemble(PAGE, "armwright, live", connects=True, values={"data": ""}))


class LivePage:
    """The requests of the page of a run folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._run = LiveRun(folder)

    def routes(self) -> list[Route]:
        """Return the routes below the page's address."""
        return [
            Route("/run", self.packed),
            Route("/file", self.file),
            Route("/status", self.status),
            post_route("/control", ControlRequest, self.control),
        ]

    async def packed(self, request: Request) -> Response:
        try:
            data = await asyncio.to_thread(self._run.packed)
        except ValueError as fault:  # damaged numbers in the folder's files
            return PlainTextResponse(f"the run cannot be shown: {fault}", status_code=500)
        if data is None:
            return PlainTextResponse(self._run.fault or "the run has not started yet", status_code=503)
        return Response(data, media_type="application/octet-stream")

    async def file(self, request: Request) -> Response:
        given, kind = request.query_params.get("design", ""), request.query_params.get("format", "")
        number = int(given) if given.isascii() and given.isdigit() and len(given) < 10 else None
        try:
            text = None if number is None else await asyncio.to_thread(self._run.file, number, kind)
        except ArmwrightError as fault:  # the arm of a data sheet that cannot be made
            return PlainTextResponse(str(fault), status_code=500)
        if text is None:
            return PlainTextResponse("no such file", status_code=404)
        return PlainTextResponse(text)  # the page saves it; nothing runs here

    async def status(self, request: Request) -> Response:
        return JSONResponse(await asyncio.to_thread(self._run.status))

    def control(self, body: ControlRequest) -> None:
        if not self._folder.is_dir():
            raise RunFolderError("the run folder is gone")
        stop_study(self._folder)
