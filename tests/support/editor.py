"""Serve the editor of two files from a thread, and send requests to it."""

import json
import queue
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from armwright.editor.edited_files import EditedFiles
from armwright.editor.server import serve_editor
from tests.support.server import Served, ask, running


@dataclass(frozen=True)
class ServedEditor(Served):
    """An editor's server."""

    task: Path  # its space file is beside it

    def get(self, path: str) -> tuple[int, bytes]:
        return ask(self.port, "GET", path, X_Armwright_Key=self.key)

    def post(self, path: str, content: Any, **headers: str) -> tuple[int, bytes]:
        """Send what the page sends, but for these headers; one that is empty is left out."""
        right = {
            "Origin": f"http://127.0.0.1:{self.port}",
            "Content_Type": "application/json",
            "X_Armwright_Key": self.key,
        }
        body = content if isinstance(content, bytes) else json.dumps(content).encode()
        return ask(self.port, "POST", path, body, **{k: v for k, v in (right | headers).items() if v})


@contextmanager
def served_editor(task: Path, port: int = 0) -> Iterator[ServedEditor]:
    """Serve the editor of a task file until the end of the block."""
    addresses: queue.Queue[str] = queue.Queue()
    with running(partial(serve_editor, EditedFiles(task), addresses.put, port)):
        yield ServedEditor(addresses.get(), task)
