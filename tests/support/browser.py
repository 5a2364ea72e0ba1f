"""A real browser: Chromium from the path, with WebGL in software."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Browser, Page, expect, sync_playwright

from tests.support.command_line import PATIENCE

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
expect.set_options(timeout=1000 * PATIENCE)


def program() -> str | None:
    """The browser's program, where one is installed."""
    return next((found for found in map(shutil.which, NAMES) if found), None)


@contextmanager
def browser(path: str) -> Iterator[Browser]:
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=path, args=list(FLAGS))
        yield started
        started.close()


class Tab:
    """A page of ours in a browser, and what went on in it."""

    def __init__(self, started: Browser, **options: Any) -> None:
        self.context = started.new_context(**{"viewport": {"width": 1280, "height": 900}, **options})
        self.context.set_default_timeout(1000 * PATIENCE)
        self.page: Page = self.context.new_page()
        self.requests: list[str] = []
        self.faults: list[str] = []
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("pageerror", lambda fault: self.faults.append(str(fault)))
        self.page.on("console", lambda line: self.faults.append(line.text) if line.type == "error" else None)

    def open(self, where: Path | str, at: str = "") -> None:
        """Opens a page, and waits until it shows its run."""
        address = where if isinstance(where, str) else where.resolve().as_uri()
        self.page.goto(address + at)
        self.page.locator("#title").wait_for()
        self.page.locator("#loading").wait_for(state="hidden")

    def ask(self, expression: str) -> Any:
        """The value of an expression in the page."""
        return self.page.evaluate(expression)

    def text(self, selector: str) -> str:
        return self.page.locator(selector).inner_text()

    def centres(self, kind: str) -> np.ndarray:
        """The (N, 3) middles of the drawn parts of a kind [m]."""
        parts = map(np.array, self.ask(f"armwright.drawn('{kind}')"))
        return np.array([(part.min(axis=0) + part.max(axis=0)) / 2 for part in parts])

    def close(self) -> None:
        self.context.close()
