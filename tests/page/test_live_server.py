"""The live page, with a study in another process and a real browser."""

import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Self

import psutil
import pytest
from playwright.sync_api import Browser, expect

import armwright as aw
from armwright.page.live_run import LiveRun
from armwright.proof.results import discard_results
from armwright.runs.control import Channel, read_control
from armwright.runs.folder import RunFolder, read_run
from tests.support.browser import Tab
from tests.support.chat_server import Answer, ChatServer, Request, designer
from tests.support.command_line import PATIENCE
from tests.support.live_server import post_control, served
from tests.support.wire_formats import model_options

__all__ = ["served"]  # a fixture


class LiveStudy:
    """`armwright optimize … --live` in a process of its own; a context manager, at whose end it is gone."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.folder = folder
        command = [sys.executable, "-m", "armwright", "optimize", "target-1", "--live", "--no-figures", "--out", folder]
        # Its server outlives it, with its stderr, which is therefore no pipe.
        self.process = subprocess.Popen([*command, *options], stdout=subprocess.PIPE, text=True, encoding="utf-8")
        assert self.process.stdout is not None
        addresses = (
            re.search(r"^live: (http://127\.0\.0\.1:\d+/#key=[\w-]{32})$", line) for line in self.process.stdout
        )
        self.address = next(found[1] for found in addresses if found)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.communicate()

    def end(self) -> int:
        """Waits for its end."""
        self.said, _ = self.process.communicate(timeout=PATIENCE)
        return self.process.returncode


@pytest.fixture
def tab(browser: Browser) -> Iterator[Tab]:
    opened = Tab(browser)
    yield opened
    opened.close()


@pytest.fixture
def live() -> Iterator[ExitStack]:
    """Ends the studies that a test began, whatever became of it."""
    with ExitStack() as begun:
        yield begun


def test_live_page_receives_designs_and_stops(
    tmp_path: Path, tab: Tab, live: ExitStack, chat_server: ChatServer
) -> None:
    gate = threading.Event()

    def answer(request: Request) -> Answer:
        if len(chat_server.requests) > 3:  # a check, and two steps of the first proposal
            gate.wait(PATIENCE)
        return designer(request)

    chat_server.answer = answer
    model = ("--model", "test-model", *model_options(base_url=chat_server.url, origin="scripted"))
    counts = ("--n-init", "4", "--n-step", "4", "--n-total", "4000")
    study = live.enter_context(LiveStudy(tmp_path / "run", *model, *counts))
    tab.open(study.address)
    page = tab.page
    expect(page.locator("#doing")).to_have_text(re.compile(r"^asking the model, \d"))
    # The second proposal's question is under way with 8 designs finished.
    expect(page.locator("#facts")).to_contain_text("black box 3")
    assert tab.ask("armwright.content.n") == 8

    # A reload shows the whole state; a second tab, too.
    page.reload()
    page.locator("#loading").wait_for(state="hidden")
    assert tab.ask("armwright.content.n") == 8
    other = Tab(page.context.browser)
    other.open(study.address)

    gate.set()
    page.get_by_role("button", name="Stop after this design").click()
    assert study.end() == 130
    assert "stopped" in study.said
    expect(page.locator("#doing")).to_have_text(re.compile(r"^stopped at \d+ of 4004; repeat the command to resume"))
    expect(page.locator("#stop")).to_be_hidden()
    finished = len(read_run(study.folder)[1])
    assert f"stopped at {finished} of" in page.locator("#doing").inner_text()
    page.reload()  # the server lives on as long as a page looks on
    page.locator("#loading").wait_for(state="hidden")
    assert tab.ask("armwright.content.n") == finished
    other.close()
    assert tab.faults == []


def test_live_page_shows_the_end_and_outlives_the_study(tmp_path: Path, tab: Tab, live: ExitStack) -> None:
    study = live.enter_context(LiveStudy(tmp_path / "run", "--proposer", "rules", "--n-total", "30", "--seed", "3"))
    tab.open(study.address)
    expect(tab.page.locator("#doing")).to_have_text("finished: 40 designs")
    assert study.end() == 0
    expect(tab.page.locator("#facts")).to_contain_text("robust")
    history = read_run(study.folder)[1]
    assert tab.ask("armwright.content.n") == 40
    assert tab.ask("armwright.content.curve.at(-1)") == pytest.approx(history.hypervolume[-1])
    assert sorted(tab.ask("armwright.content.head.front")) == sorted(m.number for m in history.front)
    with tab.page.expect_download() as download:
        tab.page.get_by_role("button", name="URDF").click()
    assert Path(download.value.path()).read_text(encoding="utf-8").startswith("<?xml")
    assert all(study.address.partition("=")[2] not in url for url in tab.requests)
    assert tab.faults == []


def test_study_survives_a_killed_server(tmp_path: Path, tab: Tab, live: ExitStack) -> None:
    study = live.enter_context(LiveStudy(tmp_path / "run", "--proposer", "none", "--n-total", "300"))
    tab.open(study.address)
    (server,) = psutil.Process(study.process.pid).children()
    server.kill()
    expect(tab.page.locator("#doing")).to_have_text(re.compile("Connection lost"))
    assert study.end() == 0
    assert len(read_run(study.folder)[1]) == 310


def test_direct_search_is_searching_as_long_as_it_holds_its_folder(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    aw.find_front(aw.Problem(aw.load_task("target-1")), evaluations=400, out=folder)
    run = LiveRun(folder)
    assert run.status()["doing"] == "finished"
    discard_results(folder)
    with RunFolder(folder):
        assert run.status()["doing"] == "searching"
    assert run.status()["doing"] == "unknown"
    Channel(folder).report("evaluating", 0)  # by a process that has been killed
    assert run.status()["doing"] == "gone"


@pytest.mark.parametrize(
    ("content", "status"),
    [
        (b"", 422), (b"\xff\xfe", 422), (b"[" * 60000, 422), (b'{"action":' * 9000, 413), ({"action": "explode"}, 422),
        ({"action": "stop", "more": 1}, 422),
    ],
)  # fmt: skip
def test_invalid_control_requests_are_refused(served: tuple[Path, int, str], content: object, status: int) -> None:
    folder, port, key = served
    before = read_control(folder)
    assert post_control(port, key, content) == status
    assert read_control(folder) == before


def test_server_listens_on_loopback_only(served: tuple[Path, int, str]) -> None:
    _, port, _ = served
    listening = [c.laddr.ip for c in psutil.net_connections("inet") if c.status == "LISTEN" and c.laddr.port == port]
    assert listening == ["127.0.0.1"]
