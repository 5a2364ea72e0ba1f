"""Locked, read-only, moved and deleted folders; no home; no cache."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from armwright.exceptions import RunFolderError
from armwright.files import replace_folder
from armwright.kinematics import kernel_cache
from armwright.problem.problem import Problem
from armwright.runs.folder import RunFolder, is_held
from armwright.study.progress import Progress
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task
from tests.torture.lives import is_beginning, is_same_run, n_lines, trials
from tests.torture.short import N_TRIALS, armwright, as_a_plain_user, command, one_line, run, study

SETTINGS: dict[str, Any] = {"proposer": "rules", "n_init": 5, "n_step": 4, "n_total": 20, "seed": 3}
PROBLEM = Problem(load_task("target-1"))


def at(number: int, act: Callable[[], object]) -> Callable[[Progress], None]:
    """Acts when this trial is finished."""

    def watch(progress: Progress) -> None:
        if (progress.doing, progress.number) == ("finished", number):
            act()

    return watch


def test_second_process_is_refused_without_effect_on_the_first(tmp_path: Path, whole: Path) -> None:
    folder, refusals = tmp_path / "run", []

    def second() -> None:
        assert is_held(folder)
        refusals.append(one_line(study(folder)))
        refusals.append(one_line(armwright("design", "target-1", "--out", folder)))

    optimize(PROBLEM, **SETTINGS, out=folder, watch=at(9, second))
    assert len(refusals) == 2
    assert all("is in use by another armwright process; wait for it, or give another --out DIR" in r for r in refusals)
    assert not is_held(folder)
    assert trials(folder) == trials(whole)


def test_one_of_two_simultaneous_processes_gets_the_folder(tmp_path: Path, whole: Path) -> None:
    folder = tmp_path / "run"
    both = [
        subprocess.Popen(command(folder, "--no-figures"), stderr=subprocess.PIPE, text=True, encoding="utf-8")
        for _ in range(2)
    ]
    for process in both:
        _, said = process.communicate()
        assert process.returncode == 0 or "is in use by another armwright process" in said
        assert "Traceback" not in said
    is_same_run(folder, whole)


def test_lock_of_a_killed_process_is_free(tmp_path: Path, whole: Path) -> None:
    folder = tmp_path / "run"
    process = subprocess.Popen(command(folder, "--no-figures"), stdout=subprocess.DEVNULL)
    while n_lines(folder / "trials.jsonl") < 3:
        time.sleep(0.002)
    process.send_signal(signal.SIGSTOP)
    assert is_held(folder)
    process.kill()
    process.wait()
    assert (folder / ".lock").exists()
    assert not is_held(folder)
    assert study(folder).returncode == 0
    is_same_run(folder, whole)


def test_checking_a_lock_does_not_block_others(tmp_path: Path) -> None:
    """A process that looks all the time, while others come and go."""
    looking = (
        "import sys; from pathlib import Path; from armwright.runs.folder import is_held\n"
        "while True: is_held(Path(sys.argv[1]))"
    )
    looks = [subprocess.Popen([sys.executable, "-c", looking, str(tmp_path)]) for _ in range(2)]
    try:
        for _ in range(100):
            with RunFolder(tmp_path):
                pass
    finally:
        for process in looks:
            process.kill()
            process.wait()


# Gone while a run goes on.


def test_deleted_folder_is_not_recreated_without_its_trials(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with pytest.raises(RunFolderError, match="was moved or deleted during the run; move it back"):
        optimize(PROBLEM, **SETTINGS, out=folder, watch=at(9, lambda: shutil.rmtree(folder)))
    assert not folder.exists()


def test_folder_deleted_after_the_last_trial_is_not_recreated(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with pytest.raises(RunFolderError, match="was moved or deleted"):
        optimize(PROBLEM, **SETTINGS, out=folder, watch=at(N_TRIALS - 1, lambda: shutil.rmtree(folder)))
    assert not folder.exists()


@pytest.mark.parametrize("number", [9, N_TRIALS - 1])
def test_moved_folder_resumes_at_its_new_place(tmp_path: Path, whole: Path, number: int) -> None:
    folder, elsewhere = tmp_path / "run", tmp_path / "elsewhere"
    with pytest.raises(RunFolderError, match="was moved or deleted"):
        optimize(PROBLEM, **SETTINGS, out=folder, watch=at(number, lambda: folder.rename(elsewhere)))
    assert not folder.exists()
    is_beginning(elsewhere, whole)
    assert study(elsewhere).returncode == 0
    is_same_run(elsewhere, whole)


def test_replaced_folder_is_left_untouched(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with pytest.raises(RunFolderError, match="was moved or deleted"):
        optimize(
            PROBLEM, **SETTINGS, out=folder,
            watch=at(9, lambda: (folder.rename(tmp_path / "elsewhere"), folder.mkdir())),
        )  # fmt: skip
    assert list(folder.iterdir()) == [] or {path.name for path in folder.iterdir()} == {"status.json"}


def test_deleted_trials_end_the_run(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with pytest.raises(RunFolderError, match="the file was deleted during the run"):
        optimize(PROBLEM, **SETTINGS, out=folder, watch=at(9, lambda: (folder / "trials.jsonl").unlink()))


# Folders that cannot be written.


@contextmanager
def read_only(folder: Path) -> Iterator[None]:
    modes = {path: path.stat().st_mode for path in (folder, *folder.rglob("*"))}
    for path, mode in modes.items():
        path.chmod(mode & ~0o222)
    try:
        yield
    finally:
        for path, mode in modes.items():
            path.chmod(mode)


def test_read_only_folder_is_read_and_not_written(tmp_path: Path, whole: Path) -> None:
    run_, empty = tmp_path / "run", tmp_path / "empty"
    shutil.copytree(whole, run_)
    empty.mkdir()
    with read_only(run_), read_only(empty):
        for refused in (run_, empty, empty / "run"):
            words = one_line(run(as_a_plain_user(command(refused, "--no-figures"))))
            assert "cannot write" in words
            assert "Permission denied" in words
        for reader in (["compare", "--list", tmp_path], ["pick", run_], ["export", run_]):
            done = run(as_a_plain_user([sys.executable, "-m", "armwright", *map(str, reader)]))
            assert (done.returncode, done.stderr) == (0, "")
        report = run(as_a_plain_user([sys.executable, "-m", "armwright", "report", str(run_)]))
        assert "Permission denied; the trials are safe" in one_line(report)
        assert not is_held(run_)
    is_same_run(run_, whole)


def test_folder_resumes_after_being_read_only(tmp_path: Path, whole: Path) -> None:
    folder = tmp_path / "run"
    process = subprocess.Popen(
        as_a_plain_user(command(folder, "--no-figures")),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
    )
    while n_lines(folder / "trials.jsonl") < 3:
        time.sleep(0.002)
    folder.chmod(0o555)
    _, said = process.communicate()
    folder.chmod(0o755)
    assert process.returncode == 1
    assert said.startswith(f"armwright: cannot write {folder}/")
    assert "Permission denied. What was written before is safe" in said
    assert said.count("\n") == 1
    is_beginning(folder, whole)
    assert study(folder).returncode == 0
    is_same_run(folder, whole)


NO_HOME: list[dict[str, str | None]] = [
    {"HOME": None, "XDG_CONFIG_HOME": None, "XDG_CACHE_HOME": None},
    {"HOME": "/proc/self/nowhere", "XDG_CONFIG_HOME": "/dev/null", "XDG_CACHE_HOME": "relative", "TMPDIR": "/proc"},
]


@pytest.fixture(scope="session")
def cache(tmp_path_factory: pytest.TempPathFactory, whole: Path) -> Path:
    """A kernels' cache that has what the short study needs: a copy of the one that it was kept in."""
    import warp

    assert whole.exists()
    PROBLEM.evaluate(PROBLEM.space.sample(1, seed=0))  # from here on Warp knows where its cache is
    copied = tmp_path_factory.mktemp("kernels") / "cache"
    shutil.copytree(Path(warp.config.kernel_cache_dir).parent, copied)
    return copied


