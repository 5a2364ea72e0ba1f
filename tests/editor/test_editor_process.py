"""`armwright edit` as a process: its end, and that of the search it has started."""

import json
import signal
import stat
from pathlib import Path

import psutil
import pytest

from tests.support.command_line import PATIENCE, refused, start
from tests.support.editor import ServedEditor


@pytest.mark.slow
def test_ctrl_c_ends_the_editor_and_its_search(in_folder: Path) -> None:
    editing = start("edit", "cell.yaml")
    assert editing.stdout is not None
    editor = ServedEditor(editing.stdout.readline().strip(), in_folder / "cell.yaml")
    opened = json.loads(editor.get("/opened")[1])
    body = {"task": opened["task"], "space": opened["space"], "seconds": 600}
    assert editor.post("/design", body)[0] == 200
    assert editor.post("/design", body)[0] == 409  # one at a time
    (search,) = psutil.Process(editing.pid).children()
    while not any("evaluations" in line for line in json.loads(editor.get("/job")[1])["lines"]):
        assert search.is_running()
    editing.send_signal(signal.SIGINT)
    _, errors = editing.communicate(timeout=PATIENCE)
    assert "Traceback" not in errors
    assert not search.is_running()
    assert (in_folder / "runs/cell-1").is_dir()


@pytest.mark.slow
def test_the_browser_is_opened_by_a_file_that_only_its_user_reads(
    in_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    browser = in_folder / "browser.sh"
    browser.write_text(
        '#!/bin/sh\nfile="${1#file://}"\ncp "$file" seen.html\nstat -c %a "$(dirname "$file")" > mode\n',
        encoding="utf-8",
    )
    browser.chmod(browser.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("BROWSER", f"{browser} %s")
    editing = start("edit", "cell.yaml", "--open")
    assert editing.stdout is not None
    address = editing.stdout.readline().strip()
    mode = in_folder / "mode"
    while not (mode.exists() and mode.read_text(encoding="utf-8").strip()):
        assert editing.poll() is None
    assert mode.read_text(encoding="utf-8").strip() == "700"
    assert address in (in_folder / "seen.html").read_text(encoding="utf-8")
    editing.send_signal(signal.SIGINT)
    editing.communicate(timeout=PATIENCE)


def test_what_cannot_be_edited_is_refused_in_one_line(in_folder: Path) -> None:
    assert "expected a name that ends in .yaml" in refused(2, "edit", "cell.txt")
    assert "there is no folder nowhere" in refused(2, "edit", "nowhere/cell.yaml")
    (in_folder / "large.yaml").write_text("#" * 300_000, encoding="utf-8")
    assert "at most 256 KiB" in refused(2, "edit", "large.yaml")
