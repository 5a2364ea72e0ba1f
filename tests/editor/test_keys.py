"""The key of the editor's server: pages of other users, other tabs and later servers do not get at data."""

import base64
import http.server
import signal
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Request, expect
from starlette.routing import Route

from armwright.editor.app import Editor
from armwright.editor.edited_files import EditedFiles
from tests.support.browser import Tab
from tests.support.command_line import PATIENCE, start
from tests.support.editor import ServedEditor, served_editor
from tests.support.server import ask, port_and_key

TASK = "name: secret-cell\ntargets:\n  - [0.3, 0.2, 0.1]\n"
MARK = "secret"  # in the name of the task


def routes(server: ServedEditor) -> list[Route]:
    """Those with addresses that are the same for each server."""
    made = Editor(EditedFiles(server.task))
    return [one for one in made.routes() if one.path == "/" or one.path not in made.open_paths]


@contextmanager
def a_server(folder: Path, port: int = 0) -> Iterator[ServedEditor]:
    task = folder / "secret-cell.yaml"
    task.write_text(TASK, encoding="utf-8")
    with served_editor(task, port) as editor:
        yield editor


@pytest.fixture
def server(in_folder: Path) -> Iterator[ServedEditor]:
    with a_server(in_folder) as begun:
        yield begun


def test_every_address_but_the_shell_needs_the_key(server: ServedEditor) -> None:
    origin = {"Origin": f"http://127.0.0.1:{server.port}", "Content_Type": "application/json"}
    for route in routes(server):
        for method in route.methods or ():
            wrong = (
                {},
                {"X_Armwright_Key": server.key[:-1]},
                {"X_Armwright_Key": "é"},
                {"Cookie": f"armwright-key={server.key}; armwright-{server.port}={server.key}"},
                {"Authorization": f"Bearer {server.key}"},
                {"Referer": server.address},
            )
            for query in ("", f"?key={server.key}"):
                for headers in wrong:
                    status, body = ask(server.port, method, route.path + query, None, **origin, **headers)
                    if route.path == "/":
                        assert status == 200
                        assert MARK.encode() not in body
                        assert server.key.encode() not in body
                    else:
                        assert status == 403, f"{method} {route.path}"
    for path in ("/nothing", "/../config.yaml", "//", "/run", "/openapi.json"):
        assert ask(server.port, "GET", path)[0] == 403


def test_only_the_page_itself_is_served(server: ServedEditor, tmp_path: Path) -> None:
    """With DNS rebinding, the browser considers page and server one site."""
    own = f"127.0.0.1:{server.port}"
    right = {"Origin": f"http://{own}", "Content_Type": "application/json", "X_Armwright_Key": server.key}
    before = files(tmp_path)
    posts = [r.path for r in routes(server) if "POST" in (r.methods or ())]
    foreign = ("null", "http://evil.example", f"http://localhost:{server.port}", f"https://{own}")
    hosts = ("evil.example", f"evil.example:{server.port}", "127.0.0.1", f"127.0.0.1:{server.port + 1}")
    assert posts
    for path in posts:
        for status, changes in (
            *((403, {"Origin": origin}) for origin in foreign),
            (415, {"Content_Type": "text/plain"}),
            *((421, {"Host": host, "Origin": f"http://{host}"}) for host in hosts),
        ):
            assert ask(server.port, "POST", path, b"{}", **(right | changes))[0] == status, (path, changes)
        assert ask(server.port, "POST", path, b"{}", X_Armwright_Key=server.key)[0] == 403
        for method in ("GET", "OPTIONS"):
            assert ask(server.port, method, path, **right)[0] == 405
    for host in hosts:
        assert ask(server.port, "GET", "/", Host=host)[0] == 421
    assert ask(server.port, "GET", "/", Host=f"localhost:{server.port}")[0] == 200
    assert files(tmp_path) == before


