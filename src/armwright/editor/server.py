"""Serve the editor to browsers on this machine."""

import html
import webbrowser
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from armwright.editor.edited_files import EditedFiles
from armwright.extras import check_extra
from armwright.page.live_server import serve_app


def serve_editor(files: EditedFiles, tell: Callable[[str], None], port: int = 0, opens_browser: bool = False) -> None:
    """Serve the editor of two files until Ctrl-C, on this machine only; port 0 is any free one.

    `tell` is called with the address, which holds the key, once it can be opened.

    Raises:
        MissingExtraError: The extra `live` is not installed.
        FailureError: The port cannot be used.
    """
    check_extra("live", "the editor")
    from armwright.editor.app import SHELLS, editor_app

    with TemporaryDirectory(prefix="armwright-") as private:

        def announce(address: str) -> None:
            tell(address)
            if opens_browser:
                page = Path(private) / "open.html"  # other users see the arguments of processes
                refresh = f'<meta http-equiv="refresh" content="0; url={html.escape(address)}">\n'
                page.write_text(refresh, encoding="utf-8")
                webbrowser.open(page.as_uri())

        serve_app(editor_app(files), SHELLS, announce, port)
