"""Ctrl-C ends a command in order, says what it waits for, and ends it in any case; the resumed run is the same."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from armwright.cli.signals import interruptible
from tests.support.command_line import PATIENCE, armwright
from tests.torture.short import is_same_run

STUDY = ("optimize", "target-1", "--n-init", "3", "--n-step", "3", "--n-total", "6", "--no-figures", "--out")

# It misbehaves at its fourth design, until there is a file `good`.
EVALUATOR = """
import pathlib, time
import armwright

n_calls = 0

@armwright.evaluator("reach [m]", "height [m]")
def measure(arm, task):
    global n_calls
    n_calls += 1
    if n_calls == 4 and not pathlib.Path("good").exists():
        pathlib.Path("begun").touch()
        {bad}
    return sum(link.length for link in arm.links), abs(arm.base[2])
"""
STUBBORN = "while True:\n            try: time.sleep(1)\n            except BaseException: pass"
HOLDS_LOCK = "sum(range(10**15))"  # C code that neither lets other threads run nor looks for signals


@contextmanager
def begun(*arguments: object) -> Iterator[subprocess.Popen[str]]:
    """A command in its own process that has made the file `begun`."""
    with subprocess.Popen(
        [sys.executable, "-m", "armwright", *map(str, arguments)], stdin=subprocess.DEVNULL, encoding="utf-8",
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env={**os.environ, "PYTHONUNBUFFERED": "1"},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:  # fmt: skip
        assert process.stdout is not None
        while not Path("begun").exists():
            assert process.poll() is None, process.stdout.read()
        yield process
        process.kill()


@pytest.fixture
def evaluator(in_folder: Path, request: pytest.FixtureRequest) -> tuple[str, ...]:
    (in_folder / "ev.py").write_text(EVALUATOR.format(bad=request.param), encoding="utf-8")
    return "--evaluator", "ev.py:measure"


@pytest.mark.slow
@pytest.mark.parametrize("evaluator", ["time.sleep(1000)"], indirect=True)
def test_first_interrupt_ends_an_evaluator_in_order(in_folder: Path, evaluator: tuple[str, ...]) -> None:
    with begun(*STUDY, in_folder / "run", *evaluator) as process:
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert "stopped; every finished trial is in" in output
    command = " ".join(map(str, (*STUDY, in_folder / "run", *evaluator)))
    assert f"Resume with:\n  python -m armwright {command}" in output
    assert "waiting for" not in output
    (in_folder / "good").touch()
    for folder in ("run", "whole"):
        done = armwright(*STUDY, folder, *evaluator)
        assert done.returncode == 0, done.stderr
    is_same_run(in_folder / "run", in_folder / "whole")


@pytest.mark.slow
@pytest.mark.parametrize("evaluator", [STUBBORN], indirect=True)
def test_evaluator_that_swallows_interrupts_is_named_and_ended(in_folder: Path, evaluator: tuple[str, ...]) -> None:
    with begun(*STUDY, in_folder / "run", *evaluator) as process:
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=PATIENCE)  # after ten seconds
    assert process.returncode == 130
    assert "armwright: waiting for the evaluator ev; Ctrl-C again ends at once\n" in output
    assert "armwright: ended without the evaluator ev\n" in output


@pytest.mark.slow
@pytest.mark.parametrize("evaluator", [HOLDS_LOCK], indirect=True)
def test_second_interrupt_ends_an_evaluator_at_once(in_folder: Path, evaluator: tuple[str, ...]) -> None:
    with begun(*STUDY, in_folder / "run", *evaluator) as process:
        process.send_signal(signal.SIGINT)
        while True:  # until the first one was delivered; two at once are one
            process.send_signal(signal.SIGINT)
            try:
                process.communicate(timeout=1.0)
                break
            except subprocess.TimeoutExpired:
                continue
    assert process.returncode in (130, -signal.SIGINT)  # both are 130 for a shell


def test_error_that_code_in_c_makes_of_an_interrupt_is_one() -> None:
    before = signal.signal(signal.SIGTERM, lambda *_: None)
    try:
        with pytest.raises(ValueError, match="ours"), interruptible():
            raise ValueError("ours")
        signal.signal(signal.SIGTERM, signal.SIG_DFL)  # as after a first Ctrl-C
        with pytest.raises(KeyboardInterrupt), interruptible():
            raise TypeError("Cannot compare structured arrays")
    finally:
        signal.signal(signal.SIGTERM, before)
