"""The reference run of the fault tests, and their final report."""

from pathlib import Path

import pytest

from tests.support.command_line import armwright
from tests.torture.short import study


@pytest.fixture(scope="session")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The short study, undisturbed."""
    folder = tmp_path_factory.mktemp("undisturbed") / "whole"
    done = armwright(*study(folder))
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="session")
def kills(pytestconfig: pytest.Config) -> int:
    """How thorough the suite is to be."""
    return int(pytestconfig.getoption("--kills"))


@pytest.fixture
def thorough(kills: int) -> None:
    """What takes a minute is left to `make torture`."""
    if kills < 100:
        pytest.skip("takes a minute; `make torture` runs it")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    told = [pair for report in terminalreporter.getreports("passed") for pair in report.user_properties]
    if told:
        terminalreporter.section("faults")
        for name, came_to in told:
            terminalreporter.write_line(f"{name}: {came_to}")