def test_no_websocket_is_opened(server: ServedEditor) -> None:
    own = (f"127.0.0.1:{server.port}", f"http://127.0.0.1:{server.port}")
    for host, origin in (own, ("evil.example", own[1]), (own[0], "http://evil.example"), (own[0], "null")):
        for path in {route.path for route in routes(server)}:
            for key in ("", f"X-Armwright-Key: {server.key}\r\n"):
                handshake = (
                    f"GET {path} HTTP/1.1\r\nHost: {host}\r\nOrigin: {origin}\r\nConnection: Upgrade\r\n{key}"
                    "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
                    f"Sec-WebSocket-Key: {base64.b64encode(bytes(16)).decode()}\r\n\r\n"
                )
                with socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE) as connection:
                    connection.sendall(handshake.encode())
                    status = int(connection.recv(64).split()[1])
                assert status == 421 if host != own[0] else status in (200, 403, 404, 405)
                if host == own[0] and not key:
                    assert status == (200 if path == "/" else 403)


def test_headers_of_proxies_change_nothing(server: ServedEditor) -> None:
    right = {"Content_Type": "application/json", "X_Armwright_Key": server.key}
    forged = {"X_Forwarded_Proto": "https", "X_Forwarded_For": "192.0.2.1", "Forwarded": "proto=https"}
    own = f"127.0.0.1:{server.port}"
    assert ask(server.port, "POST", "/stop", b"{}", Origin=f"http://{own}", **right, **forged)[0] == 204
    assert ask(server.port, "POST", "/stop", b"{}", Origin=f"https://{own}", **right, **forged)[0] == 403


