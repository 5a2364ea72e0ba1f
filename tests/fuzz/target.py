"""A target of the fuzzer: an entry point for documents from outside, with valid documents to mutate.

A target is given bytes. It may raise ArmwrightError and nothing else. Accepted documents are used as a command would
use them.
"""

import atexit
import os
import shutil
import signal
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from random import Random

from armwright.exceptions import ArmwrightError
from tests import ROOT
from tests.fuzz.mutation import changed

MAX_REFUSAL_LENGTH = 3000  # characters
LONGEST = 30.0  # [s] of an input


class DefectError(AssertionError):
    """A document was accepted or refused in the wrong way."""


@dataclass(frozen=True)
class Target:
    """An entry point for documents."""

    inputs: int
    """Of a whole run, by what one takes."""
    form: str
    """Format of the documents: yaml, json, jsonl or text."""
    seeds: Callable[[], list[bytes]]
    """Returns valid documents."""
    run: Callable[[bytes], None]
    """Reads and uses a document."""

    def make(self, rng: Random) -> bytes:
        """Return a mutated valid document."""
        return changed(rng.choice(seeds_of(self)), self.form, rng)


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


def check(target: Target, data: bytes) -> bool:
    """Return whether a document was accepted; any exception raised here is a defect."""
    try:
        target.run(data)
    except ArmwrightError as refusal:
        check_words(refusal)
        return False
    return True


def check_words(refusal: ArmwrightError) -> None:
    words = str(refusal)
    if len(words) > MAX_REFUSAL_LENGTH or not words or not words.isprintable():
        raise DefectError(f"a refusal of {len(words)} characters that is no line: {words[:500]!r}") from refusal


@cache
def seeds_of(target: Target) -> list[bytes]:
    """Return the valid documents of a target."""
    return target.seeds()


@cache
def folder() -> Path:
    """Return this process's folder for input files, in memory if possible."""
    place = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    made = Path(tempfile.mkdtemp(prefix="armwright-fuzz-", dir=place))
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return made


def file_of(data: bytes, name: str) -> Path:
    path = folder() / name
    path.write_bytes(data)
    return path


def shipped(room: str) -> list[bytes]:
    """Return the YAML files in the folder `builtin` of a subpackage."""
    files = (resources.files("armwright") / room / "builtin").iterdir()
    found = [file.read_bytes() for file in sorted(files, key=lambda file: file.name) if file.name.endswith(".yaml")]
    assert found, room
    return found


def of_examples(part: str) -> list[bytes]:
    return [file.read_bytes() for file in sorted((ROOT / "examples").glob(f"*{part}*.yaml"))]


def any_of(reads: Iterable[Callable[[], object]]) -> None:
    """Call all readers and raise the first refusal if none accepts."""
    refusals: list[ArmwrightError] = []
    passed = False
    for read in reads:
        try:
            read()
            passed = True
        except ArmwrightError as refusal:
            check_words(refusal)
            refusals.append(refusal)
    if refusals and not passed:
        raise refusals[0]
