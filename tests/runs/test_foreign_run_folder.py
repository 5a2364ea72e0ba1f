"""Run folders that others made or can read: huge files are not read whole, and locks are the owner's alone."""

import fcntl
import json
import os
import shutil
import tracemalloc
import zipfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from armwright import Problem, arrays, files, find_front, load_space, load_task, optimize, write_report
from armwright.exceptions import RunFolderError
from armwright.existing.compare_arms import read_existing_arms
from armwright.llm.transcript import Transcript
from armwright.problem.facts import describe_supply
from armwright.proof.cycle_faults import describe_path
from armwright.proof.design_record import read_records
from armwright.proof.results import read_summary
from armwright.proof.selection import pick_from
from armwright.runs.folder import RunFolder, read_run
from armwright.sheet.design_sheet import design_sheet
from tests import ROOT
from tests.support.run_locks import is_held

HUGE = 3 * 1024**3  # [bytes] of zeros, which take no room on the disk
MOST = 400 * 1024**2  # [bytes] of memory at once
READERS: dict[str, Callable[[Path], object]] = {
    "config.yaml": read_run,
    "trials.jsonl": read_run,
    "transcripts.jsonl": lambda run: Transcript(run / "transcripts.jsonl", read_only=True),
    "summary.json": read_summary,
    "existing_arms.json": lambda run: read_existing_arms(run, 2),
    "simulation.json": lambda run: design_sheet(run, 0),
}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finished") / "run"
    optimize(Problem(load_task("target-1")), proposer="rules", n_init=3, n_step=2, n_total=2, out=folder)
    return folder


@pytest.fixture
def run(finished: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished, tmp_path / "run"))


@pytest.fixture
def memory() -> Iterator[None]:
    """Fail if the test takes more memory than MOST at any time."""
    tracemalloc.start()
    yield
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < MOST, f"{peak // 1024**2} MiB"


@pytest.mark.usefixtures("memory")
@pytest.mark.parametrize("name", READERS)
def test_huge_files_are_not_read_whole(run: Path, name: str) -> None:
    with (run / name).open("wb") as file:
        file.truncate(HUGE)
    with suppress(RunFolderError):
        READERS[name](run)
    with suppress(RunFolderError):
        write_report(run)