def files(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def history(tab: Tab) -> list[str]:
    """The addresses that this tab can go back and forward to."""
    session = tab.context.new_cdp_session(tab.page)
    return [entry["url"] for entry in session.send("Page.getNavigationHistory")["entries"]]


def wait(tab: Tab, server: ServedEditor) -> None:
    tab.page.locator("#loading").wait_for(state="hidden")
    expect(tab.page).to_have_title("secret-cell.yaml: armwright")


def test_the_key_leaves_the_address_and_stays_in_the_tab(server: ServedEditor, browser: Browser) -> None:
    tab = Tab(browser)
    requests: list[Request] = []
    tab.page.on("request", lambda request: requests.append(request))
    tab.page.goto(server.address)
    wait(tab, server)
    home = f"http://127.0.0.1:{server.port}/"
    assert tab.page.url.partition("#")[0] == home
    tab.page.reload()
    wait(tab, server)
    assert history(tab)[-1].partition("#")[0] == home
    sent = [request.all_headers() for request in requests if request.url.startswith(home)]
    assert all(server.key not in url for url in (*history(tab), *tab.requests, tab.ask("document.URL")))
    assert all(server.key not in headers.get("referer", "") for headers in sent)
    assert tab.ask("document.cookie") == ""
    assert tab.context.cookies() == []
    assert all("cookie" not in headers for headers in sent)
    assert tab.faults == []

    other = tab.context.new_page()
    other.goto(home)
    expect(other.locator("#loading")).to_have_text(
        "This page cannot be shown: this tab has no key; open the address that the terminal shows, with all that "
        "follows the #"
    )
    assert MARK not in other.content()
    other.goto(server.address)  # the same document, with a fragment
    expect(other.locator("#loading")).to_be_hidden()
    tab.close()


def test_a_page_of_an_earlier_server_says_so(in_folder: Path, browser: Browser) -> None:
    tab = Tab(browser)
    with a_server(in_folder) as first:
        tab.page.goto(first.address)
        tab.page.locator("#loading").wait_for(state="hidden")
        port = first.port
    with a_server(in_folder, port) as second:
        sentence = (
            "this tab has the key of another server, such as an earlier one; open the address that the terminal shows"
        )
        tab.page.get_by_role("button", name="Add ground", exact=True).click()
        expect(tab.page.locator("#fault")).to_contain_text(sentence)
        tab.page.reload()
        expect(tab.page.locator("#loading")).to_contain_text(f"This page cannot be shown: {sentence}")
        tab.page.goto(second.address)
        tab.page.locator("#loading").wait_for(state="hidden")
    tab.close()


@pytest.fixture
def neighbour() -> Iterator[tuple[str, list[dict[str, str]]]]:
    """Another user's server on another port of this address, and the headers of the requests that it got."""
    got: list[dict[str, str]] = []

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            got.append({name.lower(): value for name, value in self.headers.items()})
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(b"<!doctype html><title>neighbour</title>")

        def log_message(self, format: str, *args: object) -> None: ...

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as there:
        threading.Thread(target=there.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{there.server_address[1]}/", got
        there.shutdown()


STEAL = """async ([home, paths, posts]) => {
    const got = [], body = '{"action":"stop"}';
    const attempt = async (what) => {
        try { got.push(String(await what())); } catch (fault) { got.push(fault.name); } };
    const loads = (element) => new Promise((done) => {
        element.onload = () => done('loaded'); element.onerror = () => done('refused');
        document.body.append(element); });
    for (const path of paths) {
        await attempt(async () => (await fetch(home + path, { credentials: 'include' })).text());
        await attempt(async () => (await fetch(home + path, { headers: { 'x-armwright-key': 'x' } })).text());
        await attempt(async () => (await fetch(home + path, { mode: 'no-cors', credentials: 'include' })).type);
        await attempt(() => loads(Object.assign(document.createElement('script'), { src: home + path })));
    }
    for (const path of posts) {
        for (const headers of [{ 'Content-Type': 'application/json', 'X-Armwright-Key': 'x' }, {}]) {
            const mode = 'Content-Type' in headers ? 'cors' : 'no-cors';
            await attempt(async () => (await fetch(home + path, { method: 'POST', body, headers, mode })).text());
        }
        await attempt(() => new Promise((done) => {
            const target = document.createElement('iframe'), form = document.createElement('form');
            target.name = form.target = path; target.onload = () => done('sent');
            Object.assign(form, { method: 'POST', action: home + path, enctype: 'text/plain' });
            form.innerHTML = `<input name='{"action":"stop","x":"' value='"}'>`;
            document.body.append(target, form); form.submit(); }));
    }
    await attempt(() => JSON.stringify([sessionStorage, localStorage, document.cookie]));
    await attempt(() => document.referrer);
    const frame = document.createElement('iframe'); frame.src = home;
    await attempt(() => loads(frame));
    await attempt(() => frame.contentWindow.sessionStorage.getItem('armwright-key'));
    const opened = window.open(home);
    await attempt(() => opened.sessionStorage.getItem('armwright-key'));
    await attempt(() => opened.location.href);
    return got;
}"""


def test_a_page_on_another_port_gets_neither_key_nor_data(
    server: ServedEditor, browser: Browser, tmp_path: Path, neighbour: tuple[str, list[dict[str, str]]]
) -> None:
    """Ports share cookies, so only what belongs to an origin can be kept from the servers of other users."""
    address, got = neighbour
    tab = Tab(browser)
    tab.page.goto(server.address)
    wait(tab, server)
    other = tab.context.new_page()
    other.goto(address)
    before = files(tmp_path)
    home = f"http://127.0.0.1:{server.port}/"
    paths, posts = ([r.path[1:] for r in routes(server) if method in (r.methods or ())] for method in ("GET", "POST"))
    stolen: list[Any] = other.evaluate(STEAL, [home, paths, posts])
    # The user leaves our page for the other one, in the same tab and from a link.
    tab.page.on("dialog", lambda dialog: dialog.accept())
    tab.page.evaluate(
        "(address) => { const link = document.createElement('a'); link.href = address; document.body.append(link);"
        " link.click(); }",
        address,
    )
    expect(tab.page).to_have_title("neighbour")
    stolen += tab.page.evaluate(STEAL, [home, paths, posts])
    assert files(tmp_path) == before
    for text in (*stolen, *(str(headers) for headers in got)):
        assert server.key not in text
        assert MARK not in text
    assert len(got) >= 2
    assert all("cookie" not in headers and headers.get("referer", address) == address for headers in got)
    tab.close()


@pytest.mark.slow
def test_no_log_holds_the_key(in_folder: Path) -> None:
    with start("edit", "secret-cell.yaml") as process:
        assert process.stdout is not None
        port, key = port_and_key(process.stdout.readline().strip())
        for headers in ({}, {"X_Armwright_Key": key}, {"Upgrade": "websocket", "Connection": "Upgrade"}):
            for path in ("/", "/run", f"/?key={key}", "/nothing"):
                ask(port, "GET", path, **headers)
        with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as connection:
            connection.sendall(f"not HTTP {key}\r\n\r\n".encode())
            connection.recv(64)
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=PATIENCE) == ("", "")
    assert process.returncode == 0
