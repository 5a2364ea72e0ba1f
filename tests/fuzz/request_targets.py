"""Fuzz requests to the live server, without a network."""

import asyncio
import json
import shutil
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from tests.fuzz.run_targets import a_run
from tests.fuzz.target import DefectError, folder


@dataclass
class LiveServer:
    """The live page's application, called without a network."""

    folder: Path
    key: str = "the-key"
    app: Any = field(init=False)

    def __post_init__(self) -> None:
        from armwright.page.live_app import OpenPages, live_app
        from armwright.page.request_guard import Guard

        self.app = Guard(live_app(self.folder, OpenPages()), self.key, {"/"}, lambda host: host == "127.0.0.1:9")

    async def _ask(self, method: str, path: bytes, headers: list[tuple[bytes, bytes]], body: bytes) -> tuple[int, Any]:
        address, _, query = path.partition(b"?")
        scope = {
            "type": "http", "asgi": {"version": "3.0"}, "http_version": "1.1", "method": method, "scheme": "http",
            "path": address.decode("utf-8", "replace"), "raw_path": address, "query_string": query, "root_path": "",
            "headers": headers, "client": ("127.0.0.1", 1), "server": ("127.0.0.1", 9),
        }  # fmt: skip
        parts = [body[:7], body[7:]]
        said: list[Any] = []

        async def receive() -> Any:
            part = parts.pop(0) if parts else b""
            return {"type": "http.request", "body": part, "more_body": bool(parts)}

        async def send(message: Any) -> None:
            said.append(message)

        await self.app(scope, receive, send)
        return said[0]["status"], said[0]["headers"]

    def ask(self, method: str, path: bytes, headers: Mapping[str, str], body: bytes = b"") -> tuple[int, Any]:
        """Return status and headers of the response."""
        given = [
            (name.lower().encode("latin-1", "replace"), value.encode("latin-1", "replace"))
            for name, value in headers.items()
        ]
        with ThreadPoolExecutor(1) as elsewhere:  # this thread may have a loop already: Playwright's
            return elsewhere.submit(lambda: asyncio.run(self._ask(method, path, given, body))).result()


@cache
def a_server() -> LiveServer:
    there = folder() / "served"
    shutil.copytree(a_run(), there)
    return LiveServer(there)


def request_seeds() -> list[bytes]:
    right = {"Host": "127.0.0.1:9", "Origin": "http://127.0.0.1:9", "Content-Type": "application/json",
             "X-Armwright-Key": "the-key"}  # fmt: skip
    actions = (
        {"action": "pause"},
        {"action": "stop"},
        {"action": "resume"},
        {"action": "hint", "text": "lower, please"},
    )
    posts = [{"method": "POST", "path": "/control", "headers": right, "body": json.dumps(action)} for action in actions]
    paths = ("/run?designs=3&calls=1", "/file?design=2&format=mjcf", "/", "/control")
    gets = [{"method": "GET", "path": path, "headers": right, "body": ""} for path in paths]
    return [json.dumps(one).encode() for one in (*posts, *posts, *gets)]


def run_request(data: bytes) -> None:
    server = a_server()
    try:
        one = json.loads(data)
        method, path, headers, body = one["method"], one["path"], one["headers"], one["body"]
        headers = {str(name): str(value) for name, value in headers.items()}
    except (ValueError, RecursionError, KeyError, TypeError, AttributeError):
        method, path, headers, body = "POST", "/control", json.loads(request_seeds()[0])["headers"], data
    if isinstance(method, str) and str(path).partition("?")[0] == "/events":
        return  # without an end
    if not isinstance(body, bytes):
        body = (body if isinstance(body, str) else json.dumps(body)).encode("utf-8", "replace")
    before = {path.name for path in server.folder.iterdir()}
    status, sent = server.ask(str(method)[:50], str(path).encode("utf-8", "replace"), headers, body)
    if status >= 500 and not (status == 503):
        raise DefectError(f"{status} for {method} {path}")
    if not {b"x-content-type-options", b"content-security-policy", b"cache-control"} <= {
        bytes(name).lower() for name, _ in sent
    }:
        raise DefectError(f"headers are missing: {sent}")
    if {path.name for path in server.folder.iterdir()} - before - {"control.json", ".control.lock"}:
        raise DefectError("a request made a file")
    control = server.folder / "control.json"
    if control.is_file() and control.stat().st_size > 3_000:
        control.unlink()
