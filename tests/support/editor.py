"""Serve the editor of two files from a thread, and send requests to it."""

import json
import queue
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import uvicorn

from armwright.editor.edited_files import EditedFiles
from armwright.editor.server import serve_editor
from tests.support.live_server import ask


@dataclass
class ServedEditor:
    """An editor's server.

    Attributes:
        address: What the terminal shows, with the key.
        task: The task file; its space file is beside it.
    """

    address: str
    task: Path
    token: str = field(default="", init=False)

    def __post_init__(self) -> None:
        page = self.get("/")[1].decode()
        self.token = page.partition('name="armwright-token" content="')[2].partition('"')[0]

    @property
    def port(self) -> int:
        return int(self.address.partition("127.0.0.1:")[2].partition("/")[0])

    @property
    def key(self) -> str:
        return self.address.partition("?key=")[2]

    @property
    def cookie(self) -> str:
        return f"armwright-{self.port}={self.key}"

    def get(self, path: str, **headers: str) -> tuple[int, bytes]:
        return ask(self.port, "GET", path, **{"Cookie": self.cookie, **headers})

    def post(self, path: str, content: Any, **headers: str) -> tuple[int, bytes]:
        """Send what the page sends, but for these headers; one that is empty is left out."""
        right = {
            "Cookie": self.cookie,
            "Origin": f"http://127.0.0.1:{self.port}",
            "Content_Type": "application/json",
            "X_Armwright_Token": self.token,
        }
        body = content if isinstance(content, bytes) else json.dumps(content).encode()
        return ask(self.port, "POST", path, body, **{k: v for k, v in (right | headers).items() if v})


@contextmanager
def served_editor(task: Path) -> Iterator[ServedEditor]:
    """Serve the editor of a task file until the end of the block."""
    addresses: queue.Queue[str] = queue.Queue()
    servers: list[uvicorn.Server] = []
    startup = uvicorn.Server.startup

    async def noting(self: uvicorn.Server, *arguments: Any, **options: Any) -> None:
        servers.append(self)
        await startup(self, *arguments, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(uvicorn.Server, "startup", noting)
        files = EditedFiles(task)
        thread = threading.Thread(target=serve_editor, args=(files, addresses.put))
        thread.start()
        yield ServedEditor(addresses.get(), task)
        servers[0].should_exit = True
        thread.join()
