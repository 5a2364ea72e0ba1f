"""Clocks that jump during a command (libfaketime)."""

import threading
from collections.abc import Callable, Iterator
from itertools import cycle
from pathlib import Path

import pytest
import yaml

from tests.torture.lives import is_same_run
from tests.torture.short import armwright, command, run, study

LIBRARIES = ("/usr/lib/*/faketime/libfaketime.so.1", "/usr/lib/faketime/libfaketime.so.1")
TIMES = ("-50y", "+0", "+100y", "-1h", "+3d", "-70y")  # against the true one
Tell = Callable[[str, object], None]


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
    # A machine's clock for durations does not jump with the one of the day.
    yield {
        "LD_PRELOAD": str(found[0]),
        "FAKETIME_TIMESTAMP_FILE": str(file),
        "FAKETIME_NO_CACHE": "1",
        "FAKETIME_DONT_FAKE_MONOTONIC": "1",
        "DONT_FAKE_MONOTONIC": "1",
    }
    over.set()
    jumping.join()


def test_clock_of_these_tests_jumps(clock: dict[str, str]) -> None:
    """Or these tests would show nothing."""
    said = run(["date", "+%Y"], environment=clock)
    years = {run(["date", "+%Y"], environment=clock).stdout for _ in range(30)} | {said.stdout}
    assert len(years) > 1


def test_study_survives_a_jumping_clock(tmp_path: Path, whole: Path, clock: dict[str, str]) -> None:
    done = study(tmp_path / "run", environment=clock)
    assert (done.returncode, done.stderr) == (0, "")
    is_same_run(tmp_path / "run", whole)


def test_run_from_the_future_is_resumed(tmp_path: Path, whole: Path, clock: dict[str, str]) -> None:
    ahead = clock["LD_PRELOAD"]
    environment = {"LD_PRELOAD": ahead, "FAKETIME": "+10y", "DONT_FAKE_MONOTONIC": "1"}
    folder = tmp_path / "run"
    first = command(folder, "--no-figures")
    first[first.index("--n-total") + 1] = "8"
    assert run(first, environment=environment).returncode == 0
    assert study(folder).returncode == 0
    assert study(folder, environment=environment).returncode == 0
    is_same_run(folder, whole)


@pytest.mark.slow
def test_design_and_experiment_survive_a_jumping_clock(
    tmp_path: Path, clock: dict[str, str], record_property: Tell
) -> None:
    asked = ("design", "target-1", "--evaluations", "5000", "--out")
    done = armwright(*asked, tmp_path / "whole", "--no-figures")
    assert (done.returncode, done.stderr) == (0, "")
    done = armwright(*asked, tmp_path / "run", environment=clock)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "run/trials.jsonl").read_bytes() == (tmp_path / "whole/trials.jsonl").read_bytes()
    timed = ("design", "target-1", "--budget", "1s", "--no-figures", "--out", tmp_path / "timed")
    done = armwright(*timed, environment=clock)
    assert (done.returncode, done.stderr) == (0, "")
    plan = tmp_path / "small.yaml"
    content = {"name": "small", "tasks": ["target-1"], "seeds": 1, "n_init": 4, "n_total": 6}
    plan.write_text(
        yaml.safe_dump({**content, "methods": {"rules": {"label": "R", "proposer": "rules", "n_step": 3}}}),
        encoding="utf-8",
    )
    here = ("--workers", "0", "--no-figures", "--out", tmp_path / "experiment")
    done = armwright("experiment", plan, *here, environment=clock)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    record_property("clock", "jumps between 70 years ago and 100 years ahead, every 0.02 s")
