"""Clocks that jump during a command (libfaketime)."""

import threading
from collections.abc import Callable, Iterator
from itertools import cycle
from pathlib import Path

import pytest

from tests.torture.short import armwright, is_resumed, run, study

LIBRARIES = ("/usr/lib/*/faketime/libfaketime.so.1", "/usr/lib/faketime/libfaketime.so.1")
TIMES = ("-50y", "+0", "+100y", "-1h", "+3d", "-70y")  # against the true one
# A machine's clock for durations does not jump with the one of the day.
STEADY = {"FAKETIME_NO_CACHE": "1", "FAKETIME_DONT_FAKE_MONOTONIC": "1", "DONT_FAKE_MONOTONIC": "1"}


@pytest.fixture
def clock(tmp_path: Path) -> Iterator[dict[str, str]]:
    """An environment in which the clock jumps to and fro, as often as a thread can make it."""
    found = [path for pattern in LIBRARIES for path in Path("/").glob(pattern.lstrip("/"))]
    if not found:
        pytest.skip("libfaketime is not installed (on Debian and Ubuntu: sudo apt install faketime)")
    file, over = tmp_path / "clock", threading.Event()
    file.write_text(f"{TIMES[0]}\n", encoding="utf-8")

    def jump() -> None:
        for time in cycle(TIMES):
            new = file.with_name("clock.new")
            new.write_text(f"{time}\n", encoding="utf-8")
            new.replace(file)
            if over.wait(0.02):
                return

    jumping = threading.Thread(target=jump)
    jumping.start()
    yield {"LD_PRELOAD": str(found[0]), "FAKETIME_TIMESTAMP_FILE": str(file), **STEADY}
    over.set()
    jumping.join()


def test_clock_of_these_tests_jumps(clock: dict[str, str]) -> None:
    """Or these tests would show nothing."""
    assert len({run(["date", "+%Y"], environment=clock).stdout for _ in range(30)}) > 1


def test_commands_survive_a_jumping_clock(
    tmp_path: Path, whole: Path, clock: dict[str, str], record_property: Callable[[str, object], None]
) -> None:
    timed = ("design", "target-1", "--budget", "1s", "--no-figures", "--out", str(tmp_path / "timed"))
    begun = study(tmp_path / "run")
    begun[begun.index("--n-total") + 1] = "8"
    for arguments in (begun, timed):
        done = armwright(*arguments, environment=clock)
        assert (done.returncode, done.stderr) == (0, "")
    is_resumed(tmp_path / "run", whole)
    record_property("clock", "jumps between 70 years ago and 100 years ahead, every 0.02 s")
