"""Files are replaced whole, beside others' files, and without following links."""

import os
import shutil
import stat
import threading
from pathlib import Path

import pytest

from armwright.exceptions import RunFolderError
from armwright.files import check_no_links, new_part, open_to_append, replace_file, replace_folder
from armwright.problem.problem import Problem
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task
from tests.support.command_line import armwright, refused

STUDY = ("optimize", "target-1", "--n-init", "3", "--n-step", "3", "--n-total", "3", "--no-figures")
WRITERS: dict[str, tuple[str, ...]] = {  # commands that write into a finished run, its folder last
    "optimize": (*STUDY[:-2], "6", "--out"),
    "report": ("report",),
    "datasheet": ("datasheet",),
    "reach-map": ("reach-map", "--spacing", "0.3"),
    "compare-arms": ("compare-arms", "target-1", "no-such-arm.urdf", "--run"),
}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run."""
    folder = tmp_path_factory.mktemp("finished") / "run"
    assert armwright(*STUDY, "--out", folder).returncode == 0
    return folder


@pytest.fixture
def run(finished: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished, tmp_path / "run"))


def test_replaced_file_is_never_read_in_part(tmp_path: Path) -> None:
    """Two writers and a reader at once."""
    target, contents = tmp_path / "x", [letter * 100_000 for letter in (b"a", b"b")]
    target.write_bytes(contents[0])

    def write(content: bytes) -> None:
        for _ in range(200):
            replace_file(target, content)

    writers = [threading.Thread(target=write, args=(content,)) for content in contents]
    for writer in writers:
        writer.start()
    while any(writer.is_alive() for writer in writers):
        assert target.read_bytes() in contents
    assert [path.name for path in tmp_path.iterdir()] == ["x"]


def test_files_of_the_user_survive(tmp_path: Path) -> None:
    names = ["x.part", ".x.part", "x.old", ".x.0123456789abcdef.part", ".x.1-0123456789abcdef.part"]
    for name in names:
        (tmp_path / name).write_text("mine", encoding="utf-8")
    replace_file(tmp_path / "x", b"new")
    (tmp_path / "folder").mkdir()
    replace_folder(tmp_path / "folder", None)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*names, "x"])


def test_rests_of_dead_processes_are_removed(tmp_path: Path) -> None:
    child = os.fork()
    if not child:
        os._exit(0)
    os.waitpid(child, 0)
    rest, folder = tmp_path / f".x.{child}-0123456789abcdef.part", tmp_path / f".y.{child}-0123456789abcdef.part"
    own = new_part(tmp_path / "x")
    rest.write_bytes(b"half")
    own.write_bytes(b"another thread's")
    folder.mkdir()
    replace_file(tmp_path / "x", b"new")
    replace_file(tmp_path / "y", b"new")
    assert {path.name for path in tmp_path.iterdir()} == {"x", "y", own.name}


@pytest.mark.parametrize("mode", [0o600, 0o640])
def test_private_file_is_private_from_the_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: int) -> None:
    modes: list[int] = []

    def replace(part: Path, target: Path) -> None:
        modes.append(stat.S_IMODE(part.stat().st_mode))
        part.rename(target)

    monkeypatch.setattr(os, "replace", replace)
    replace_file(tmp_path / "x", b"secret", mode)
    assert modes == [mode]


def test_link_is_replaced_and_not_followed(tmp_path: Path) -> None:
    victim, link = tmp_path / "victim", tmp_path / "link"
    victim.write_text("before", encoding="utf-8")
    link.symlink_to(victim)
    with pytest.raises(OSError, match="symbolic links"):
        open_to_append(link)
    replace_file(link, b"after")
    assert (victim.read_text(encoding="utf-8"), link.read_text(encoding="utf-8"), link.is_symlink()) == (
        "before",
        "after",
        False,
    )


def test_failed_replacement_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "file").touch()
    with pytest.raises(OSError, match="directory"):
        replace_file(tmp_path / "x", b"new")
    assert [path.name for path in tmp_path.iterdir()] == ["x"]


def test_pipes_are_refused(tmp_path: Path) -> None:
    """A reader would wait for ever."""
    os.mkfifo(tmp_path / "trials.jsonl")
    with pytest.raises(RunFolderError, match=r"trials\.jsonl is no ordinary file"):
        check_no_links(tmp_path)


@pytest.mark.parametrize(
    ("command", "name"),
    [("report", "config.yaml"), ("report", "designs"), *((command, "trials.jsonl") for command in WRITERS)],
)
def test_links_among_the_files_of_a_run_are_refused(run: Path, tmp_path: Path, command: str, name: str) -> None:
    place, outside = run / name, tmp_path / "outside"
    if place.exists():
        place.rename(outside)
    else:
        outside.write_text("", encoding="utf-8")
    before = {path: path.read_bytes() for path in [outside, *outside.rglob("*")] if path.is_file()}
    place.symlink_to(outside)
    assert f"{place} is a link; remove it, or put the file itself in its place" in refused(1, *WRITERS[command], run)
    assert {path: path.read_bytes() for path in [outside, *outside.rglob("*")] if path.is_file()} == before


def test_links_in_the_folder_of_an_experiment_are_refused(tmp_path: Path) -> None:
    plan, out, outside = tmp_path / "plan.yaml", tmp_path / "out", tmp_path / "outside"
    plan.write_text(
        "name: small\ntasks: [target-1]\nmethods: {tpe: {label: TPE}}\nseeds: 1\nn_init: 2\nn_total: 2\n",
        encoding="utf-8",
    )
    outside.mkdir()
    out.mkdir()
    (out / "target-1").symlink_to(outside)
    assert f"{out / 'target-1'} is a link" in refused(1, "experiment", plan, "--out", out)
    assert not list(outside.iterdir())


def test_run_folder_may_be_a_link_itself(tmp_path: Path) -> None:
    """A user's `runs/latest`, or a disk with more room."""
    (tmp_path / "there").mkdir()
    (tmp_path / "run").symlink_to(tmp_path / "there")
    optimize(Problem(load_task("target-1")), n_init=2, n_total=2, out=tmp_path / "run")
    assert (tmp_path / "there" / "summary.json").exists()
