"""Full disks: finished trials are kept, and one line states the reason."""

import random
import resource
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from armwright.exceptions import RunFolderError
from armwright.llm.transcript import Call, Transcript
from tests.support import command_line
from tests.torture.short import armwright, is_resumed, is_same_run, one_line, study

Tell = Callable[[str, object], None]


def limit(n: int) -> Callable[[], None]:
    """For a process to come: no file of its may have more bytes."""
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (n, n))


def largest(folder: Path) -> int:
    return max(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def test_file_size_limit_keeps_finished_trials(tmp_path: Path, whole: Path, kills: int, record_property: Tell) -> None:
    """At a random size, between nothing and more than is needed."""
    chance = random.Random("limits")
    ended: Counter[int] = Counter()
    rounds = max(2, kills // 5)
    for n in range(rounds):
        folder = tmp_path / f"run{n}"
        done = armwright(*study(folder), preexec_fn=limit(chance.randint(0, largest(whole) * 11 // 10)))
        ended[done.returncode] += 1
        if done.returncode:
            assert any(words in one_line(done) for words in ("File too large", "No space left on device"))
            is_resumed(folder, whole)
        is_same_run(folder, whole)
    record_property("no file may grow", f"{rounds} sizes, {ended[1]} of them too small; each resumed")


@pytest.mark.usefixtures("thorough")
def test_no_space_for_page_and_figures(tmp_path: Path, record_property: Tell, kills: int) -> None:
    whole = tmp_path / "whole"
    armwright(*study(whole, "--figures"))
    chance = random.Random("figures")
    rounds = kills // 40
    for n in range(rounds):
        folder = tmp_path / f"run{n}"
        size = chance.randint(30_000, largest(whole) - 1)
        done = armwright(*study(folder, "--figures"), preexec_fn=limit(size))
        assert "File too large; the trials are safe" in one_line(done)
        is_resumed(folder, whole, "--figures")
    record_property("no room for page and figures", f"{rounds} sizes; each made again")


def test_no_space_for_a_search(tmp_path: Path) -> None:
    asked = ("design", "target-1", "--evaluations", "1000", "--no-figures", "--out")
    assert "File too large" in one_line(armwright(*asked, tmp_path / "run", preexec_fn=limit(20_000)))
    for name in ("whole", "run"):
        assert command_line.armwright(*asked, tmp_path / name).returncode == 0
    assert (tmp_path / "run" / "trials.jsonl").read_bytes() == (tmp_path / "whole" / "trials.jsonl").read_bytes()


def test_no_space_for_an_answer(tmp_path: Path) -> None:
    """Half a line is taken back: what another thread adds when there is room again stands on a line of its own."""
    calls = [Call(f"llm-{n}", "answer", "?", answer="x" * 1000, origin="model", model="m") for n in range(3)]
    transcript = Transcript(tmp_path / "transcripts.jsonl")
    transcript.add(calls[0])
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, hard))
    try:
        with pytest.raises(RunFolderError, match=r"cannot write .*transcripts.jsonl"):
            transcript.add(calls[1])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    transcript.add(calls[2])
    assert Transcript(tmp_path / "transcripts.jsonl").calls == (calls[0], calls[2])


@pytest.mark.usefixtures("thorough")
def test_no_space_for_the_kernels(tmp_path: Path, whole: Path) -> None:
    cache = {"WARP_CACHE_PATH": str(tmp_path / "cache")}
    words = one_line(armwright(*study(tmp_path / "run"), environment=cache, preexec_fn=limit(50_000)))
    assert "cannot write compiled kernels: File too large" in words
    is_resumed(tmp_path / "run", whole)