@pytest.mark.parametrize("environment", NO_HOME, ids=["unset", "no folders at all"])
def test_command_without_a_home(tmp_path: Path, whole: Path, cache: Path, environment: dict[str, str | None]) -> None:
    folder = tmp_path / "run"
    done = study(folder, environment={**environment, "WARP_CACHE_PATH": str(cache)}, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    is_same_run(folder, whole)


@pytest.mark.slow
def test_figures_without_a_home(tmp_path: Path, cache: Path) -> None:
    """matplotlib makes do with a temporary folder, and says so."""
    done = study(
        tmp_path / "run", "--figures", environment={"HOME": "/proc/self/nowhere", "WARP_CACHE_PATH": str(cache)}
    )
    assert done.returncode == 0
    assert "Traceback" not in done.stderr
    assert list((tmp_path / "run" / "figures").glob("*.png"))


def compiled(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*.o"))


@pytest.mark.slow
def test_home_that_cannot_be_written(tmp_path: Path, whole: Path, cache: Path) -> None:
    """Kernels are kept in a temporary folder, which later commands and other processes find again."""
    place = tmp_path / "tmp"
    place.mkdir()
    nowhere: dict[str, str | None] = {
        "HOME": "/proc/self/nowhere", "XDG_CACHE_HOME": None, "XDG_CONFIG_HOME": None, "WARP_CACHE_PATH": None,
        "TMPDIR": str(place),
    }  # fmt: skip
    kept = place / f"armwright-kernels-{os.getuid()}"
    shutil.copytree(cache, kept)  # as an earlier command left it
    kept.chmod(0o700)
    before = compiled(kept)
    assert before
    for name, more in (("run", ()), ("workers", ("--workers", "2"))):  # one line for all processes
        done = study(tmp_path / name, "--no-figures", *more, environment=nowhere)
        assert done.returncode == 0, done.stderr
        (line,) = done.stderr.splitlines()
        assert line.startswith(f"compiled kernels are kept in {kept}, as your cache folder cannot be written; ")
        assert len(trials(tmp_path / name)) == N_TRIALS
    is_same_run(tmp_path / "run", whole)
    assert compiled(kept) == before


@pytest.mark.slow
def test_read_only_kernel_cache_is_used_as_far_as_it_goes(tmp_path: Path, whole: Path, cache: Path) -> None:
    home, place = tmp_path / "cache", tmp_path / "tmp"
    (version,) = (folder for folder in cache.iterdir() if folder.is_dir())
    shutil.copytree(version, home / "warp" / version.name)
    place.mkdir()
    environment = {"XDG_CACHE_HOME": str(home), "WARP_CACHE_PATH": None, "TMPDIR": str(place)}
    with read_only(home):
        done = run(as_a_plain_user(command(tmp_path / "run", "--no-figures")), environment=environment)
    assert (done.returncode, done.stderr) == (0, "")
    for module in compiled(home):
        if "ik_kernels" in str(module):
            shutil.rmtree(module.parent, ignore_errors=True)
    with read_only(home):
        done = run(as_a_plain_user(command(tmp_path / "again", "--no-figures")), environment=environment)
    assert done.returncode == 0, done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"compiled kernels are kept in {place}/armwright-kernels-")
    for name in ("run", "again"):
        is_same_run(tmp_path / name, whole)


def test_named_kernel_cache_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    words = one_line(study(tmp_path / "run", environment={"WARP_CACHE_PATH": "/proc/self/nowhere"}))
    assert "cannot write compiled kernels" in words
    assert "set WARP_CACHE_PATH to a writable folder" in words


@pytest.mark.parametrize("mode", [0o777, 0o720])
def test_temporary_kernel_cache_of_others_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: int
) -> None:
    monkeypatch.setattr(kernel_cache.tempfile, "tempdir", str(tmp_path))
    folder = Path(kernel_cache._private_folder())
    assert folder.parent == tmp_path
    assert folder.stat().st_mode & 0o777 == 0o700
    assert Path(kernel_cache._private_folder()) == folder
    folder.chmod(mode)
    other = Path(kernel_cache._private_folder())
    assert other != folder
    assert other.stat().st_mode & 0o777 == 0o700
    folder.rmdir()
    folder.symlink_to(other)
    assert Path(kernel_cache._private_folder()) not in (folder, other)


