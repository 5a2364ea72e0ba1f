"""Shared fixtures, the two tiers of the suite, and isolation from the user's home.

`make test` runs what is not slow, `make test-all` the rest. A test is slow if it is marked so, lies in one of
SLOW_FOLDERS or uses one of SLOW_FIXTURES; of a test marked fast_cases, all but the first cases are. A test that is not
slow fails if it starts a process.
"""

import gc
import signal
import sys
from collections import Counter
from collections.abc import Iterator
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any

import httpcore2
import mujoco  # noqa: F401  # its first import starts a process, which no test is to be blamed for
import pytest
from hypothesis import HealthCheck, settings
from playwright.sync_api import Browser

from tests.support import browser as browsers
from tests.support.chat_server import ChatServer

# The same examples each time, however busy the machine is. `make fuzz` looks for new ones.
settings.register_profile(
    "tests", deadline=None, derandomize=True, database=None, max_examples=50, suppress_health_check=list(HealthCheck)
)
settings.load_profile("tests")

SLOW_FOLDERS = frozenset({"torture", "fuzz"})
SLOW_FIXTURES = frozenset({"browser", "guide", "shell"})
_homes = count()
_certificates = cache(httpcore2.default_ssl_context)  # reading them takes longer than most requests


def pytest_configure(config: pytest.Config) -> None:
    """Let tests send Ctrl-C: a shell's background job ignores SIGINT, and so would the processes that it starts."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--kills", type=int, default=6, help="how often runs are killed in tests/torture")
    parser.addoption("--fuzz", type=float, default=0.0, help="share of the inputs of `make fuzz` in tests/fuzz")


@pytest.fixture(autouse=True)
def _own_home(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Hide the user's models and keys: no test can call a real model."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path_factory.getbasetemp() / f"config-{next(_homes)}"))
    for name in ("ARMWRIGHT_MODEL", "ARMWRIGHT_BASE_URL", "ARMWRIGHT_API_KEY", "OPENAI_API_KEY", "ANTHROPIC_API_KEY"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def chat_server(monkeypatch: pytest.MonkeyPatch) -> Iterator[ChatServer]:
    """Yield a local OpenAI-compatible server with scripted answers."""
    monkeypatch.setattr(httpcore2, "default_ssl_context", _certificates)
    with ChatServer() as server:
        yield server


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """A real browser."""
    program = browsers.program()
    if program is None:
        pytest.skip("chromium is not installed (on Debian: sudo apt install chromium)")
    with browsers.browser(program) as started:
        yield started


@pytest.fixture
def tab(browser: Browser) -> Iterator[browsers.Tab]:
    """A tab without a network."""
    opened = browsers.Tab(browser, offline=True)
    yield opened
    opened.close()


@pytest.fixture(scope="session")
def studied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run that tests only read: black box and rules on target-2, 40 counted trials, with its page."""
    import armwright as aw
    from armwright.page.page import write_report

    folder = tmp_path_factory.mktemp("studied") / "run"
    aw.optimize(aw.Problem(aw.load_task("target-2")), proposer="rules", n_total=40, seed=1, out=folder)
    write_report(folder)
    return folder


@pytest.fixture
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def pytest_collection_finish() -> None:
    """Freeze shared objects, so that the garbage collector skips them."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark slow tests, and put them first, so that no worker is left alone with them at the end."""
    seen: Counter[str] = Counter()
    for item in items:
        limit = item.get_closest_marker("fast_cases")
        case_of = item.nodeid.partition("[")[0]
        seen[case_of] += 1
        if limit is not None and seen[case_of] > limit.args[0]:
            item.add_marker(pytest.mark.slow)
        folders = item.path.relative_to(Path(__file__).parent).parts
        if SLOW_FOLDERS.intersection(folders) or SLOW_FIXTURES.intersection(getattr(item, "fixturenames", ())):
            item.add_marker(pytest.mark.slow)
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


_started: list[str] = []


def _note_process(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "subprocess.Popen" and arguments[1][0] != "uname":  # which Python's own `platform` asks
        _started.append(str(arguments[1]))


sys.addaudithook(_note_process)


@pytest.fixture(autouse=True)
def _no_process(request: pytest.FixtureRequest) -> Iterator[None]:
    """Keep the fast tier in one process."""
    _started.clear()
    yield
    if request.node.get_closest_marker("slow") is None and _started:
        pytest.fail(f"mark this test slow, as it starts a process: {_started[0]}")
