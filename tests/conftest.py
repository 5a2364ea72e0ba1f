"""Fixtures shared by all tests, and a home that is not the user's."""

import gc
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from tests import browser as browsers
from tests.chat_server import ChatServer
from tests.postgres import PostgresServer, binaries


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--kills", type=int, default=10, help="how often runs are killed in tests/torture")


@pytest.fixture(autouse=True)
def _own_home(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """No test sees the user's models and keys, and none can call a real model."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path_factory.mktemp("config")))
    for name in ("ARMWRIGHT_MODEL", "ARMWRIGHT_BASE_URL", "ARMWRIGHT_API_KEY", "OPENAI_API_KEY", "ANTHROPIC_API_KEY"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def chat_server() -> Iterator[ChatServer]:
    """An OpenAI-compatible server on 127.0.0.1 that answers as a test tells it."""
    with ChatServer() as server:
        yield server


@pytest.fixture(scope="session")
def postgres() -> Iterator[PostgresServer]:
    """A real PostgreSQL, running."""
    programs = binaries()
    if programs is None:
        pytest.skip("PostgreSQL is not installed (on Debian and Ubuntu: sudo apt install postgresql)")
    server = PostgresServer(programs)
    server.start()
    yield server
    server.stop()
    server.remove()


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """A real browser."""
    program = browsers.program()
    if program is None:
        pytest.skip("chromium is not installed (on Debian: sudo apt install chromium)")
    with browsers.browser(program) as started:
        yield started


@pytest.fixture
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def pytest_collection_finish() -> None:
    """What all tests share lives to the end: the collector need not look at it again and again."""
    gc.collect()
    gc.freeze()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Slow tests come first, so that no worker is left alone with them at the end."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)
