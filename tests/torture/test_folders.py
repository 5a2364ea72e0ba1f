"""Locked, read-only, moved and deleted folders; no home; no cache."""

import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from armwright.exceptions import RunFolderError
from armwright.files import replace_folder
from armwright.problem.problem import Problem
from armwright.study.progress import Progress
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task
from tests.support.run_locks import is_held
from tests.torture.short import (
    N_TRIALS,
    SETTINGS,
    armwright,
    as_a_plain_user,
    command,
    is_resumed,
    is_same_run,
    one_line,
    run,
    study,
)

PROBLEM = Problem(load_task("target-1"))


def short(folder: Path, number: int, act: Callable[[Path], object]) -> None:
    """The short study; acts on its folder when this trial is finished."""

    def watch(progress: Progress) -> None:
        if (progress.doing, progress.number) == ("finished", number):
            act(folder)

    optimize(PROBLEM, **SETTINGS, out=folder, watch=watch)


def test_one_of_two_simultaneous_processes_gets_the_folder(tmp_path: Path, whole: Path) -> None:
    arguments = command(study(tmp_path / "run"))
    both = [subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True, encoding="utf-8") for _ in range(2)]
    for process in both:
        _, said = process.communicate()
        assert process.returncode == 0 or "is in use by another armwright process" in said
        assert "Traceback" not in said
    is_same_run(tmp_path / "run", whole)


def move(folder: Path) -> None:
    folder.rename(folder.with_name("elsewhere"))


def replace(folder: Path) -> None:
    move(folder)
    folder.mkdir()


@pytest.mark.parametrize(("act", "number"), [(shutil.rmtree, N_TRIALS - 1), (move, 9), (replace, N_TRIALS - 1)])
def test_folder_that_is_gone_is_not_created_again(
    tmp_path: Path, whole: Path, act: Callable[[Path], object], number: int
) -> None:
    folder, elsewhere = tmp_path / "run", tmp_path / "elsewhere"
    with pytest.raises(RunFolderError, match="was moved or deleted during the run; move it back"):
        short(folder, number, act)
    assert {path.name for path in folder.glob("*")} == set()
    assert folder.exists() == (act is replace)
    if elsewhere.exists():
        is_resumed(elsewhere, whole)


def test_deleted_trials_end_the_run(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="the file was deleted during the run"):
        short(tmp_path / "run", 9, lambda folder: (folder / "trials.jsonl").unlink())


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
    folder = Path(shutil.copytree(whole, tmp_path / "run"))
    with read_only(folder):
        refused = one_line(run(as_a_plain_user(command(study(folder)))))
        assert "cannot write" in refused
        assert "Permission denied" in refused
        picked = run(as_a_plain_user(command(["pick", folder])))
        assert (picked.returncode, picked.stderr) == (0, "")
        report = run(as_a_plain_user(command(["report", folder])))
        assert "Permission denied; the trials are safe" in one_line(report)
        assert not is_held(folder)
    is_same_run(folder, whole)


@pytest.fixture(scope="session")
def cache(tmp_path_factory: pytest.TempPathFactory, whole: Path) -> Path:
    """A kernels' cache that has what the short study needs: a copy of the one that it was kept in."""
    import warp

    assert whole.exists()
    PROBLEM.evaluate(PROBLEM.space.sample(1, seed=0))  # from here on Warp knows where its cache is
    copied = tmp_path_factory.mktemp("kernels") / "cache"
    shutil.copytree(Path(warp.config.kernel_cache_dir).parent, copied)
    return copied


def test_command_without_a_home(tmp_path: Path, whole: Path, cache: Path) -> None:
    places = {"HOME": "/proc/self/nowhere", "XDG_CONFIG_HOME": "/dev/null", "XDG_CACHE_HOME": "relative"}
    environment = {**places, "TMPDIR": "/proc", "WARP_CACHE_PATH": str(cache)}
    done = armwright(*study(tmp_path / "run"), environment=environment, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    is_same_run(tmp_path / "run", whole)


def compiled(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*.o"))


@pytest.mark.parametrize("home", ["/proc/self/nowhere", "relative"])
def test_home_that_cannot_be_written(tmp_path: Path, home: str) -> None:
    nowhere: dict[str, str | None] = {
        "HOME": home, "XDG_CACHE_HOME": None, "XDG_CONFIG_HOME": None, "WARP_CACHE_PATH": None,
    }  # fmt: skip
    words = one_line(armwright(*study(tmp_path / "run", "--no-figures"), environment=nowhere, cwd=tmp_path))
    assert "cannot write compiled kernels" in words
    assert "set WARP_CACHE_PATH to a writable folder" in words


@pytest.mark.usefixtures("thorough")
def test_read_only_kernel_cache_without_all_kernels(tmp_path: Path, cache: Path) -> None:
    home = tmp_path / "cache"
    (version,) = (folder for folder in cache.iterdir() if folder.is_dir())
    shutil.copytree(version, home / "warp" / version.name)
    environment = {"XDG_CACHE_HOME": str(home), "WARP_CACHE_PATH": None}
    for module in compiled(home):
        if "ik_kernels" in str(module):
            shutil.rmtree(module.parent, ignore_errors=True)
    with read_only(home):
        words = one_line(run(as_a_plain_user(command(study(tmp_path / "again"))), environment=environment))
    assert "set WARP_CACHE_PATH to a writable folder" in words


def test_filled_read_only_kernel_cache_is_used(tmp_path: Path, whole: Path, cache: Path) -> None:
    (version,) = (folder for folder in cache.iterdir() if folder.is_dir())
    shutil.copytree(version, tmp_path / "cache" / "warp" / version.name)
    environment = {"XDG_CACHE_HOME": str(tmp_path / "cache"), "WARP_CACHE_PATH": None}
    with read_only(tmp_path / "cache"):
        done = run(as_a_plain_user(command(study(tmp_path / "run"))), environment=environment)
    assert (done.returncode, done.stderr) == (0, "")
    is_same_run(tmp_path / "run", whole)


def test_named_kernel_cache_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    words = one_line(armwright(*study(tmp_path / "run"), environment={"WARP_CACHE_PATH": "/proc/self/nowhere"}))
    assert "cannot write compiled kernels" in words
    assert "set WARP_CACHE_PATH to a writable folder" in words


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
