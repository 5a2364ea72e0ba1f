"""The editor's HTTP application. Needs the extra `edit`.

/           the page, without data
/opened     the texts of both files, and the lists to choose from
/assess     POST: texts and edits; the new texts and what they mean
/points     POST: pasted points; as targets of a task file, and notes on how they were read
/save       POST: write both files
/design     POST: write both files and search designs
/stop       POST: end the search
/job        the state of the search
/SECRET     report.html of the search; only /job tells this address, as a browser opens a page without the key

All but the two pages need the server's key (request_guard.py). What changes anything must come from the page itself.
"""

import asyncio
import secrets
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from importlib import resources
from typing import Any

from pydantic import BaseModel, Field
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, Response
from starlette.routing import Route

from armwright.editor.assessment import assess
from armwright.editor.choices import choices
from armwright.editor.design_run import DesignRun, next_folder
from armwright.editor.edited_files import MAX_BYTES, EditedFiles, Texts
from armwright.editor.request_guard import post_route, to_response
from armwright.editor.yaml_edits import Edit, edit_text
from armwright.exceptions import TaskError
from armwright.page.assembly import SHARED, PageSource, assemble
from armwright.proof.results import REPORT
from armwright.tasks.points_file import parse_points
from armwright.tasks.task import Task
from armwright.yaml_documents import parse_document

MAX_BODY = 4 * MAX_BYTES  # [bytes]; two texts, their quotes escaped
MAX_EDITS = 10_000
MIN_SECONDS, MAX_SECONDS = 5.0, 24 * 3600.0
PAGE = PageSource(
    template="editor.html",
    main="editor.js",
    styles=("page.css", "editor.css"),
    libraries=("three.min.js",),
    folders=(resources.files("armwright.editor") / "page", SHARED),
)


class TextsBody(Texts, frozen=True, extra="forbid"):
    """The texts of both files; overwrite: even if they have changed on disk."""

    overwrite: bool = False


class AssessBody(TextsBody, frozen=True):
    """The texts, and edits of the task and the space."""

    task_edits: tuple[Edit, ...] = Field(default=(), max_length=MAX_EDITS)
    space_edits: tuple[Edit, ...] = Field(default=(), max_length=MAX_EDITS)


class DesignBody(TextsBody, frozen=True):
    """The texts, and the time of a search [s]."""

    seconds: float = Field(ge=MIN_SECONDS, le=MAX_SECONDS)


class PointsBody(BaseModel, frozen=True, extra="forbid"):
    """Pasted points."""

    text: str = Field(max_length=MAX_BYTES)
    unit: str = "m"


class StopBody(BaseModel, frozen=True, extra="forbid"):
    """Nothing."""


class Editor:
    """The editor's requests."""

    def __init__(self, files: EditedFiles) -> None:
        self._files = files
        self._job: DesignRun | None = None
        self._report = f"/{secrets.token_urlsafe(24)}"
        self.open_paths = ("/", self._report)  # they need no key

    def app(self) -> Starlette:
        """Return the application, to be guarded."""
        return Starlette(routes=self.routes(), lifespan=self.lifespan)

    def routes(self) -> list[Route]:
        """Return the routes of the application."""
        return [
            Route("/", self.page),
            Route("/opened", self.opened),
            Route("/job", self.job),
            post_route("/assess", AssessBody, self.assess, MAX_BODY),
            post_route("/points", PointsBody, self.points, MAX_BODY),
            post_route("/save", TextsBody, self.save, MAX_BODY),
            post_route("/design", DesignBody, self.design, MAX_BODY),
            post_route("/stop", StopBody, self.stop),
            Route(self._report, self.report),
        ]

    @asynccontextmanager
    async def lifespan(self, app: Starlette) -> AsyncGenerator[None]:
        yield
        if self._job is not None:
            await asyncio.to_thread(self._job.close)

    async def page(self, request: Request) -> Response:
        return HTMLResponse(assemble(PAGE, "armwright", connects=True, values={}))

    async def opened(self, request: Request) -> Response:
        files = self._files
        names = {"task": files.task.name, "space": files.space.name}
        state = {"exist": files.exist, "notes": files.notes, "choices": choices()}
        return to_response({"files": names, **dict(files.texts()), **state})

    async def job(self, request: Request) -> Response:
        return to_response(None if self._job is None else {**self._job.status(), "report": self._report})

    async def report(self, request: Request) -> Response:
        if self._job is None or not (page := self._job.folder / REPORT).is_file():
            raise HTTPException(404, "there is no report")
        return FileResponse(page)

    def assess(self, body: AssessBody) -> dict[str, Any]:
        files = self._files
        texts = Texts(
            task=edit_text(body.task, body.task_edits, str(files.task)),
            space=edit_text(body.space, body.space_edits, str(files.space)),
        )
        return {"texts": texts, **assess(texts, files)}

    def points(self, body: PointsBody) -> Any:
        return parse_points(body.text, body.unit, "pasted text")

    def save(self, body: TextsBody) -> None:
        self._files.save(body, body.overwrite)

    def design(self, body: DesignBody) -> dict[str, Any]:
        if self._job is not None and self._job.is_running:
            raise HTTPException(409, "a search is running; stop it first")
        name = parse_document(body.task, Task, TaskError, self._files.task).name
        self._files.save(body, body.overwrite)
        self._job = DesignRun(self._files.task, self._files.space, body.seconds, next_folder(name))
        return self._job.status()

    def stop(self, body: StopBody) -> None:
        if self._job is not None:
            self._job.stop()