@pytest.fixture(scope="module")
def assembly(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder, examples = tmp_path_factory.mktemp("assembly") / "run", ROOT / "examples"
    space = load_space(examples / "2-assembly-space.yaml")
    find_front(Problem(load_task(examples / "2-assembly-task.yaml"), space), evaluations=200, out=folder)
    return folder


@pytest.mark.parametrize(
    "change",
    [
        {"facts": {}},
        {"facts": {"price": {"label": "Price", "unit": "USD", "explanation": "x", "value": float("nan")}}},
        {"facts": {"mass": {"label": "Mass", "unit": "m", "explanation": "x", "value": 1.7e308}}},
        {"facts": {"voltage": None}},
        {"path": {"clearance": [], "jumps": {}}},
        {"motion": {"seconds": [], "q": []}},
        {"motion": {"seconds": [1e400], "q": [[[0.0]]]}},
        {
            "loads": {
                "seconds": 1.0,
                **{key: [] for key in ("torque", "speed", "slides", "peak", "continuous", "no_load")},
            }
        },
        {"number": 1e30},
        {"params": {}},
    ],
)
def test_records_that_do_not_fit_their_design_are_computed_again(
    assembly: Path, tmp_path: Path, change: dict[str, Any]
) -> None:
    """What shows a run takes neither numbers that are none nor parts that do not belong together."""
    run = Path(shutil.copytree(assembly, tmp_path / "run"))
    _, history = read_run(run)
    numbers = [member.number for member in history.front]
    expected = read_records(assembly, history, numbers)
    for file in (run / "designs").glob("*/design.json"):
        record = json.loads(file.read_text(encoding="utf-8"))
        for key, value in change.items():
            is_part = key == "facts" and value
            record[key] = {**record[key], **value} if is_part else value
        file.write_text(json.dumps(record), encoding="utf-8")
    found = read_records(run, history, numbers)
    assert {n: one.facts for n, one in found.items()} == {
        n: {name: fact for name, fact in one.facts.items() if name in found[n].facts} for n, one in expected.items()
    }
    assert [one.motion for one in found.values()] == [one.motion for one in expected.values()]
    write_report(run)
    _, members, records = pick_from(run, by="mass")
    assert describe_path(records[members[0].number].path)
    assert describe_supply(records[members[0].number].facts)


def test_trials_and_calls_are_refused_beyond_their_limits(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    trials = run / "trials.jsonl"
    lines = trials.read_bytes().splitlines(keepends=True)
    monkeypatch.setattr(files, "MAX_RECORDS", sum(map(len, lines)))
    monkeypatch.setattr(files, "MAX_LINE", max(map(len, lines)))
    assert len(read_run(run)[1]) == len(lines)
    for limit in ("MAX_RECORDS", "MAX_LINE"):
        with monkeypatch.context() as patch:
            patch.setattr(files, limit, getattr(files, limit) - 1)
            with pytest.raises(RunFolderError, match=r"trials\.jsonl: expected at most .* MiB of "):
                read_run(run)


def test_arrays_that_unpack_to_more_than_a_limit_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "run"
    find_front(Problem(load_task("target-1")), evaluations=200, out=folder)
    file = folder / "search.npz"
    with zipfile.ZipFile(file) as packed:
        size = sum(entry.file_size for entry in packed.infolist())
    monkeypatch.setattr(arrays, "MAX_ARRAYS", size)
    find_front(Problem(load_task("target-1")), evaluations=200, out=folder)
    monkeypatch.setattr(arrays, "MAX_ARRAYS", size - 1)
    with pytest.raises(RunFolderError, match=r"search\.npz is damaged \(expected arrays of at most"):
        find_front(Problem(load_task("target-1")), evaluations=200, out=folder)


def mode(path: Path) -> int:
    return path.stat().st_mode & 0o777


@pytest.mark.parametrize("before", [None, 0o644, 0o666])
def test_no_other_user_can_open_the_lock_of_a_run(run: Path, before: int | None) -> None:
    lock = run / ".lock"
    lock.unlink(missing_ok=True)
    if before is not None:
        lock.touch()
        lock.chmod(before)
    mask = os.umask(0)
    try:
        with RunFolder(run):
            assert mode(lock) == 0o600
            assert is_held(run)
    finally:
        os.umask(mask)
    assert not is_held(run)


def test_a_lock_that_somebody_opened_before_is_waited_for(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("armwright.runs.folder.LOCK_SECONDS", 0.01)
    lock = run / ".lock"
    lock.chmod(0o644)
    with lock.open("rb") as opened:
        fcntl.flock(opened, fcntl.LOCK_SH)
        with pytest.raises(RunFolderError, match="is in use by another"), RunFolder(run):
            pass
    monkeypatch.undo()
    with RunFolder(run):
        assert mode(lock) == 0o600


def test_a_lock_that_is_a_link_leaves_its_target_as_it_is(run: Path, tmp_path: Path) -> None:
    target = tmp_path / "mine"
    target.touch(0o644)
    (run / ".lock").unlink()
    (run / ".lock").symlink_to(target)
    with pytest.raises(RunFolderError, match="is a link"), RunFolder(run):
        pass
    assert mode(target) == 0o644


@pytest.mark.parametrize("entry", [[], [[[0.0]]], [[[0.0] * 5] * 2]])
def test_postures_of_another_shape_are_damage(assembly: Path, tmp_path: Path, entry: Any) -> None:
    copy = shutil.copytree(assembly, tmp_path / "run")
    first, *others = (copy / "trials.jsonl").read_text().splitlines(keepends=True)
    (copy / "trials.jsonl").write_text(json.dumps(json.loads(first) | {"entry": [*entry, []]}) + "\n" + "".join(others))
    with pytest.raises(RunFolderError, match=r"line 1 is damaged .entry: expected as many angles for each of"):
        read_run(copy)
