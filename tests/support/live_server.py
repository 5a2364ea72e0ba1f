"""Serve the live page of a finished run from a thread, and send requests to it."""

import http.client
import json
import os
import queue
import re
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

import armwright as aw
from armwright.report import live_server as live
from tests.support.command_line import PATIENCE


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, int, str]]:
    """A finished run on a server: its folder, the server's port, the page's token."""
    folder = tmp_path_factory.mktemp("served") / "run"
    aw.optimize(aw.Problem(task=aw.load_task("target-1")), proposer="none", n_init=4, n_total=6, out=folder)
    addresses: queue.Queue[str] = queue.Queue()
    reader, writer = (os.fdopen(end, mode, encoding="utf-8") for end, mode in zip(os.pipe(), ("rb", "wb"), strict=True))
    with pytest.MonkeyPatch.context() as patch, reader, writer:
        patch.setattr(live, "LINGER", 0.1)  # not 0: it would end with its first page
        patch.setattr(live, "GRACE", 0.1)
        # It ends with the study that `writer` stands for.
        server = threading.Thread(target=live.serve, args=(folder, addresses.put), kwargs={"study": reader})
        server.start()
        port = int(addresses.get().rstrip("/").rpartition(":")[2])
        _, page = ask(port, "GET", "/")
        (token,) = re.findall(r'name="armwright-token" content="([\w-]+)"', page.decode())
        yield folder, port, token
        writer.close()
        server.join()


def ask(port: int, method: str, path: str, body: bytes | None = None, **headers: str) -> tuple[int, bytes]:
    """The status and body of an answer, with exactly these headers."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
    given = {"Host": f"127.0.0.1:{port}"} | {name.replace("_", "-"): value for name, value in headers.items()}
    connection.putrequest(method, path, skip_host=True)
    if body is not None:
        given["Content-Length"] = str(len(body))
    for name, value in given.items():
        connection.putheader(name, value)
    connection.endheaders(body)
    response = connection.getresponse()
    found = response.status, response.read()
    connection.close()
    return found


def post_control(port: int, token: str, content: object = None, **headers: str) -> int:
    """What the server says to a POST that is right but for these headers."""
    right = {"Origin": f"http://127.0.0.1:{port}", "Content_Type": "application/json", "X_Armwright_Token": token}
    body = content if isinstance(content, bytes) else json.dumps(content or {"action": "pause"}).encode()
    return ask(port, "POST", "/control", body, **{k: v for k, v in (right | headers).items() if v})[0]
