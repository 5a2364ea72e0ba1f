"""Serve the editor to browsers on this machine. Needs the extra `edit`."""

import html
import secrets
import socket
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from armwright.editor.edited_files import EditedFiles
from armwright.exceptions import FailureError, SettingsError
from armwright.extras import check_extra

LOOPBACK = "127.0.0.1"
HTTP_PORT = ":80"  # omitted in addresses


def serve_editor(files: EditedFiles, tell: Callable[[str], None], port: int = 0, opens_browser: bool = False) -> None:
    """Serve the editor of two files until Ctrl-C, on this machine only; port 0 is any free one.

    `tell` is called with the address, which holds a key of 192 bits, once it can be opened.

    Raises:
        MissingExtraError: The extra `edit` is not installed.
        FailureError: The port cannot be used.
    """
    check_extra("edit", "the editor")
    import uvicorn

    from armwright.editor.app import Editor
    from armwright.editor.request_guard import Guard

    listener, key, editor = _listen(port), secrets.token_urlsafe(24), Editor(files)
    port = listener.getsockname()[1]
    hosts = {f"{name}:{port}".removesuffix(HTTP_PORT) for name in ("localhost", LOOPBACK)}
    settings = uvicorn.Config(
        Guard(editor.app(), key, editor.open_paths, hosts), log_config=None, access_log=False,
        log_level="error",  # a client's invalid requests are not news
        lifespan="on", timeout_graceful_shutdown=1, server_header=False,
        proxy_headers=False,  # any user of this machine can send X-Forwarded-Proto and -For
        ws="none",
    )  # fmt: skip

    with TemporaryDirectory(prefix="armwright-") as private:

        class Server(uvicorn.Server):
            async def startup(self, sockets: list[socket.socket] | None = None) -> None:
                await super().startup(sockets)
                # From here on Ctrl-C ends it in order.
                address = f"http://{LOOPBACK}:{port}/#key={key}"
                tell(address)
                if opens_browser:
                    page = Path(private) / "open.html"  # other users see the arguments of processes
                    refresh = f'<meta http-equiv="refresh" content="0; url={html.escape(address)}">\n'
                    page.write_text(refresh, encoding="utf-8")
                    webbrowser.open(page.as_uri())

        with suppress(KeyboardInterrupt):
            Server(settings).run(sockets=[listener])


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
