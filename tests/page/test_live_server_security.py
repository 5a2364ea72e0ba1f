"""The live server under attack from other pages and hand-made requests."""

import http.client
import json
import re
import shutil
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
import pytest
import yaml

from armwright.page.page import write_report
from armwright.page.request_guard import HEADERS
from armwright.runs.control import read_control
from tests.fuzz.run_targets import EXISTING, a_run
from tests.support.browser import Tab
from tests.support.command_line import PATIENCE
from tests.support.live_server import ask, post_control, served

__all__ = ["served"]  # a fixture

LINK = (
    '<a href="https://evil.example/">click</a><img src=x onerror="window.hacked = 1"><script>window.hacked = 2</script>'
)


def said(port: int, request: bytes) -> tuple[int, dict[str, str], bytes]:
    """The answer to these very bytes, which are no more than a part of a request perhaps."""
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as connection:
        connection.sendall(request)
        answer = http.client.HTTPResponse(connection, method=request.split(b" ")[0].decode())
        answer.begin()
        return answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read()


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


def test_responses_have_security_headers(served: tuple[Path, int, str]) -> None:
    _, port, key = served
    host, with_key = f"Host: 127.0.0.1:{port}", f"X-Armwright-Key: {key}"
    for status, request in (
        (200, lines("GET / HTTP/1.1", host)),
        (200, lines("GET /run HTTP/1.1", host, with_key)),
        (200, lines("HEAD /status HTTP/1.1", host, with_key)),
        (404, lines("GET /config.yaml HTTP/1.1", host, with_key)),
        (405, lines("GET /control HTTP/1.1", host, with_key)),
        (403, lines("POST /control HTTP/1.1", host, "Content-Length: 0")),
        (415, lines("POST /control HTTP/1.1", *right(port, key)[:2], right(port, key)[3], "Content-Length: 0")),
        (421, lines("GET / HTTP/1.1", "Host: evil.example")),
    ):
        got, headers, _ = said(port, request)
        assert got == status
        assert {name.lower(): headers.get(name.lower()) for name in HEADERS} == {
            n.lower(): v for n, v in HEADERS.items()
        }
        assert not [name for name in headers if name.startswith("access-control") or name == "server"]
    assert HEADERS["Content-Security-Policy"] == "frame-ancestors 'none'"


@pytest.mark.parametrize("method", ["PUT", "DELETE", "TRACE", "BREW"])
def test_other_methods_are_refused(served: tuple[Path, int, str], method: str) -> None:
    folder, port, key = served
    before = read_control(folder)
    more = ["Access-Control-Request-Method: POST", "X-HTTP-Method-Override: POST", "Content-Length: 0"]
    for path in ("/control", "/", "/run", "/file?design=0&format=urdf", "/status"):
        assert said(port, lines(f"{method} {path} HTTP/1.1", *right(port, key), *more))[0] in (400, 405)
    assert read_control(folder) == before


@pytest.mark.parametrize("first", [True, False])
def test_two_host_headers_are_refused(served: tuple[Path, int, str], first: bool) -> None:
    folder, port, key = served
    hosts = [f"Host: 127.0.0.1:{port}", "Host: evil.example"][:: 1 if first else -1]
    origin = f"Origin: http://{hosts[0].partition(': ')[2]}"
    request = lines("POST /control HTTP/1.1", *hosts, origin, *right(port, key)[2:], "Content-Length: 17")
    assert said(port, request + b'{"action":"stop"}')[0] in (400, 421)
    assert not read_control(folder).stop


PATHS = (
    "/../config.yaml", "/%2e%2e%2fconfig.yaml", "/%252e%252e/config.yaml", "/..%5cconfig.yaml", "//etc/passwd",
    "/run/../config.yaml", "/%c0%ae%c0%ae/x", "/config.yaml%00.html", "/trials.jsonl", "/.lock", "/file",
    "/file?design=..%2f..%2fconfig.yaml&format=urdf", "/file?design=0&format=..%2fconfig.yaml",
    "/file?design=0&format=", "/file?design=-1&format=urdf", "/file?design=%D9%A1&format=__class__",
    "/file?design=99999999999999999999&format=json",
)  # fmt: skip


@pytest.mark.parametrize("path", PATHS)
def test_paths_do_not_reach_files(served: tuple[Path, int, str], path: str) -> None:
    _, port, key = served
    status, _, body = said(port, lines(f"GET {path} HTTP/1.1", *right(port, key)))
    assert status in (400, 404)
    assert b"targets" not in body
    assert b"root:" not in body