def test_filled_read_only_kernel_cache(tmp_path: Path, whole: Path, cache: Path) -> None:
    with read_only(cache):
        done = run(
            as_a_plain_user(command(tmp_path / "run", "--no-figures")), environment={"WARP_CACHE_PATH": str(cache)}
        )
    assert (done.returncode, done.stderr) == (0, "")
    is_same_run(tmp_path / "run", whole)


@pytest.mark.parametrize("with_part", [True, False])
def test_folder_replacement_is_atomic(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, with_part: bool) -> None:
    """Whatever step the process dies at: here when it takes away the files of the old one, one by one."""
    place, part = tmp_path / "figures", tmp_path / "figures.part"
    for folder, content in ((place, "old"), (part, "new")):
        folder.mkdir()
        for n in range(3):
            (folder / f"{n}.png").write_text(content, encoding="utf-8")

    def dies(folder: Path) -> None:
        next(folder.iterdir()).unlink()
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(shutil, "rmtree", dies)
        with pytest.raises(KeyboardInterrupt):
            replace_folder(place, part if with_part else None)
    assert [file.read_text(encoding="utf-8") for file in place.glob("*")] == (["new"] * 3 if with_part else [])
    replace_folder(place)
    assert not place.exists()
    assert not place.with_name("figures.old").exists()
