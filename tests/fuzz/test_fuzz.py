"""Give mutated documents to every entry point; `make fuzz` gives more than the short form does."""

import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random

import pytest

from tests.fuzz.target import check, seeds_of
from tests.fuzz.targets import TARGETS

FOUND = Path("fuzz-found")
LONGEST = 30.0  # [s] of an input
LARGEST = 1.5  # [GiB] of a process


class TooSlowError(BaseException):
    """An input takes too long; not an Exception, so that no handler hides it."""


@contextmanager
def limited(seconds: float = LONGEST) -> Iterator[None]:
    """Raise TooSlowError after so many CPU seconds of all threads, however busy the machine is."""

    def end(*_: object) -> None:
        raise TooSlowError(f"more than {seconds} s")

    before = signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


@pytest.mark.parametrize("name", TARGETS)
def test_mutated_documents_are_read_or_refused(name: str, pytestconfig: pytest.Config) -> None:
    """The unchanged documents are valid, or little code would be reached; some command lines are wrong on purpose."""
    target, share = TARGETS[name], pytestconfig.getoption("--fuzz")
    short = min(100, max(4, target.inputs // 1000))  # some half a second
    for number in range(max(1, round(share * target.inputs)) if share else short):
        data = target.make(Random(number))
        try:
            with limited():
                check(target, data)
        except BaseException:
            FOUND.mkdir(exist_ok=True)
            (FOUND / f"{name.replace(' ', '-')}-{number}").write_bytes(data)
            raise
    seeds = seeds_of(target)
    assert sum(check(target, one) for one in seeds) >= 0.7 * len(seeds)
    if share:
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20 < LARGEST