def test_endless_body_is_refused_early(served: tuple[Path, int, str]) -> None:
    folder, port, key = served
    server = next(c.pid for c in psutil.net_connections("inet") if c.laddr.port == port and c.status == "LISTEN")
    before = psutil.Process(server).memory_info().rss
    huge, chunked = "Content-Length: 1000000000000", "Transfer-Encoding: chunked"
    part = b"%x\r\n%s\r\n" % (70_000, b" " * 70_000)
    for extra, body in ((huge, b" " * 70_000), (chunked, part)):
        assert refused(port, lines("POST /control HTTP/1.1", *right(port, key), extra) + body)
        # Whoever has no key is not even listened to.
        assert said(port, lines("POST /control HTTP/1.1", *right(port, "no"), extra))[0] == 403
    assert refused(port, lines("GET / HTTP/1.1", f"Host: 127.0.0.1:{port}", "X: " + "x" * 200_000))
    assert psutil.Process(server).memory_info().rss - before < 50e6
    assert not read_control(folder).stop


@pytest.mark.slow
def test_slow_clients_do_not_block_others(served: tuple[Path, int, str]) -> None:
    folder, port, key = served
    begun = lines("POST /control HTTP/1.1", *right(port, key), "Content-Length: 17") + b'{"action":'
    slow = [socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) for _ in range(50)]
    for number, connection in enumerate(slow):
        connection.sendall(begun if number % 2 else begun[:30])
    assert ask(port, "GET", "/run", X_Armwright_Key=key)[0] == 200
    assert post_control(port, key) == 204
    for connection in slow:
        connection.close()
    assert ask(port, "GET", "/run", X_Armwright_Key=key)[0] == 200
    assert read_control(folder).stop


def changed(file: Path, change: Callable[[dict[str, Any]], dict[str, Any]]) -> list[dict[str, Any]]:
    """Change each line of a file of records."""
    records = [change(json.loads(line)) for line in file.read_text(encoding="utf-8").splitlines()]
    file.write_text("".join(f"{json.dumps(record)}\n" for record in records), encoding="utf-8")
    return records


def test_names_in_a_run_folder_are_escaped(tmp_path: Path, tab: Tab) -> None:
    """The answers of a model, and names of objectives, sources, faults, arms and the folder, may be a stranger's."""
    folder = Path(shutil.copytree(a_run(), tmp_path / re.sub("[/]", "", LINK)[:60]))
    config = yaml.safe_load((folder / "config.yaml").read_text(encoding="utf-8"))
    for objective in config["objectives"]:
        objective |= {"label": LINK, "unit": LINK, "symbol": LINK}
    config["method"]["proposer"]["name"] = LINK
    config["space"]["name"] = LINK[:100]
    config["task"] |= {"description": LINK, "provenance": LINK}
    config["versions"]["armwright"] = LINK
    (folder / "config.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    names = {"source": LINK, "reason": LINK, "proposal": LINK, "fault": LINK}
    trials = changed(folder / "trials.jsonl", lambda trial: trial | (names if trial["number"] > 2 else {}))
    calls = changed(folder / "transcripts.jsonl", lambda call: call | {"prompt": LINK, "answer": LINK})
    fact = {"label": LINK, "unit": LINK, "explanation": LINK, "value": 0.5}
    arm = {**EXISTING, "values": trials[-1]["values"], "facts": {"mass": fact, LINK: fact}, "notes": [LINK]}
    (folder / "existing_arms.json").write_text(json.dumps([arm | {"name": LINK}]), encoding="utf-8")
    for file in (folder / "designs").glob("*/design.json"):
        record = json.loads(file.read_text(encoding="utf-8"))
        record["facts"] |= {name: {**one, "label": LINK, "explanation": LINK} for name, one in record["facts"].items()}
        file.write_text(json.dumps(record), encoding="utf-8")
    (folder / "command.txt").write_text(LINK, encoding="utf-8")
    page = write_report(folder)
    tab.open(page, "#design=5")
    tab.page.locator("#pareto").hover()
    tab.page.locator("#all-calls").check()
    assert tab.page.locator("#transcript .call").count() == len(calls)
    tab.page.locator("#configuration-box summary").click()
    assert tab.ask("window.hacked") is None
    made = tab.ask("[...document.querySelectorAll('a, img, image')].map((one) => one.outerHTML)")
    assert [html for html in made if re.search("evil|src=.?x", html)] == []
    assert "evil.example" in tab.ask("document.body.textContent")
    assert [address for address in tab.requests if not address.startswith(("file:", "data:", "blob:"))] == []
