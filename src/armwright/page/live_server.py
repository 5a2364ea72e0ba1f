"""Serve the live page of a run to browsers on this machine, in this process or another.

The server reads the run folder and writes the user's requests into control.json, so the study never waits for it.
Needs the extra `live`.
"""

import secrets
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Collection
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from armwright.child_process import start_module
from armwright.exceptions import FailureError, SettingsError
from armwright.extras import check_extra

if TYPE_CHECKING:
    from starlette.applications import Starlette

LOOPBACK = "127.0.0.1"
HTTP_PORT = ":80"  # omitted in addresses
GRACE = 3.0  # [s] to wait for a first page after the study has ended
LINGER = 60.0  # [s] to wait for the next request of a page, such as a tab in the background


def serve(folder: Path, tell: Callable[[str], None], port: int = 0, study: BinaryIO | None = None) -> None:
    """Serve the page of a run until Ctrl-C; port 0 is any free one.

    `tell` is called with the page's address, which holds the key, once it can be opened. `study` is a pipe that closes
    when the study's process ends; the server then ends as soon as no page is open.

    Raises:
        MissingExtraError: The extra `live` is not installed.
        FailureError: The port cannot be used.
    """
    check_extra("live", "the live page")
    from armwright.page.live_app import live_app

    serve_app(live_app(folder), {"/"}, tell, port, study)


def serve_app(
    app: "Starlette",
    shells: Collection[str],
    tell: Callable[[str], None],
    port: int,
    study: BinaryIO | None = None,
) -> None:
    """Serve an application as `serve` does, behind a guard with a key of 192 bits.

    `shells` are the paths of its pages, which need no key.
    """
    import uvicorn

    from armwright.page.request_guard import Guard

    listener, key = _listen(port), secrets.token_urlsafe(24)
    port = listener.getsockname()[1]
    hosts = {f"{name}:{port}".removesuffix(HTTP_PORT) for name in ("localhost", LOOPBACK)}
    guard = Guard(app, key, shells, hosts)
    settings = uvicorn.Config(
        guard, log_config=None, access_log=False,
        log_level="error",  # a client's invalid requests are not news
        lifespan="on", timeout_graceful_shutdown=1, server_header=False,
        proxy_headers=False,  # any user of this machine can send X-Forwarded-Proto and -For
        ws="none",
    )  # fmt: skip

    class Server(uvicorn.Server):
        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            # From here on Ctrl-C ends it in order.
            tell(f"http://{LOOPBACK}:{port}/#key={key}")

    server = Server(settings)

    def end_after(study: BinaryIO) -> None:
        study.read()
        time.sleep(GRACE)
        while guard.latest is not None and time.monotonic() - guard.latest < LINGER:
            time.sleep(GRACE)
        server.should_exit = True

    if study is not None:
        threading.Thread(target=end_after, args=(study,), daemon=True).start()
    with suppress(KeyboardInterrupt):
        server.run(sockets=[listener])


def _listen(port: int) -> socket.socket:
    try:
        listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((LOOPBACK, port))
        listener.listen(128)  # accepts connections before the address is announced
    except OSError as fault:
        raise FailureError(f"cannot listen on {LOOPBACK}, port {port}: {fault.strerror or fault}") from fault
    except OverflowError as fault:
        raise SettingsError(f"--port: expected a whole number from 0 to 65535, got {port}") from fault
    return listener


def start_server(folder: Path) -> str:
    """Start a process that serves the page of this process's study, and return the page's address.

    The server outlives the study while a page is open. If it crashes, the study goes on.
    """
    check_extra("live", "the live page")
    # In a session of its own: after Ctrl-C the page still shows the results.
    server = start_module(
        "armwright", "report", "--live", "--follow", folder.absolute(), stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert server.stdout is not None
    address = server.stdout.readline().decode().strip()
    if not address.startswith("http://"):
        raise FailureError("the live page's server did not start; its output is above")
    _pipes.append(server)
    return address


_pipes: list[subprocess.Popen[bytes]] = []  # kept open: their closing tells the servers that the study has ended
