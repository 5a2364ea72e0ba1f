"""Hand-made requests to the editor's server."""

import http.client
import socket
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from armwright.editor.request_guard import HEADERS
from tests.support.command_line import PATIENCE
from tests.support.editor import ServedEditor, served_editor


@pytest.fixture
def editor(in_folder: Path) -> Iterator[ServedEditor]:
    with served_editor(in_folder / "my-task.yaml") as served:
        yield served


def said(port: int, request: bytes) -> tuple[int, dict[str, str]]:
    """The answer to these very bytes, which are no more than a part of a request perhaps."""
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as connection:
        connection.sendall(request)
        answer = http.client.HTTPResponse(connection, method=request.split(b" ")[0].decode())
        answer.begin()
        return answer.status, {name.lower(): value for name, value in answer.getheaders()}


def refused(port: int, request: bytes) -> bool:
    """Whether the server says so, or hangs up while it is still spoken to."""
    try:
        return said(port, request)[0] in (400, 413, 431)
    except ConnectionError:
        return True


def lines(*words: str) -> bytes:
    return "\r\n".join([*words, "", ""]).encode("latin-1")


def right(port: int, key: str) -> list[str]:
    """The headers of the page's own POST, but for its length."""
    host = f"127.0.0.1:{port}"
    return [f"Host: {host}", f"Origin: http://{host}", "Content-Type: application/json", f"X-Armwright-Key: {key}"]


def test_responses_have_security_headers(editor: ServedEditor) -> None:
    host, with_key = f"Host: 127.0.0.1:{editor.port}", f"X-Armwright-Key: {editor.key}"
    for status, request in (
        (200, lines("GET / HTTP/1.1", host)),
        (200, lines("GET /job HTTP/1.1", host, with_key)),
        (404, lines("GET /config.yaml HTTP/1.1", host, with_key)),
        (405, lines("GET /stop HTTP/1.1", host, with_key)),
        (403, lines("POST /stop HTTP/1.1", host, "Content-Length: 0")),
        (421, lines("GET / HTTP/1.1", "Host: evil.example")),
    ):
        got, headers = said(editor.port, request)
        assert got == status
        assert {name.lower(): headers.get(name.lower()) for name in HEADERS} == {
            n.lower(): v for n, v in HEADERS.items()
        }
        assert not [name for name in headers if name.startswith("access-control") or name == "server"]
    assert HEADERS["Content-Security-Policy"] == "frame-ancestors 'none'"


@pytest.mark.parametrize("first", [True, False])
def test_two_host_headers_are_refused(editor: ServedEditor, first: bool) -> None:
    hosts = [f"Host: 127.0.0.1:{editor.port}", "Host: evil.example"][:: 1 if first else -1]
    origin = f"Origin: http://{hosts[0].partition(': ')[2]}"
    request = lines("POST /stop HTTP/1.1", *hosts, origin, *right(editor.port, editor.key)[2:], "Content-Length: 2")
    assert said(editor.port, request + b"{}")[0] in (400, 421)


def test_endless_body_is_refused_early(editor: ServedEditor) -> None:
    before = psutil.Process().memory_info().rss
    headers = right(editor.port, editor.key)
    part = b"%x\r\n%s\r\n" % (70_000, b" " * 70_000)
    for extra, body in (("Content-Length: 1000000000000", b" " * 70_000), ("Transfer-Encoding: chunked", part)):
        assert refused(editor.port, lines("POST /stop HTTP/1.1", *headers, extra) + body)
        # Whoever has no key is not even listened to.
        assert said(editor.port, lines("POST /stop HTTP/1.1", *right(editor.port, "no"), extra))[0] == 403
    assert refused(editor.port, lines("GET / HTTP/1.1", headers[0], "X: " + "x" * 200_000))
    assert psutil.Process().memory_info().rss - before < 50e6


def test_no_report_is_served_before_a_search(editor: ServedEditor) -> None:
    assert editor.get("/report.html")[0] == 404
